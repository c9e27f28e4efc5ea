"""What this machine can do, part by part, and what to do about what is missing.

Effects: starts a process per part that could crash (LLVM, GL), reads versions.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Final, Literal

from pbrs_farm.installation import (
    EXTRA_OF,
    GIVES,
    install_command,
    is_installed,
    llvm_command,
    missing_extras,
    mitsuba_command,
    system_command,
)

State = Literal["ok", "degraded", "missing"]
PROBE_TIMEOUT_S: Final = 120
GL: Final = "GL"
"""The part whose lack leaves path tracing and takes the two OpenGL modes."""
_EXCEPTION: Final = re.compile(r"^(pbrs_farm\.[\w.]+|\w+Error): ")  # before a traceback's last text

# fmt: off
PACKAGES: Final = (
    "numpy", "pydantic", "mitsuba", "drjit", "moderngl", "trimesh", "manifold3d", "pyoidn",
    "OpenImageIO", "shapely",
)
# fmt: on
_GIVES: Final = {
    "LLVM": GIVES["llvm"],
    "mitsuba cuda_ad_rgb": "light of a view in a second or two",
    "mitsuba llvm_ad_rgb": "light and labels several times faster",
    "GL": "the pictures opengl_dl and opengl_il; without it they are left out",
    "redis": GIVES["workers"],
}
_VARIANTS: Final = ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")


@dataclass(frozen=True, slots=True)
class Finding:
    """One part of the machine: its state, what was found, what to do about it."""

    part: str
    state: State  # degraded: the main job still runs
    text: str
    remedy: str = ""
    needed: bool = False  # the main job cannot run without it

    @property
    def gives(self) -> str:
        """What the part would give where it is not there and the main job does without; "" else."""
        return "" if self.state == "ok" else _GIVES.get(self.part, "")


def examine(store_url: str = "", redis_url: str = "") -> list[Finding]:
    """Every part of the machine, in the order in which a house meets it.

    store_url, redis_url: what to try beside the machine; "" tries none. Each part that could crash
    is tried in a process of its own, so that this takes some ten seconds and never ends ours.
    """
    # What to install where a library is missing.
    again = install_command()
    return [
        _python(),
        packages(),
        llvm(),
        *_variants(),
        probe(GL, check_gl, _gl_remedy(), state="degraded"),
        probe("denoiser", check_denoiser, again, needed=True),
        probe("pictures", check_pictures, again, needed=True),
        _extras(),
        redis(redis_url),
        _store(store_url),
    ]


def can_run(findings: list[Finding]) -> bool:
    """Whether the main job (run, demo) can run: nothing that it needs is missing.

    What is degraded slows it or takes a part of it, such as the OpenGL modes.
    """
    return not any(f.needed and f.state == "missing" for f in findings)


def _python() -> Finding:
    state: State = "ok" if sys.version_info >= (3, 11) else "missing"
    return Finding("python", state, sys.version.split()[0], "Python 3.11+", True)


def packages() -> Finding:
    versions, missing = [], []
    for package in PACKAGES:
        try:
            versions.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            missing.append(package)
    if missing:
        text = "not installed: " + ", ".join(missing)
        extras = sorted({EXTRA_OF[name] for name in missing if name in EXTRA_OF})
        return Finding("packages", "missing", text, install_command(*extras), True)
    return Finding("packages", "ok", ", ".join(versions))


def _extras() -> Finding:
    missing = missing_extras()
    if not missing:
        # `all` leaves it out: torch is large, and only networks need it.
        exception = f" but study, which trains networks: {install_command('study')}"
        return Finding("extras", "ok", "all" + exception * (not is_installed("torch")))
    features = "; ".join(f"{name}: {GIVES[name]}" for name in missing)
    return Finding("extras", "degraded", f"not installed: {features}", install_command(*missing))


def llvm() -> Finding:
    from pbrs_farm.raycast.variant import MIN_LLVM, find_llvm, llvm_libraries

    library = find_llvm()
    if library is not None:
        return Finding("LLVM", "ok", str(library))
    # Say which versions there are: an old one looks like a good one to apt.
    old = ", ".join(".".join(map(str, v)) for v, _path in llvm_libraries())
    text = f"only {old}; 14 to 16 crash inside Dr.Jit" if old else "no libLLVM found"
    text += f"; {MIN_LLVM} or later is needed (19 is what we test); running with scalar_rgb, several times slower"
    return Finding("LLVM", "degraded", text, llvm_command())


def _variants() -> list[Finding]:
    findings = [
        probe(f"mitsuba {n}", check_variant, _variant_remedy(n), argument=n, state="degraded")
        for n in _VARIANTS
    ]
    # One variant is enough; without any nothing can be rendered.
    if not any(f.state == "ok" for f in findings):
        last = findings[-1]
        findings[-1] = Finding(last.part, "missing", last.text, last.remedy, True)
    return findings


def _variant_remedy(name: str) -> str:
    """What to do where a variant of Mitsuba does not work."""
    if name == "cuda_ad_rgb":
        return "only with an NVIDIA GPU and its driver; not needed"
    return llvm_command() if name == "llvm_ad_rgb" else mitsuba_command()


def _gl_remedy() -> str:
    return system_command("gl") if is_installed("moderngl") else install_command()


def redis(url: str) -> Finding:
    if url:
        remedy = "is it running? PBRS_REDIS_URL names it"
        return probe("redis", check_redis, remedy, argument=url, state="degraded")
    server = shutil.which("redis-server")
    if server is not None:
        return Finding("redis", "ok", f"{server} (only the farm needs it)")
    remedy = system_command("redis")
    return Finding("redis", "degraded", "no redis-server (only the farm needs it)", remedy)


def _store(url: str) -> Finding:
    if not url:
        return Finding("store", "ok", "folders (no --out or PBRS_STORE given)")
    remedy = "check the path, endpoint and credentials"
    return probe("store", check_store, remedy, argument=url, needed=True)


def probe(
    part: str,
    check: Callable[[str], str],
    remedy: str,
    *,
    argument: str = "",
    needed: bool = False,
    state: State = "missing",
) -> Finding:
    """The finding of a check, run in a process of its own: a crash there is a finding here.

    check: a function of this module; it returns what it found, and exits with a fault's text.
    """
    code = f"import sys; from {__name__} import {check.__name__} as f; print(f(sys.argv[1]))"
    command = [sys.executable, "-c", code, argument]
    # The child imports the check by name; its last line is what it found.
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PROBE_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        text = f"did not answer within {PROBE_TIMEOUT_S} s"
        return Finding(part, state, text, remedy, needed)
    if done.returncode == 0:
        return Finding(part, "ok", done.stdout.strip().splitlines()[-1], "", needed)
    # The last line of a traceback, or of SystemExit, is the fault.
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    text = lines[-1] if lines else f"ended with exit code {done.returncode}"
    # Neither the name of the exception nor its own remedy is news to a reader.
    text = _EXCEPTION.sub("", text).removesuffix(f" ({remedy})")
    return Finding(part, state, text[:200], remedy, needed)


def check_variant(name: str) -> str:
    """Mitsuba's variant of that name traces a ray.

    Traces in this process, so a library that crashes ends it: the doctor runs each check in a
    child. SystemExit with the reason where it does not work.
    """
    from pbrs_farm.raycast import variant

    # Dr.Jit would load an old LLVM and crash.
    if name.startswith("llvm") and not variant.find_llvm():
        raise SystemExit(f"no LLVM of version {variant.MIN_LLVM} or later")
    variant.choose_variant()
    if not variant.works(name):
        raise SystemExit("does not work here")
    return name


def check_gl(_argument: str) -> str:
    """An OpenGL context opens."""
    from pbrs_farm.raster.gl_device import open_context

    context = open_context()
    return f"{context.info['GL_RENDERER']}, GL {context.version_code / 100}"


def check_denoiser(_argument: str) -> str:
    """Open Image Denoise keeps a grey picture grey."""
    import numpy as np

    from pbrs_farm.transport.develop.denoiser import denoise_radiance

    grey = np.full((32, 32, 3), 0.5, np.float32)
    # The denoiser's guides: a grey albedo, a floor's normal.
    normal = np.broadcast_to(np.array([0, 1, 0], np.float32), grey.shape).copy()
    mean = float(denoise_radiance(grey, grey, normal).mean())
    if abs(mean - 0.5) >= 0.05:
        raise SystemExit(f"a grey of 0.5 comes out as {mean}")
    return f"Open Image Denoise, pyoidn {version('pyoidn')}"


def check_pictures(_argument: str) -> str:
    """OpenImageIO reads back the PNG it wrote."""
    import numpy as np

    from pbrs_farm.images import array_from_png, png_from_array

    # Every value of a byte, in the 16 bits that depth has.
    pixels = np.arange(256, dtype=np.uint16).reshape(16, 16)
    if not np.array_equal(array_from_png(png_from_array(pixels)), pixels):
        raise SystemExit("a PNG reads back as other pixels")
    return f"OpenImageIO {version('OpenImageIO')}"


def check_redis(url: str) -> str:
    """The Redis at url answers."""
    # By name: the package itself does without Redis.
    client = import_module("redis").Redis.from_url(url, socket_timeout=5)
    return f"answers, version {client.info('server')['redis_version']}"


def check_store(url: str) -> str:
    """The store at url keeps an object.

    Writes, reads and removes doctor/probe.txt. SystemExit or the store's own error where one of
    these fails.
    """
    from pbrs_farm.settings import settings_from_environment
    from pbrs_farm.store import store_from_url

    store = store_from_url(url, settings_from_environment().store)
    # Write, read back, remove: what a worker does with every file.
    store.put("doctor/probe.txt", b"ok")
    if store.get("doctor/probe.txt") != b"ok":
        raise SystemExit("an object reads back as other bytes")
    store.delete("doctor/probe.txt")
    return f"{store.url} can be written"
