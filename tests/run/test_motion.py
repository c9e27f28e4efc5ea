"""A stereo walk through the small home with labels only: outputs of a run, and checks of verify."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.check.certificate import Certificate
from pbrs_farm.core.layers import LAYER, LAYERS
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.cameras_json import views_from_json
from pbrs_farm.formats.layer_file import layer_bytes, layer_from_bytes
from pbrs_farm.formats.pairs_parquet import pairs_from_parquet, pairs_parquet
from pbrs_farm.images import array_from_png, layers_from_exr, png_from_array
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run, Summary
from pbrs_farm.run.plan import wanted
from tests.check.roots import sign

pytestmark = pytest.mark.long

BETWEEN = [x.name for x in LAYERS if x.partner]
FIELDS = {
    "image.width_px": "96",
    "image.height_px": "72",
    "cameras.source": "walk",
    "cameras.walk_frames": "4",
    "cameras.walk_fps": "5",
    "cameras.stereo_m": "0.065",
}


@pytest.fixture(scope="module")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Summary]:
    out = tmp_path_factory.mktemp("out")
    want = wanted(["opengl_dl"], BETWEEN, pairs=True)
    return out, run_local(Run(["builtin"], str(out), recipe_from_name("preview", FIELDS), want))


@pytest.fixture(scope="module")
def certificate(finished_run: tuple[Path, Summary]) -> Certificate:
    return verify(finished_run[0], all_pixels=True)


def house(root: Path) -> Path:
    return next(root.glob("houses/*"))


def test_every_frame_has_both_pictures_and_nothing_fails(
    finished_run: tuple[Path, Summary],
) -> None:
    assert finished_run[1].failures == []
    assert sorted(p.name for p in house(finished_run[0]).glob("views/*")) == sorted(
        f"frame_{k:05d}{side}" for k in range(4) for side in ("", "_right")
    )


def test_the_first_frame_has_no_previous_and_the_last_no_next(
    finished_run: tuple[Path, Summary],
) -> None:
    for name, lacking in (("frame_00000", "previous"), ("frame_00003_right", "next")):
        view = house(finished_run[0]) / "views" / name
        layers = {x.name for x in LAYERS if x.partner and (view / x.file).is_file()}
        assert layers == {x.name for x in LAYERS if x.partner and x.partner != lacking}


def test_verify_finds_every_layer_between_views_right(certificate: Certificate) -> None:
    assert certificate.is_clean, certificate.text()
    for name in BETWEEN:
        count = certificate.counts[f"motion: {name}"]
        assert count.checked > 10_000
        assert count.ties <= 1e-3 * count.checked


def test_the_cameras_keep_frame_and_time_and_the_view_names_its_partners(
    finished_run: tuple[Path, Summary],
) -> None:
    file = house(finished_run[0]) / "cameras.json"
    views = views_from_json(file.read_bytes(), "cameras.json")
    assert (views["frame_00002"].frame, views["frame_00002"].time_s) == (2, 0.4)
    table = json.loads((house(finished_run[0]) / "views/frame_00002/view.json").read_text())
    assert table["frame"] == 2
    assert {k: v["view"] for k, v in table["partners"].items()} == {
        "next": "frame_00003",
        "previous": "frame_00001",
        "stereo": "frame_00002_right",
    }


def test_flow_there_and_back_cancels_at_points_seen_by_both_frames(
    finished_run: tuple[Path, Summary],
) -> None:
    def layer(frame: int, name: str) -> np.ndarray:
        file = house(finished_run[0]) / f"views/frame_{frame:05d}" / LAYER[name].file
        return layer_from_bytes(name, file.read_bytes(), name)

    forward, back = layer(1, "flow_forward"), layer(2, "flow_backward")
    visible = layer(1, "occlusion_forward") == 0
    rows, columns = np.nonzero(visible)
    x, y = columns + 0.5 + forward[visible][:, 0], rows + 0.5 + forward[visible][:, 1]
    returned = back[np.floor(y).astype(int), np.floor(x).astype(int)] + forward[visible]
    # Neighbouring pixels differ at edges: nine of ten flows cancel.
    assert np.quantile(np.abs(returned).max(1), 0.9) < 0.5


def test_pairs_are_those_of_each_room_and_a_stereo_pair_shares_nearly_all(
    finished_run: tuple[Path, Summary],
) -> None:
    rows = pairs_from_parquet(
        (house(finished_run[0]) / "pairs.parquet").read_bytes(), "pairs.parquet"
    )
    assert len(rows) == 8 * 7 / 2
    stereo = next(
        r for r in rows if (r["view_a"], r["view_b"]) == ("frame_00000", "frame_00000_right")
    )
    assert stereo["common"] > 0.8
    assert stereo["baseline_m"] == pytest.approx(0.065)


def test_verify_recomputes_pairs_and_finds_a_share_that_is_wrong(
    certificate: Certificate, finished_run: tuple[Path, Summary], tmp_path: Path
) -> None:
    assert certificate.counts["pairs"].checked > 50
    root = tmp_path / "root"
    shutil.copytree(finished_run[0], root)
    file = house(root) / "pairs.parquet"
    rows = pairs_from_parquet(file.read_bytes(), "pairs.parquet")
    file.write_bytes(pairs_parquet([row | {"a_in_b": row["a_in_b"] - 0.05} for row in rows]))
    sign(root, house(root))
    # Two errors per row: the share, and `common`, which is the mean of both.
    assert verify(root, sample=10).counts["pairs"].failed == 2 * len(rows)


@pytest.mark.parametrize(
    "lens",
    [
        pytest.param({"lens.model": "radtan", "lens.k1": "-0.2"}, marks=pytest.mark.slow),
        pytest.param(
            {"lens.preset": "fisheye180", "image.width_px": "64", "image.height_px": "64"},
            marks=pytest.mark.slow,
        ),
        {"lens.model": "equirect", "image.width_px": "64", "image.height_px": "32"},
    ],
    ids=lambda fields: fields.get("lens.model", "fisheye"),
)
def test_verify_recomputes_pairs_through_any_lens(lens: dict[str, str], tmp_path: Path) -> None:
    fields = FIELDS | {"cameras.walk_frames": "3", "cameras.stereo_m": "0"} | lens
    want = wanted(["opengl_dl"], [], pairs=True)
    run_local(Run(["builtin"], str(tmp_path), recipe_from_name("preview", fields), want))
    pairs = verify(tmp_path, sample=10).counts["pairs"]
    # Three pairs have two shares, their mean, room, baseline and angle each; names and number are
    # two more.
    assert (pairs.checked, pairs.failed) == (20, 0)


def _flow_moved(view: Path) -> None:
    file = view / "flow_forward.exr"
    planes = layers_from_exr(file.read_bytes())
    flow = np.stack([planes["X"] + 0.1, planes["Y"]], axis=-1)
    file.write_bytes(layer_bytes("flow_forward", flow))


def _hidden_swapped(view: Path) -> None:
    file = view / "occlusion_forward.png"
    file.write_bytes(png_from_array(np.zeros_like(array_from_png(file.read_bytes()))))


def _disparity_doubled(view: Path) -> None:
    file = view / "disparity.png"
    file.write_bytes(png_from_array(array_from_png(file.read_bytes()) * np.uint16(2)))


@pytest.mark.parametrize(
    ("damage", "check"),
    [
        (_flow_moved, "motion: flow_forward"),
        (_hidden_swapped, "motion: occlusion_forward"),
        (_disparity_doubled, "motion: disparity"),
    ],
)
def test_verify_finds_damage_to_a_layer_between_views(
    damage, check: str, finished_run: tuple[Path, Summary], tmp_path: Path
) -> None:
    root = tmp_path / "root"
    shutil.copytree(finished_run[0], root)
    damage(house(root) / "views/frame_00001")
    sign(root, house(root))
    counts = verify(root, all_pixels=True).counts
    assert counts[check].failed > 500
