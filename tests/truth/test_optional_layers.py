from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm import truth
from pbrs_farm.core.arrays import HitRecord
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU13_NAMES, NYU40_NAMES
from pbrs_farm.core.house import House, Material, MaterialKind, ModelPose, geometry_from_house
from pbrs_farm.core.layers import LAYER, LAYERS
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.truth.sensor_reading import Hole
from pbrs_farm.truth.stereo_sensor import D435, D455, stereo_depth
from pbrs_farm.truth.tof_sensor import AZURE, KINECT2, L515, tof_depth
from tests.inputs.label_inputs import label_inputs_of
from tests.truth.hits import camera, hit, house, square


def glazed() -> House:
    """A pane at 2 m in front of a red wall at 3 m."""
    home = house(9, 1)
    items = tuple(
        replace(i, surfaces=(replace(square(z, half), material=k),), source_class=name)
        for k, (i, z, half, name) in enumerate(
            zip(home.items, (-2.0, -3.0), (1.0, 10.0), ("windowSmall", "wall"), strict=True)
        )
    )
    materials = (Material("pane", MaterialKind.PANE), Material("red", diffuse=(1.0, 0, 0)))
    return replace(home, items=items, materials=materials)


def test_the_table_of_layers_names_exactly_the_computable_ones():
    assert set(truth.OPTIONAL_NAMES) == {x.name for x in LAYERS if x.optional and x.step == "truth"}


def test_every_layer_has_the_shape_and_type_of_the_table():
    home = builtin_home()
    view = Camera.look(Intrinsics.from_hfov(64, 48), home.cameras[0].eye, home.cameras[0].towards)
    for name, array in truth.optional_layers(
        truth.OPTIONAL_NAMES, label_inputs_of(home, view)
    ).items():
        channels = LAYER[name].channels
        n = 3 if channels == "RGB" else len(channels.split())
        assert array.shape == ((48, 64) if n == 1 else (48, 64, n)), name
        assert str(array.dtype) == LAYER[name].dtype, name


def test_the_wall_behind_glass_is_labelled_and_the_mask_marks_it():
    layers = truth.optional_layers(truth.OPTIONAL_NAMES, label_inputs_of(glazed(), camera()))
    assert layers["glass"][3, 4] == 255
    assert layers["glass"][0, 0] == 0
    assert (layers["depth_z"][3, 4], layers["behind_glass_depth"][3, 4]) == (2.0, 3000)
    assert layers["behind_glass_semantic"][3, 4] == 1
    assert (layers["behind_glass_instance"] == 2).all()
    assert layers["material"][3, 4] == 1
    assert layers["material"][0, 0] == 2


def test_the_sources_classes_and_materials_are_named_in_the_table():
    label_inputs = label_inputs_of(glazed(), camera())
    ids = truth.optional_layers(["class_source", "material"], label_inputs)
    tables = truth.optional_tables(["class_source", "material"], label_inputs.house)
    assert tables["source_classes"][str(ids["class_source"][3, 4])] == "windowSmall"
    assert tables["materials"][str(ids["material"][0, 0])] == {"name": "red", "kind": "opaque"}


def test_a_house_without_glass_or_faces_needs_no_second_cast():
    def never(_: object) -> HitRecord:
        raise AssertionError

    empty = house()
    label_inputs = truth.LabelInputs(
        hit(np.zeros((6, 8)), 0.0), empty, geometry_from_house(empty), camera(), never, {}
    )
    layers = truth.optional_layers(truth.OPTIONAL_NAMES, label_inputs)
    nothing = ("normal_shading", "normal_world", "behind_glass_normal", "behind_mirror_normal")
    holes = [layers.pop(name) for name in tuple(layers) if name.startswith("depth_hole")]
    assert all((hole == Hole.TOO_FAR).all() for hole in holes)
    assert not any(array.any() for name, array in layers.items() if name not in nothing)
    assert all((layers[name] == 32768).all() for name in nothing)


