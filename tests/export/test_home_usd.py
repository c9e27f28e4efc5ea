"""A home as an OpenUSD stage reads back equal, and the library's validators pass."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdLux, UsdPhysics, UsdUtils, UsdValidation
from scipy.spatial.transform import Rotation

from pbrs_farm.core import keys
from pbrs_farm.core.house import NOTHING_LEFT, MaterialKind, Texture
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.export.forms.usd import write_usd
from pbrs_farm.export.forms.usdz import write_usdz
from pbrs_farm.export.home_pieces import exported_home
from pbrs_farm.formats.house_glb import gltf_material
from pbrs_farm.geometry.opened import item_at
from pbrs_farm.images import png_from_array
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.export.homes import differences, repaired_home
from tests.inputs.cupboards import cupboard
from tests.inputs.loose_items import small_home


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The built-in home written in both forms."""
    folder = tmp_path_factory.mktemp("usd")
    home = exported_home(repaired_home())
    write_usd(home, folder)
    assert sum(p.is_file() for p in folder.rglob("*")) == 1 + len(home.house.textures)
    write_usdz(home, folder)
    return {form: folder / f"{home.house.id}.{form}" for form in ("usdc", "usdz")}


@pytest.mark.long
@pytest.mark.parametrize("form", ["usdc", "usdz"])
def test_a_written_home_is_read_back_equal(written: dict[str, Path], form: str) -> None:
    got = read_house(resolve(str(written[form])), ReadFields())
    assert differences(repaired_home(), got) == []
    assert [n for n in got.notes if n.kind != "outer-side"] == []
    assert len(got.textures) == len(repaired_home().textures)
    kinds = [{m.kind for m in house.materials} for house in (repaired_home(), got)]
    assert kinds[0] == kinds[1]


HOLED: tuple[dict[str, Any], ...] = (
    {"alpha_cutoff": 0.7},
    {"alpha_cutoff": NOTHING_LEFT},
    {"kind": MaterialKind.GLASS, "opacity": 0.25},
)


@pytest.mark.quick(1)
@pytest.mark.parametrize("change", HOLED)
def test_a_cut_out_keeps_its_cutoff_and_glass_its_holes(
    tmp_path: Path, change: dict[str, Any]
) -> None:
    home = repaired_home()
    pixels = np.full((4, 4, 4), 255, np.uint8)
    pixels[:2, :, 3] = 90
    data = png_from_array(pixels)
    texture = Texture(keys.sha256(data)[:16], "leaf.png", "image/png", data)
    (used,) = {s.material for s in home.items[-1].surfaces[:1]}
    leaf = replace(home.materials[used], texture_id=texture.id, alpha_cutout=True, **change)
    materials = [leaf if k == used else m for k, m in enumerate(home.materials)]
    holed = replace(
        home, materials=tuple(materials), textures={**home.textures, texture.id: texture}
    )
    write_usd(exported_home(holed), tmp_path)
    got = read_house(resolve(str(tmp_path / f"{home.id}.usdc")), ReadFields())
    cut = [m for m in got.materials if m.alpha_cutout]
    assert cut
    for m in cut:
        assert (m.kind, m.alpha_cutoff) == (leaf.kind, pytest.approx(leaf.alpha_cutoff))
        assert m.opacity == pytest.approx(leaf.opacity)
    written = gltf_material(leaf, {texture.id: 0})
    gltf_values = written if written["alphaMode"] == "MASK" else written["extras"]
    assert gltf_values["alphaCutoff"] == leaf.alpha_cutoff


@pytest.mark.parametrize("form", ["usdc", "usdz"])
def test_the_validators_of_usd_find_no_fault(written: dict[str, Path], form: str) -> None:
    diagnostics = UsdUtils.CoalescingDiagnosticDelegate()
    stage = Usd.Stage.Open(str(written[form]))
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    errors = [f"{e.GetName()}: {e.GetMessage()}" for e in context.Validate(stage)]
    assert errors == []
    assert diagnostics.TakeUncoalescedDiagnostics() == []


