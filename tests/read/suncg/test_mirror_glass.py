"""The glass of a SUNCG mirror reflects, its frame does not."""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.core.house import MaterialKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_meshes import Obj, mtl


def test_the_flat_material_of_a_mirror_reflects_and_its_frame_does_not(tmp_path: Path) -> None:
    house = suncg_root.write_root(tmp_path)
    table = tmp_path / "metadata/ModelCategoryMappingNewActive.csv"
    table.write_text(table.read_text().replace("chair,2,chair,,,1", "mirror,2,mirror,,,1"))
    obj = Obj("chair.mtl")
    obj.begin(material="material_0")
    for x in (-0.5, 0.45):
        obj.box((x, 0, -0.05), (x + 0.05, 1.5, 0.05))
    obj.begin(material="material_1")
    obj.quad([(-0.45, 0, 0.03), (0.45, 0, 0.03), (0.45, 1.5, 0.03), (-0.45, 1.5, 0.03)])
    suncg_root.write(tmp_path / "object/chair/chair.obj", obj.text())
    looks = [{"name": f"material_{k}", "Kd": "0.6 0.5 0.4"} for k in range(2)]
    suncg_root.write(tmp_path / "object/chair/chair.mtl", mtl(*looks))
    read = read_suncg(tmp_path, house, ReadFields())
    mirror = next(i for i in read.items if i.id == "0_2")
    kinds = {s.name: read.materials[s.material].kind for s in mirror.surfaces}
    assert kinds == {"material_0": MaterialKind.OPAQUE, "material_1": MaterialKind.MIRROR}