def test_each_of_the_forty_classes_has_one_of_the_thirteen():
    assert len(NYU40_NAMES) == len(NYU13_FROM_NYU40) == 41
    assert set(NYU13_FROM_NYU40[1:]) == set(range(1, 14))
    by_name = {NYU40_NAMES[k]: NYU13_NAMES[NYU13_FROM_NYU40[k]] for k in range(41)}
    assert by_name["night stand"] == "furniture"
    assert by_name["desk"] == "table"
    assert by_name["floor mat"] == "floor"
    assert by_name["none"] == "none"


def test_world_normals_do_not_turn_with_the_camera():
    up = hit([[1]], 2.0, (0.0, 1.0, 0.0))
    label_inputs = truth.LabelInputs(
        up, house(5), geometry_from_house(house(5)), camera(1, 1), lambda _: up, {}
    )
    assert truth.optional_layers(["normal_world"], label_inputs)["normal_world"].tolist() == [
        [[32768, 65535, 32768]]
    ]


def two_squares(near: float, far: float) -> truth.LabelInputs:
    home = house(5, 5)
    items = (
        replace(home.items[0], surfaces=(square(near, 1.0),)),
        replace(home.items[1], surfaces=(square(far, 20.0),)),
    )
    return label_inputs_of(replace(home, items=items), camera())


def test_occlusion_belongs_to_the_nearer_side():
    occlusion = truth.optional_layers(["boundary_occlusion"], two_squares(-2.0, -3.0))[
        "boundary_occlusion"
    ]
    assert occlusion[2].tolist() == [0, 128, 255, 0, 0, 255, 128, 0]


def test_a_poster_on_a_wall_is_an_instance_boundary_and_no_occlusion():
    layers = truth.optional_layers(
        ["boundary_occlusion", "boundary_crease"], two_squares(-2.99, -3.0)
    )
    assert not layers["boundary_occlusion"].any()
    assert not layers["boundary_crease"].any()


def room_corner(fall: float) -> HitRecord:
    """A floor 1 m below, cut by a leaning wall at 4 m; fall 0 is upright."""
    view = camera(40, 30)
    _, rays = view.rays()
    with np.errstate(divide="ignore"):
        floor = np.where(rays[..., 1] < 0, -1.0 / rays[..., 1], np.inf)
    wall = 4.0 / (1 - fall * rays[..., 1])
    on_floor = floor < wall
    depth_z = np.where(on_floor, floor, wall).astype(np.float32)
    normal_wall = np.array([0, fall, 1.0]) / np.hypot(1, fall)
    normal = np.where(on_floor[..., None], [0, 1.0, 0], normal_wall)
    return hit(np.ones((30, 40)), depth_z, normal)


def test_a_corner_of_ninety_degrees_is_a_crease_and_slanting_floors_are_no_occlusion():
    occlusion, crease = truth.typed_boundaries(room_corner(0.0), camera(40, 30))
    assert not occlusion.any()
    assert ((crease > 0).sum(axis=0) == 1).all()


def test_something_before_nothing_is_an_occlusion():
    occlusion, _ = truth.typed_boundaries(hit([[0, 1, 1, 0]], 2.0), camera(4, 1))
    assert occlusion.tolist() == [[128, 255, 255, 128]]


