"""Opens files that strangers name: regular ones of bounded size, nothing else; writes folders whole. Effect: reads and writes files.

The one way in for every file that a user hands over. A device has no end, a pipe may never answer,
and a file larger than its limit would fill the memory: each is an OSError whose strerror says so.
"""

from __future__ import annotations

import codecs
import errno
import hashlib
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.file_kinds import HEAD_BYTES, other_kind, wrong_kind
from pbrs_farm.operating_system import NOT_REGULAR, open_unwaiting

MAX_FILE_BYTES: Final = 512 * 2**20  # maximum of a file read whole: a home, a scene, a picture
MAX_SCENE_BYTES: Final = 1_000_000_000  # of a scene or model with the files beside it
MAX_TEXT_BYTES: Final = 64 * 2**20  # maximum of a file parsed by hand: a list of houses or cameras
MAX_DIGEST_BYTES: Final = 4 * 2**30  # maximum of a file read in pieces


@contextmanager
def open_regular(path: Path, max_bytes: int = MAX_FILE_BYTES) -> Iterator[BufferedReader]:
    """The file, opened to be read; OSError where it is no regular file or above max_bytes."""
    # Open without waiting, so that a pipe without a writer opens, and inspect the opened file.
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
    """The file's bytes; OSError as open_regular, also where the file grows while it is read."""
    with open_regular(path, max_bytes) as file:
        # Ask for what there is, since a read sets aside all the memory it may need.
        size = os.fstat(file.fileno()).st_size
        data = file.read(size + 1)
        # The byte too many says that the file grows.
        if size < len(data) <= max_bytes:
            data += file.read(max_bytes + 1 - len(data))
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"grew above {max_bytes / 1e6:.0f} MB", str(path))
    return data


def read_given(
    path: Path, max_bytes: int = MAX_FILE_BYTES, *, error: type[BadInput] = BadInput, hint: str = ""
) -> bytes:
    """The bytes of a file that a user names; raises error, which says why it cannot be read."""
    try:
        return read_regular(path, max_bytes)
    except OSError as fault:
        raise error(path, "", fault_of(fault), hint=hint) from None


def text_given(path: Path, *, error: type[BadInput] = BadInput) -> str:
    """The text of a file that a user names, as read_given; raises error where it is no UTF-8.

    And where its content is of a known kind that its name does not say, text or not.
    """
    data = read_given(path, MAX_TEXT_BYTES, error=error)
    if other_kind(data, path) is not None:
        text, hint = wrong_kind(data, path)
        raise error(path, "", text, hint=hint)
    try:
        return text_from_bytes(data)
    except UnicodeDecodeError:
        raise error(path, "", "cannot be read: is no UTF-8 text") from None


@contextmanager
def naming_kind(path: Path) -> Iterator[None]:
    """Replace a reader's error by the file's actual kind if its name claims another.

    A reader's words for a file of another kind are riddles ("byte 0: no valid JSON").
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


def text_from_bytes(data: bytes, errors: str = "strict") -> str:
    """The text of a file that any system may have written, without its byte order mark.

    It is UTF-8, or UTF-16 where the mark says so. errors: as of bytes.decode.
    """
    is_wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if is_wide else "utf-8-sig", errors)


def digest_of_regular(path: Path) -> str:
    """Hex sha256 of the file, read in pieces; OSError as open_regular."""
    with open_regular(path, MAX_DIGEST_BYTES) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def real_path(path: Path) -> Path:
    """The absolute path without links; a link to itself stays."""
    return Path(os.path.realpath(path))


def fault_of(error: OSError) -> str:
    """The error of a file for a message: "no such file", "cannot be read: ..."."""
    if isinstance(error, FileNotFoundError):
        return "no such file"
    return f"cannot be read: {error.strerror or 'the system gave no reason'}"


def files_below(folder: Path) -> list[Path]:
    """The regular files of a folder and of all folders in it."""
    return [path for path in folder.rglob("*") if path.is_file()]


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder that is renamed to out at the end, or removed on any error.

    Raises BadInput if out is not empty or cannot be written.
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
