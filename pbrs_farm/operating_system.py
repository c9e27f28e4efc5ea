"""Wrappers for functions that differ between operating systems, with substitutes for POSIX and Linux.

They cover processes, memory, pipes and files; other modules use no system-specific names. Effects:
those of each function. psutil is imported on use, since the command line imports this module.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import errno
import gc
import os
import platform
import select
import signal
import stat
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path, PureWindowsPath
from typing import IO, Any, Final, Protocol

NOT_REGULAR: Final = "is not a regular file (a device or a pipe)"
_PR_SET_PDEATHSIG: Final = 1  # from linux/prctl.h
_LOOK_EVERY_S: Final = 1.0  # interval of checks for a dead parent, where the system sends no signal
_CRASH_CODES: Final = 0xC0000000  # Windows: lowest exit code that is a fault (NTSTATUS error)
_CHUNK: Final = 65536  # maximum bytes per read of a pipe

_POSIX: Final = hasattr(os, "killpg")  # has process groups, and signal 0 as a test
OWN_SESSION: Final[Mapping[str, Any]] = (
    {"start_new_session": True}
    if _POSIX
    else {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
)
"""Popen options for a process that ignores Ctrl-C and that end_tree ends with its descendants."""

MEMORY_LIMIT: Final = """
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
except (ImportError, ValueError, OSError):
    pass  # a system that limits no process
"""
"""Code that limits a process to 8 GiB of memory, where the system supports it."""

PATH_FROM_PARENT: Final = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
"""Code of a child that sees the modules its parent sees, wherever it was started."""


# Processes


def can_fork() -> bool:
    """Whether `forked` works: on Linux alone, as macOS' own libraries break in a fork."""
    return _POSIX and hasattr(os, "fork") and _has_proc()


def forked(serve: Callable[[], object], log: IO[bytes]) -> subprocess.Popen[bytes]:
    """A fork of this process in its own session that runs `serve`, with pipes and a log for standard error.

    It keeps modules and objects, but each open file becomes /dev/null, and the exit calls neither the parent's
    atexit functions nor any finalizer of `weakref.finalize`, even of an object that `serve` makes. Only if
    `can_fork`.
    """

    def run() -> None:
        try:
            # Close the pipes of other children, and Popen's own, for which the parent waits. Their numbers stay
            # taken: an inherited object that closes its file later must not close a new one.
            numbers = [int(file.name) for file in OPEN_FILES.iterdir()]
            nothing = os.open(os.devnull, os.O_RDWR)
            for number in numbers:
                if number > 2 and number != nothing:
                    os.dup2(nothing, number, inheritable=False)
            atexit._clear()
            gc.enable()
            serve()
        except BaseException:  # noqa: BLE001 - the parent's code must not run on here
            traceback.print_exc()
        os._exit(1)

    flush_output()
    # Popen makes the pipes and forks; `run` never returns to it, so no program is executed.
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [sys.executable], stdin=pipe, stdout=pipe, stderr=log,
        preexec_fn=run, restore_signals=False, **OWN_SESSION,
    )  # fmt: skip


def open_standard_streams() -> None:
    """Replace standard streams that were closed at the start (>&-) with /dev/null, also for child processes."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            number = os.open(os.devnull, os.O_RDWR)  # the lowest free number, so the stream's
            os.set_inheritable(number, True)
            setattr(sys, name, os.fdopen(number, "r" if name == "stdin" else "w"))


def flush_output() -> None:
    """Flush standard output and error, unless they are closed."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            if stream is not None:  # None if the descriptor was closed at the start
                stream.flush()


