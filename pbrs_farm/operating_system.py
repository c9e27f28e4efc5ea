"""Differences between operating systems, each with a substitute where POSIX or Linux names are missing.

Processes, their memory, pipes and files. No other module uses such a name. Effects: those of
each function. psutil is imported by the functions that need it, since the command line imports this module.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import select
import signal
import stat
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path, PureWindowsPath
from typing import IO, Any, Final, Protocol

NOT_REGULAR: Final = "is no regular file (a device or a pipe)"
_PR_SET_PDEATHSIG: Final = 1  # of linux/prctl.h
_LOOK_EVERY_S: Final = 1.0  # whether the parent lives, where the system does not tell of its end
_CRASH_CODES: Final = 0xC0000000  # Windows: exit codes from here on are faults that it names
_CHUNK: Final = 65536  # bytes read of a pipe at once

_POSIX: Final = hasattr(os, "killpg")  # whether there are process groups, and signal 0 asks
OWN_SESSION: Final[Mapping[str, Any]] = (
    {"start_new_session": True}
    if _POSIX
    else {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
)
"""Options of Popen for a process that Ctrl-C does not reach, and that end_tree ends with all it started."""

MEMORY_LIMIT: Final = """
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
except (ImportError, ValueError, OSError):
    pass  # a system that limits no process
"""
"""Code for a process that may not take more than 8 GiB, where the system can hold it to that."""


# Processes


def end_tree(process: subprocess.Popen[bytes]) -> None:
    """Kill a process that was started with OWN_SESSION, and whatever it started, without waiting.

    SIGKILL to its process group; where there are no groups, each process below it is ended.
    """
    if _POSIX:
        # macOS forbids signals to a group whose processes have all ended.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        return
    import psutil

    with contextlib.suppress(psutil.Error):
        for child in psutil.Process(process.pid).children(recursive=True):
            with contextlib.suppress(psutil.Error):
                child.kill()
    process.kill()


def has_crashed(code: int) -> bool:
    """Whether an exit code is that of a process that did not end by itself."""
    return code < 0 or code >= _CRASH_CODES


def was_killed(code: int) -> bool:
    """Whether an exit code may be that of a process which the system killed, as when memory is short."""
    return hasattr(signal, "SIGKILL") and code == -signal.SIGKILL


def ending(code: int) -> str:
    """How a process ended, in words; code: minus the signal that killed it, or Windows' number of a fault.

    Signals are named; SIGKILL says that memory may have been short, as the kernel kills so.
    """
    if was_killed(code):
        return "its process was killed by SIGKILL from outside (out of memory?)"
    if code < 0:
        return f"its process was killed by {signal.Signals(-code).name}"
    if has_crashed(code):
        return f"its process died of fault 0x{code:08X}"
    return f"its process ended with {code}"


def die_with_parent(sign: int | None = None) -> None:
    """Have this process end when the one that started it does; sign: the signal, SIGKILL unless given.

    Linux sends the signal when the parent's thread ends, so a parent starts children from a thread that lives
    as long as they should; it is lost when the child starts another program with other rights. Elsewhere a
    thread of ours looks once a second.
    """
    parent = os.getppid()
    if not _has_proc():
        watch = threading.Thread(target=_end_after, args=(parent, sign), daemon=True)
        watch.start()
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(sign or signal.SIGKILL), 0, 0, 0)
    # The parent may have ended before prctl.
    if os.getppid() != parent:
        _end_by(sign)


def dying_with_parent(sign: int | None = None) -> Callable[[], None] | None:
    """The preexec_fn of a program that ends when this process does; None where only Linux could do it."""
    return (lambda: die_with_parent(sign)) if _has_proc() else None


def _end_after(parent: int, sign: int | None) -> None:
    # Windows keeps the number of a parent that is gone, others give the orphan a new one.
    while os.getppid() == parent and is_running(parent):
        time.sleep(_LOOK_EVERY_S)
    _end_by(sign)


def _end_by(sign: int | None) -> None:
    sign = sign or getattr(signal, "SIGKILL", None)
    if sign is None:
        os._exit(1)
    os.kill(os.getpid(), sign)


def is_running(pid: int) -> bool:
    """True while a process of this number runs, or has ended and was not waited for."""
    import psutil

    return bool(psutil.pid_exists(pid))


def after_fork(act: Callable[[], None]) -> None:
    """Have each process that is forked from this one call act first; nothing where none is ever forked."""
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=act)


# Memory


def memory_bytes() -> int:
    """Memory of this machine, bytes."""
    import psutil

    return int(psutil.virtual_memory().total)


def resident_mb(pid: int) -> float:
    """Resident memory of a process in MiB, 0 when it is gone; pages shared with others count in full."""
    import psutil

    try:
        return float(psutil.Process(pid).memory_info().rss) / 2**20
    except psutil.Error:
        return 0.0


def tree_mb(pid: int) -> float:
    """Resident memory of a process and its descendants, in MiB; shared pages count for each process.

    0 if the process is gone.
    """
    import psutil

    try:
        children = psutil.Process(pid).children(recursive=True)
    except psutil.Error:
        return 0.0
    return sum(resident_mb(pid) for pid in (pid, *(child.pid for child in children)))


def peak_mb() -> float:
    """Largest resident memory of this process so far, MB."""
    try:
        resource = import_module("resource")
    except ImportError:
        import psutil

        memory = psutil.Process().memory_info()
        return float(getattr(memory, "peak_wset", memory.rss)) / 1e6
    peak = float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    return peak / 1000 if _has_proc() else peak / 1e6  # Linux counts in KiB, macOS in bytes


def give_back_memory() -> None:
    """Hand pages that nothing uses back to the system, where the C library can; 5 ms.

    Each thread has an arena of its own (mallopt(3)), which keeps what was freed.
    """
    if _has_proc():
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


# Pipes


class Readable(Protocol):
    """What has a descriptor that can be waited for."""

    def fileno(self) -> int: ...


class ReplyPipe:
    """The end of a pipe that is read as it fills; wait_readable waits for several.

    select(2) watches pipes on POSIX. Where it knows sockets alone, a thread reads each pipe.
    """

    def __init__(self, pipe: IO[bytes]) -> None:
        self._pipe = pipe
        self._chunks: list[bytes] = []  # what the thread has read; b"" is the end
        if not _POSIX:
            _READ_BY_THREAD[pipe.fileno()] = self
            threading.Thread(target=self._fill, daemon=True).start()

    def fileno(self) -> int:
        """Its descriptor."""
        return self._pipe.fileno()

    def read(self, timeout_s: float) -> bytes | None:
        """What has come, b"" at the pipe's end, None where nothing comes in timeout_s. From one thread only."""
        if not wait_readable([self], timeout_s):
            return None
        if _POSIX:
            return os.read(self.fileno(), _CHUNK)
        with _NEWS:
            return self._chunks.pop(0) if self._chunks[0] else b""

    def close(self) -> None:
        """Close it; the process at its other end has ended."""
        if not self._pipe.closed:
            _READ_BY_THREAD.pop(self.fileno(), None)
            self._pipe.close()

    def has_news(self) -> bool:
        """Whether the thread has read something, or the end."""
        return bool(self._chunks)

    def _fill(self) -> None:
        chunk = b"?"
        while chunk:
            try:
                chunk = os.read(self._pipe.fileno(), _CHUNK)
            except (OSError, ValueError):  # closed meanwhile
                chunk = b""
            with _NEWS:
                self._chunks.append(chunk)
                _NEWS.notify_all()


