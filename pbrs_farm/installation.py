"""Commands that install missing parts of this installation, for hints. Effects: reads /etc/os-release.

A wheel takes extras by name, a checkout from its folder; system packages depend on the distribution.
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
    "starlette": "", "uvicorn": "", "torch": "study", "pbrs_farm_weights": "study", "av": "video", "pxr": "usd",
    "ifcopenshell": "ifc", "DracoPy": "gltf", "opengl_basisu": "gltf", "mujoco": "physics", "coacd": "physics",
    "onnx": "study", "onnxscript": "study", "tensorboard": "tensorboard", "wandb": "wandb",
}
# fmt: on
"""Module -> the extra of pyproject.toml that installs it; "" for required packages."""

GIVES: Final = {
    "llvm": "light and labels several times faster, where the system has no LLVM",
    "s3": "stores on S3",
    "workers": "a farm of many machines",
    "selection": "choosing views by photographs",
    "video": "films of walks",
    "physics": "models that fall and lie",
    "usd": "homes from and to USD",
    "ifc": "homes from IFC",
    "gltf": "packed meshes and textures of glTF",
}
"""Optional extra -> the feature it adds."""

# System -> library or service -> the command that installs it.
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
    """The pip command that adds extras to this installation, or without extras reinstalls it.

    extras: names of pyproject.toml; "" is ignored. A checkout is installed from its folder, since no
    index has it. For hints in errors: runs nothing.
    """
    chosen = [name for name in extras if name]
    names = f"[{','.join(chosen)}]" if chosen else ""
    checkout = checkout_folder()
    if checkout is not None:
        # The weights are a package of the same checkout.
        weights = f"'{checkout}/deploy/weights' " * ("study" in chosen)
        return f"{pip_command()} install {weights}-e '{checkout}{names}'"
    return f"{pip_command()} install {'--force-reinstall ' * (not chosen)}'pbrs-farm{names}'"


def pip_command() -> str:
    """Command prefix for this Python's pip: "pip" if PATH resolves to it, else "PYTHON -m pip".

    For hints: "install ..." follows it, and it always reaches the current environment.
    """
    path = shutil.which("pip")
    is_ours = path is not None and Path(path).parent == Path(sys.executable).parent
    return "pip" if is_ours else f"{sys.executable} -m pip"


def checkout_folder(package: Path | None = None) -> Path | None:
    """The checkout from which this program runs; None if it was installed from a wheel.

    package: the folder pbrs_farm; default: this one.
    """
    folder = (package or Path(__file__).parent).parent
    return folder if (folder / "pyproject.toml").is_file() else None


def system_command(what: str, system: str = "") -> str:
    """The command that installs "llvm", "atomic", "gl" or "redis" on this system (or the given one).

    On an unsupported system, a sentence that names the package to install.
    """
    return _COMMANDS.get(system or this_system(), _WHAT).get(what, _WHAT[what])


def llvm_command() -> str:
    """The command that adds LLVM: pip's, which needs no root, if LLVM has a wheel for this platform."""
    if sys.platform == "linux" and platform.machine() == "x86_64":
        return install_command("llvm")
    return system_command("llvm")


def missing_extras() -> list[str]:
    """Extras of GIVES with a missing module. LLVM has no module, so it is never included."""
    lacking = {EXTRA_OF[name] for name in EXTRA_OF if not is_installed(name)}
    return [extra for extra in GIVES if extra in lacking]


def mitsuba_command() -> str:
    """The command that repairs a Mitsuba that fails to import.

    On Linux its wheel needs libatomic: if that is missing, the command installs it, else it reinstalls
    the package.
    """
    if sys.platform == "linux":
        try:
            ctypes.CDLL("libatomic.so.1")
        except OSError:
            return system_command("atomic")
    return install_command()


def this_system(os_release: Path = Path("/etc/os-release")) -> str:
    """This system: debian, ubuntu, fedora, arch, macos, or "" if unsupported.

    Derived distributions map to the first supported one of os-release's ID_LIKE.
    """
    if sys.platform == "darwin":
        return "macos"
    try:
        lines = os_release.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    fields = dict(line.partition("=")[::2] for line in lines)
    words = f"{fields.get('ID', '')} {fields.get('ID_LIKE', '')}".replace('"', "").split()
    alike = {"rhel": "fedora", "centos": "fedora"}
    return next((s for w in words if (s := alike.get(w, w)) in _COMMANDS), "")


def is_installed(module: str) -> bool:
    """True if a module is installed, judged by its files without importing it.

    A broken package counts as installed.
    """
    # kombu has no spec after its import.
    return module in sys.modules or find_spec(module) is not None


def need(*modules: str) -> None:
    """Raise MachineFailed if a module is missing, with its name and the command that installs it.

    need("moderngl") at the start of a verb fails before any step does.
    """
    missing = [name for name in modules if not is_installed(name)]
    if missing:
        extras = sorted({EXTRA_OF[name] for name in missing})
        raise MachineFailed(f"this needs {', '.join(missing)}", hint=install_command(*extras))