def end_tree(process: subprocess.Popen[bytes]) -> None:
    """Kill a process started with OWN_SESSION and its descendants, without waiting.

    Sends SIGKILL to the process group; without process groups, kills each process of the tree.
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
    """True if an exit code means a signal or a fault."""
    return code < 0 or code >= _CRASH_CODES


def was_killed(code: int) -> bool:
    """True if an exit code means SIGKILL, as sent when memory runs out."""
    return hasattr(signal, "SIGKILL") and code == -signal.SIGKILL


def ending(code: int) -> str:
    """Describe how a process ended. code: minus the signal that killed it, or Windows' fault number.

    Names the signal; SIGKILL adds a note that memory may have run out, as the kernel then sends it.
    """
    if was_killed(code):
        return "its process was killed by SIGKILL from outside (out of memory?)"
    if code < 0:
        return f"its process was killed by {signal.Signals(-code).name}"
    if has_crashed(code):
        return f"its process died of fault 0x{code:08X}"
    return f"its process ended with {code}"


def die_with_parent(sign: int | None = None) -> None:
    """Make this process end when its parent ends. sign: the signal to use; default SIGKILL.

    Linux sends the signal when the parent's thread ends, so the parent must start children from a thread
    with their lifetime. The setting is lost when the child executes a program with other privileges. Other
    systems use a thread that checks once a second.
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
    """A preexec_fn for a program that ends with this process; None on other systems than Linux."""
    return (lambda: die_with_parent(sign)) if _has_proc() else None


def _end_after(parent: int, sign: int | None) -> None:
    # Windows keeps the parent's pid after its end; other systems give the orphan a new parent.
    while os.getppid() == parent and is_running(parent):
        time.sleep(_LOOK_EVERY_S)
    _end_by(sign)


def _end_by(sign: int | None) -> None:
    sign = sign or getattr(signal, "SIGKILL", None)
    if sign is None:
        os._exit(1)
    os.kill(os.getpid(), sign)


def is_running(pid: int) -> bool:
    """True if a process with this pid runs, or is a zombie."""
    import psutil

    return bool(psutil.pid_exists(pid))


def after_fork(act: Callable[[], None]) -> None:
    """Call act first in every process forked from this one; no effect on systems without fork."""
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=act)


# Memory


def memory_bytes() -> int:
    """Physical memory of this machine, bytes."""
    import psutil

    return int(psutil.virtual_memory().total)


def resident_mb(pid: int) -> float:
    """Resident memory of a process in MiB, with shared pages in full; 0 if it has ended."""
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
    """Peak resident memory of this process, MB."""
    try:
        resource = import_module("resource")
    except ImportError:
        import psutil

        memory = psutil.Process().memory_info()
        return float(getattr(memory, "peak_wset", memory.rss)) / 1e6
    peak = float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    return peak / 1000 if _has_proc() else peak / 1e6  # KiB on Linux, bytes on macOS


def give_back_memory() -> None:
    """Return free heap pages to the system, if the C library supports it; 5 ms.

    Each thread has a malloc arena, which otherwise keeps freed memory (mallopt(3)).
    """
    if _has_proc():
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


# Pipes


class Readable(Protocol):
    """An object with a file descriptor that can be waited for."""

    def fileno(self) -> int: ...


class ReplyPipe:
    """The read end of a pipe; wait_readable waits for several.

    Uses select(2) on POSIX. Windows' select supports only sockets, so a thread reads each pipe.
    """

    def __init__(self, pipe: IO[bytes]) -> None:
        self._pipe = pipe
        self._chunks: list[bytes] = []  # chunks read by the thread; b"" marks the end
        if not _POSIX:
            _READ_BY_THREAD[pipe.fileno()] = self
            threading.Thread(target=self._fill, daemon=True).start()

    def fileno(self) -> int:
        """The file descriptor."""
        return self._pipe.fileno()

    def read(self, timeout_s: float) -> bytes | None:
        """Read available bytes: b"" at the end, None after timeout_s without data. Call from one thread only."""
        if not wait_readable([self], timeout_s):
            return None
        if _POSIX:
            return os.read(self.fileno(), _CHUNK)
        with _NEWS:
            return self._chunks.pop(0) if self._chunks[0] else b""

    def close(self) -> None:
        """Close the pipe after the process at its other end has ended."""
        if not self._pipe.closed:
            _READ_BY_THREAD.pop(self.fileno(), None)
            self._pipe.close()

    def has_news(self) -> bool:
        """True if the thread has read data or the end."""
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


