from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.frames import srgb_from_linear
from pbrs_farm.core.house import (
    NOTHING_LEFT,
    LightPart,
    Material,
    MaterialKind,
    Surface,
    geometry_from_house,
)
from pbrs_farm.core.lighting import LightForm, PowerUnit
from pbrs_farm.core.recipe import RasterFields
from pbrs_farm.raster import Rasterizer
from pbrs_farm.raster.shader_programs import DL_SCALE, MAX_PANE_OPACITY
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.inputs.drawn_items import items_drawn
from tests.raster.raster_scenes import camera, house, item, square

WHITE = Material("white")
RED = Material("red", diffuse=(1.0, 0.0, 0.0))
BLUE = Material("blue", diffuse=(0.0, 0.0, 1.0))


def byte(linear: float) -> float:
    return float(255 * srgb_from_linear(np.array(min(linear, 1.0))))


@pytest.mark.parametrize(
    "intrinsics",
    [Intrinsics.from_hfov(320, 240), Intrinsics(161, 90, 140.0, 120.0, 60.25, 50.5)],
    ids=["centred", "off-centre principal point"],
)
def test_a_picture_shows_the_items_of_the_hit_record(intrinsics: Intrinsics) -> None:
    home = builtin_home()
    stored = home.cameras[0]
    view = Camera.look(intrinsics, stored.eye, stored.towards)
    hit = Caster(geometry_from_house(home)).hit_record(view).item
    drawn = items_drawn(home, view)
    assert (drawn == hit)[hit > 0].mean() > 0.98
    # Away from edges only a rug's rim of a few millimetres differs.
    inside = (minimum_filter(hit, 3) == maximum_filter(hit, 3)) & (hit > 0)
    assert (drawn == hit)[inside].mean() > 0.9999


def test_a_white_wall_under_directional_light_has_the_brightness_of_the_closed_form():
    with Rasterizer(house((item(square(-2.0, 0)),), (WHITE,)), {}) as raster:
        picture = raster.render_dl(camera())
    # Normal +z towards the camera: headlight 0.5, key light 5 / sqrt(50), the fill comes from behind.
    expected = byte(DL_SCALE * (0.5 + 5 / np.sqrt(50)))
    assert np.abs(picture.astype(float) - expected).max() <= 1


@pytest.mark.parametrize("turned", [False, True])
def test_a_wall_is_lit_the_same_from_both_sides_of_its_winding(turned):
    with Rasterizer(house((item(square(-2.0, 0, turned=turned)),), (WHITE,)), {}) as raster:
        picture = raster.render_dl(camera())
    assert np.abs(picture.astype(float) - byte(DL_SCALE * (0.5 + 5 / np.sqrt(50)))).max() <= 1


def test_diffuse_colour_is_decoded_from_srgb_before_it_is_lit():
    grey = Material("grey", diffuse=(0.5, 0.5, 0.5))
    with Rasterizer(house((item(square(-2.0, 0)),), (grey,)), {}) as raster:
        picture = raster.render_dl(camera())
    linear = ((0.5 + 0.055) / 1.055) ** 2.4
    assert abs(float(picture.mean()) - byte(linear * DL_SCALE * (0.5 + 5 / np.sqrt(50)))) <= 1


def test_the_top_row_of_a_texture_is_at_the_top_of_the_wall():
    pixels = np.zeros((4, 4, 3), np.uint8)
    pixels[:2, :, 0] = 255
    pixels[2:, :, 2] = 255
    painted = Material("painted", texture_id="t")
    with Rasterizer(house((item(square(-2.0, 0, half=1.0)),), (painted,)), {"t": pixels}) as raster:
        picture = raster.render_dl(camera())
    assert picture[8, 16, 0] > 100 > picture[8, 16, 2]
    assert picture[15, 16, 2] > 100 > picture[15, 16, 0]


@pytest.mark.parametrize(("copies", "is_mixed"), [(1, False), (2, True)])
def test_only_a_repeating_texture_mixes_its_ends_at_the_border(copies, is_mixed):
    wall = square(-1.0, 0, half=1.0)
    wall = replace(wall, uvs=wall.uvs * copies)
    picture = np.zeros((20, 20, 3), np.uint8)
    picture[:, :10] = 255
    painted = Material("painted", texture_id="t")
    with Rasterizer(house((item(wall),), (painted,)), {"t": picture}) as drawn:
        row = drawn.render_dl(camera())[12, :, 0].astype(int)
    assert (row[0] < row[1] - 5) == is_mixed


def test_only_visible_textures_are_looked_up_and_a_missing_one_is_white():
    class Pictures(dict):
        def __contains__(self, name):
            return name in ("unreadable", "behind")

        def get(self, name, default=None):
            assert name != "behind"
            return default

    shown, hidden = (Material(name, texture_id=name) for name in ("unreadable", "behind"))
    scene = house((item(square(-2.0, 0)), item(square(20.0, 1))), (shown, hidden))
    with Rasterizer(scene, Pictures()) as raster:
        textured = raster.render_dl(camera())
    plain = house((item(square(-2.0, 0)),), (replace(shown, texture_id=None),))
    with Rasterizer(plain, {}) as raster:
        assert (raster.render_dl(camera()) == textured).all()


