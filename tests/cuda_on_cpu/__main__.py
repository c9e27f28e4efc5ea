"""Build the libraries and exec a command that finds them; see the package."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Final

HERE: Final = Path(__file__).resolve().parent
OUT: Final = HERE.parents[1] / "out" / "cuda-on-cpu"
_CC: Final = ("gcc", "-O1", "-fopenmp", "-shared", "-fPIC", "-w")


def main(command: list[str]) -> None:
    """Run a command in place of this process."""
    if not command:
        sys.exit("usage: python -m tests.cuda_on_cpu COMMAND [ARGUMENT...]")
    build()
    os.environ |= {
        "DRJIT_LIBCUDA_PATH": str(OUT / "libcuda_on_cpu.so"),
        "DRJIT_LIBOPTIX_PATH": str(OUT / "liboptix_on_cpu.so"),
        "CUDA_ON_CPU": str(OUT),
        "CUDA_ON_CPU_TRANSLATE": shlex.join([sys.executable, str(HERE / "ptx_to_c.py")]),
        "CUDA_ON_CPU_INCLUDE": str(HERE),
    }
    os.execvp(command[0], command)


def build() -> None:
    """Build both libraries if their source has changed, and delete translated kernels with them."""
    import embreex

    embree = next((Path(embreex.__file__).parents[1] / "embreex.libs").glob("libembree4*.so*"))
    driver, optix = OUT / "libcuda_on_cpu.so", OUT / "liboptix_on_cpu.so"
    sources = [*filter(Path.is_file, HERE.iterdir()), embree, _drjit()]
    newest = max(path.stat().st_mtime for path in sources)
    if optix.is_file() and optix.stat().st_mtime > newest:
        return
    OUT.mkdir(parents=True, exist_ok=True)
    for old in OUT.glob("*.so"):
        old.unlink()
    stubs = OUT / "other_calls.c"
    stubs.write_text(_other_calls())
    subprocess.run([*_CC, "-o", driver, HERE / "driver.c", stubs, "-ldl"], check=True)
    links = [str(driver), str(embree), f"-Wl,-rpath,{embree.parent}"]
    subprocess.run([*_CC, "-o", optix, HERE / "optix.c", *links], check=True)


def _drjit() -> Path:
    """Dr.Jit's library."""
    import drjit

    return Path(drjit.__file__).parent / "libdrjit-core.so"


def _other_calls() -> str:
    """C stubs of the driver's functions that Dr.Jit looks up and driver.c lacks."""
    library = _drjit().read_bytes()
    names = {name.decode() for name in re.findall(rb"\0(cu[A-Z]\w+)(?=\0)", library)}
    ours = set(re.findall(r"^int (cu\w+)\(", (HERE / "driver.c").read_text(), re.MULTILINE))
    return "".join(f"int {name}(void) {{ return 0; }}\n" for name in sorted(names - ours))


if __name__ == "__main__":
    main(sys.argv[1:])
