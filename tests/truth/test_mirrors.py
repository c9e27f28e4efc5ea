"""Layers of mirrors and gloss in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm import truth
from pbrs_farm.core.house import House, Material, MaterialKind, Surface
from tests.inputs.label_inputs import label_inputs_of
from tests.truth.hits import camera, house, square

MIRROR = Material("mirror", MaterialKind.MIRROR)


def scene(*surfaces: Surface, materials: tuple[Material, ...]) -> House:
    """A house with one item per surface, each with a separate material."""
    home = house(*range(1, len(surfaces) + 1))
    items = tuple(
        replace(item, surfaces=(replace(s, material=k),))
        for k, (item, s) in enumerate(zip(home.items, surfaces, strict=True))
    )
    return replace(home, items=items, materials=materials)


def turned(surface: Surface, degrees: float) -> Surface:
    """The surface turned about the vertical axis through (0, 0, -2)."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    points = (surface.positions - [0, 0, -2]) @ turn.T + [0, 0, -2]
    return replace(surface, positions=points.astype(np.float32))


def layers_of(home: House, *names: str) -> dict[str, np.ndarray]:
    return truth.optional_layers(names, label_inputs_of(home, camera()))


def test_a_mirror_before_the_eye_shows_the_wall_behind_it_as_far_behind_the_mirror():
    home = scene(square(-2, 1), square(3, 40), materials=(MIRROR, Material("wall")))
    layers = layers_of(
        home, "mirror", *(f"behind_mirror_{n}" for n in ("depth", "normal", "semantic", "instance"))
    )
    assert layers["mirror"][3, 4] == 255
    assert layers["behind_mirror_depth"][3, 4] == 2000 + 5000
    assert layers["behind_mirror_instance"][3, 4] == layers["behind_mirror_semantic"][3, 4] == 2
    # The mirrored wall faces the eye: published axes are x right, y forward, z up.
    assert layers["behind_mirror_normal"][3, 4].tolist() == [32768, 0, 32768]
    # Beside the mirror nothing is hit.
    assert layers["mirror"][0, 0] == layers["behind_mirror_depth"][0, 0] == 0


def test_a_slanting_mirror_shows_a_wall_at_the_side_turned_as_its_image():
    wall = turned(square(-2 + 4, 40), 90)  # x = 4, across the reflected rays
    home = scene(turned(square(-2, 0.5), 45), wall, materials=(MIRROR, Material("wall")))
    layers = layers_of(
        home, "mirror", "behind_mirror_depth", "behind_mirror_normal", "behind_mirror_instance"
    )
    where = layers["mirror"] > 0
    assert where.any()
    assert (layers["behind_mirror_instance"][where] == 2).all()
    # The mirrored wall is the plane z = -6, which faces the eye.
    assert set(layers["behind_mirror_depth"][where]) == {6000}
    assert (np.abs(layers["behind_mirror_normal"][where] - np.array([32768, 0, 32768])) <= 2).all()


def test_mirrors_face_to_face_end_as_a_mirror_and_open_ones_show_nothing():
    facing = scene(square(-2, 40), square(3, 40), materials=(MIRROR, MIRROR))
    assert layers_of(facing, "behind_mirror_instance")["behind_mirror_instance"][3, 4] in (1, 2)
    alone = scene(square(-2, 1), materials=(MIRROR,))
    assert layers_of(alone, "behind_mirror_instance")["behind_mirror_instance"][3, 4] == 0


@pytest.mark.parametrize(
    ("material", "roughness", "f0", "metallic"),
    [
        (Material("matte"), 255, 0, 0),
        (Material("varnish", specular=(0.5,) * 3, roughness=0.5), 128, 56, 0),  # f0 .04
        (Material("phong", specular=(1.0,) * 3, shininess=6.0), 180, 80, 0),  # alpha .5, f0 .08
        (Material("steel", diffuse=(0.0,) * 3, specular=(0.8,) * 3, roughness=1.0), 255, 204, 255),
        (MIRROR, 0, 243, 255),  # reflects 0.9
        (Material("pane", MaterialKind.PANE), 0, 56, 0),
    ],
)  # fmt: skip
def test_gloss_is_that_of_the_material(material, roughness, f0, metallic):
    layers = layers_of(scene(square(-2, 1), materials=(material,)), "roughness", "f0", "metallic")
    assert layers["roughness"][3, 4] == roughness
    assert layers["f0"][3, 4].tolist() == [f0] * 3
    assert layers["metallic"][3, 4] == metallic


def test_a_roughness_map_scales_the_roughness_by_its_green():
    surface = replace(square(-2, 1), uvs=np.zeros((4, 2), np.float32))
    rough = Material("oak", roughness=0.8, roughness_texture_id="r")
    home = scene(surface, materials=(rough,))
    picture = np.full((2, 2, 3), (9, 102, 9), np.uint8)
    inputs = label_inputs_of(home, camera(), {"r": picture})
    assert truth.optional_layers(["roughness"], inputs)["roughness"][3, 4] == round(255 * 0.8 * 0.4)
