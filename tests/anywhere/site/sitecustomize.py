"""Simulates a system without POSIX: this folder on PYTHONPATH hides names from our modules.

PBRS_TEST_LACKS selects: posix (as on Windows), or proc, the files of Linux (as on macOS).

Python imports this file at its start, so it also applies to every child process. The standard
library and other packages keep their names, as they have separate implementations for each system.
Effects: __import__, and the files of /proc and /sys, which nobody can open.
"""

from __future__ import annotations

import builtins
import importlib
import io
import os
import select
import signal
import socket
import subprocess
import sys
import types
from typing import Any

OURS = ("pbrs_farm", "workers")
LACKING = {
    "os": """
        O_ACCMODE O_ASYNC O_CLOEXEC O_DIRECT O_DIRECTORY O_DSYNC O_LARGEFILE O_NDELAY O_NOATIME O_NOCTTY O_NOFOLLOW
        O_NONBLOCK O_PATH O_RSYNC O_SYNC O_TMPFILE chown chroot confstr ctermid eventfd fchdir fchmod fchown fdatasync
        fork forkpty getegid geteuid getgid getgroups getloadavg getpgid getpgrp getpriority getresuid getsid getuid
        initgroups killpg lchown lockf login_tty major memfd_create minor mkfifo mknod nice openpty pathconf pidfd_open
        pipe2 posix_fadvise posix_spawn posix_spawnp pread preadv pwrite pwritev readv register_at_fork
        sched_getaffinity sched_setaffinity sched_yield sendfile setegid seteuid setgid setgroups setpgid setpriority
        setreuid setsid setuid splice statvfs sync sysconf sysconf_names tcgetpgrp tcsetpgrp ttyname uname unshare
        wait wait3 wait4 waitid writev EX_OK WNOHANG WIFEXITED WIFSIGNALED WEXITSTATUS WTERMSIG
    """,
    "signal": """
        ITIMER_REAL SIGALRM SIGBUS SIGCHLD SIGCONT SIGHUP SIGIO SIGKILL SIGPIPE SIGPROF SIGQUIT SIGSTOP SIGTSTP SIGTTIN
        SIGTTOU SIGURG SIGUSR1 SIGUSR2 SIGWINCH SIG_BLOCK alarm getitimer pause pthread_kill pthread_sigmask setitimer
        siginterrupt sigpending sigtimedwait sigwait
    """,
    "select": "poll epoll kqueue devpoll",
    "socket": "AF_UNIX socketpair",
    "subprocess": "",
    "ctypes": "",
}
"""Module -> the names, separated by spaces, that it lacks on Windows."""
NO_MODULES = {
    "fcntl",
    "resource",
    "pwd",
    "grp",
    "termios",
    "tty",
    "pty",
    "posix",
    "syslog",
    "readline",
}
NO_FILES = ("/proc/", "/sys/")
_BY_SIGNAL = {"SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM"}


class _Popen(subprocess.Popen):  # type: ignore[type-arg]
    """Popen as on Windows: only the three standard descriptors, no code between fork and exec."""

    def __init__(self, *words: Any, **options: Any) -> None:
        if options.get("preexec_fn") or options.get("pass_fds"):
            raise ValueError("preexec_fn and pass_fds are not supported on Windows")
        super().__init__(*words, **options)


def _select(readable: Any, writable: Any, other: Any, timeout_s: Any = None) -> Any:
    for file in [*readable, *writable, *other]:
        if not isinstance(file, socket.socket):
            raise OSError(10038, "an operation was attempted on something that is not a socket")
    return select.select(readable, writable, other, timeout_s)


def _handler(number: int, act: Any) -> Any:
    if signal.Signals(number).name not in _BY_SIGNAL:
        raise ValueError("invalid signal value")
    return signal.signal(number, act)


def _kill(pid: int, number: int) -> None:
    raise AssertionError("os.kill ends the process, whatever the signal")


def _library(name: Any, *more: Any) -> Any:
    import ctypes

    if name is None:
        raise TypeError("argument of type 'NoneType' is not iterable")
    return ctypes.CDLL(name, *more)


_INSTEAD = {
    "subprocess": {"Popen": _Popen}, "select": {"select": _select}, "signal": {"signal": _handler},
    "os": {"kill": _kill}, "ctypes": {"CDLL": _library},
}  # fmt: skip
_import, _import_module = builtins.__import__, importlib.import_module
_poorer: dict[str, types.ModuleType] = {}


def _without(name: str) -> types.ModuleType:
    """A module of the standard library as our modules see it."""
    if name not in _poorer:
        module = types.ModuleType(name)
        vars(module).update(vars(_import(name)))
        for lacking in LACKING[name].split():
            vars(module).pop(lacking, None)
        vars(module).update(_INSTEAD.get(name, {}))
        _poorer[name] = module
    return _poorer[name]


def _imported(
    name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0
) -> Any:
    importer = str((globals or {}).get("__name__", ""))
    if level == 0 and importer.partition(".")[0] in OURS:
        if name in NO_MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name in LACKING:
            return _without(name)
    return _import(name, globals, locals, fromlist, level)


def _module(name: str, package: str | None = None) -> Any:
    # Only our modules call it: those of the standard library are imported by then.
    importer = sys._getframe(1).f_globals.get("__name__", "")
    if importer.partition(".")[0] in OURS and name in NO_MODULES:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return _import_module(name, package)


def _no_such_file(act: Any) -> Any:
    def acted(path: Any = ".", *words: Any, **options: Any) -> Any:
        if isinstance(path, str | os.PathLike) and os.fspath(path).startswith(NO_FILES):
            raise FileNotFoundError(2, "No such file or directory", os.fspath(path))
        return act(path, *words, **options)

    return acted


class _Process:
    """The part of psutil's Process that our modules use."""

    def __init__(self, pid: int = 0) -> None:
        self.pid = pid

    def memory_info(self) -> Any:
        return types.SimpleNamespace(rss=100 * 2**20)

    def children(self, recursive: bool = False) -> list[_Process]:
        return []


def _pid_exists(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


_psutil = types.ModuleType("psutil")
vars(_psutil).update(
    Error=LookupError,
    Process=_Process,
    pid_exists=_pid_exists,
    virtual_memory=lambda: types.SimpleNamespace(total=16 * 2**30),
)
sys.modules["psutil"] = _psutil
os.stat, os.scandir = _no_such_file(os.stat), _no_such_file(os.scandir)
io.open = builtins.open = _no_such_file(io.open)
if os.environ["PBRS_TEST_LACKS"] == "posix":
    builtins.__import__, importlib.import_module = _imported, _module
