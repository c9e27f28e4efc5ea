"""Materials of OBJ models: colour and picture from their MTL."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.read.common.model_materials import GREY, WHITE, ModelMaterials
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder
from pbrs_farm.read.mesh.mtl import ObjMaterial
from tests.read.small_houses import png


def look(folder: Path, mtl: ObjMaterial) -> Material:
    materials = ModelMaterials(RootFolder(folder), Notes("m.obj", strict=False))
    return materials.material(mtl, None, place="m", clear=MaterialKind.GLASS)


@pytest.mark.parametrize("kd", [(0.0, 0.0, 0.0), GREY])
def test_a_picture_with_a_black_or_missing_colour_is_unchanged(
    tmp_path: Path, kd: tuple[float, float, float]
) -> None:
    mtl = ObjMaterial("wood", kd=kd, map_kd="p.png")
    assert look(tmp_path, mtl).diffuse == GREY  # the file is missing
    (tmp_path / "p.png").write_bytes(png())
    material = look(tmp_path, mtl)
    assert (material.diffuse, material.texture_id is not None) == (WHITE, True)
