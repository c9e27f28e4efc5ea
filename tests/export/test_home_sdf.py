"""A home as a Gazebo world: models at the items' places, with meshes, masses, lamps."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Box, corners_of_surfaces
from pbrs_farm.core.joints import JointKind
from pbrs_farm.export.export_homes import export_house
from pbrs_farm.export.forms.sdf import write_sdf
from pbrs_farm.export.home_pieces import ExportedHome, Piece, exported_home
from pbrs_farm.formats.glb import gltf_from_glb
from pbrs_farm.geometry.convex_parts import hull_faces
from pbrs_farm.geometry.opened import item_at, moved_surface
from tests.export.homes import repaired_home, stored
from tests.inputs.cupboards import cupboard
from tests.inputs.loose_items import small_home

_HOME = exported_home(repaired_home())


def turned(piece: Piece) -> Piece:
    """The piece turned about a slanting axis, which exposes any wrong sign or order of axes."""
    frame = np.eye(4)
    frame[:3, :3] = Rotation.from_rotvec([0.3, 0.9, -0.5]).as_matrix()
    frame[:3, 3] = [1.0, 2.0, -3.0]
    return replace(piece, world_from_local=frame @ piece.world_from_local)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built-in home as a document."""
    folder = tmp_path_factory.mktemp("sdf")
    write_sdf(_HOME, folder)
    return folder / f"{_HOME.house.id}.sdf"


def world_of(path: Path) -> ET.Element:
    (world,) = ET.parse(path).getroot().findall("world")
    return world


def numbers(element: ET.Element, path: str) -> list[float]:
    return [float(x) for x in (element.findtext(path) or "").split()]


def pose(element: ET.Element) -> np.ndarray:
    """The matrix of an element's pose, a unit matrix without one."""
    matrix = np.eye(4)
    pose_element = element.find("pose")
    if pose_element is not None:
        assert pose_element.get("rotation_format") == "quat_xyzw"
        values = numbers(element, "pose")
        matrix[:3, 3] = values[:3]
        matrix[:3, :3] = Rotation.from_quat(values[3:]).as_matrix()
    return matrix