def test_albedo_is_texture_times_colour_in_linear_light():
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[:4] = 255
    pixels[4:, :, 0] = 255
    home = replace(
        house(5, half=1.0), materials=(Material("m", diffuse=(1.0, 0.5, 1.0), texture_id="t"),)
    )
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    textured = replace(home.items[0].surfaces[0], uvs=uvs)
    home = home.with_items([replace(home.items[0], surfaces=(textured,))])
    view = camera(64, 48)
    albedo = truth.optional_layers(["albedo"], label_inputs_of(home, view, {"t": pixels}))["albedo"]
    assert albedo[20, 32].tolist() == [255, 128, 255]  # above the middle: the white row
    assert albedo[28, 32].tolist() == [255, 0, 0]
    plain = truth.optional_layers(["albedo"], label_inputs_of(home, view))["albedo"]
    assert plain[28, 32].tolist() == [255, 128, 255]
    assert plain[0, 0].tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("normal", "angle"), [((0, 1, 0), 38), ((0, 0, 1), 128), ((0, -1, 0), 218)]
)
def test_hha_holds_disparity_height_and_the_angle_with_gravity(normal, angle):
    record = hit([[1, 1, 0]], [[3.1, 6.2, 0.0]], normal)
    position = np.array([[[0, -1.5, 0], [0, -0.5, 0], [0, 0, 0]]], np.float32)
    points = record.points._replace(position_world=position)
    record = replace(record, interpolate=lambda: points)
    label_inputs = truth.LabelInputs(
        record, house(5), geometry_from_house(house(5)), camera(3, 1), lambda _: record, {}
    )
    hha = truth.optional_layers(["hha"], label_inputs)["hha"]
    assert hha[0].tolist() == [[100, 0, angle], [50, 100, angle], [0, 0, 0]]


def test_a_sensor_measures_a_wall_with_noise_that_grows_with_distance():
    errors = []
    for z in (1.0, 3.0):
        record = hit(np.ones((60, 80)), z)
        noisy = truth.sensor_depth(record, camera(80, 60), seed=1)
        measured = noisy[noisy > 0] / 1000
        assert len(measured) > 0.9 * noisy.size
        assert abs(np.median(measured) - z) < 0.02 * z
        errors.append(measured.std())
    # Disparity error is constant: depth error grows with the square of depth.
    assert 6 < errors[1] / errors[0] < 12


def test_a_kinects_noise_is_patchy_over_its_block():
    wall = hit(np.ones((240, 640)), 2.0)
    depth = truth.sensor_depth(wall, camera(640, 240), seed=5).astype(float)
    noise = 580 * 75 / depth - 580 * 75 / 2000
    assert 0.9 < noise.std() * 6 < 1.1

    def alike(px: int) -> float:
        return float(np.corrcoef(noise[:, px:].ravel(), noise[:, :-px].ravel())[0, 1])

    # Two 9 x 9 blocks shifted by px share (9 - px) / 9 of their pixels.
    for px in (1, 3, 6):
        assert abs(alike(px) - (9 - px) / 9) < 0.08
    assert abs(alike(12)) < 0.08


def test_a_sensor_is_the_same_for_the_same_seed_and_blind_out_of_range():
    record = hit([[1] * 8] * 6, [[0.3, 0.3, 0.3, 0.3, 9.0, 9.0, 9.0, 9.0]] * 6)
    assert not truth.sensor_depth(record, camera(), seed=3).any()
    wall = hit([[1] * 8] * 6, 2.0)
    same = [truth.sensor_depth(wall, camera(), seed=s) for s in (3, 3, 4)]
    assert (same[0] == same[1]).all()
    assert (same[0] != same[2]).any()


def test_the_sensors_shadow_is_left_of_near_objects():
    depth_z = np.full((40, 320), 3.0)
    depth_z[:, 150:] = 1.0
    noisy = truth.sensor_depth(hit(np.ones((40, 320)), depth_z), camera(320, 40), seed=0)
    # fx = 160: 160 * 0.075 * (1 - 1 / 3) = 8 columns are hidden from the projector.
    lost = (noisy == 0).mean(axis=0)
    assert lost[144:148].min() > 0.9
    assert lost[100:138].max() < 0.3
    assert lost[153:300].max() < 0.3


def tilted_map(degrees: float, *, along_v: bool = False) -> np.ndarray:
    """A normal map with one normal, turned by degrees from z towards u or v."""
    x, z = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    normal = (0, x, z) if along_v else (x, 0, z)
    return np.full((4, 4, 3), np.round((np.array(normal) + 1) * 127.5), np.uint8)


