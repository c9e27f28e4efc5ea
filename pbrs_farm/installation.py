"""How this program was installed, and the command that adds what it lacks. Effects: reads /etc/os-release.

A wheel takes its extras by name, a checkout from its own folder; each system has its own packages.
"""

from __future__ import annotations

import ctypes
import platform
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from pbrs_farm.core.errors import MachineFailed

# fmt: off
EXTRA_OF: Final = {
    "moderngl": "", "glcontext": "", "mitsuba": "", "drjit": "", "pyoidn": "", "obstore": "s3", "celery": "workers", "kombu": "workers",
    "redis": "workers", "prometheus_client": "workers", "h5py": "selection", "faiss": "selection",
    "starlette": "board", "uvicorn": "board", "torch": "study", "av": "video", "pxr": "usd",
    "ifcopenshell": "ifc", "DracoPy": "gltf", "opengl_basisu": "gltf", "mujoco": "physics", "coacd": "physics",
    "onnx": "study", "onnxscript": "study", "tensorboard": "tensorboard", "wandb": "wandb",
}
# fmt: on
"""Module -> the extra of pyproject.toml that installs it; "" where every installation has it."""

GIVES: Final = {
    "llvm": "light and labels several times faster, where the system has no LLVM",
    "s3": "stores on S3",
    "workers": "a farm of many machines",
    "board": "a run in a browser",
    "selection": "choosing views by photographs",
    "video": "films of walks",
    "physics": "models that fall and lie",
    "usd": "homes from and to USD",
    "ifc": "homes from IFC",
    "gltf": "packed meshes and textures of glTF",
}
"""Extra that a user may want -> what it gives."""

# System -> what is needed -> the command that installs it.
_COMMANDS: Final = {
    "debian": {
        "llvm": "sudo apt-get install -y libllvm19",
        "atomic": "sudo apt-get install -y libatomic1",
        "gl": "sudo apt-get install -y libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri",
        "redis": "sudo apt-get install -y redis-server",
    },
    "ubuntu": {
        "llvm": "sudo apt-get install -y libllvm18",
        "atomic": "sudo apt-get install -y libatomic1",
        "gl": "sudo apt-get install -y libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri",
        "redis": "sudo apt-get install -y redis-server",
    },
    "fedora": {
        "llvm": "sudo dnf install -y llvm-libs",
        "atomic": "sudo dnf install -y libatomic",
        "gl": "sudo dnf install -y mesa-libEGL mesa-libGL mesa-dri-drivers",
        "redis": "sudo dnf install -y valkey",
    },
    "arch": {
        "llvm": "sudo pacman -S --needed llvm-libs",
        "atomic": "sudo pacman -S --needed gcc-libs",
        "gl": "sudo pacman -S --needed mesa libglvnd",
        "redis": "sudo pacman -S --needed valkey",
    },
    "macos": {
        "llvm": "brew install llvm",
        "gl": "macOS brings OpenGL; run in a session that has a screen",
        "redis": "brew install redis",
    },
}
_WHAT: Final = {
    "llvm": "install LLVM 17 or later (its shared library)",
    "atomic": "install libatomic (of GCC)",
    "gl": "install EGL and OpenGL (Mesa, or the driver of the GPU)",
    "redis": "install Redis",
}


def install_command(*extras: str) -> str:
    """The pip command that adds extras to this installation; without any, that repairs it.

    extras: names of pyproject.toml; "" is ignored. In a checkout the command installs the checkout,
    since no index has it; a wheel takes its extras by name. For hints of errors: nothing is run.
    """
    chosen = [name for name in extras if name]
    names = f"[{','.join(chosen)}]" if chosen else ""
    checkout = checkout_folder()
    if checkout is not None:
        return f"{pip_command()} install -e '{checkout}{names}'"
    return f"{pip_command()} install {'--force-reinstall ' * (not chosen)}'pbrs-farm{names}'"


def pip_command() -> str:
    """How this Python's own pip is called: "pip" only where that word starts it, as in an active environment.

    For hints of what to install: the words go before "install", and always reach the environment
    that runs us.
    """
    path = shutil.which("pip")
    is_ours = path is not None and Path(path).parent == Path(sys.executable).parent
    return "pip" if is_ours else f"{sys.executable} -m pip"


def checkout_folder(package: Path | None = None) -> Path | None:
    """The checkout that this program runs from, None where it was installed from a wheel.

    package: the folder pbrs_farm, this one where it is left out.
    """
    folder = (package or Path(__file__).parent).parent
    return folder if (folder / "pyproject.toml").is_file() else None


def system_command(what: str, system: str = "") -> str:
    """The command that installs "llvm", "atomic", "gl" or "redis" on this system (or the one named).

    On a system that we know no command of, a sentence that says what to install.
    """
    return _COMMANDS.get(system or this_system(), _WHAT).get(what, _WHAT[what])


def llvm_command() -> str:
    """The command that adds LLVM: pip's, which needs no root, where there is a wheel of it."""
    if sys.platform == "linux" and platform.machine() == "x86_64":
        return install_command("llvm")
    return system_command("llvm")


def missing_extras() -> list[str]:
    """The extras of GIVES that lack a module here; LLVM's is no module and never among them."""
    lacking = {EXTRA_OF[name] for name in EXTRA_OF if not is_installed(name)}
    return [extra for extra in GIVES if extra in lacking]


def mitsuba_command() -> str:
    """The command that repairs a Mitsuba that cannot be imported.

    Its wheel needs libatomic on Linux: where that is missing, the command that installs it, else the
    one that installs the package again.
    """
    if sys.platform == "linux":
        try:
            ctypes.CDLL("libatomic.so.1")
        except OSError:
            return system_command("atomic")
    return install_command()


def this_system(os_release: Path = Path("/etc/os-release")) -> str:
    """debian, ubuntu, fedora, arch, macos, or "" for one we know no command of.

    A system that is none of these is the first of them that os-release says it is like.
    """
    if sys.platform == "darwin":
        return "macos"
    try:
        lines = os_release.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    fields = dict(line.partition("=")[::2] for line in lines)
    # A system that is none of ours names those it is like.
    words = f"{fields.get('ID', '')} {fields.get('ID_LIKE', '')}".replace('"', "").split()
    alike = {"rhel": "fedora", "centos": "fedora"}
    return next((s for w in words if (s := alike.get(w, w)) in _COMMANDS), "")


def is_installed(module: str) -> bool:
    """Whether a module could be imported, as far as its files tell; nothing is imported.

    A package that is there and broken counts as installed.
    """
    # kombu, once imported, has no spec any more.
    return module in sys.modules or find_spec(module) is not None


def need(*modules: str) -> None:
    """Raise MachineFailed, naming what is missing and the command that adds it, unless all modules are there.

    need("moderngl") at the start of a verb says at once what each step would say later.
    """
    missing = [name for name in modules if not is_installed(name)]
    if missing:
        extras = sorted({EXTRA_OF[name] for name in missing})
        raise MachineFailed(f"this needs {', '.join(missing)}", hint=install_command(*extras))