_READ_BY_THREAD: Final[dict[int, ReplyPipe]] = {}  # descriptor -> pipe
_NEWS: Final = threading.Condition()


def wait_readable(files: Sequence[Readable], timeout_s: float) -> bool:
    """True if a reply pipe, or another object with the same descriptor, becomes readable within timeout_s."""
    if _POSIX:
        return bool(select.select(files, [], [], timeout_s)[0])
    pipes = [_READ_BY_THREAD[file.fileno()] for file in files]
    with _NEWS:
        return _NEWS.wait_for(lambda: any(pipe.has_news() for pipe in pipes), timeout_s)


# Files


def open_unwaiting(path: Path) -> int:
    """Open a file for reading without waiting for a pipe's writer; returns the descriptor. OSError like os.open.

    Systems without O_NONBLOCK raise OSError for anything but a regular file.
    """
    if hasattr(os, "O_NONBLOCK"):
        return os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, NOT_REGULAR, str(path))
    return os.open(path, os.O_RDONLY | _OF_WINDOWS)


OPEN_FILES_MOVE: Final = _POSIX
"""True if a file can be renamed while a process has it open."""


def create_new(path: Path) -> int:
    """Create a file for writing; returns its descriptor. FileExistsError if it exists."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0)
    return os.open(path, flags | _OF_WINDOWS, 0o666)


LOCKS_ARE_INHERITED: Final = _POSIX


def lock_file(path: Path, *, wait: bool = False) -> IO[bytes] | None:
    """Lock a file until the returned one is closed or this process ends; None if another process has it.

    The system releases the lock of a killed process. A child that inherits the file keeps the lock, if
    LOCKS_ARE_INHERITED. wait: block until the lock is free.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    file = path.open("ab")
    try:
        if _POSIX:
            fcntl = import_module("fcntl")
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        else:
            msvcrt = import_module("msvcrt")
            msvcrt.locking(file.fileno(), msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)
    except OSError:
        file.close()
        return None
    return file


def flush_folder(folder: Path) -> None:
    """Sync a folder's entries to disk; no effect where folders cannot be opened."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


_OF_WINDOWS: Final[int] = getattr(os, "O_BINARY", 0) | getattr(os, "O_NOINHERIT", 0)


OPEN_FILES: Final = Path("/proc/self/fd")
"""Linux folder of this process's open files, by descriptor."""


def memory_file(name: str) -> int | None:
    """Create a file in memory, reachable through OPEN_FILES; returns its descriptor, or None if unsupported."""
    if not (hasattr(os, "memfd_create") and OPEN_FILES.is_dir()):
        return None
    try:
        return os.memfd_create(name)
    except OSError:  # forbidden in some sandboxes
        return None


def has_drive(place: str) -> bool:
    """True if a path has a drive letter (C:\\homes); a URL's scheme has more than one letter."""
    return bool(PureWindowsPath(place).drive)


def path_of_url(path: str) -> Path:
    """The path that the part of a file URL after its host names: /C:/homes is C:\\homes on Windows."""
    from urllib.request import url2pathname  # imports HTTP modules

    return Path(url2pathname(path))


def kernel_cache() -> Path:
    """Dr.Jit's folder of compiled kernels."""
    return Path.home() / ".drjit" if _POSIX else Path.home() / "AppData/Local/Temp/drjit"


def processor_name() -> str:
    """Model of the processor, or its kind where the system has no /proc."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = (x.partition(":")[2].strip() for x in lines if x.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def has_nvidia_driver() -> bool:
    """True if an NVIDIA driver is installed."""
    on_windows = Path(os.environ.get("SYSTEMROOT", "C:/Windows"), "System32/nvcuda.dll")
    return Path("/proc/driver/nvidia").exists() or on_windows.exists()


def _has_proc() -> bool:
    """True on Linux, which has /proc."""
    return Path("/proc/self/statm").exists()
