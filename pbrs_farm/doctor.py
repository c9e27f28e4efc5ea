"""What this machine can do, part by part, and what to do about what is missing.

Effects: starts a process per part that could crash (LLVM, GL), reads versions.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version


@dataclass(frozen=True, slots=True)
class Finding:
    """One part: state "ok", "degraded" (the main job still runs) or "missing"; what to do."""

    part: str
    state: str
    text: str
    remedy: str = ""
    needed: bool = False


def examine(store_url: str = "", redis_url: str = "") -> list[Finding]:
    """Every part in the order a house meets it. needed: the main job cannot run without it."""
    findings = [_python(), _packages(), _llvm()]
    findings += _variants()
    findings += [
        _probe(
            "GL",
            _GL,
            "sudo apt-get install -y libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri",
            needed=True,
        ),
        _probe("denoiser", _OIDN, "pip install 'pbrs-farm[transport]'", needed=True),
        _probe("pictures", _OIIO, "pip install OpenImageIO", needed=True),
        _redis(redis_url),
        _store(store_url),
    ]
    return findings


def can_run(findings: list[Finding]) -> bool:
    """The main job (run, demo) can run."""
    return not any(f.needed and f.state == "missing" for f in findings)


def _python() -> Finding:
    text = sys.version.split()[0]
    return Finding(
        "python", "ok" if sys.version_info >= (3, 11) else "missing", text, "Python 3.11+", True
    )


_PACKAGES = ("numpy", "pydantic", "mitsuba", "drjit", "moderngl", "trimesh", "manifold3d", "pyoidn")


def _packages() -> Finding:
    found, missing = [], []
    for package in (*_PACKAGES, "OpenImageIO", "shapely"):
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            missing.append(package)
    if missing:
        text = "not installed: " + ", ".join(missing)
        return Finding("packages", "missing", text, "pip install -e '.[gl,transport]'", True)
    return Finding("packages", "ok", ", ".join(found))


def _llvm() -> Finding:
    from pbrs_farm.raycast.variant import MIN_LLVM, find_llvm, llvm_libraries

    library = find_llvm()
    remedy = "sudo apt-get install -y libllvm19"
    if library is not None:
        return Finding("LLVM", "ok", str(library))
    old = ", ".join(".".join(map(str, v)) for v, _path in llvm_libraries())
    text = f"only {old}; 14 to 16 crash inside Dr.Jit" if old else "no libLLVM found"
    text += f"; {MIN_LLVM} or later is needed (19 is what we test); running with scalar_rgb, several times slower"
    return Finding("LLVM", "degraded", text, remedy)


_VARIANT = """
import sys
from pbrs_farm.transport import variant
name = sys.argv[1]
if name.startswith("llvm"):
    assert variant.find_llvm(), "no LLVM of version 17 or later"
variant.choose_variant()
assert variant.works(name), "does not work here"
print(name)
"""


def _variants() -> list[Finding]:
    findings = [
        _probe(f"mitsuba {name}", _VARIANT, remedy, argument=name, state="degraded")
        for name, remedy in (
            ("cuda_ad_rgb", "only with an NVIDIA GPU and its driver; not needed"),
            ("llvm_ad_rgb", "sudo apt-get install -y libllvm19"),
            ("scalar_rgb", "pip install 'pbrs-farm[transport]'"),
        )
    ]
    if not any(f.state == "ok" for f in findings):
        last = findings[-1]
        findings[-1] = Finding(last.part, "missing", last.text, last.remedy, True)
    return findings


_GL = """
from pbrs_farm.raster.gl_device import open_context
context = open_context()
print(context.info["GL_RENDERER"] + ", GL " + str(context.version_code / 100))
"""

_OIDN = """
from importlib.metadata import version
import numpy as np
from pbrs_farm.transport.develop.denoiser import denoise_radiance
grey = np.full((32, 32, 3), 0.5, np.float32)
up = np.zeros((32, 32, 3), np.float32); up[..., 1] = 1
out = denoise_radiance(grey, grey, up)
assert abs(float(out.mean()) - 0.5) < 0.05, out.mean()
print("Open Image Denoise, pyoidn " + version("pyoidn"))
"""

_OIIO = """
from importlib.metadata import version
import numpy as np
from pbrs_farm.images import array_from_png, png_from_array
pixels = np.arange(256, dtype=np.uint16).reshape(16, 16)
assert (array_from_png(png_from_array(pixels)) == pixels).all()
print("OpenImageIO " + version("OpenImageIO"))
"""


def _probe(
    part: str,
    code: str,
    remedy: str,
    *,
    argument: str = "",
    needed: bool = False,
    state: str = "missing",
) -> Finding:
    """Run code in a process of its own: a crash there is a finding here."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", code, argument], capture_output=True, text=True, timeout=120
        )
    except subprocess.TimeoutExpired:
        return Finding(part, state, "did not answer within 120 s", remedy, needed)
    if done.returncode == 0:
        return Finding(
            part,
            "ok",
            done.stdout.strip().splitlines()[-1] if done.stdout.strip() else "works",
            "",
            needed,
        )
    lines = [line for line in done.stderr.strip().splitlines() if line.strip()]
    text = (
        lines[-1].removeprefix("AssertionError: ")
        if lines
        else f"ended with exit code {done.returncode}"
    )
    return Finding(part, state, text[:200], remedy, needed)


def _redis(url: str) -> Finding:
    server = shutil.which("redis-server")
    if url:
        return _probe(
            "redis", _PING, "is it running? PBRS_REDIS_URL names it", argument=url, state="degraded"
        )
    if server is None:
        return Finding(
            "redis",
            "degraded",
            "no redis-server (only the farm needs it)",
            "sudo apt-get install -y redis-server",
        )
    return Finding("redis", "ok", f"{server} (only the farm needs it)")


_PING = """
import sys
from importlib import import_module
client = import_module("redis").Redis.from_url(sys.argv[1], socket_timeout=5)
print("answers, version " + client.info("server")["redis_version"])
"""


def _store(url: str) -> Finding:
    if not url:
        return Finding("store", "ok", "folders (no --out or PBRS_STORE given)")
    return _probe(
        "store", _PUT, "check the path, endpoint and credentials", argument=url, needed=True
    )


_PUT = """
import sys
from pbrs_farm.settings import settings_from_environment
from pbrs_farm.store import store_from_url
store = store_from_url(sys.argv[1], settings_from_environment().store)
store.put("doctor/probe.txt", b"ok")
assert store.get("doctor/probe.txt") == b"ok"
store.delete("doctor/probe.txt")
print(store.url + " can be written")
"""
