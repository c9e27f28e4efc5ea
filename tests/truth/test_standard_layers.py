import numpy as np
import pytest

from pbrs_farm import truth
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import PUBLISHED_FROM_OPENGL
from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.core.layers import LAYER
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.truth.hits import camera, hit, house


def test_depth_is_rounded_to_millimetres():
    depth = truth.depth_mm(np.array([[0.0, 1.0004, 1.0006, 2.5]], np.float32))
    assert depth.tolist() == [[0, 1000, 1001, 2500]]


def test_depth_beyond_the_range_is_the_largest_value_and_never_wraps():
    depth = truth.depth_mm(np.array([[65.5346, 65.536, 70.0, np.inf]], np.float32))
    assert depth.tolist() == [[65535, 65535, 65535, 65535]]


def test_something_very_near_is_not_nothing_and_nan_is():
    depth = truth.depth_mm(np.array([[1e-4, np.nan]], np.float32))
    assert depth.tolist() == [[1, 0]]


@pytest.mark.parametrize(
    ("normal", "colour"),
    [
        ((0, 1, 0), (32768, 32768, 65535)),  # a floor is blue
        ((0, 0, 1), (32768, 0, 32768)),  # a wall that faces the camera has no green
        ((1, 0, 0), (65535, 32768, 32768)),
        ((0, -1, 0), (32768, 32768, 0)),
    ],
)
def test_normals_have_the_published_axes(normal, colour):
    encoded = truth.normal_label(np.array([[normal]], np.float32), camera().world_from_camera)
    assert encoded[0, 0].tolist() == list(colour)


def test_normals_turn_with_the_camera():
    eye = np.zeros(3)
    right = Camera.look(Intrinsics.from_hfov(8, 6), eye, np.array([1.0, 0.0, 0.0]))
    encoded = truth.normal_label(np.array([[[-1.0, 0, 0]]], np.float32), right.world_from_camera)
    assert encoded[0, 0].tolist() == [32768, 0, 32768]


@pytest.mark.parametrize("normal", [(0, 0, 0), (np.nan, 0, 1), (0, 0, 2)])
def test_a_normal_that_is_no_unit_vector_is_nothing_and_not_valid(normal):
    record = hit([[1]], 2.0, normal)
    layers = truth.layers_from_hit(record, house(5), camera(1, 1))
    assert layers["normal"][0, 0].tolist() == [32768, 32768, 32768]
    assert layers["valid"][0, 0] == 0
    assert layers["depth"][0, 0] == 2000


def test_semantic_is_the_items_class_and_zero_for_an_item_without():
    layers = truth.layers_from_hit(hit([[0, 1, 2, 3]], 2.0), house(5, 0, 40), camera(4, 1))
    assert layers["semantic"].tolist() == [[0, 5, 0, 40]]
    assert layers["instance"].tolist() == [[0, 1, 2, 3]]


def test_a_class_outside_the_table_names_the_item():
    with pytest.raises(BadHouse, match=r"test\.file: item item1: NYU40 class 41"):
        truth.layers_from_hit(hit([[1]], 2.0), house(5, 41), camera(1, 1))


def test_more_items_than_sixteen_bits_hold_is_refused():
    many = house(1).with_items(house(1).items * 65536)
    with pytest.raises(BadHouse, match="65536 items"):
        truth.layers_from_hit(hit([[1]], 2.0), many, camera(1, 1))
    assert truth.instance_label(np.array([[65535]], np.uint32), house(1)).tolist() == [[65535]]


def test_an_empty_view_has_layers_of_nothing():
    layers = truth.layers_from_hit(hit(np.zeros((6, 8)), 0.0), house(), camera())
    assert not any(layers[name].any() for name in layers if name != "normal")
    assert (layers["normal"] == 32768).all()


def test_layers_have_the_shape_and_type_of_the_table_and_agree_with_each_other():
    home = builtin_home()
    stored = home.cameras[0]
    view = Camera.look(Intrinsics.from_hfov(64, 48), stored.eye, stored.towards)
    layers = truth.layers_from_hit(Caster(geometry_from_house(home)).hit_record(view), home, view)
    for name, array in layers.items():
        assert str(array.dtype) == LAYER[name].dtype
        assert array.shape == ((48, 64, 3) if LAYER[name].channels == "RGB" else (48, 64))
    assert ((layers["valid"] == 255) == (layers["depth"] > 0)).all()
    assert ((layers["instance"] > 0) == (layers["depth"] > 0)).all()
    normal = layers["normal"] / 32767.5 - 1
    length = np.linalg.norm(normal, axis=-1)
    assert np.abs(length[layers["valid"] > 0] - 1).max() < 1e-4
    _, rays = view.rays()
    towards = rays @ (PUBLISHED_FROM_OPENGL @ view.world_from_camera[:3, :3].T).T
    assert (np.einsum("hwi,hwi->hw", normal, towards)[layers["valid"] > 0] < 1e-4).all()
