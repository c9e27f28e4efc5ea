"""A home as one OpenUSD package, its textures within. Effects: writes files."""

from __future__ import annotations

import tempfile
from pathlib import Path

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.forms.usd import write_usd
from pbrs_farm.export.home_pieces import COLLIDES, ExportedHome
from pbrs_farm.installation import need


def write_usdz(home: ExportedHome, folder: Path) -> None:
    """<house id>.usdz, which includes its textures.

    Written by way of a .usdc in a temporary folder. Needs the module pxr; raises MachineFailed if the
    package could not be written.
    """
    need("pxr")
    from pxr import UsdUtils

    with tempfile.TemporaryDirectory() as scratch:
        write_usd(home, Path(scratch))
        stage = Path(scratch) / f"{home.house.id}.usdc"
        package = folder / f"{home.house.id}.usdz"
        if not UsdUtils.CreateNewUsdzPackage(str(stage), str(package)):
            raise MachineFailed(f"{package.name} could not be written")


FORM = HomeForm(
    "usdz", write_usdz, "the same as `usd` in one file: `<id>/<id>.usdz`", remark=COLLIDES
)
