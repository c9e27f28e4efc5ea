"""Cases of names, templates, joints and encodings in scenes of many formats; writers write files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.joints import JointKind
from pbrs_farm.export.export_homes import export_house
from pbrs_farm.geometry.opened import item_at
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.cases.case import Case, house_of, named
from tests.inputs import plan_files
from tests.inputs.cupboards import cupboard
from tests.inputs.habitat_files import written
from tests.inputs.obj_files import write_obj_home
from tests.read.gltf.gltf_scenes import Scene, two_rooms
from tests.read.habitat.habitat_sets import dataset


def cases() -> Iterator[Case]:
    """By format."""
    yield Case("materials_called_mat", _materials_called_mat, _ask_for_no_floor_mat)
    yield Case("mirrored_copies", _mirrored_copies, _ask_for_no_mirror)
    yield Case("vertex_colours", _vertex_colours, _ask_for_a_red_box)
    yield Case("instances", _instances, _ask_for_three_chairs)
    yield Case("habitat_inline", _habitat_inline, _ask_for_the_sofa)
    yield Case("obj_home", partial(write_obj_home, per_metre=100), _ask_for_sofa_and_desk)
    yield Case("blueprint3d", plan_files.write_blueprint3d, _ask_for_the_rooms_of_the_plan)
    yield Case("utf_16", _utf_16, _ask_for_the_rooms_of_the_plan)
    for form in ("usd", "mjcf", "habitat"):
        yield Case(f"joints_{form}", partial(_half_open, form), _ask_for_half_open_joints)


def _glb(folder: Path, scene: Scene) -> Path:
    return written(folder / "room.glb", scene.glb())


def _materials_called_mat(folder: Path) -> Path:
    scene = two_rooms()
    for k, name in enumerate(("mat_0", "Mat.1", "mat_black")):
        scene.materials.append({"name": name})
        scene.node(f"Object_{k}", mesh=scene.box([1, 0, 1], [1.6, 0.1, 1.6], k))
    return _glb(folder, scene)


def _ask_for_no_floor_mat(path: Path) -> None:
    assert {named(house_of(path), f"Object_{k}").nyu40 for k in range(3)} == {40}


def _mirrored_copies(folder: Path) -> Path:
    scene = two_rooms()
    for name, size in (("Chair_mirror.001", 0.5), ("Cabinet.mirror", 0.8)):
        scene.node(name, mesh=scene.box([1, 0, 1], [1 + size, 0.9, 1.45]))
    return _glb(folder, scene)


def _ask_for_no_mirror(path: Path) -> None:
    classes = [NYU40_NAMES[i.nyu40] for i in house_of(path).items if "mirror" in i.name]
    assert classes == ["chair", "cabinet"]


def _vertex_colours(folder: Path) -> Path:
    scene = two_rooms()
    scene.materials.append({"pbrMetallicRoughness": {"metallicFactor": 0}})
    scene.node("Box", mesh=scene.box([1, 0, 1], [1.5, 0.5, 1.5], 0))
    rgb = np.tile(np.array([[1, 0, 0]], np.float32), (24, 1))
    scene.meshes[-1]["primitives"][0]["attributes"]["COLOR_0"] = scene.writer.add_vertices(rgb)
    return _glb(folder, scene)


def _ask_for_a_red_box(path: Path) -> None:
    house = house_of(path)
    red = house.materials[named(house, "Box").surfaces[0].material].diffuse
    np.testing.assert_allclose(red, (1, 0, 0), atol=1e-6)


def _instances(folder: Path) -> Path:
    scene = two_rooms()
    moves = scene.writer.add_vertices(np.array([[0, 0, 0], [1, 0, 0], [4, 0, 1]], np.float32))
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves}}}
    scene.node("Chair", mesh=scene.box([0.5, 0, 1], [1, 0.9, 1.5]), extensions=extension)
    scene.more = {"extensionsUsed": ["EXT_mesh_gpu_instancing"]}
    return _glb(folder, scene)


def _ask_for_three_chairs(path: Path) -> None:
    assert [i.nyu40 for i in house_of(path).items if i.name == "Chair"] == [5, 5, 5]


def _habitat_inline(folder: Path) -> Path:
    row = {"template_name": "long_sofa", "translation": [2, 0.3, 1.5], "translation_origin": "COM"}
    path = dataset(folder, object_instances=[row])
    template = {"original_file": "objects/ab12.object_config.json", "template_handle": "long_sofa",
                "attributes": {"scale": [1.5, 1, 1]}}  # fmt: skip
    written(folder / "x.scene_dataset_config.json", {"objects": {"configs": [template]}})
    return path


def _ask_for_the_sofa(path: Path) -> None:
    sofa = named(house_of(path), "long_sofa")
    np.testing.assert_allclose(np.ptp(sofa.bounds, axis=0), (3.0, 0.6, 0.8), atol=1e-6)


def _ask_for_sofa_and_desk(path: Path) -> None:
    house = house_of(path)
    assert (named(house, "sofa").nyu40, named(house, "desk").nyu40) == (6, 14)
    assert named(house, "sofa").bounds[1, 1] < 1


def _utf_16(folder: Path) -> Path:
    path = plan_files.write_blueprint3d(folder)
    return written(path, path.read_text("utf-8").encode("utf-16"))


def _ask_for_the_rooms_of_the_plan(path: Path) -> None:
    assert len(house_of(path).rooms) == len(plan_files.ROOMS)


def _half_open(form: str, folder: Path) -> Path:
    home = builtin_home()
    kinds = ((JointKind.REVOLUTE, 1.0), (JointKind.PRISMATIC, 2.5))
    items = [replace(cupboard(kind, x, kind.value), nyu40=3) for kind, x in kinds]
    opened = [item_at(i, i.joints[0].part, i.joints[0].upper / 2) for i in items]
    building = [item for item in home.items if not item.id.startswith("piece_")]
    export_house(replace(home, items=(*building, *opened)), folder / "home", form)
    ending = {"usd": "*.usd*", "mjcf": "*.xml", "habitat": "*.scene_instance.json"}[form]
    return next((folder / "home").rglob(ending))


def _ask_for_half_open_joints(path: Path) -> None:
    joints = [joint for item in house_of(path).items for joint in item.joints]
    shares = {joint.kind: joint.share for joint in joints if joint.value > 0.01}
    assert {kind: round(share, 3) for kind, share in shares.items()} == dict.fromkeys(
        JointKind, 0.5
    )
