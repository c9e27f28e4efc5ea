"""The glass of a SUNCG mirror reflects, its frame does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.core.house import MaterialKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_meshes import Obj, mtl

TEAL, WOOD = "0.4 0.6 0.6", "0.6 0.4 0.2"


@pytest.mark.parametrize(
    ("words", "colours", "is_mirror"),
    [
        ("dressing_table,2,dresser", (WOOD, TEAL), True),
        ("dresser,2,dresser", (WOOD, TEAL), True),
        ("dresser,2,dresser", (WOOD, WOOD), False),  # a back board
        ("desk,2,desk", (WOOD, TEAL), False),
    ],
)
def test_the_pane_of_a_dressing_table_reflects(
    tmp_path: Path, words: str, colours: tuple[str, str], is_mirror: bool
) -> None:
    obj = Obj("chair.mtl")
    obj.begin(material="material_0")
    obj.box((-0.5, 0, -0.2), (0.5, 0.75, 0.2))
    obj.box((-0.5, 0.75, -0.2), (0.5, 1.5, -0.17))
    obj.begin(material="material_1")
    obj.quad([(-0.4, 0.8, -0.16), (0.4, 0.8, -0.16), (0.4, 1.4, -0.16), (-0.4, 1.4, -0.16)])
    assert kinds_of(tmp_path, words, obj, colours) == {
        "material_0": MaterialKind.OPAQUE,
        "material_1": MaterialKind.MIRROR if is_mirror else MaterialKind.OPAQUE,
    }


def test_no_front_of_a_chest_reflects(tmp_path: Path) -> None:
    obj = Obj("chair.mtl")
    obj.begin(material="material_0")
    obj.box((-0.5, 0, -0.2), (0.5, 0.9, 0.2))
    obj.begin(material="material_1")
    obj.quad([(-0.4, 0.5, 0.21), (0.4, 0.5, 0.21), (0.4, 0.8, 0.21), (-0.4, 0.8, 0.21)])
    kinds = kinds_of(tmp_path, "dresser,2,dresser", obj, (WOOD, TEAL))
    assert MaterialKind.MIRROR not in kinds.values()


def kinds_of(
    folder: Path, words: str, obj: Obj, colours: tuple[str, str]
) -> dict[str, MaterialKind]:
    """Material -> its kind, of a model with the classes of a row of the category table."""
    house = suncg_root.write_root(folder)
    table = folder / "metadata/ModelCategoryMappingNewActive.csv"
    table.write_text(table.read_text().replace("chair,2,chair", words))
    suncg_root.write(folder / "object/chair/chair.obj", obj.text())
    looks = [{"name": f"material_{k}", "Kd": colour} for k, colour in enumerate(colours)]
    suncg_root.write(folder / "object/chair/chair.mtl", mtl(*looks))
    read = read_suncg(folder, house, ReadFields())
    item = next(i for i in read.items if i.id == "0_2")
    return {s.name: read.materials[s.material].kind for s in item.surfaces}


def test_the_flat_material_of_a_mirror_reflects_and_its_frame_does_not(tmp_path: Path) -> None:
    obj = Obj("chair.mtl")
    obj.begin(material="material_0")
    for x in (-0.5, 0.45):
        obj.box((x, 0, -0.05), (x + 0.05, 1.5, 0.05))
    obj.begin(material="material_1")
    obj.quad([(-0.45, 0, 0.03), (0.45, 0, 0.03), (0.45, 1.5, 0.03), (-0.45, 1.5, 0.03)])
    kinds = kinds_of(tmp_path, "mirror,2,mirror", obj, (WOOD, WOOD))
    assert kinds == {"material_0": MaterialKind.OPAQUE, "material_1": MaterialKind.MIRROR}