def decoded(picture: np.ndarray) -> np.ndarray:
    """A stored normal (published camera frame: x right, y forward, z up) in OpenGL axes."""
    n = picture.astype(np.float64) * 2 / 65535 - 1
    return np.stack([n[..., 0], n[..., 2], -n[..., 1]], -1)


@pytest.mark.parametrize(("mirrored", "back"), [(False, False), (True, False), (False, True)])
def test_the_shading_layer_shows_the_normal_map_and_no_other_layer_does(
    mirrored: bool, back: bool
) -> None:
    plain = house(5, half=1.0)
    mapped = replace(plain, materials=(Material("m", normal_texture_id="n"),))
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) * [-1 if mirrored else 1, 1]
    (item,) = mapped.items
    faces = item.surfaces[0].faces[:, ::-1] if back else item.surfaces[0].faces
    surface = replace(item.surfaces[0], uvs=uvs.astype(np.float32), faces=faces)
    mapped = mapped.with_items([replace(item, surfaces=(surface,))])
    maps = {"n": tilted_map(30)}
    for along_v in (False, True):
        maps = {"n": tilted_map(30, along_v=along_v)}
        layers = truth.optional_layers(
            ("normal_shading", "normal_world"), label_inputs_of(mapped, camera(), maps)
        )
        # u points right, v up; mirrored, u points left. Seen from the back, bumps are dents.
        turn = -1 if back or (mirrored and not along_v) else 1
        expected = np.array([0, turn * 0.5, 0]) if along_v else np.array([turn * 0.5, 0, 0])
        expected[2] = np.cos(np.radians(30))
        shown = decoded(layers["normal_shading"])[3, 4]
        np.testing.assert_allclose(shown, expected, atol=0.006)
        flat = truth.optional_layers(("normal_world",), label_inputs_of(plain, camera()))
        np.testing.assert_array_equal(layers["normal_world"], flat["normal_world"])


def test_a_surface_without_texture_coordinates_is_flat_under_a_normal_map() -> None:
    mapped = replace(house(5, half=1.0), materials=(Material("m", normal_texture_id="n"),))
    inputs = label_inputs_of(mapped, camera(), {"n": tilted_map(30)})
    layers = truth.optional_layers(("normal_shading",), inputs)
    np.testing.assert_allclose(decoded(layers["normal_shading"])[3, 4], [0, 0, 1], atol=1e-4)


def test_a_time_of_flight_camera_has_less_noise_than_a_kinect_and_mixes_at_edges():
    wall = hit(np.ones((60, 80)), 2.0)
    errors = {
        name: (layer(wall, camera(80, 60), seed=1) - 2000.0).std()
        for name, layer in (("kinect", truth.sensor_depth), ("tof", tof_depth))
    }
    assert 1 < errors["tof"] < errors["kinect"]
    # A near card on the left: the pixels at its edge are between the two depths.
    depth_z = np.where(np.arange(80) < 40, 1.0, 3.0)[None, :].repeat(60, 0)
    depth = tof_depth(hit(np.ones((60, 80)), depth_z), camera(80, 60), seed=1)
    assert ((depth[:, 39:41] > 1050) & (depth[:, 39:41] < 2950)).mean() > 0.9
    assert ((depth[:, 10:30] > 1050) & (depth[:, 10:30] < 2950)).mean() == 0
    assert not tof_depth(hit(np.ones((6, 8)), 6.0), camera(), seed=1).any()