def test_a_cut_out_texture_shows_what_lies_behind():
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[..., 3] = 0
    holed = Material("holed", texture_id="t", alpha_cutout=True)
    scene = house((item(square(-2.0, 0)), item(square(-3.0, 1))), (holed, RED))
    with Rasterizer(scene, {"t": pixels}) as raster:
        picture = raster.render_dl(camera())
    assert (picture[..., 1] == 0).all()
    assert (picture[..., 0] > 100).all()


@pytest.mark.parametrize(("cutoff", "is_left"), [(0.2, True), (0.5, False), (0.9, False)])
def test_the_cutoff_is_the_materials(cutoff, is_left):
    pixels = np.full((8, 8, 4), 90, np.uint8)
    holed = Material("holed", texture_id="t", alpha_cutout=True, alpha_cutoff=cutoff)
    scene = house((item(square(-2.0, 0)), item(square(-3.0, 1))), (holed, RED))
    with Rasterizer(scene, {"t": pixels}) as raster:
        picture = raster.render_dl(camera())
    assert bool((picture[..., 1] > 0).all()) is is_left


def test_glass_has_holes_too():
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[..., 3] = 0
    glass = Material(
        "g", MaterialKind.GLASS, opacity=0.5, texture_id="t", alpha_cutout=True,
        diffuse=(0.0, 0.0, 1.0),
    )  # fmt: skip
    wall = item(square(-3.0, 0))
    with Rasterizer(house((wall,), (RED,)), {}) as bare:
        without = bare.render_dl(camera())
    with Rasterizer(house((wall, item(square(-2.0, 1))), (RED, glass)), {"t": pixels}) as glazed:
        assert np.array_equal(glazed.render_dl(camera()), without)


def test_a_fully_cut_out_surface_needs_no_picture():
    gone = Material("gone", alpha_cutout=True, alpha_cutoff=NOTHING_LEFT)
    scene = house((item(square(-2.0, 0)), item(square(-3.0, 1))), (gone, RED))
    with Rasterizer(scene, {}) as raster:
        assert (raster.render_dl(camera())[..., 1] == 0).all()


def test_a_window_pane_lets_nearly_everything_through():
    pane = Material("pane", MaterialKind.PANE, opacity=0.5)
    wall = item(square(-3.0, 0))
    with Rasterizer(house((wall,), (RED,)), {}) as bare:
        without = bare.render_dl(camera())
    with Rasterizer(house((wall, item(square(-2.0, 1))), (RED, pane)), {}) as glazed:
        picture = glazed.render_dl(camera())
    red = picture[12, 16, 0] / without[12, 16, 0]
    assert 1 - 2 * MAX_PANE_OPACITY < red <= 1
    assert picture[12, 16, 1] < 100


