import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.images import exr_from_layers, png_from_array
from tests.check.roots import SIZE, changed_pixel, edit_table, failed, house_of, make_root, sign


def test_a_finished_folder_is_clean_to_the_last_pixel(clean):
    certificate = verify(clean, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    assert certificate.n_views == 2
    assert certificate.counts["ray: depth"].checked == 2 * 128 * 96
    assert certificate.counts["ray: instance"].ties <= 2
    assert certificate.counts["reprojection"].checked >= 0
    assert certificate.text().endswith("\nCLEAN")


def test_a_sample_checks_the_requested_number_of_pixels(clean):
    assert verify(clean, sample=100).counts["ray: normal"].checked == 200


@pytest.mark.quick(3)
@pytest.mark.parametrize(
    ("file", "by", "check"),
    [
        ("depth.png", 3, "ray: depth"),
        ("normal.png", 200, "ray: normal"),
        ("instance.png", 1, "ray: instance"),
        ("semantic.png", 1, "ray: semantic"),
        ("valid.png", 1, "ray: valid"),
        ("boundary.png", 1, "boundary"),
    ],
)
def test_one_changed_pixel_is_caught_even_if_the_hashes_agree(root, file, by, check):
    changed_pixel(house_of(root) / "views/v0" / file, 48, 64, by)
    sign(root, house_of(root))
    assert check in failed(root)


def test_a_wrong_class_in_the_table_is_caught(root):
    edit_table(root, lambda t: t["instances"][0].update(nyu40=3, **{"class": "cabinet"}))
    assert "semantic = table" in failed(root, all_pixels=False)


def test_a_wrong_pixel_count_in_the_table_is_caught(root):
    edit_table(root, lambda t: t["instances"][0].update(pixels=1))
    assert failed(root) == {"table"}


def test_an_instance_missing_from_the_table_is_caught(root):
    edit_table(root, lambda t: t["instances"].pop())
    assert "table" in failed(root, all_pixels=False)


@pytest.fixture(scope="module")
def rich(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("rich")
    make_root(root, with_optional=True)
    return root


def test_optional_layers_are_checked_if_they_exist(rich):
    certificate = verify(rich, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    names = {"ray: depth_z", "ray: position", "ray: normal_world", "ray: material", "ray: glass"}
    names |= {
        f"ray: behind {g} {x}"
        for g in ("glass", "mirror")
        for x in ("depth", "normal", "semantic", "instance")
    }
    names |= {f"ray: {x}" for x in ("mirror", "roughness", "metallic", "f0")}
    assert names | {"nyu13", "class_source", "boundary_semantic"} <= certificate.counts.keys()


@pytest.mark.quick(4)
@pytest.mark.parametrize(
    ("file", "check"),
    [
        ("normal_world.png", "ray: normal_world"),
        ("material.png", "ray: material"),
        ("glass.png", "ray: glass"),
        ("behind_glass/depth.png", "ray: behind glass depth"),
        ("behind_glass/instance.png", "ray: behind glass instance"),
        ("mirror.png", "ray: mirror"),
        ("behind_mirror/depth.png", "ray: behind mirror depth"),
        ("behind_mirror/normal.png", "ray: behind mirror normal"),
        ("behind_mirror/semantic.png", "ray: behind mirror semantic"),
        ("behind_mirror/instance.png", "ray: behind mirror instance"),
        ("roughness.png", "ray: roughness"),
        ("metallic.png", "ray: metallic"),
        ("f0.png", "ray: f0"),
        ("nyu13.png", "nyu13"),
        ("class_source.png", "class_source"),
        ("boundary_semantic.png", "boundary_semantic"),
        ("boundary_occlusion.png", "boundary_occlusion"),
        ("normal_shading.png", "ray: normal_shading"),
    ],
)
def test_one_changed_pixel_of_an_optional_layer_is_caught(rich, tmp_path, file, check):
    shutil.copytree(rich, tmp_path / "root")
    house = house_of(tmp_path / "root")
    by = next((n for part, n in (("normal", 900), ("roughness", -9), ("f0", 9)) if part in file), 1)
    changed_pixel(house / "views/v0" / file, 48, 64, by)
    sign(tmp_path / "root", house)
    assert check in failed(tmp_path / "root")


def test_a_black_picture_is_noted_by_outdoor_light_and_fails_by_opengl(root):
    black = png_from_array(np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    house = house_of(root)
    for name in ("mlt_ol.png", "opengl_dl.png"):
        (house / "views/v0" / name).write_bytes(black)
        (house / f"done/{name}.v0.json").write_text(json.dumps({"files": [f"views/v0/{name}"]}))
    sign(root, house)
    certificate = verify(root, sample=10)
    assert certificate.counts["pictures"].failed == 1
    assert any("opengl_dl.png: is one colour" in f for f in certificate.failures)
    assert any("mlt_ol.png is one colour" in n for n in certificate.notes)


def test_a_picture_that_all_light_leaves_black_fails_and_a_dark_room_is_noted(root):
    house = house_of(root)
    for name, level in (("v0", 0.0), ("v1", 0.01)):
        view = house / f"views/{name}"
        planes = {
            f"{g}.{c}": np.full(SIZE[::-1], level, np.float32)
            for g in ("outdoor", "indoor", "albedo")
            for c in "RGB"
        }
        (view / "radiance.exr").write_bytes(exr_from_layers(planes))
        table = json.loads((view / "view.json").read_text()) | {"room": "0_0"}
        (view / "view.json").write_text(json.dumps(table))
        (house / f"done/light.{name}.json").write_text(
            json.dumps({"files": [f"views/{name}/radiance.exr"]})
        )
    rows = [{"room": "0_0", "outdoor_lx": 0.0, "indoor_lx": 0.4}]
    (house / "illuminance.json").write_text(json.dumps({"rooms": rows}))
    (house / "done/illuminance.json").write_text(json.dumps({"files": ["illuminance.json"]}))
    sign(root, house)
    certificate = verify(root, sample=10)
    count = certificate.counts["black pictures"]
    assert (count.checked, count.failed) == (2, 1)
    assert any(f"black pictures: {house.name}/v0: all light" in f for f in certificate.failures)
    assert any("v1 is in room 0_0, which has 0.4 lx" in n for n in certificate.notes)
