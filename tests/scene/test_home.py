"""A home in Python: inspected, changed as a value, and clear about errors."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import pbrs_farm as pf
from pbrs_farm.core.errors import BadInput, BadRecipe
from pbrs_farm.core.house import Item, MaterialKind
from pbrs_farm.formats.glb import gltf_from_glb
from tests.scene.homes import can, crate, small_home


@pytest.fixture(scope="module")
def home() -> pf.Home:
    return small_home()


def item(home: pf.Home, name: str) -> Item:
    match: Item = home.items[name]
    return match


def test_importing_the_package_loads_nothing_else() -> None:
    code = "import sys, pbrs_farm; print([m for m in ('numpy', 'pydantic', 'drjit') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_public_name_has_a_docstring() -> None:
    for name in pf.__all__:
        assert name.startswith("__") or getattr(pf, name).__doc__, name


def test_rooms_and_items_are_tables(home: pf.Home) -> None:
    assert "Living room" in repr(home.rooms)
    assert "<td>Bedroom</td>" in home.rooms._repr_html_()
    assert home.rooms["bedroom"].id == "0_1"
    assert home.rooms.column("area") == [20.0, 15.6]
    assert item(home, "sofa").id == "piece_1"
    assert item(home, "chair 2").id == "piece_11"
    near = [row["name"] for row in home.items.near("desk", within_m=0.5)]
    assert near[0] == "chair"
    assert len(repr(home)) < 100


@pytest.mark.parametrize(
    ("name", "says"),
    [("sofaa", "did you mean sofa"), ("chair", '"chair 1"'), ("chair 9", "no such item")],
)
def test_an_unknown_name_is_refused_with_the_nearest(home: pf.Home, name: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        home.items[name]
    with pytest.raises(BadInput, match="did you mean Bedroom"):
        home.rooms["Bedrom"]


def test_a_change_is_a_new_home_with_a_new_id(home: pf.Home) -> None:
    bare = home.without("sofa")
    assert bare.id == home.without("sofa").id
    assert bare.id.startswith(f"{home.id}-e")
    assert bare.id != home.without("bed").id
    assert len(bare.items) == len(home.items) - 1
    assert len(home.items) == 36  # outdoor surroundings are not items of the home
    assert bare.without("bed").source.unedited == home.source


@pytest.mark.long
def test_whatever_is_removed_all_others_keep_their_instance_ids(
    home: pf.Home, tmp_path: Path
) -> None:
    def ids(of: pf.Home) -> dict[str, int]:
        return {row["id"]: row["instance"] for row in of.items}

    with_both = home.place(can(tmp_path), at=(2, 0, 2)).place(crate(tmp_path), at=(1, 0, 2))
    bare = with_both.without(["sofa", "can 1"])
    gone = {with_both.items["sofa"].id, "can 1"}
    assert ids(bare) == {key: k for key, k in ids(with_both).items() if key not in gone}
    # The name is free again; the item that takes it is another instance.
    again = bare.place(can(tmp_path), at=(2, 0, 1), name="can 1")
    assert ids(again)["can 1"] == max(ids(with_both).values()) + 1
    # Labels and the stored file have these ids, and no trace of removed items.
    camera = pf.Camera.look_at((3.5, 1.6, 3.5), (1, 0, 1.5), hfov_deg=90)
    frames = [pf.render(edited, camera, modes=["opengl_dl"]) for edited in (with_both, again)]
    ids_seen = [{r["name"]: r["id"] for r in f.table["instances"]} for f in frames]
    assert ids_seen[0]["crate"] == ids_seen[1]["crate"]
    assert ids(with_both)["crate 1"] == ids_seen[0]["crate"]
    data = gltf_from_glb((bare.export(tmp_path / "out") / f"{bare.id}.glb").read_bytes(), "")
    rows = [node["extras"] for node in data.document["nodes"] if node.get("extras")]
    assert {row["item"]: row["instance"] for row in rows} == ids(bare)
    with pytest.raises(BadInput, match="no such item"):
        bare.without("sofa")


def test_items_move_turn_and_take_their_colour(home: pf.Home, tmp_path: Path) -> None:
    moved = home.move("tv", by=(0.0, 0.5, 0.0), turn_deg=90)
    before, after = item(home, "tv").bounds, item(moved, "tv").bounds
    assert after.mean(0) == pytest.approx(before.mean(0) + np.array([0, 0.5, 0]), abs=1e-5)
    assert np.ptp(after, axis=0)[[2, 1, 0]] == pytest.approx(np.ptp(before, axis=0), abs=1e-5)

    painted = home.paint("wall*", "#336699")
    for wall in painted.items.named("wall*"):
        for surface in wall.surfaces:
            material = painted.house.materials[surface.material]
            assert material.diffuse == pytest.approx((0.2, 0.4, 0.6))
    paint = painted.house.materials[item(painted, "sofa").surfaces[0].material]
    assert paint == home.house.materials[item(home, "sofa").surfaces[0].material]

    Image.new("RGB", (8, 8), (90, 60, 30)).save(tmp_path / "wood.png")
    wooden = home.material("floor*", tmp_path / "wood.png", scale_m=0.5)
    floor = item(wooden, "floor_0_0").surfaces[0]
    material = wooden.house.materials[floor.material]
    assert material.texture_id in wooden.house.textures
    assert np.ptp(floor.uvs, axis=0).max() == pytest.approx(5.3 / 0.5, rel=0.01)


def test_lamps_are_set_and_added(home: pf.Home) -> None:
    lit = home.light("floor lamp", lm=300, kelvin=2700)
    (part, *_others) = item(lit, "floor lamp").lights
    assert (part.power, part.unit) == (300, "lumen")
    assert part.rgb_linear[0] == 1.0 > part.rgb_linear[2]
    spot = home.add_light((2, 2, 2), lm=500, towards=(2, 0, 2), angle_deg=40)
    added = item(spot, "light 1")
    assert added.room_id == "0_0"
    assert added.lights[0].direction == (0, -1, 0)
    assert spot.house.materials[added.surfaces[0].material].kind is MaterialKind.BULB
    with pytest.raises(BadInput, match="is not a lamp"):
        home.light("sofa", lm=10)


def test_a_model_is_at_its_given_place(home: pf.Home, tmp_path: Path) -> None:
    model = can(tmp_path)
    on_table = home.place(model, on="dining table", seed=3)
    stood = item(on_table, "can 1")
    assert stood.bounds[0, 1] == pytest.approx(0.75, abs=1e-4)
    assert np.ptp(stood.bounds, axis=0) == pytest.approx([0.066, 0.122, 0.066], abs=1e-3)
    assert stood.room_id == "0_0"
    low, high = item(home, "dining table").bounds
    assert (stood.bounds[0, [0, 2]] >= low[[0, 2]] - 0.01).all()
    assert (stood.bounds[1, [0, 2]] <= high[[0, 2]] + 0.01).all()

    pose = np.eye(4)
    pose[:3, 3] = 2, 1, 3
    exact = item(home.place(model, pose=pose, name="mine"), "mine")
    assert exact.pose is not None
    assert exact.pose.world_from_model == tuple(map(tuple, pose.tolist()))
    assert exact.bounds.mean(0) == pytest.approx([2, 1, 3], abs=1e-6)
    with pytest.raises(BadInput, match="there is an item of that id"):
        on_table.place(model, at=(1, 0, 1), name="can 1")
    with pytest.raises(BadInput, match="not a rigid"):
        home.place(model, pose=np.eye(4) * 2)
    with pytest.raises(BadInput, match="no free place"):
        home.place(model, on="picture")


def test_scattered_models_keep_apart(home: pf.Home, tmp_path: Path) -> None:
    models = [can(tmp_path), crate(tmp_path)]
    first, again = (home.scatter(models, 12, in_="Living room", seed=5) for _ in range(2))
    assert first.id == again.id
    placed = [i for i in first.house.items if i.pose]
    assert len(placed) == 12
    boxes = np.array([i.bounds for i in placed])
    for k, (low, high) in enumerate(boxes):
        is_apart = (boxes[:, 0] >= high).any(1) | (boxes[:, 1] <= low).any(1)
        # Boxes along the axes may meet where turned crates do not: then heights or outlines differ.
        assert is_apart.sum() >= 8, placed[k].id
    with pytest.raises(BadInput, match="space for"):
        home.scatter(models, 900, on="coffee table")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda h: h.set(**{"light.sp": 3}), "light.spp"),
        (lambda h: h.sun(elevation=120), "sun_elevation_deg"),
    ],
)
def test_an_unknown_field_is_refused(home: pf.Home, change, says: str) -> None:
    with pytest.raises(BadRecipe, match=says):
        change(home)


def test_a_home_is_dressed_once_and_before_its_edits(home: pf.Home) -> None:
    with pytest.raises(BadInput, match="before editing it"):
        home.without("sofa").dress(seed=2)
    dressed = home.dress(seed=2)
    assert dressed.id == f"{home.id}-d2"
    with pytest.raises(BadInput, match="already"):
        dressed.dress(seed=3)


def test_rows_of_items_name_the_items_they_are_of(home: pf.Home) -> None:
    row = home.items[len(home.items) - 1]
    assert home.without(row).id == home.without(row["id"]).id
    assert row["id"] not in {item["id"] for item in home.without([row]).items}


def joint_row(home: pf.Home) -> Mapping[str, Any]:
    return next(row for row in home.joints if row["item"] == "door_inner")


def test_a_door_opens_and_shuts_and_the_old_home_stays(home: pf.Home) -> None:
    row = joint_row(home)
    assert (row["name"], row["part"], row["kind"], row["open"]) == ("door", "leaf 1", "revolute", 0)
    opened = home.open("door_inner", 0.5)
    assert joint_row(opened)["value"] == pytest.approx(np.pi / 4)
    assert joint_row(home)["value"] == 0
    shut, wide = item(home, "door_inner"), item(opened, "door_inner")
    np.testing.assert_array_equal(wide.surfaces[0].positions, shut.surfaces[0].positions)
    # The leaf's knob turns about the hinge at constant distance, by 45 degrees.
    knob = np.array(row["point"])[[0, 2]]
    was, now = (s.surfaces[2].positions[:, [0, 2]].mean(0) - knob for s in (shut, wide))
    assert np.linalg.norm(now) == pytest.approx(np.linalg.norm(was), abs=1e-5)
    assert was @ now == pytest.approx(was @ was * np.sqrt(0.5), abs=1e-4)
    again = item(opened.open("door_inner", 0.0), "door_inner")
    assert again.surfaces[1].positions == pytest.approx(shut.surfaces[1].positions, abs=1e-5)


def test_a_door_stops_before_an_obstacle_with_a_warning(home: pf.Home, tmp_path: Path) -> None:
    row = joint_row(home)
    leaf = item(home, "door_inner").surfaces[1]
    points = leaf.positions.astype(np.float64)
    far = points[
        np.argmax(np.linalg.norm(points[:, [0, 2]] - np.array(row["point"])[[0, 2]], axis=1))
    ]
    (joint,) = item(home, "door_inner").joints
    matrix = joint.motion(0.8)
    x, _y, z = matrix[:3, :3] @ far + matrix[:3, 3]
    with pytest.warns(UserWarning, match="crate 1 blocks it"):
        opened = home.place(crate(tmp_path), at=(x, 0.0, z)).open("door_inner")
    assert 0.4 < joint_row(opened)["value"] < 0.85


def test_what_does_not_open_is_told(home: pf.Home) -> None:
    with pytest.raises(BadInput, match="has no part that opens"):
        home.open("sofa")
    with pytest.raises(BadInput, match="leaf 1"):
        home.open("door", part="drawer*")
