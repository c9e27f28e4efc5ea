"""Choice of a Mitsuba variant and of LLVM's library; sets both for this process and loads dependencies."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import importlib
import os
import re
import site
import sys
from pathlib import Path
from typing import Any, Final

from pbrs_farm.assets.libatomic import load_libatomic
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.installation import mitsuba_command

MIN_LLVM: Final = 17  # older ones (14 to 16) crash inside Dr.Jit's first compilation
LIBRARY_PLACES: Final = (
    # Debian and Ubuntu: the library itself, and a version's own folder.
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    # Fedora and Arch; built by hand.
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    # Homebrew on Apple silicon and on Intel; Windows, whose installer names no version.
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
    "/Program Files/LLVM/bin/LLVM-C.dll",
)
_UNNAMED: Final = (MIN_LLVM,)  # what a library without a version in its name counts as
# Beside the LLVM of a wheel (karellen-llvm-core), as it needs them: each after those it is linked with.
_BESIDE_LLVM: Final = ("libunwind.so.1.0", "libc++abi.so.1.0", "libc++.so.1.0")


def import_renderer(name: str) -> Any:
    """Mitsuba or Dr.Jit, imported by name; raises MachineFailed where it is not installed."""
    try:
        return importlib.import_module(name)
    except (ImportError, NameError) as error:  # NameError: Dr.Jit without a library that it wants
        load_libatomic()  # reports a missing library
        text = f"Mitsuba cannot be imported: {error}"
        raise MachineFailed(text, hint=mitsuba_command()) from error


def llvm_version(library: Path) -> tuple[int, ...]:
    """Version of a libLLVM by its real file name, () unknown; Windows' LLVM-C.dll is MIN_LLVM."""
    # Resolve links first: libLLVM.so alone names no version.
    name = library.resolve().name
    if name == "LLVM-C.dll":
        return _UNNAMED
    match = re.search(r"LLVM(?:-|\.so\.|\.)(\d+(?:\.\d+)*)", name)
    return tuple(int(n) for n in match.group(1).split(".")) if match else ()


def llvm_libraries() -> list[tuple[tuple[int, ...], Path]]:
    """(version, path) of every libLLVM in the usual places, newest first, unloaded."""
    of_python = (sys.prefix, site.getuserbase())
    patterns = (*LIBRARY_PLACES, *(f"{folder}/lib/libLLVM*.so*" for folder in of_python))
    libraries: dict[Path, tuple[int, ...]] = {}
    for pattern in patterns:
        root = Path(Path(pattern).anchor)
        for path in root.glob(str(Path(pattern).relative_to(root))):
            # A link and its target are one library.
            version = llvm_version(path)
            if version:
                libraries[path.resolve()] = version
    return sorted(((v, p) for p, v in libraries.items()), reverse=True)


def find_llvm() -> Path | None:
    """Dr.Jit's LLVM, 17 or later: DRJIT_LIBLLVM_PATH, else the newest installed one; or None."""
    # Honour the user's choice unless that library is known to crash.
    named = os.environ.get("DRJIT_LIBLLVM_PATH", "")
    if named and Path(named).exists():
        version = llvm_version(Path(named))
        if not version or version[0] >= MIN_LLVM:
            return Path(named)
    good = [path for version, path in llvm_libraries() if version[0] >= MIN_LLVM]
    return good[0] if good else None


@functools.cache
def name_libraries() -> Path | None:
    """Set DRJIT_LIBLLVM_PATH to the result of `find_llvm`, which is returned, and load its dependencies.

    Must run before anything imports drjit, which loads LLVM once: a package whose modules begin with
    `import drjit` calls it. A failed load is reported later, by the function that needs the library.
    """
    with contextlib.suppress(MachineFailed):
        load_libatomic()
    library = find_llvm()
    if library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
        # A wheel's links to them are made when Python starts next: until then only their files are there.
        folder = library.parent / "x86_64-unknown-linux-gnu"
        with contextlib.suppress(OSError):
            for name in _BESIDE_LLVM if folder.is_dir() else ():
                ctypes.CDLL(str(folder / name))
    return library


@functools.cache
def choose_variant() -> str:
    """cuda_ad_rgb if a GPU works, else llvm_ad_rgb, else scalar_rgb, each tried; MachineFailed."""
    library = name_libraries()
    dr = import_renderer("drjit")
    # Prefer the GPU, then LLVM, then Mitsuba without Dr.Jit's arrays.
    if dr.has_backend(dr.JitBackend.CUDA) and works("cuda_ad_rgb"):
        return "cuda_ad_rgb"
    if library is not None and _has_good_llvm(dr) and works("llvm_ad_rgb"):
        return "llvm_ad_rgb"
    if works("scalar_rgb"):
        return "scalar_rgb"
    raise MachineFailed("no variant of Mitsuba works", hint="run `pbrs-farm doctor`")


def mitsuba(variant: str | None = None) -> Any:
    """The mitsuba module with a variant set, before any use of drjit; MachineFailed if it cannot load."""
    name = choose_variant() if variant is None else variant
    module = import_renderer("mitsuba")
    if module.variant() != name:
        module.set_variant(name)
    return module


def set_threads(n_threads: int) -> None:
    """Let Dr.Jit use n_threads cores of this process, once, before rendering; MachineFailed without it."""
    choose_variant()
    importlib.import_module("drjit").set_thread_count(n_threads)


def llvm_of_variant(variant: str) -> str:
    """The version of LLVM that compiles a variant's kernels, such as "19.1.7"; "" where none does."""
    if not variant.startswith("llvm"):
        return ""
    return ".".join(map(str, import_renderer("drjit").detail.llvm_version()))


def _has_good_llvm(dr: Any) -> bool:
    # Ask Dr.Jit which library it holds: it may have loaded another before we named one.
    if not dr.has_backend(dr.JitBackend.LLVM):
        return False
    return bool(dr.detail.llvm_version()[0] >= MIN_LLVM)


def works(variant: str) -> bool:
    """The variant traces a ray (a compilation) on this machine; False for every failure."""
    try:
        mi = mitsuba(variant)
        # Aim at the middle of a square 1 m away.
        scene = mi.load_dict({"type": "scene", "shape": {"type": "rectangle"}})
        ray = mi.Ray3f(mi.Point3f(0, 0, 1), mi.Vector3f(0, 0, -1))
        t = scene.ray_intersect_preliminary(ray).t
        return abs(float(t if isinstance(t, float) else t[0]) - 1.0) < 1e-4
    except (MachineFailed, RuntimeError, ImportError, ValueError, AttributeError):
        return False