def test_a_stereo_cameras_noise_grows_with_the_square_of_distance_and_edges_have_a_shadow():
    near, far = (
        stereo_depth(hit(np.ones((60, 320)), z), camera(320, 60), seed=2)[:, 40:]
        for z in (1.0, 3.0)
    )
    assert 5 < (far - 3000.0).std() / (near - 1000.0).std() < 13
    assert near.all()
    # The area left of the near card's left edge is hidden from the right camera.
    depth_z = np.where((np.arange(320) >= 160) & (np.arange(320) < 200), 1.0, 3.0)
    depth = stereo_depth(
        hit(np.ones((40, 320)), depth_z[None].repeat(40, 0)), camera(320, 40), seed=0
    )
    assert (depth[:, 155:159] == 0).mean() > 0.7
    assert depth[:, 210:].all()
    same = [stereo_depth(hit(np.ones((6, 8)), 2.0), camera(), seed=s) for s in (3, 3)]
    assert (same[0] == same[1]).all()


def wall_errors(layer, z: float, **fields) -> np.ndarray:
    """Errors in mm for a wall z metres away, excluding the picture's edges."""
    measured = layer(hit(np.ones((60, 320)), z), camera(320, 60), seed=2, **fields)[5:-5, 60:-5]
    assert measured.all()
    return measured - 1000.0 * z


def test_each_sensor_has_the_noise_of_its_data_sheet() -> None:
    # Twice the baseline, so half the depth error, which is inverse to focal length times baseline.
    d435, d455 = (wall_errors(stereo_depth, 3.0, sensor=s).std() for s in (D435, D455))
    assert d455 / d435 == pytest.approx(447 * 0.05 / (455 * 0.095), rel=0.1)
    # A lidar camera: 2.5 mm at 1 m, 9 mm at 5 m, on the line to 15.5 mm at 9 m.
    for z, sigma in ((1.0, 2.5), (5.0, 9.0)):
        assert wall_errors(tof_depth, z, sensor=L515).std() == pytest.approx(sigma, rel=0.1)
    # An Azure Kinect at 3.5 m is no worse than a Kinect 2 at 2.5 m, and has a shorter range.
    azure, kinect2 = (wall_errors(tof_depth, 3.5, sensor=s).std() for s in (AZURE, KINECT2))
    assert azure == pytest.approx(wall_errors(tof_depth, 2.5).std(), rel=0.1)
    assert azure < 0.75 * kinect2
    assert not tof_depth(hit(np.ones((6, 8)), 4.0), camera(), seed=1, sensor=AZURE).any()


def test_an_azure_kinect_leaves_edges_out() -> None:
    depth_z = np.where(np.arange(80) < 40, 1.0, 3.0)[None, :].repeat(60, 0)
    depth = tof_depth(hit(np.ones((60, 80)), depth_z), camera(80, 60), seed=1, sensor=AZURE)
    assert not depth[:, 39:41].any()
    assert depth[:, :38].all()
    assert depth[:, 42:].all()


def test_nocs_is_the_point_in_the_models_box_and_nothing_elsewhere() -> None:
    # Two squares, the nearer one a model turned by 90 degrees about the view axis and moved.
    home = house(5, 1)
    half, z = 0.5, -2.0
    pose = ModelPose("m", ((0, -1, 0, 0), (1, 0, 0, 0), (0, 0, 1, z), (0, 0, 0, 1)))
    model = replace(home.items[0], surfaces=(square(z, half),), pose=pose)
    home = replace(home, items=(model, replace(home.items[1], surfaces=(square(-3, 9),))))
    inputs = label_inputs_of(home, camera(64, 64))
    label = truth.optional_layers(["nocs"], inputs)["nocs"]
    assert label.dtype == np.uint16
    near_item = inputs.hit.item == 1
    assert near_item.any()
    assert not label[~near_item].any()
    # The model's x is the world's y, its y the world's -x; the box is flat, with diagonal sqrt(2).
    world = inputs.hit.points.position_world[near_item].astype(np.float64)
    model_xyz = np.stack([world[:, 1], -world[:, 0], np.zeros(len(world))], axis=1)
    expected = model_xyz / np.sqrt(2) + 0.5
    assert np.abs(label[near_item] / 65535 - expected).max() < 1e-5
    assert (label[near_item][:, 2] == 32768).all()
