"""Check the parts of this machine and suggest a remedy for each missing one.

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

State = Literal["ok", "absent", "degraded", "missing"]
PROBE_TIMEOUT_S: Final = 120
GL: Final = "GL"
"""Name of the OpenGL part. Without it the two OpenGL modes are unavailable; path tracing works."""
_EXCEPTION: Final = re.compile(r"^(pbrs_farm\.[\w.]+|\w+Error): ")  # prefix of an error line

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
    """Result of checking one part of the machine: state, details and remedy."""

    part: str
    state: State  # absent: optional; degraded: the main job runs without it, slower or with fewer files
    text: str
    remedy: str = ""
    needed: bool = False  # the main job cannot run without it

    @property
    def gives(self) -> str:
        """The benefit of installing an absent, optional part; "" otherwise."""
        return "" if self.state == "ok" else _GIVES.get(self.part, "")


def examine(store_url: str = "", redis_url: str = "") -> list[Finding]:
    """Check all parts of the machine, in the order in which a run uses them.

    store_url, redis_url: services to check too; "" skips them. Parts that could crash are checked in
    child processes, about 10 s in all.
    """
    # Remedy for missing libraries.
    again = install_command()
    return [
        _python(),
        packages(),
        llvm(),
        *renderer_variants(),
        probe(GL, check_gl, _gl_remedy(), state="degraded"),
        probe("denoiser", check_denoiser, again, needed=True),
        probe("pictures", check_pictures, again, needed=True),
        optional_extras(),
        redis(redis_url),
        _store(store_url),
    ]


def can_run(findings: list[Finding]) -> bool:
    """True if the main job (run, demo) can run, with all required parts present.

    Degraded parts make it slower or disable an output, such as the OpenGL modes.
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


def optional_extras() -> Finding:
    missing = missing_extras()
    if not missing:
        # The extra `all` excludes torch, which is large and only used to train networks.
        exception = f" but study, which trains networks: {install_command('study')}"
        return Finding("extras", "ok", "all" + exception * (not is_installed("torch")))
    features = "; ".join(f"{name}: {GIVES[name]}" for name in missing)
    return Finding("extras", "absent", f"not installed: {features}", install_command(*missing))


def llvm() -> Finding:
    from pbrs_farm.raycast.variant import MIN_LLVM, find_llvm, llvm_libraries

    library = find_llvm()
    if library is not None:
        return Finding("LLVM", "ok", str(library))
    # List the old versions, as apt reports LLVM as installed.
    old = ", ".join(".".join(map(str, v)) for v, _path in llvm_libraries())
    text = f"only {old}; 14 to 16 crash inside Dr.Jit" if old else "no libLLVM found"
    text += f"; {MIN_LLVM} or later is needed (19 is what we test); running with scalar_rgb, several times slower"
    return Finding("LLVM", "degraded", text, llvm_command())


def renderer_variants() -> list[Finding]:
    # A machine without a GPU is complete.
    states: dict[str, State] = {"cuda_ad_rgb": "absent"}
    findings = [
        probe(
            f"mitsuba {n}",
            check_variant,
            _variant_remedy(n),
            argument=n,
            state=states.get(n, "degraded"),
        )
        for n in _VARIANTS
    ]
    # One working variant is enough; without any, rendering is impossible.
    if not any(f.state == "ok" for f in findings):
        last = findings[-1]
        findings[-1] = Finding(last.part, "missing", last.text, last.remedy, True)
    return findings


def _variant_remedy(name: str) -> str:
    """Remedy if a variant of Mitsuba fails."""
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
    return Finding("redis", "absent", "no redis-server (only the farm needs it)", remedy)


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
    """Run a check in a child process and return the finding; a crash counts as a failed check.

    check: a function of this module; it returns a description, or raises SystemExit with the error.
    """
    code = f"import sys; from {__name__} import {check.__name__} as f; print(f(sys.argv[1]))"
    command = [sys.executable, "-c", code, argument]
    # The child imports the check by name; its last output line is the result.
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PROBE_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        text = f"did not answer within {PROBE_TIMEOUT_S} s"
        return Finding(part, state, text, remedy, needed)
    if done.returncode == 0:
        return Finding(part, "ok", done.stdout.strip().splitlines()[-1], "", needed)
    # The last line of a traceback, or the text of SystemExit, is the error.
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    text = lines[-1] if lines else f"ended with exit code {done.returncode}"
    # Drop the exception's name, and the remedy, which is shown separately.
    text = _EXCEPTION.sub("", text).removesuffix(f" ({remedy})")
    return Finding(part, state, text[:200], remedy, needed)


def check_variant(name: str) -> str:
    """Trace a ray with a variant of Mitsuba; SystemExit with the reason if that fails.

    Runs in this process, so a crash ends it; the doctor calls each check in a child.
    """
    from pbrs_farm.raycast import variant

    # Dr.Jit would load an older LLVM and crash.
    if name.startswith("llvm") and not variant.find_llvm():
        raise SystemExit(f"no LLVM of version {variant.MIN_LLVM} or later")
    variant.choose_variant()
    if not variant.works(name):
        raise SystemExit("does not work here")
    return name


def check_gl(_argument: str) -> str:
    """Open an OpenGL context."""
    from pbrs_farm.raster.gl_device import open_context

    context = open_context()
    return f"{context.info['GL_RENDERER']}, GL {context.version_code / 100}"


def check_denoiser(_argument: str) -> str:
    """Denoise a grey picture with Open Image Denoise and check that it is unchanged."""
    import numpy as np

    from pbrs_farm.transport.develop.denoiser import denoise_radiance

    grey = np.full((32, 32, 3), 0.5, np.float32)
    # Guide images: grey albedo and an upward normal.
    normal = np.broadcast_to(np.array([0, 1, 0], np.float32), grey.shape).copy()
    mean = float(denoise_radiance(grey, grey, normal).mean())
    if abs(mean - 0.5) >= 0.05:
        raise SystemExit(f"a grey of 0.5 comes out as {mean}")
    return f"Open Image Denoise, pyoidn {version('pyoidn')}"


def check_pictures(_argument: str) -> str:
    """Write a PNG with OpenImageIO and read it back."""
    import numpy as np

    from pbrs_farm.images import array_from_png, png_from_array

    # All byte values, in 16 bits as in depth images.
    pixels = np.arange(256, dtype=np.uint16).reshape(16, 16)
    if not np.array_equal(array_from_png(png_from_array(pixels)), pixels):
        raise SystemExit("a PNG reads back as other pixels")
    return f"OpenImageIO {version('OpenImageIO')}"


def check_redis(url: str) -> str:
    """Ping the Redis at url."""
    # Import by name: redis is an optional package.
    client = import_module("redis").Redis.from_url(url, socket_timeout=5)
    return f"answers, version {client.info('server')['redis_version']}"


def check_store(url: str) -> str:
    """Write, read and remove doctor/probe.txt in the store at url.

    Raises SystemExit or the store's own error if one of these fails.
    """
    from pbrs_farm.settings import settings_from_environment
    from pbrs_farm.store import store_from_url

    store = store_from_url(url, settings_from_environment().store)
    store.put("doctor/probe.txt", b"ok")
    if store.get("doctor/probe.txt") != b"ok":
        raise SystemExit("an object reads back as other bytes")
    store.delete("doctor/probe.txt")
    return f"{store.url} can be written"
