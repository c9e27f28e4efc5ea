"""Open untrusted regular files with a size limit; write folders atomically. Effects: reads and writes files.

All files given by a user are read here. A device may be endless, a pipe may block, and a file larger
than its limit would fill the memory: each raises an OSError with the reason in its strerror.
"""

from __future__ import annotations

import codecs
import errno
import hashlib
import os
import shutil
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.file_kinds import HEAD_BYTES, other_kind, wrong_kind
from pbrs_farm.operating_system import NOT_REGULAR, open_unwaiting

MAX_FILE_BYTES: Final = 512 * 2**20  # maximum size of a file read whole: a home, a scene, a picture
MAX_SCENE_BYTES: Final = 1_000_000_000  # maximum size of a scene or model with referenced files
MAX_TOML_BYTES: Final = 2**20  # tomllib is slow
MAX_TEXT_BYTES: Final = 64 * 2**20  # maximum size of a text file: a list of houses or cameras
MAX_DIGEST_BYTES: Final = 4 * 2**30  # maximum size of a file read in chunks


@contextmanager
def open_regular(path: Path, max_bytes: int = MAX_FILE_BYTES) -> Iterator[BufferedReader]:
    """Open a file for reading; OSError if it is not regular or is larger than max_bytes."""
    # Open without blocking on a pipe without a writer, then inspect the open file.
    descriptor = open_unwaiting(path)
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, NOT_REGULAR, str(path))
        if status.st_size > max_bytes:
            text = f"has {status.st_size / 1e6:.0f} MB, at most {max_bytes / 1e6:.0f} MB are read"
            raise OSError(errno.EFBIG, text, str(path))
        yield file


def read_regular(path: Path, max_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Read a file's bytes; OSError like open_regular, and if the file grows during the read."""
    with open_regular(path, max_bytes) as file:
        # Read the actual size only, since read(n) allocates n bytes.
        size = os.fstat(file.fileno()).st_size
        data = file.read(size + 1)
        # One byte more than its size means that the file grows.
        if size < len(data) <= max_bytes:
            data += file.read(max_bytes + 1 - len(data))
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"grew above {max_bytes / 1e6:.0f} MB", str(path))
    return data


def read_given(
    path: Path, max_bytes: int = MAX_FILE_BYTES, *, error: type[BadInput] = BadInput, hint: str = ""
) -> bytes:
    """Read the bytes of a file given by the user; raises error with the reason if it cannot be read."""
    try:
        return read_regular(path, max_bytes)
    except OSError as fault:
        raise error(path, "", fault_of(fault), hint=hint) from None


def text_given(
    path: Path, max_bytes: int = MAX_TEXT_BYTES, *, error: type[BadInput] = BadInput
) -> str:
    """Read a text file given by the user, like read_given; raises error if it is not UTF-8.

    Also raises error if its content is of a known file type that differs from its suffix.
    """
    data = read_given(path, max_bytes, error=error)
    if other_kind(data, path) is not None:
        text, hint = wrong_kind(data, path)
        raise error(path, "", text, hint=hint)
    try:
        return text_from_bytes(data)
    except UnicodeDecodeError:
        raise error(path, "", "is not UTF-8 text") from None


@contextmanager
def naming_kind(path: Path) -> Iterator[None]:
    """Replace a reader's error by the file's actual type if its suffix differs.

    A reader's own error for such a file ("byte 0: no valid JSON") does not help the user.
    """
    try:
        yield
    except BadInput as error:
        text, hint = _kind_at(path)
        if not text:
            raise
        raise type(error)(path, "", text, hint=hint) from None


def _kind_at(path: Path) -> tuple[str, str]:
    try:
        with open_regular(path, MAX_DIGEST_BYTES) as file:
            return wrong_kind(file.read(HEAD_BYTES), path)
    except OSError:
        return "", ""


def toml_given(path: Path) -> dict[str, Any]:
    """Read the tables of a TOML file given by the user, like text_given; raises BadInput if it is no TOML."""
    text = text_given(path, MAX_TOML_BYTES)
    try:
        return tomllib.loads(text)
    # RecursionError: brackets within brackets; ValueError: also an integer of thousands of digits.
    except (ValueError, RecursionError) as error:
        raise BadInput(path, "", f"is not valid TOML: {error}") from None


def text_from_bytes(data: bytes, errors: str = "strict") -> str:
    """Decode a text file from any system, without its byte order mark.

    UTF-8, or UTF-16 if the mark says so. errors: as in bytes.decode.
    """
    is_wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if is_wide else "utf-8-sig", errors)


def digest_of_regular(path: Path) -> str:
    """Hex sha256 of a file, read in chunks; OSError like open_regular."""
    with open_regular(path, MAX_DIGEST_BYTES) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def real_path(path: Path) -> Path:
    """The absolute path with links resolved; a link to itself stays."""
    return Path(os.path.realpath(path))


def fault_of(error: OSError) -> str:
    """Describe a file's error for a message: "no such file", "cannot be read: ..."."""
    if isinstance(error, FileNotFoundError):
        return "no such file"
    return f"cannot be read: {error.strerror or 'the system gave no reason'}"


def files_below(folder: Path) -> list[Path]:
    """All regular files below a folder, recursively."""
    return [path for path in folder.rglob("*") if path.is_file()]


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder, renamed to out at the end or removed on any error.

    Raises BadInput if out is not empty or cannot be written.
    """
    out = out.absolute()
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadInput(out, "", "already exists", hint="name a new folder")
    # Write to a sibling on the same file system, then rename it.
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
