"""Makes the image's environment smaller: what no code of ours loads goes, equal libraries become links.

A step of docker/Dockerfile: `python slim.py /opt/venv/lib`. The image then imports every library, so that
one too many removed ends the build.
"""

from __future__ import annotations

import hashlib
import shutil
import sys
from pathlib import Path

NOT_LOADED = (
    "tests", "include", "*/pyoidn/oidn/bin",
    "*/pyoidn/oidn/lib/*sycl*", "*/pyoidn/oidn/lib/*_hip.*", "*/pyoidn/oidn/lib/libur_*",  # Intel's and AMD's GPUs
    "*/pyarrow/*flight*", "*/mitsuba/*_mono*.so", "*/mitsuba/*_spectral*.so",
)  # fmt: skip


def main(root: Path) -> None:
    """Slim the packages under root."""
    for pattern in NOT_LOADED:
        for path in [p for p in root.rglob("*") if p.match(pattern)]:
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
    # A wheel holds no links: lib.so, lib.so.2 and lib.so.2.5 are three copies.
    first: dict[tuple[Path, str], Path] = {}
    for path in sorted(root.rglob("*.so*")):
        key = (path.parent, hashlib.sha256(path.read_bytes()).hexdigest())
        if first.setdefault(key, path) != path:
            path.unlink()
            path.symlink_to(first[key].name)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