_READ_BY_THREAD: Final[dict[int, ReplyPipe]] = {}  # by descriptor
_NEWS: Final = threading.Condition()


def wait_readable(files: Sequence[Readable], timeout_s: float) -> bool:
    """Whether one of the reply pipes, or of what has their descriptors, can be read within timeout_s."""
    if _POSIX:
        return bool(select.select(files, [], [], timeout_s)[0])
    pipes = [_READ_BY_THREAD[file.fileno()] for file in files]
    with _NEWS:
        return _NEWS.wait_for(lambda: any(pipe.has_news() for pipe in pipes), timeout_s)


# Files


def open_unwaiting(path: Path) -> int:
    """The descriptor of a file opened to be read, a pipe without a writer too; OSError as of os.open.

    Where opening cannot be asked not to wait, what is no regular file is an OSError instead.
    """
    if hasattr(os, "O_NONBLOCK"):
        return os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, NOT_REGULAR, str(path))
    return os.open(path, os.O_RDONLY | _OF_WINDOWS)


OPEN_FILES_MOVE: Final = _POSIX
"""Whether a file can be moved while a process has it open."""


def create_new(path: Path) -> int:
    """The descriptor of a file that was not there, opened to be written; FileExistsError where it was."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0)
    return os.open(path, flags | _OF_WINDOWS, 0o666)


def flush_folder(folder: Path) -> None:
    """Have the names in a folder outlive a loss of power; nothing where folders cannot be opened."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


_OF_WINDOWS: Final[int] = getattr(os, "O_BINARY", 0) | getattr(os, "O_NOINHERIT", 0)


OPEN_FILES: Final = Path("/proc/self/fd")
"""Where the files that this process holds open are, by number, on Linux."""


def memory_file(name: str) -> int | None:
    """The descriptor of a new file in memory, which OPEN_FILES has; None where none can be made."""
    if not (hasattr(os, "memfd_create") and OPEN_FILES.is_dir()):
        return None
    try:
        return os.memfd_create(name)
    except OSError:  # a sandbox forbids it
        return None


def has_drive(place: str) -> bool:
    """Whether words name a folder by a drive, as C:\\homes does; a URL has more letters before its colon."""
    return bool(PureWindowsPath(place).drive)


def path_of_url(path: str) -> Path:
    """The path that the part of a file URL after its host names: /C:/homes is C:\\homes on Windows."""
    from urllib.request import url2pathname  # loads what speaks HTTP

    return Path(url2pathname(path))


def kernel_cache() -> Path:
    """The folder in which Dr.Jit keeps compiled kernels."""
    return Path.home() / ".drjit" if _POSIX else Path.home() / "AppData/Local/Temp/drjit"


def has_nvidia_driver() -> bool:
    """Whether the driver of an NVIDIA GPU is installed."""
    on_windows = Path(os.environ.get("SYSTEMROOT", "C:/Windows"), "System32/nvcuda.dll")
    return Path("/proc/driver/nvidia").exists() or on_windows.exists()


def _has_proc() -> bool:
    """Whether this is Linux, whose processes are files."""
    return Path("/proc/self/statm").exists()
