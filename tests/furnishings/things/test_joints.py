"""Furniture of the generated catalogue opens: to the front, with an inside behind its fronts."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Surface
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.dress.style import style_for
from pbrs_farm.furnishings.things.appliances import microwave
from pbrs_farm.furnishings.things.families import families, family_pieces, family_shape
from pbrs_farm.home.masses import surfaces_kg

# Furniture with fronts, and the least depth of the space behind one, metres.
_CLOSED = {
    "base_cabinet": 0.3, "drawer_cabinet": 0.3, "upper_cabinet": 0.15, "kitchen_sink": 0.3,
    "cooker": 0.2, "built_in_cooker": 0.2, "dishwasher": 0.2, "fridge": 0.1, "washing_machine": 0.2,
    "wardrobe": 0.3, "drawer_chest": 0.2, "sideboard_cabinet": 0.15, "vanity": 0.15, "tv_bench": 0.15,
    "fitted_wardrobe": 0.3, "fitted_cabinet": 0.2,
}  # fmt: skip


def shapes_of(name: str, n: int = 4) -> list[Shape]:
    pieces = [p for p in family_pieces() if p.id.startswith(f"generated#{name}-")]
    return [family_shape(p) for p in pieces[:n]]


def points_of(surfaces: list[Surface]) -> np.ndarray:
    return np.concatenate([s.positions for s in surfaces]).astype(np.float64)


def kg_of(shape: Shape, joint: Joint) -> float:
    part = [s for s in shape.surfaces if s.part == joint.part]
    return surfaces_kg(part, shape.materials, 0)


def moved(shape: Shape, joint: Joint) -> tuple[np.ndarray, np.ndarray]:
    """The points of a part when shut and wide open."""
    shut = points_of([s for s in shape.surfaces if s.part == joint.part])
    return shut, transform_points(joint.motion(joint.upper), shut)


@pytest.mark.parametrize("name", sorted(_CLOSED))
def test_every_front_is_a_joint_that_opens_to_the_front(name: str) -> None:
    shapes = shapes_of(name)
    assert sum(bool(shape.joints) for shape in shapes) >= 3, "few have open shelves alone"
    for shape in shapes:
        assert {j.part for j in shape.joints} == {s.part for s in shape.surfaces} - {""}
        for joint in shape.joints:
            shut, wide = moved(shape, joint)
            assert 0.05 < kg_of(shape, joint) < 50, joint
            if joint.part.startswith("leaf"):
                assert abs(np.array(joint.axis)) == pytest.approx([1, 0, 0])
                continue
            assert wide[:, 2].mean() > shut[:, 2].mean() + 0.02, joint
            if joint.kind is JointKind.REVOLUTE:
                # The hinge is at an edge of its front: the axis is inside the part's box.
                pivot, is_across = np.array(joint.point), np.abs(joint.axis) < 0.5
                low, high = shut.min(0) - 0.008, shut.max(0) + 0.008
                assert ((pivot >= low) & (pivot <= high))[is_across].all(), joint
                # No part of it enters the body: the front's plane stays the hindmost.
                assert wide[:, 2].min() > shut[:, 2].max() - 0.14, joint


@pytest.mark.parametrize("name", sorted(_CLOSED))
def test_behind_an_opened_front_is_an_inside(name: str) -> None:
    for shape in shapes_of(name, 3):
        body = np.concatenate([s.positions[s.faces] for s in shape.surfaces if s.part == ""])
        mesh = trimesh.Trimesh(
            body.reshape(-1, 3), np.arange(3 * len(body)).reshape(-1, 3), process=False
        )
        for joint in shape.joints:
            if name == "washing_machine" and joint.part == "drawer 1":
                continue  # a soap dispenser protrudes from a panel
            shut, _wide = moved(shape, joint)
            low, high = shut.min(0), shut.max(0)
            # Look inside through a grid of points in the front's middle; the deepest counts.
            share = np.linspace(0.3, 0.7, 9)
            x, y = np.meshgrid(
                low[0] + share * (high[0] - low[0]), low[1] + share * (high[1] - low[1])
            )
            eyes = np.stack([x.ravel(), y.ravel(), np.full(x.size, high[2] + 0.5)], -1)
            ways = np.tile([0.0, 0.0, -1.0], (len(eyes), 1))
            hit = mesh.ray.intersects_first(eyes, ways)
            locations, _rays, _ = mesh.ray.intersects_location(eyes, ways, multiple_hits=False)
            assert (hit >= 0).any()
            # Fronts end within 10 cm of the most protruding point.
            depth = high[2] - locations[:, 2].min()
            assert depth > _CLOSED[name], (joint, depth)


def test_a_drawer_has_a_bottom_two_sides_and_a_back() -> None:
    (shape,) = shapes_of("drawer_chest", 1)
    drawers = [joint for joint in shape.joints if joint.part.startswith("drawer")]
    assert drawers
    for joint in drawers:
        surfaces = [s for s in shape.surfaces if s.part == joint.part]
        corners = np.concatenate([s.positions[s.faces] for s in surfaces]).astype(np.float64)
        low, high = corners.min((0, 1)), corners.max((0, 1))
        middle = (low + high) / 2
        mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(len(corners) * 3).reshape(-1, 3))
        inside = np.array([middle[0], low[1] + 0.05, low[2] + 0.1])
        for way in ([1, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1], [0, 0, 1]):
            assert mesh.ray.intersects_any([inside], [way]).all(), (joint, way)
        assert not mesh.ray.intersects_any([inside], [[0, 1, 0]]).any(), "open above"


def test_families_with_fronts_are_all_listed_here() -> None:
    with_joints = {
        name
        for name in families()
        if name not in _CLOSED and any(s.joints for s in shapes_of(name))
    }
    assert with_joints <= {
        "open_bookcase",
        "fitted_bookcase",
        "coffee_table",
        "desk",
        "nightstand",
        "hall_bench",
        "toilet",
    }


def test_a_toilets_lid_opens_upright_before_its_cistern_over_an_open_bowl() -> None:
    shut = [shape for shape in shapes_of("toilet", 12) if shape.joints]
    assert len(shut) >= 4
    for shape in shut:
        (joint,) = shape.joints
        low, wide = moved(shape, joint)
        assert 0.3 < kg_of(shape, joint) < 12
        assert np.ptp(low[:, 1]) < 0.03 < 0.3 < np.ptp(wide[:, 1])
        body = [s for s in shape.surfaces if s.part == ""]
        corners = np.concatenate([s.positions[s.faces] for s in body]).astype(np.float64)
        mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(len(corners) * 3).reshape(-1, 3))
        # A ray down through the lid's middle ends deep in the bowl.
        eye = [0.0, low[:, 1].max() + 0.2, low[:, 2].mean()]
        (place, *_), _, _ = mesh.ray.intersects_location([eye], [[0, -1.0, 0]], multiple_hits=False)
        assert low[:, 1].min() - place[1] > 0.12
        # The upright lid touches nothing: behind each of its points is a gap, or nothing.
        back = wide[wide[:, 2] < wide[:, 2].min() + 0.02]
        hit, rays, _ = mesh.ray.intersects_location(back, np.tile([0, 0, -1.0], (len(back), 1)))
        assert (back[rays][:, 2] - hit[:, 2] > 0.001).all()


def test_a_sink_has_a_deep_bowl_with_a_strainer() -> None:
    for shape in shapes_of("kitchen_sink", 12):
        body = [s.positions[s.faces] for s in shape.surfaces if s.part == ""]
        corners = np.concatenate(body).astype(np.float64)
        mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        worktop = shape.bounds[1, 1] - 0.3
        xs = np.arange(-0.34, 0.35, 0.01)
        eyes = np.c_[xs, np.full(len(xs), worktop + 0.02), np.full(len(xs), 0.06)]
        at, _rays, _faces = mesh.ray.intersects_location(
            eyes, np.tile([0, -1.0, 0], (len(eyes), 1)), multiple_hits=False
        )
        assert (worktop - at[:, 1] > 0.13).mean() > 0.3


def test_a_microwave_has_a_door_and_a_plate_in_a_space_behind_it() -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        _piece, shape = microwave.make(rng, style_for(rng))
        (joint,) = shape.joints
        shut, wide = moved(shape, joint)
        assert 0.2 < kg_of(shape, joint) < 4
        assert wide[:, 2].mean() > shut[:, 2].mean() + 0.1
        body = np.concatenate([s.positions[s.faces] for s in shape.surfaces if s.part == ""])
        mesh = trimesh.Trimesh(body.reshape(-1, 3), np.arange(3 * len(body)).reshape(-1, 3))
        low, high = shut.min(0), shut.max(0)
        eye = [[*((low + high) / 2)[:2], high[2] + 0.3]]
        points, _rays, _ = mesh.ray.intersects_location(eye, [[0, 0, -1.0]], multiple_hits=False)
        assert high[2] - points[0, 2] > 0.2
