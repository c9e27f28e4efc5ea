"""Reading in a child process, for formats whose library may crash on damaged files. Effects: starts it."""

from __future__ import annotations

import json
import os
import pickle
import pkgutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.crash_notes import is_watched
from pbrs_farm.operating_system import PATH_FROM_PARENT, die_with_parent, ending, has_crashed
from pbrs_farm.read.common.format import GivenFile

_BOOT: Final = PATH_FROM_PARENT + (
    "from pbrs_farm.read.common.own_process import main; main(sys.argv[2], sys.argv[3])"
)


def read_apart(reader: str, given: GivenFile, fields: ReadFields) -> House:
    """The house that the function `module:function` reads, in a child process.

    A watched process reads directly. Raises the reader's errors; BadHouse if the child crashes.
    """
    if is_watched():
        house: House = pkgutil.resolve_name(reader)(given, fields)
        return house
    # Libraries may print to the child's standard output, so the house comes back in a file.
    handle, name = tempfile.mkstemp(prefix="pbrs-farm-")
    os.close(handle)
    try:
        command = [sys.executable, "-P", "-c", _BOOT, json.dumps(sys.path), reader, name]
        task = pickle.dumps((given, fields))
        code = subprocess.run(
            command, input=task, stdout=subprocess.DEVNULL, check=False
        ).returncode
        data = Path(name).read_bytes()
    finally:
        Path(name).unlink(missing_ok=True)
    if not data:
        cause = "damaged: it crashes the library" if has_crashed(code) else "cannot be read"
        raise BadHouse(given.path, "", f"{cause}: {ending(code)}", hint="export it again")
    result = pickle.loads(data)
    if isinstance(result, Exception):
        raise result
    assert isinstance(result, House)
    return result


def main(reader: str, name: str) -> None:
    """The child: read the task from standard input, and write the house or the error to the file."""
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    given, fields = pickle.load(sys.stdin.buffer)
    result: House | Exception
    try:
        result = pkgutil.resolve_name(reader)(given, fields)
    except Exception as error:  # noqa: BLE001 - the parent raises it
        result = error
    Path(name).write_bytes(pickle.dumps(result, pickle.HIGHEST_PROTOCOL))
