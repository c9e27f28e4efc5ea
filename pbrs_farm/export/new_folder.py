"""A folder that appears whole or not at all. Effects: writes beside it, renames."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pbrs_farm.core.errors import BadInput


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A folder beside out that becomes out at the end, and is removed on any error.

    Raises BadInput where out holds something, or cannot be written.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadInput(out, "", "is there already", hint="name a new folder")
    # Write beside it, on the same file system, then rename.
    scratch = out.with_name(f".{out.name}.partial")
    shutil.rmtree(scratch, ignore_errors=True)
    try:
        scratch.mkdir(parents=True)
        yield scratch
        if out.exists():
            out.rmdir()  # empty, as checked above
        scratch.rename(out)
    except OSError as error:
        raise BadInput(out, "", f"cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