def placed(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def z_up(points: np.ndarray) -> np.ndarray:
    x, y, z = np.moveaxis(np.asarray(points), -1, 0)
    return np.stack([x, -z, y], -1)


def bounds_of_glb(path: Path) -> np.ndarray:
    """Bounds of its vertices in the file; no node may move them."""
    document = gltf_from_glb(path.read_bytes(), path.name).document
    assert not any(
        {"matrix", "translation", "rotation"} & node.keys() for node in document["nodes"]
    )
    accessors = [row for row in document["accessors"] if "min" in row]
    return np.array(
        [np.min([row["min"] for row in accessors], 0), np.max([row["max"] for row in accessors], 0)]
    )


def test_the_verb_writes_a_world_with_models_of_the_building_and_the_items(tmp_path: Path) -> None:
    root = stored(tmp_path / "root", repaired_home())
    assert main(["export", str(root), "--to", "sdf", "--out", str(tmp_path / "out")]) == 0
    (path,) = (tmp_path / "out").glob("*/*.sdf")
    assert path.parent.name == path.stem == repaired_home().id
    assert ET.parse(path).getroot().get("version") == "1.9"
    assert numbers(world_of(path), "gravity") == [0.0, 0.0, -9.81]
    models = {m.get("name"): m for m in world_of(path).findall("model")}
    doors = [piece.name for piece in _HOME.building if len(piece.bodies) > 1]
    assert list(models) == ["building", *doors, *(piece.name for piece in _HOME.things)]
    assert models["building"].findtext("static") == "true"
    for piece in _HOME.things:
        static = models[piece.name].findtext("static")
        stands = piece.is_fixed and len(piece.bodies) == 1
        assert static == ("true" if stands else "false")
        if len(piece.bodies) > 1:
            kinds = [joint.get("type") for joint in models[piece.name].findall("joint")]
            assert kinds.count("fixed") == piece.is_fixed
            assert len(kinds) == len(piece.bodies) - 1 + piece.is_fixed
    assert {m.findtext("static") for m in models.values()} == {"true", "false"}


def test_every_link_is_complete_and_every_mesh_exists(written: Path) -> None:
    pieces = {piece.name: piece for piece in _HOME.things}
    for model in world_of(written).findall("model"):
        links = model.findall("link")
        for link in links:
            names = [child.get("name") for child in link if child.get("name")]
            assert len(names) == len(set(names))
            assert len(link.findall("visual")) <= 1
        assert len(model.findall("link/visual")) >= 1
        piece = pieces.get(model.get("name") or "")
        if piece is not None:
            assert len(links) == len(piece.bodies)
            masses = [numbers(link, "inertial/mass")[0] for link in links]
            assert min(masses) > 0
        if piece is not None and len(links) == 1:
            (link,) = links
            assert len(link.findall("collision")) == len(piece.colliders) > 0
            assert numbers(link, "inertial/mass") == pytest.approx([piece.mass_kg])
            moments = [numbers(link, f"inertial/inertia/{k}")[0] for k in ("ixx", "iyy", "izz")]
            assert min(moments) > 0
            assert 2 * max(moments) <= sum(moments) * (1 + 1e-6)
    uris = {uri.text or "" for uri in world_of(written).iter("uri")}
    assert all((written.parent / uri).stat().st_size > 0 for uri in uris)
    assert uris == {f"meshes/{p.name}" for p in (written.parent / "meshes").iterdir()}


def test_poses_put_the_vertices_of_a_mesh_at_the_items_places(tmp_path: Path) -> None:
    things = tuple(turned(piece) for piece in _HOME.things if len(piece.bodies) == 1)[:4]
    home = ExportedHome(_HOME.house, (*_HOME.building[:1], *things))
    write_sdf(home, tmp_path)
    models = world_of(tmp_path / f"{home.house.id}.sdf").findall("model")
    for piece, model in zip(things, models[1:], strict=True):
        (link,) = model.findall("link")
        (visual,) = link.findall("visual")
        local = corners_of_surfaces(piece.surfaces).reshape(-1, 3)
        mesh = bounds_of_glb(tmp_path / (visual.findtext("geometry/mesh/uri") or ""))
        assert np.allclose(mesh, [local.min(0), local.max(0)], atol=1e-5)
        world = z_up(placed(piece.world_from_local, local))
        assert np.allclose(placed(pose(model) @ pose(visual), local), world, atol=1e-5)
        for part, collision in zip(piece.colliders, link.findall("collision"), strict=True):
            path = tmp_path / (collision.findtext("geometry/mesh/uri") or "")
            rows = [line.split() for line in path.read_text().splitlines()]
            corners = np.array([row[1:] for row in rows if row[0] == "v"], np.float64)
            expected = z_up(placed(piece.world_from_local, part))
            got = placed(pose(model) @ pose(collision), corners)
            assert np.allclose(got, expected, atol=1e-5)
        middle = placed(piece.world_from_local, np.array([0, piece.size[1] / 2, 0]))
        centre = numbers(link, "inertial/pose")[:3]
        assert np.allclose(placed(pose(model), np.array(centre)), z_up(middle), atol=1e-5)
        turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
        moments = np.diag(turn @ np.diag(piece.inertia) @ turn.T)
        inertia = [numbers(link, f"inertial/inertia/{k}")[0] for k in ("ixx", "iyy", "izz")]
        assert np.allclose(inertia, moments)


def test_the_building_is_in_place(written: Path) -> None:
    model = world_of(written).findall("model")[0]
    corners = np.array([[1.0, 2.0, 3.0], [0.0, 1.0, 0.0]])
    for tag in ("visual", "collision"):
        shape = model.find(f"link/{tag}")
        assert shape is not None
        assert np.allclose(placed(pose(model) @ pose(shape), corners), z_up(corners))


def test_lamps_are_in_place_with_their_colour_and_range(written: Path) -> None:
    models = {m.get("name"): m for m in world_of(written).findall("model")}
    lit = [piece for piece in _HOME.things if piece.lamps]
    assert lit
    for piece in lit:
        lights = models[piece.name].findall("link/light")
        for lamp, light in zip(piece.lamps, lights, strict=True):
            place = (pose(models[piece.name]) @ pose(light))[:3, 3]
            assert np.allclose(place, z_up(lamp.position), atol=1e-5)
            assert light.get("type") == ("spot" if lamp.spot else "point")
            assert numbers(light, "diffuse") == pytest.approx([*lamp.rgb_linear, 1])
            strength, reach = numbers(light, "intensity")[0], numbers(light, "attenuation/range")[0]
            assert strength == pytest.approx(lamp.candela / 100)
            assert reach == 1.0 or strength / reach**2 == pytest.approx(0.01)


def test_a_spot_has_the_direction_of_its_lamp(tmp_path: Path) -> None:
    piece = turned(next(piece for piece in _HOME.things if piece.lamps))
    looks = (0.6, -0.8, 0.0)
    piece = replace(piece, lamps=(replace(piece.lamps[0], spot=(looks, 0.5)),))
    write_sdf(ExportedHome(_HOME.house, (piece,)), tmp_path)
    (model,) = world_of(tmp_path / f"{_HOME.house.id}.sdf").findall("model")[1:]
    light = model.find("link/light")
    assert light is not None
    direction = np.array(numbers(light, "direction"))
    got = (pose(model) @ pose(light))[:3, :3] @ direction
    assert np.allclose(got, z_up(np.array(looks)), atol=1e-6)
    assert numbers(light, "spot/outer_angle") == [1.0]


@pytest.mark.parametrize("kind", list(JointKind))
@pytest.mark.parametrize("stands_at", [0.0, 0.2])
def test_a_part_moves_by_its_joint_as_the_homes_does(
    tmp_path: Path, kind: JointKind, stands_at: float
) -> None:
    frame = np.eye(4)
    frame[:3, :3] = Rotation.from_euler("y", 0.6).as_matrix()
    frame[:3, 3] = [0.2, 0.0, 0.4]
    shut = cupboard(kind)
    assert shut.box is not None
    shut = replace(
        shut, surfaces=tuple(moved_surface(s, frame) for s in shut.surfaces),
        joints=tuple(joint.placed(frame) for joint in shut.joints),
        box=Box(placed(frame, shut.box.centre), shut.box.half, frame[:3, :3]),
    )  # fmt: skip
    write_sdf(exported_home(small_home(item_at(shut, "front", stands_at))), tmp_path)
    model = world_of(tmp_path / "small.sdf").findall("model")[1]
    body, part = model.findall("link")
    axes, joint = model.findall("joint")
    assert model.findtext("static") == "false"
    assert (axes.get("type"), axes.findtext("parent")) == ("fixed", "world")
    assert axes.findtext("child") == joint.findtext("parent") == body.get("name")
    assert joint.findtext("child") == part.get("name")
    assert joint.get("type") == str(kind)
    limits = [numbers(joint, f"axis/limit/{end}")[0] for end in ("lower", "upper")]
    assert limits == pytest.approx([0, shut.joints[0].upper])
    point, axis = np.array(numbers(joint, "pose")[:3]), np.array(numbers(joint, "axis/xyz"))
    visual = part.find("visual")
    assert visual is not None
    mesh = bounds_of_glb(tmp_path / (visual.findtext("geometry/mesh/uri") or ""))
    box_corners = np.array(list(itertools.product(*mesh.T)))
    for value in (0.0, 0.3):
        moved = placed(pose(visual), box_corners)
        if kind is JointKind.PRISMATIC:
            moved = moved + value * axis
        else:
            moved = Rotation.from_rotvec(value * axis).apply(moved - point) + point
        expected = item_at(shut, "front", value).surfaces[1].positions
        got = placed(pose(model), moved)
        assert max(np.abs(got - w).max(1).min() for w in z_up(expected)) < 1e-4
    masks = {c.findtext("surface/contact/collide_bitmask") for c in part.findall("collision")}
    assert masks == {"2"}
    still = {c.findtext("surface/contact/collide_bitmask") for c in body.findall("collision")}
    assert still == {"1"}
    assert part.findtext("gravity") == "false"


def test_no_model_has_a_name_that_sdf_or_the_building_has(tmp_path: Path) -> None:
    names = ("world", "building", "building_thing")
    things = tuple(replace(p, name=n) for p, n in zip(_HOME.things, names, strict=False))
    write_sdf(ExportedHome(_HOME.house, things), tmp_path)
    models = world_of(tmp_path / f"{_HOME.house.id}.sdf").findall("model")
    got = [model.get("name") for model in models]
    assert len(set(got)) == 4
    assert "world" not in got


def test_a_folder_with_files_is_left_unchanged(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(BadInput):
        export_house(repaired_home(), tmp_path, "sdf")
    assert [p.name for p in tmp_path.iterdir()] == ["mine"]


def test_faces_of_a_hull_look_outwards() -> None:
    points = np.random.default_rng(3).normal(size=(30, 3))
    a, b, c = (points[hull_faces(points)[:, k]] for k in range(3))
    outwards = (np.cross(b - a, c - a) * (a + b + c - 3 * points.mean(0))).sum(1)
    assert (outwards > 0).all()
    assert len(hull_faces(np.zeros((4, 3)))) == 0
