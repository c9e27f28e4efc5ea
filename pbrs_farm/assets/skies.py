"""Outdoor panoramas of Debian's `blender-data` (CC0): fetched into a folder for sky.panoramas.

Effects: those of debian.py, and EXR files in the cache folder.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from pbrs_farm.assets.debian import cache_folder, fetched_deb, write_whole

PACKAGE: Final = "blender-data"
TESTED_VERSION: Final = "3.4.1+dfsg-2"
# Those of its panoramas that show a daylight sky (interior, studio, courtyard, night do not).
NAMES: Final = ("city", "forest", "sunrise", "sunset")


def fetch_skies() -> Path:
    """The folder that holds the outdoor panoramas, filled through apt the first time.

    Raises MachineFailed where apt cannot give the package.
    """
    folder = cache_folder() / "skies"
    if all((folder / f"{name}.exr").exists() for name in NAMES):
        return folder
    deb = fetched_deb(PACKAGE, TESTED_VERSION)
    paths = {f"{name}.exr" for name in NAMES}
    files = deb.members(lambda path: "studiolights/world/" in path and Path(path).name in paths)
    if {Path(path).name for path in files} != paths:
        raise deb.damaged(f"has no {', '.join(sorted(paths))}")
    folder.mkdir(parents=True, exist_ok=True)
    for path, data in files.items():
        write_whole(folder / Path(path).name, data)
    deb.path.unlink(missing_ok=True)
    return folder