def test_pieces_collide_loose_ones_have_a_mass_and_lamps_shine(written: dict[str, Path]) -> None:
    stage = Usd.Stage.Open(str(written["usdc"]))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    home = exported_home(repaired_home())
    lamps = 0.0
    for piece in home.pieces:
        prim = stage.GetPrimAtPath(f"/Home/Items/{piece.name}")
        assert prim.GetAttribute("semantics:labels:class").Get()[0] == piece.class_name
        below = list(Usd.PrimRange(prim))
        assert any(p.HasAPI(UsdPhysics.CollisionAPI) for p in below) == bool(piece.surfaces)
        is_loose = bool(piece.surfaces) and not piece.is_fixed
        assert prim.HasAPI(UsdPhysics.RigidBodyAPI) == is_loose
        for light in (UsdLux.SphereLight(p) for p in below if p.IsA(UsdLux.SphereLight)):
            radius, nits = light.GetRadiusAttr().Get(), light.GetIntensityAttr().Get()
            lamps += 4 * np.pi**2 * radius**2 * nits
    expected = sum(lamp.flux_lm for piece in home.pieces for lamp in piece.lamps)
    assert lamps == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("kind", list(JointKind))
@pytest.mark.parametrize("stands_at", [0.0, 0.2])
def test_opening_parts_are_an_articulation_whose_joint_connects_its_bodies(
    tmp_path: Path, kind: JointKind, stands_at: float
) -> None:
    shut = cupboard(kind)
    item = item_at(shut, "front", stands_at)
    home = exported_home(small_home(item))
    write_usd(home, tmp_path)
    stage = Usd.Stage.Open(str(tmp_path / "small.usdc"))
    joints = {p.GetTypeName(): p for p in stage.Traverse() if p.IsA(UsdPhysics.Joint)}
    (word,) = set(joints) - {"PhysicsFixedJoint"}
    assert word.lower() == f"physics{kind}joint"
    joint, root = joints[word], joints["PhysicsFixedJoint"]
    (articulation,) = [p for p in stage.Traverse() if p.HasAPI(UsdPhysics.ArticulationRootAPI)]
    assert articulation == root
    unit = 180 / np.pi if kind is JointKind.REVOLUTE else 1.0
    assert joint.GetAttribute("physics:upperLimit").Get() == pytest.approx(
        shut.joints[0].upper * unit
    )
    # The part's joint value, computed from the frames of both ends.
    frames = [_world_frame(stage, joint, n) for n in (0, 1)]
    between = np.linalg.inv(frames[0]) @ frames[1]
    if kind is JointKind.PRISMATIC:
        assert between[:3, 3] == pytest.approx([stands_at, 0, 0], abs=1e-5)
    else:
        assert np.arctan2(between[2, 1], between[1, 1]) == pytest.approx(stands_at, abs=1e-5)
        assert between[:3, 3] == pytest.approx(np.zeros(3), abs=1e-5)
    assert _world_frame(stage, root, 1) == pytest.approx(_world_frame(stage, root, 0), abs=1e-5)
    part = stage.GetPrimAtPath(f"{root.GetPath().GetParentPath()}/Body")
    assert part.GetRelationship("physics:filteredPairs").GetTargets() == [
        f"{part.GetPath().GetParentPath()}/Part_1"
    ]
    # The visible prim is at the home's place.
    (prim,) = [p for p in stage.Traverse() if p.GetDisplayName() == "front"]
    box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"]).ComputeWorldBound(prim)
    low = np.array(box.ComputeAlignedRange().GetMin())
    points = item.surfaces[1].positions
    assert low == pytest.approx(
        [points[:, 0].min(), -points[:, 2].max(), points[:, 1].min()], abs=1e-5
    )
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    assert [e.GetMessage() for e in context.Validate(stage)] == []
    # A body within a body would not move independently.
    for p in stage.Traverse():
        above = [a for a in Usd.PrimRange(p) if a != p and a.HasAPI(UsdPhysics.RigidBodyAPI)]
        assert not (p.HasAPI(UsdPhysics.RigidBodyAPI) and above)


def _world_frame(stage: Any, joint: Any, end: int) -> np.ndarray:
    """(4, 4) frame of one end of a joint in the stage, from its body's transform."""
    targets = joint.GetRelationship(f"physics:body{end}").GetTargets()
    frame = np.eye(4)
    if targets:
        cache = UsdGeom.XformCache()
        frame = np.array(cache.GetLocalToWorldTransform(stage.GetPrimAtPath(targets[0]))).T
    turn = joint.GetAttribute(f"physics:localRot{end}").Get()
    local = np.eye(4)
    local[:3, :3] = Rotation.from_quat([*turn.GetImaginary(), turn.GetReal()]).as_matrix()
    local[:3, 3] = joint.GetAttribute(f"physics:localPos{end}").Get()
    return frame @ local
