"""OpenUSD stages written with the library and read as houses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind, MaterialKind
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.repair import repair
from tests.inputs.usd_files import UsdHome, set_label, walls_of
from tests.repair.embree import EmbreeOccluder


def room_home(path: Path, unit: float = 1.0, up: str = "Z") -> UsdHome:
    home = UsdHome(path, unit, up)
    UsdGeom.Xform.Define(home.stage, "/World/Kitchen")
    walls_of(home, "/World/Kitchen", 0, 4, 0, 3)
    return home


def read(home: UsdHome) -> House:
    return read_house(resolve(str(home.save())), ReadFields())


def item(house: House, name: str) -> Item:
    return next(i for i in house.items if i.name == name)


@pytest.mark.quick(6)
@pytest.mark.parametrize("suffix", ["usda", "usdc", "usd"])
@pytest.mark.parametrize(("unit", "up"), [(1.0, "Z"), (0.01, "Z"), (1.0, "Y"), (0.0254, "Y")])
def test_unit_and_axis_give_the_same_house(
    tmp_path: Path, unit: float, up: str, suffix: str
) -> None:
    home = room_home(tmp_path / f"a.{suffix}", unit, up)
    home.box("/World/Kitchen/Chair_1", [1, 0, 1], [1.5, 0.9, 1.5])
    house = read(home)
    assert np.allclose(item(house, "Chair_1").bounds, [[1, 0, 1], [1.5, 0.9, 1.5]], atol=1e-5)
    (room,) = house.rooms
    assert np.allclose([room.floor_y, room.ceiling_y], [0, 2.6], atol=1e-5)
    assert np.allclose(room.polygon.max(0), [4, 3], atol=0.02)
    assert room.name == "Kitchen"
    assert {"wall", "floor", "ceiling", "window", "object"} == {i.kind.value for i in house.items}
    assert len(house.openings) == 1


def test_orientation_gives_the_side_of_a_triangle(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda")
    up = [[[1, 1, 2], [2, 1, 2], [2, 1, 1], [1, 1, 1]]]
    home.quads("/World/Table_a", up)
    home.quads("/World/Table_b", up).CreateOrientationAttr("leftHanded")
    house = read(home)
    for name, sign in (("Table_a", 1), ("Table_b", -1)):
        (surface,) = item(house, name).surfaces
        a, b, c = surface.positions[surface.faces[0]]
        assert np.sign(np.cross(b - a, c - a)[1]) == sign


def test_hidden_proxies_guides_and_inactive_prims_are_not_read(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda")
    UsdGeom.Imageable(home.box("/World/Chair_1", [1, 0, 1], [2, 1, 2])).MakeInvisible()
    UsdGeom.Imageable(home.box("/World/Chair_2", [1, 0, 1], [2, 1, 2])).CreatePurposeAttr("proxy")
    UsdGeom.Imageable(home.box("/World/Chair_3", [1, 0, 1], [2, 1, 2])).CreatePurposeAttr("guide")
    home.box("/World/Chair_4", [1, 0, 1], [2, 1, 2]).GetPrim().SetActive(False)
    UsdGeom.Imageable(home.box("/World/Chair_5", [1, 0, 1], [2, 1, 2])).CreatePurposeAttr("render")
    assert [i.name for i in read(home).items if i.name.startswith("Chair")] == ["Chair_5"]


def test_old_and_new_labels_give_the_class_and_a_component_is_one_item(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda")
    new = home.box("/World/Obj_1", [1, 0, 1], [2, 1, 2]).GetPrim()
    set_label(new, "sofa")
    old = home.box("/World/Obj_2", [1, 0, 1], [2, 1, 2]).GetPrim()
    for key, value in (("semanticType", "class"), ("semanticData", "bed")):
        name = f"semantic:Semantics_a:params:{key}"
        old.CreateAttribute(name, Sdf.ValueTypeNames.String).Set(value)
    thing = UsdGeom.Xform.Define(home.stage, "/World/Obj_3")
    Usd.ModelAPI(thing).SetKind(Kind.Tokens.component)
    home.box("/World/Obj_3/part_1", [1, 0, 1], [2, 1, 2])
    home.box("/World/Obj_3/part_2", [1, 1, 1], [2, 2, 2])
    house = read(home)
    assert (item(house, "Obj_1").nyu40, item(house, "Obj_2").nyu40) == (6, 4)
    assert len(item(house, "Obj_3").surfaces) == 2
    assert [n.place for n in house.notes if n.kind == "unmapped-class"] == ["/World/Obj_3"]


def test_the_size_of_a_component_decides_about_its_name(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda")
    for name, high in (("Grass", 0.02), ("Fern", 0.6)):
        thing = UsdGeom.Xform.Define(home.stage, f"/World/{name}")
        Usd.ModelAPI(thing).SetKind(Kind.Tokens.component)
        home.box(f"/World/{name}/part", [1, 0, 1], [4, high, 4])
    house = read(home)
    kinds = [item(house, name).kind for name in ("Grass", "Fern")]
    assert kinds == [ItemKind.GROUND, ItemKind.PLANT]


def test_instances_are_separate_items_and_variants_and_payloads_are_followed(
    tmp_path: Path,
) -> None:
    chair = UsdHome(tmp_path / "chair.usda")
    sets = chair.root.GetPrim().GetVariantSets().AddVariantSet("size")
    for name, high in (("small", 0.5), ("large", 1.0)):
        sets.AddVariant(name)
        sets.SetVariantSelection(name)
        with sets.GetVariantEditContext():
            chair.box("/World/Seat", [0, 0, 0], [0.5, high, 0.5])
    sets.SetVariantSelection("large")
    chair.save()
    home = room_home(tmp_path / "a.usda")
    for k in range(2):
        prim = UsdGeom.Xform.Define(home.stage, f"/World/Chair_{k}")
        prim.GetPrim().GetReferences().AddReference("chair.usda")
        prim.GetPrim().SetInstanceable(True)
        prim.AddTranslateOp().Set(Gf.Vec3d(k + 1.0, -1.0, 0))
    loaded = home.stage.DefinePrim("/World/Chair_9")
    loaded.GetPayloads().AddPayload("chair.usda")
    house = read(home)
    assert np.allclose(item(house, "Chair_0").bounds, [[1, 0, 1], [1.5, 1, 1.5]], atol=1e-5)
    assert np.allclose(item(house, "Chair_1").bounds, [[2, 0, 1], [2.5, 1, 1.5]], atol=1e-5)
    assert item(house, "Chair_9").n_faces == 12
    source = resolve(str(home.path))
    (tmp_path / "chair.usda").write_text((tmp_path / "chair.usda").read_text() + "\n")
    assert resolve(str(home.path)).companions != source.companions


def test_a_point_instancer_places_its_prototypes(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda")
    many = UsdGeom.PointInstancer.Define(home.stage, "/World/Many")
    home.box("/World/Many/Chair", [0, 0, 0], [0.4, 0.8, 0.4])
    many.CreatePrototypesRel().SetTargets(["/World/Many/Chair"])
    many.CreateProtoIndicesAttr([0, 0, 0])
    many.CreatePositionsAttr([(1, -1, 0), (2, -1, 0), (3, -1, 0)])
    many.InvisibleIds = many.CreateInvisibleIdsAttr([1])
    chair_xs = sorted(i.bounds[0, 0] for i in read(home).items if i.name == "Chair")
    assert np.allclose(chair_xs, [1, 3], atol=1e-5)


def test_solids_have_their_size_and_axis(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda")
    UsdGeom.Cube.Define(home.stage, "/World/Table_cube").CreateSizeAttr(1.0)
    UsdGeom.Sphere.Define(home.stage, "/World/Table_ball").CreateRadiusAttr(0.5)
    for name, kind in (("cylinder", UsdGeom.Cylinder), ("cone", UsdGeom.Cone)):
        solid = kind.Define(home.stage, f"/World/Table_{name}")
        solid.CreateRadiusAttr(0.25)
        solid.CreateHeightAttr(1.5)
        solid.CreateAxisAttr("X")
    house = read(home)
    for name, size in (
        ("cube", [1, 1, 1]), ("ball", [1, 1, 1]), ("cylinder", [1.5, 0.5, 0.5]), ("cone", [1.5, 0.5, 0.5])
    ):  # fmt: skip
        low, high = item(house, f"Table_{name}").bounds
        assert np.allclose(high - low, size, atol=0.01), name


def test_subsets_keep_their_materials_and_glass_of_a_window_is_a_pane(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda")
    mesh = home.box(
        "/World/Cabinet", [1, 0, 1], [2, 1, 2], material=home.material("Oak", (0.5, 0.2, 0.1))
    )
    red = home.material("Red", (0.8, 0, 0), roughness=1.0)
    subset = UsdShade.MaterialBindingAPI(mesh).CreateMaterialBindSubset("front", [0, 1])
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(red)
    house = read(home)
    materials = {
        house.materials[s.material].name: len(s.faces) for s in item(house, "Cabinet").surfaces
    }
    assert materials == {"Oak": 8, "Red": 4}
    (pane,) = item(house, "Window_1").surfaces
    assert house.materials[pane.material].kind is MaterialKind.PANE


def test_omnipbr_glass_and_other_mdl(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda")
    (tmp_path / "Odd.mdl").write_text('mdl 1.4; x = texture_2d("./odd.png", gamma_srgb);')
    for name in ("OmniPBR", "OmniGlass", "Odd"):
        material = UsdShade.Material.Define(home.stage, f"/World/Looks/{name}")
        shader = UsdShade.Shader.Define(home.stage, f"/World/Looks/{name}/Shader")
        shader.SetSourceAsset(f"./{name}.mdl", "mdl")
        shader.SetSourceAssetSubIdentifier(name, "mdl")
        colour = shader.CreateInput("diffuse_color_constant", Sdf.ValueTypeNames.Color3f)
        colour.Set((1.0, 0.0, 0.0))
        shader.CreateInput("metallic_constant", Sdf.ValueTypeNames.Float).Set(0.0)
        material.CreateSurfaceOutput("mdl").ConnectToSource(
            shader.CreateOutput("out", Sdf.ValueTypeNames.Token)
        )
        home.box(f"/World/Table_{name}", [1, 0, 1], [2, 1, 2], material=material)
    house = read(home)
    by_name = {m.name: m for m in house.materials}
    assert by_name["OmniPBR"].diffuse == pytest.approx((1.0, 0.0, 0.0))
    assert by_name["OmniGlass"].kind is MaterialKind.GLASS
    assert sorted(n.kind for n in house.notes if n.place != "") == [
        "missing-texture",
        "unread-part",
    ]


def test_lights_keep_their_place_and_suns_come_from_the_recipe(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda", 0.01)
    home.sphere_light("/World/Bulb", [2, 2, 1], 0.04)
    rect = UsdLux.RectLight.Define(home.stage, "/World/Panel")
    rect.CreateWidthAttr(60.0)
    rect.CreateHeightAttr(30.0)
    rect.CreateColorAttr((1, 0.5, 0.25))
    rect.AddTranslateOp().Set((100, -100, 250))
    UsdLux.DomeLight.Define(home.stage, "/World/Sky")
    UsdLux.DistantLight.Define(home.stage, "/World/Sun")
    lamps = [i for i in read(home).items if i.kind is ItemKind.LAMP]
    assert [i.name for i in lamps] == ["Bulb", "Panel"]
    bulb, panel = (i.lights[0] for i in lamps)
    assert np.allclose(bulb.position, [2, 2, 1], atol=1e-5)
    assert bulb.radius_m == pytest.approx(0.04)
    assert bulb.power == panel.power == 800
    assert panel.rgb_linear == pytest.approx((1, 0.5, 0.25))
    low, high = lamps[1].bounds
    assert np.allclose(high - low, [0.6, 0, 0.3], atol=1e-4)


def test_rooms_beside_the_file_are_taken(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda", 0.01)
    polygon = "[[0, 0], [200, 0], [200, -300], [0, -300]]"
    (tmp_path / "rooms.json").write_text(f'[{{"room_type": "bathroom", "polygon": {polygon}}}]')
    (room,) = read(home).rooms
    assert (room.name, room.types) == ("bathroom", ("bathroom",))
    assert np.allclose([room.polygon.min(0), room.polygon.max(0)], [[0, 0], [2, 3]], atol=0.01)


def test_a_usdz_package_is_read_with_its_pictures(tmp_path: Path) -> None:
    from pxr import UsdUtils

    from tests.inputs.pictures import picture

    (tmp_path / "p.png").write_bytes(picture())
    home = room_home(tmp_path / "a.usda")
    home.box("/World/Chair", [1, 0, 1], [2, 1, 2], material=home.material("M", picture="./p.png"))
    home.save()
    assert UsdUtils.CreateNewUsdzPackage(str(home.path), str(tmp_path / "a.usdz"))
    (tmp_path / "p.png").unlink()
    house = read_house(resolve(str(tmp_path / "a.usdz")), ReadFields())
    assert len(house.textures) == 1


def test_references_that_do_not_resolve_are_notes_and_a_third_of_them_is_refused(
    tmp_path: Path,
) -> None:
    home = room_home(tmp_path / "a.usda")
    UsdHome(tmp_path / "good.usda").save()
    for k in range(4):
        home.stage.DefinePrim(f"/World/Good_{k}").GetReferences().AddReference("good.usda")
    lost = home.stage.DefinePrim("/World/Lost")
    lost.GetReferences().AddReference("omniverse://host/chair.usd")
    house = read(home)
    assert [(n.kind, n.place) for n in house.notes if n.kind == "missing-model"] == [
        ("missing-model", "/World/Lost")
    ]
    for k in range(3):
        prim = home.stage.DefinePrim(f"/World/Lost_{k}")
        prim.GetReferences().AddReference(f"/Isaac/{k}.usd")
    with pytest.raises(BadHouse, match="4 of 8 references do not resolve"):
        read(home)


DAMAGED = {
    "empty": (b"", "damaged"),
    "other": (b"PNG", "damaged"),
    "truncated": (b'#usda 1.0\ndef Xform "W" { def "x" ', "Expected }"),
    "no text": (b'#usda 1.0\ndef Xform "W\xe3" {}\n', "damaged"),
    "no floor": (b'#usda 1.0\ndef Xform "W" {}\n', "has no floor"),
    "crate": (b"PXR-USDC" + b"\xff" * 200, "damaged"),
    "index": (
        b'#usda 1.0\ndef Mesh "M" {\npoint3f[] points = [(0,0,0)]\nint[] faceVertexCounts = [3]\n'
        b"int[] faceVertexIndices = [0,1,2]\n}\n",
        "/M: a face names a point that does not exist",
    ),
    "counts": (
        b'#usda 1.0\ndef Mesh "M" {\npoint3f[] points = [(0,0,0)]\nint[] faceVertexCounts = [4]\n'
        b"int[] faceVertexIndices = [0,0,0]\n}\n",
        "faceVertexCounts add up to 4",
    ),
    "nan": (
        b'#usda 1.0\ndef Mesh "M" {\npoint3f[] points = [(nan,0,0)]\nint[] faceVertexCounts = [3]\n'
        b"int[] faceVertexIndices = [0,0,0]\n}\n",
        "not finite",
    ),
    "bomb": (
        b"#usda 1.0\n"
        + b"".join(
            b'def "L%d" { %s }\n'
            % (k, b"".join(b'def "c%d" (references = </L%d>) {}\n' % (i, k + 1) for i in range(10)))
            for k in range(9)
        )
        + b'def "L9" {}\n',
        "composes more than",
    ),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_a_damaged_file_is_refused_with_its_place(tmp_path: Path, case: str) -> None:
    data, text = DAMAGED[case]
    path = tmp_path / ("a.usdc" if case == "crate" else "a.usda")
    path.write_bytes(data)
    with pytest.raises(BadHouse, match=text) as caught:
        read_house(resolve(str(path)), ReadFields())
    assert "\n" not in str(caught.value)


def test_a_reference_out_of_the_folder_is_refused_unless_models_names_it(tmp_path: Path) -> None:
    UsdHome(tmp_path / "chair.usda").save()
    (tmp_path / "home").mkdir()
    home = room_home(tmp_path / "home/a.usda")
    home.stage.DefinePrim("/World/Chair").GetReferences().AddReference("../chair.usda")
    home.save()
    with pytest.raises(BadHouse, match="leads out of the folder"):
        read_house(resolve(str(home.path)), ReadFields())
    assert read_house(resolve(str(home.path), models=str(tmp_path)), ReadFields()).rooms


def test_a_cycle_of_references_is_a_note(tmp_path: Path) -> None:
    home = room_home(tmp_path / "a.usda")
    home.stage.DefinePrim("/World/Again").GetReferences().AddInternalReference("/World")
    assert [n.kind for n in read(home).notes] == ["reference-cycle"]


def test_a_repaired_stage_leaks_no_ray_and_keeps_walls_and_openings(tmp_path: Path) -> None:
    house = read(room_home(tmp_path / "a.usda"))
    repaired, report = repair(house, RepairFields(), occluder_from=EmbreeOccluder)
    assert report.leaks is not None
    assert report.leaks.n_rays > 0
    assert (report.leaks.n_sky, report.leaks.closed_share) == (0, pytest.approx(1))
    assert "wall-lost" not in {n.kind for n in repaired.notes}
    assert len(repaired.openings) == len(house.openings) == 1
