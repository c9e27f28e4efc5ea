"""A module of the package as a process that returns bytes. Effects: a process."""

from __future__ import annotations

import subprocess
import sys

from pbrs_farm.core.errors import BadInput


def output_of_module(
    module: str, words: list[str], *, subject: str, timeout_s: float, stdin: bytes = b""
) -> bytes:
    """The stdout of `python -m module words`; BadInput about subject if it fails or takes too long.

    A process keeps the memory of ray casters and denoisers, and their faults, out of the server.
    """
    command = [sys.executable, "-m", module, *words]
    try:
        done = subprocess.run(
            command, input=stdin, capture_output=True, timeout=timeout_s, check=False
        )
    except subprocess.TimeoutExpired:
        raise BadInput(subject, "", f"took more than {timeout_s:.0f} s") from None
    if done.returncode != 0:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise BadInput(subject, "", lines[-1] if lines else f"exit code {done.returncode}")
    return done.stdout