def test_blended_sheets_give_the_same_picture_in_any_order_of_items():
    red_glass = Material("r", MaterialKind.GLASS, diffuse=(1.0, 0.0, 0.0), opacity=0.5)
    blue_glass = Material("b", MaterialKind.GLASS, diffuse=(0.0, 0.0, 1.0), opacity=0.5)
    near, far = item(square(-2.0, 0)), item(square(-3.0, 1))
    pictures = []
    for items in ((near, far), (far, near)):
        with Rasterizer(house(items, (red_glass, blue_glass)), {}) as raster:
            pictures.append(raster.render_dl(camera()).astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() == 0
    assert pictures[0][12, 16, 0] > pictures[0][12, 16, 2]


def test_edges_are_averages_of_four_samples_in_linear_light():
    scene = house((item(square(-2.0, 0, half=1.06)),), (Material("black", diffuse=(0, 0, 0)),))
    with Rasterizer(scene, {}) as raster:
        picture = raster.render_dl(camera())
    levels = np.unique(picture[..., 0])
    assert 2 < len(levels) <= 5


def test_a_lamp_lights_near_surfaces_most():
    bulb = LightPart((-0.8, 0.0, -1.6), 0.03, 0.5, PowerUnit.SWEETHOME3D)
    scene = house((item(square(-2.0, 0, half=2.0), lights=(bulb,)),), (WHITE,))
    with Rasterizer(scene, {}) as raster:
        picture = raster.render_il(camera())
    assert picture[12, 8, 0] > 1.5 * picture[12, 30, 0]


def test_a_house_without_lamps_is_dim_but_not_black():
    with Rasterizer(house((item(square(-2.0, 0)),), (WHITE,)), {}) as raster:
        picture = raster.render_il(camera())
    assert 30 < picture.mean() < 120


def test_a_house_without_triangles_shows_the_sky():
    with Rasterizer(house((), ()), {}) as raster:
        picture = raster.render_dl(camera())
    assert (picture == picture[0, 0]).all()


def test_two_rasterizers_live_side_by_side():
    first = Rasterizer(house((item(square(-2.0, 0)),), (RED,)), {})
    second = Rasterizer(house((item(square(-2.0, 0)),), (BLUE,)), {})
    red, blue = first.render_dl(camera()), second.render_dl(camera())
    second.close()
    again = first.render_dl(camera())
    first.close()
    assert (red == again).all()
    assert red[12, 16, 0] > 100 > red[12, 16, 2]
    assert blue[12, 16, 2] > 100 > blue[12, 16, 0]


def test_without_egl_the_error_names_the_package_to_install(monkeypatch):
    def refuse(**_: object) -> None:
        raise Exception("(detect) libEGL.so: cannot open shared object file")

    monkeypatch.setattr("moderngl.create_context", refuse)
    with pytest.raises(MachineFailed, match="libegl1"):
        Rasterizer(house((), ()), {})


def test_triangles_that_are_not_finite_or_without_area_are_drawn_as_if_not_there():
    good = square(-2.0, 0)
    points = np.concatenate([good.positions, [[np.nan, 0, -1], [0, 0, -1], [0.1, 0, -1]]])
    faces = np.concatenate([good.faces, [[0, 1, 4], [5, 6, 6], [5, 5, 5]]]).astype(np.int32)
    bad = Surface("bad", points.astype(np.float32), faces, 0, normals=None)
    pictures = []
    for surface in (Surface("good", good.positions, good.faces, 0), bad):
        with Rasterizer(house((item(surface),), (WHITE,)), {}) as raster:
            pictures.append(raster.render_dl(camera()))
    assert (pictures[0] == pictures[1]).all()


def test_shading_normals_that_are_nan_or_zero_become_face_normals():
    good = square(-2.0, 0)
    normals = np.array([[0, 0, 1], [np.nan, 0, 0], [0, 0, 0], [0, 0, 1]], np.float32)
    bad = Surface("bad", good.positions, good.faces, 0, normals=normals)
    with Rasterizer(house((item(bad),), (WHITE,)), {}) as raster:
        picture = raster.render_dl(camera())
    assert np.abs(picture.astype(float) - byte(DL_SCALE * (0.5 + 5 / np.sqrt(50)))).max() <= 1


def test_a_light_that_no_floor_sees_and_a_line_of_no_length_do_no_harm():
    lights = (
        LightPart((0, 0, -1), 0.03, 0.0, PowerUnit.SWEETHOME3D),
        LightPart(
            (0, 0, -1),
            0.03,
            0.5,
            PowerUnit.SWEETHOME3D,
            form=LightForm.LINE,
            position_end=(0, 0, -1),
        ),
        LightPart(
            (0, 0, -1), 0.03, 0.5, PowerUnit.SWEETHOME3D, form=LightForm.SPOT, direction=(0, 0, 0)
        ),
    )
    with Rasterizer(
        house((item(square(-2.0, 0, half=2.0), lights=lights),), (WHITE,)), {}
    ) as raster:
        picture = raster.render_il(camera())
    assert 30 < picture.mean() < 255


def test_a_line_of_light_is_as_bright_as_many_points_along_it():
    ends = (-1.0, 0.0, -1.5), (1.0, 0.0, -1.5)
    line = LightPart(
        ends[0], 0.03, 800.0, PowerUnit.LUMEN, form=LightForm.LINE, position_end=ends[1]
    )
    points = tuple(
        LightPart((x, 0.0, -1.5), 0.03, 800.0, PowerUnit.LUMEN, share=1 / 64)
        for x in np.linspace(-1, 1, 129)[1::2]
    )
    pictures = []
    for lights in ((line,), points):
        scene = house((item(square(-2.0, 0, half=2.0), lights=lights),), (WHITE,))
        with Rasterizer(scene, {}, RasterFields(lights_per_object=64)) as raster:
            pictures.append(raster.render_il(camera())[..., 0].astype(float))
    # Each is scaled to the median of its house: compare shapes where both are well lit.
    ratio = pictures[0][6:18, 4:28] / pictures[1][6:18, 4:28]
    assert np.abs(ratio / np.median(ratio) - 1).max() < 0.12


def test_pictures_after_another_house_are_those_of_a_new_rasterizer() -> None:
    near, far = (item(square(z, 0, half=4.0)) for z in (-2.0, -4.0))
    hidden_before, materials = item(square(-3.0, 1, half=1.0)), (WHITE, RED)
    before, after = (house((one, hidden_before), materials) for one in (near, far))
    with Rasterizer(before, {}) as raster:
        raster.render_dl(camera())
        raster.render_il(camera())
        raster.draw_house(after)
        again = raster.render_dl(camera()), raster.render_il(camera())
    for k, picture in enumerate(again):
        with Rasterizer(after, {}) as raster:
            assert np.array_equal(picture, (raster.render_dl, raster.render_il)[k](camera()))
