"""Every kind of falsehood, planted in a finished root with all its hashes mended, is found."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.images import array_from_png, exr_from_layers, layers_from_exr, png_from_array
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from pbrs_farm.views.open_views import open_views
from tests.check.roots import house_of, sign

LAYERS = (
    "albedo", "hha", "depth_sensor", "depth_sensor_tof", "depth_sensor_stereo", "material", "nyu13",
    "glass", "depth_z", "position", "normal_world", "behind_glass_depth", "boundary_semantic",
    "class_source",
)  # fmt: skip

Plant = Callable[[Path], None]


def make_finished(
    root: Path, layers: tuple[str, ...] = LAYERS, words: Mapping[str, str] | None = None
) -> Path:
    """The built-in home as a run leaves it: one small view in all modes, with layers."""
    settings = {
        "image.width_px": "160", "image.height_px": "120", "light.spp": "2", "light.pilot_spp": "0",
        "light.denoise": "false", "cameras.cell_m": "1.0",
        "cameras.score_width_px": "160", "cameras.score_height_px": "120",
    }  # fmt: skip
    recipe = recipe_from_name("preview", settings | dict(words or {}))
    assert run_local(Run(["builtin"], str(root), recipe, wanted((), layers, 1))).failures == []
    return root


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_finished(tmp_path_factory.mktemp("finished"))


@pytest.fixture
def root(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "root"))


def view_of(root: Path) -> Path:
    return next((house_of(root) / "views").iterdir())


def table(change: Callable[[dict], object]) -> Plant:
    def plant(view: Path) -> None:
        held = json.loads((view / "view.json").read_text())
        change(held)
        (view / "view.json").write_text(json.dumps(held))

    return plant


def row(change: Callable[[dict], object]) -> Plant:
    """Of the instance that covers most."""
    return table(lambda t: change(max(t["instances"], key=lambda r: r["pixels"])))


def picture(file: str, change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    def plant(view: Path) -> None:
        array = array_from_png((view / file).read_bytes())
        new = np.ascontiguousarray(change(array.astype(float)))
        most = np.iinfo(array.dtype).max
        (view / file).write_bytes(png_from_array(np.rint(new).clip(0, most).astype(array.dtype)))

    return plant


def patch(by: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(array: np.ndarray) -> np.ndarray:
        out = array.copy()
        out[50:70, 60:90] = np.where(out[50:70, 60:90] > by, out[50:70, 60:90] - by, by)
        return out

    return change


def scaled(by: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda array: array * by


def mirrored(array: np.ndarray) -> np.ndarray:
    return array[:, ::-1]


def exr(file: str, change: Callable[[np.ndarray], np.ndarray]) -> Plant:
    def plant(view: Path) -> None:
        planes = layers_from_exr((view / file).read_bytes())
        changed = {n: np.ascontiguousarray(change(p), np.float32) for n, p in planes.items()}
        (view / file).write_bytes(exr_from_layers(changed))

    return plant


def histogram(change: Callable[[dict], object]) -> Plant:
    def plant(view: Path) -> None:
        held = json.loads((view / "histogram.json").read_text())
        change(held)
        (view / "histogram.json").write_text(json.dumps(held))

    return plant


def move_count(counts: dict) -> None:
    held = list(counts["counts"])
    held[0], held[-1] = held[0] + 40, held[-1] - 40
    counts["counts"] = held


def turn_box(r: dict) -> None:
    # Another frame, grown until it holds the old box.
    c, s = np.cos(0.3), np.sin(0.3)
    r["box3d"]["axes"] = (
        np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ r["box3d"]["axes"]
    ).tolist()


def move_box(r: dict) -> None:
    r["box3d"]["centre"][0] += 0.05


def other_share(r: dict) -> None:
    f = r["visible_fraction"]
    r["visible_fraction"] = f * 0.7


def pose(change: Callable[[np.ndarray], None]) -> Plant:
    def both(t: dict) -> None:
        for name in ("world_from_camera_opengl", "world_from_camera_opencv"):
            matrix = np.array(t[name])
            change(matrix)
            t[name] = matrix.tolist()

    return table(both)


def step_aside(matrix: np.ndarray) -> None:
    matrix[0, 3] += 0.02


def brighter_with_its_facts(view: Path) -> None:
    picture("mlt_ol.png", scaled(1.1))(view)
    table(lambda t: t["modes"]["develop"]["mlt_ol"].update(exposure=9.0))(view)


def swapped_ids(view: Path) -> None:
    file = view / "instance.png"
    ids = array_from_png(file.read_bytes()).copy()
    a, b = np.argsort(np.bincount(ids.reshape(-1)))[::-1][:2]
    ids[:60][ids[:60] == a] = b
    file.write_bytes(png_from_array(ids))


FALSEHOODS: dict[str, tuple[Plant, str]] = {
    "box3d moved by 5 cm": (row(move_box), "box3d"),
    "box3d grown": (row(lambda r: r["box3d"]["half"].__setitem__(1, r["box3d"]["half"][1] + 0.03)), "box3d"),
    "box3d turned": (row(turn_box), "box3d"),
    "visible_fraction changed": (row(other_share), "visible_fraction"),
    "truncated changed": (row(lambda r: r.update(truncated=not r["truncated"])), "truncated"),
    "pixels changed": (row(lambda r: r.update(pixels=r["pixels"] + 1)), "table"),
    "fraction changed": (row(lambda r: r.update(fraction=r["fraction"] * 1.01)), "table"),
    "box2d changed": (row(lambda r: r["box2d"].__setitem__(0, r["box2d"][0] + 1)), "table"),
    "class changed": (row(lambda r: r.update(nyu40=35, **{"class": "lamp"})), "semantic = table"),
    "an instance left out": (table(lambda t: t["instances"].pop()), "table"),
    "camera moved by 2 cm": (pose(step_aside), "ray: depth"),
    "focal length changed": (table(lambda t: t["K"][0].__setitem__(0, t["K"][0][0] * 1.02)), "ray: depth"),
    "depth scaled": (picture("depth.png", scaled(1.01)), "ray: depth"),
    "depth patched": (picture("depth.png", patch(30)), "ray: depth"),
    "normals mirrored": (picture("normal.png", lambda a: np.dstack([65535 - a[..., 0], a[..., 1:]])), "ray: normal"),
    "instances swapped": (swapped_ids, "ray: instance"),
    "semantic patched": (picture("semantic.png", patch(1)), "ray: semantic"),
    "boundary moved": (picture("boundary.png", lambda a: np.roll(a, 1, 1)), "boundary"),
    "valid patched": (picture("valid.png", lambda a: a * (np.arange(a.shape[1]) > 10)), "ray: valid"),
    "depth_z scaled": (exr("depth_z.exr", scaled(1.002)), "ray: depth_z"),
    "position moved": (exr("position.exr", lambda a: a + 0.01), "ray: position"),
    "normal_world turned": (picture("normal_world.png", lambda a: a[..., [2, 1, 0]]), "ray: normal_world"),
    "material renumbered": (picture("material.png", lambda a: a + 1), "ray: material"),
    "nyu13 patched": (picture("nyu13.png", patch(1)), "nyu13"),
    "glass patched": (picture("glass.png", patch(255)), "ray: glass"),
    "behind glass moved": (picture("behind_glass/depth.png", scaled(1.02)), "ray: behind glass depth"),
    "source's class patched": (picture("class_source.png", patch(1)), "class_source"),
    "semantic boundary moved": (picture("boundary_semantic.png", lambda a: np.roll(a, 1, 0)), "boundary_semantic"),
    "albedo patched": (picture("albedo.png", patch(40)), "ray: albedo"),
    "albedo scaled": (picture("albedo.png", scaled(0.95)), "ray: albedo"),
    "hha of another height": (picture("hha.png", lambda a: a + np.array([0, 4, 0])), "hha"),
    "Kinect's depth scaled": (picture("depth_sensor.png", scaled(1.03)), "depth_sensor: values"),
    "Kinect's depth without its noise": (
        lambda view: shutil.copy(view / "depth.png", view / "depth_sensor.png"), "depth_sensor: values",
    ),
    "time of flight scaled": (picture("depth_sensor_tof.png", scaled(1.05)), "depth_sensor_tof: values"),
    "stereo's depth scaled": (picture("depth_sensor_stereo.png", scaled(1.02)), "depth_sensor_stereo: values"),
    "light mirrored": (picture("mlt_il_ol.png", mirrored), "light developed"),
    "light brightened": (picture("mlt_il_ol.png", scaled(1.05)), "light developed"),
    "light patched": (picture("mlt_ol.png", patch(20)), "light developed"),
    "light brightened, and its facts": (brighter_with_its_facts, "light developed"),
    "radiance of one colour scaled": (
        exr("radiance.exr", lambda a: a * (1 + np.arange(a.shape[1]) / 320)), "light developed",
    ),
    "OpenGL mirrored": (picture("opengl_dl.png", mirrored), "opengl edges"),
    "OpenGL of lamps upside down": (picture("opengl_il.png", lambda a: a[::-1]), "opengl edges"),
    "OpenGL moved by 3 px": (picture("opengl_dl.png", lambda a: np.roll(a, 3, 1)), "opengl edges"),
    "histogram of colours changed": (histogram(lambda h: move_count(h["colour"]["mlt_il_ol"])), "histogram"),
    "histogram of depth changed": (histogram(lambda h: move_count(h["depth"])), "histogram"),
    "brightness changed": (histogram(lambda h: h["picture"]["mlt_ol"].update(brightness=0.5)), "histogram"),
    "number of objects changed": (histogram(lambda h: h["scene"].update(n_objects=99)), "histogram"),
}  # fmt: skip


def test_a_finished_root_is_clean_and_says_what_was_looked_at(finished: Path) -> None:
    certificate = verify(finished, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    text = certificate.text()
    assert "albedo.png (1): recomputed by rays" in text
    assert "mlt_ol.png (1): developed from radiance.exr again" in text
    assert "levels of light" in text.partition("not looked at:")[2]
    # Every file of a view is told of, one way or the other.
    told = " ".join((*certificate.looked_at, *certificate.not_looked_at))
    view = view_of(finished)
    assert all(str(f.relative_to(view)) in told for f in view.rglob("*") if f.is_file())


def planted(root: Path, kind: str) -> set[str]:
    """The checks that fail once a falsehood is planted in a root, with its hashes mended."""
    plant, _check = FALSEHOODS[kind]
    plant(view_of(root))
    sign(root, house_of(root))
    return {name for name, count in verify(root).counts.items() if count.failed}


@pytest.mark.parametrize("kind", FALSEHOODS)
def test_a_falsehood_with_all_hashes_mended_is_found(root: Path, kind: str) -> None:
    assert FALSEHOODS[kind][1] in planted(root, kind)


FALSEHOODS_OF_CAMERAS = {
    "another tone told": (
        table(lambda t: t["modes"]["develop"]["variants"][0]["tone"].update(contrast=1.0)), "light developed",
    ),
    "another camera told": (
        table(lambda t: t["modes"]["develop"]["variants"][0].update(camera="none")), "light developed",
    ),
    "a camera told where none was drawn": (
        table(lambda t: t["modes"]["develop"].update(tone={"contrast": 1.2})), "light developed",
    ),
    "a variant mirrored": (picture("mlt_il_ol.2.png", mirrored), "light developed"),
    "a variant too many": (
        lambda view: shutil.copy(view / "mlt_il_ol.1.png", view / "mlt_il_ol.4.png"), "light developed",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def by_cameras(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root whose view has further pictures by cameras that are drawn."""
    words = {"tone.variants": "3", "light.spp": "16", "light.denoise": "true"}
    return make_finished(tmp_path_factory.mktemp("by_cameras"), (), words)


def test_further_pictures_by_other_cameras_are_developed_again(by_cameras: Path) -> None:
    certificate = verify(by_cameras, all_pixels=True)
    assert certificate.is_clean, certificate.text()
    assert "mlt_il_ol.3.png (1): developed from radiance.exr again" in certificate.text()
    (frame,) = open_views(str(by_cameras))
    assert len(frame.variants) == 3
    assert all((picture != frame.colour).any() for picture in frame.variants)


@pytest.mark.parametrize("kind", FALSEHOODS_OF_CAMERAS)
def test_a_falsehood_about_cameras_is_found(by_cameras: Path, tmp_path: Path, kind: str) -> None:
    root = Path(shutil.copytree(by_cameras, tmp_path / "root"))
    plant, check = FALSEHOODS_OF_CAMERAS[kind]
    plant(view_of(root))
    sign(root, house_of(root))
    counts = verify(root).counts
    assert check in {name for name, count in counts.items() if count.failed}


def test_at_least_twenty_six_kinds_of_falsehood_are_planted() -> None:
    assert len(FALSEHOODS) >= 26
