"""A stored view under other lamps: from its layers only, by number, item, name or pattern."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.cli import main
from pbrs_farm.core.recipe import Recipe, ToneFields, recipe_from_name
from pbrs_farm.formats.radiance_exr import radiance_from_exr
from pbrs_farm.images import array_from_png, exr_from_layers, layers_from_exr
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.run import relight
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from pbrs_farm.run.relight import LampFactor, unlit_lamps

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
    ),
]


def small(**light: str) -> Recipe:
    return recipe_from_name(
        "preview",
        {
            "image.width_px": "96",
            "image.height_px": "72",
            "light.spp": "4",
            "cameras.cell_m": "1.0",
            "cameras.score_width_px": "160",
            "cameras.score_height_px": "120",
            "repair.lamp_in_every_room": "false",  # the home's two lamps, by name
            **{f"light.{name}": value for name, value in light.items()},
        },
    )


def run(out: Path, recipe: Recipe, *, update: bool = False) -> int:
    summary = run_local(
        Run(["builtin"], str(out), recipe, wanted(["mlt_il_ol"], [], 1), update=update)
    )
    assert summary.failures == []
    return summary.n_done


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("lamps")
    run(out, small(groups="lamps"))
    return out


@pytest.fixture
def view(root: Path) -> Path:
    return next(root.glob("houses/*/views/*"))


def lamps_of(view: Path) -> list[dict[str, object]]:
    lamps: list[dict[str, object]] = json.loads((view / "view.json").read_text())["modes"]["light"][
        "lamps"
    ]
    return lamps


def relit(view: Path, tmp_path: Path, *words: str) -> np.ndarray:
    out = tmp_path / "relit.png"
    assert main(["relight", str(view), "--out", str(out), *words]) == 0
    return array_from_png(out.read_bytes())


def test_a_view_may_do_without_its_light(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(root, copy)
    view = next(copy.glob("houses/*/views/*"))
    before = (view / "mlt_il_ol.png").read_bytes()
    want = wanted(["mlt_il_ol"], [], 1).model_copy(update={"drop_radiance": True})

    def dropped(recipe: Recipe) -> int:
        summary = run_local(Run(["builtin"], str(copy), recipe, want, update=True))
        assert summary.failures == []
        assert not (view / "radiance.exr").exists()
        return summary.n_done

    assert dropped(small(groups="lamps")) == 0
    assert b"radiance.exr" not in (copy / "manifest.jsonl").read_bytes()
    certificate = verify(copy, sample=100)
    assert certificate.is_clean, certificate.text()
    assert "no radiance.exr to develop" in certificate.text()
    assert main(["relight", str(view)]) == 1
    assert "rendered with --drop-radiance" in capsys.readouterr().err
    # Another tone needs the light again: light, develop, view.
    other = small(groups="lamps").model_copy(update={"tone": ToneFields(contrast=1.2)})
    assert dropped(other) == 3
    assert (view / "mlt_il_ol.png").read_bytes() != before
    assert dropped(small(groups="lamps")) == 3
    assert (view / "mlt_il_ol.png").read_bytes() == before


def test_every_lamp_is_named_and_those_that_light_the_view_have_a_layer(view: Path) -> None:
    rows = lamps_of(view)
    assert [row["number"] for row in rows] == [1, 2]
    described = json.loads((view.parents[1] / "house.json").read_text())["items"]
    for row in rows:
        item = described[int(str(row["instance"])) - 1]
        assert (row["item"], row["name"], row["room"]) == (
            item["id"],
            item["name"],
            item["room_id"],
        )
        assert float(str(row["lm"])) > 500
    exr = layers_from_exr((view / "radiance.exr").read_bytes())
    lit = [str(row["layer"]) for row in rows if row["layer"]]
    assert lit
    assert {name.split(".")[0] for name in exr if name.startswith("lamp")} == set(lit)
    for c in "RGB":
        total = sum((exr[f"{name}.{c}"] for name in lit), np.zeros((72, 96), np.float32))
        np.testing.assert_array_equal(exr[f"indoor.{c}"], total)


def test_verify_sees_a_lamp_that_indoor_is_not_the_sum_of(root: Path, tmp_path: Path) -> None:
    certificate = verify(root, sample=100)
    assert certificate.is_clean, certificate.text()
    assert certificate.counts["indoor = sum of lamps"].checked == 3 * 72 * 96
    copy = tmp_path / "copy"
    shutil.copytree(root, copy)
    file = next(copy.glob("houses/*/views/*/radiance.exr"))
    layers = layers_from_exr(file.read_bytes())
    name = next(name for name in sorted(layers) if name.startswith("lamp"))
    layers[name] = layers[name] * np.float32(1.5)
    file.write_bytes(exr_from_layers(layers))
    assert verify(copy, sample=100).counts["indoor = sum of lamps"].failed > 1000
    file.write_bytes(exr_from_layers({k: v for k, v in layers.items() if k != name}))
    assert verify(copy, sample=100).counts["lamps"].failed == 1


def test_with_every_factor_1_the_file_equals_the_rendered_one(view: Path, tmp_path: Path) -> None:
    relit(view, tmp_path, "--lamp", "*=1", "--indoor", "1")
    assert (tmp_path / "relit.png").read_bytes() == (view / "mlt_il_ol.png").read_bytes()


def test_a_lamp_answers_to_its_number_its_item_its_name_and_a_pattern(
    view: Path, tmp_path: Path
) -> None:
    row = next(row for row in lamps_of(view) if row["layer"])
    dimmed = relit(view, tmp_path, "--lamp", f"{row['number']}=0.25")
    assert (dimmed != relit(view, tmp_path)).any()
    for word in (row["item"], row["name"], f"{str(row['item'])[:-1]}*"):
        np.testing.assert_array_equal(dimmed, relit(view, tmp_path, "--lamp", f"{word}=0.25"))
    # The last argument wins.
    number = str(row["number"])
    words = ("--lamp", "*=7", "--lamp", f"{number}=0.25")
    np.testing.assert_array_equal(dimmed, relit(view, tmp_path, *words))


def test_lamps_out_are_indoor_out_and_all_at_half_is_indoor_at_half(
    view: Path, tmp_path: Path
) -> None:
    for factor in ("0", "0.5"):
        by_lamp = relit(view, tmp_path, "--lamp", f"*={factor}", "--outdoor", "0.1")
        by_group = relit(view, tmp_path, "--indoor", factor, "--outdoor", "0.1")
        np.testing.assert_array_equal(by_lamp, by_group)
    assert not relit(view, tmp_path, "--lamp", "*=0", "--outdoor", "0").any()


def test_a_lamp_can_have_another_colour(view: Path, tmp_path: Path) -> None:
    blue = relit(view, tmp_path, "--lamp", "*=0.2,0.2,3", "--outdoor", "0").astype(int)
    white = relit(view, tmp_path, "--outdoor", "0").astype(int)
    assert (blue[..., 2] - blue[..., 0]).mean() > (white[..., 2] - white[..., 0]).mean() + 20


def test_list_prints_every_lamp(view: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["relight", str(view), "--list"]) == 0
    printed = capsys.readouterr().out
    for row in lamps_of(view):
        assert f"{row['item']}" in printed
        assert f"{row['name']}" in printed
    assert "%" in printed


def test_a_list_makes_no_picture(view: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["relight", str(view), "--list", "--lamp", "1=0"]) == 1
    assert "makes no picture" in capsys.readouterr().err


def test_lamps_are_denoised_fast_and_a_lone_one_not_at_all(
    view: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    qualities: list[str] = []

    def denoise(radiance: np.ndarray, *_guides: np.ndarray) -> np.ndarray:
        qualities.append(str(_guides[-1]))
        return radiance

    monkeypatch.setattr(relight, "denoise_radiance", denoise)
    radiance = radiance_from_exr((view / "radiance.exr").read_bytes(), "radiance.exr")
    lit = next(row for row in lamps_of(view) if row["layer"])
    rows = [{**lit, "number": number} for number in (1, 2)]
    two = relight.relight_layers(radiance, rows, denoise=True)
    assert qualities == ["fast", "fast"]
    one = relight.relight_layers(radiance, rows[:1], denoise=True)
    assert len(qualities) == 2
    np.testing.assert_array_equal(one.lamps[1], one.aovs.indoor)
    np.testing.assert_allclose(sum(two.lamps.values()), two.aovs.indoor, rtol=1e-5)


def test_a_lamp_without_light_is_reported(view: Path, tmp_path: Path) -> None:
    rows = [{**row, "layer": None} for row in lamps_of(view)]
    (tmp_path / "view.json").write_text(json.dumps({"modes": {"light": {"lamps": rows}}}))
    words = [LampFactor("1", (0, 0, 0)), LampFactor("*", (1, 1, 1))]
    assert [row["number"] for row in unlit_lamps(tmp_path, words)] == [1]


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("9=0.5", "9: no such lamp (of 1 piece_5 (floor lamp), 2 piece_22 (pendant lamp))"),
        ("sun=0.5", "sun: no such lamp"),
        ("1", "expected LAMP=F"),
        ("1=dim", "expected LAMP=F"),
        ("1=-1", "0 or more"),
        ("1=inf", "finite"),
        ("1=0.5,0.5", "LAMP=R,G,B"),
        ("=0.5", "expected LAMP=F"),
    ],
)
def test_a_wrong_argument_is_refused(
    word: str, says: str, view: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "never.png"
    assert main(["relight", str(view), "--lamp", word, "--out", str(out)]) == 1
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_a_view_of_two_groups_explains_how_to_add_lamps_and_keeps_its_pictures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Without the denoiser, which may amplify a rounding error to a step of 8 bits.
    out = tmp_path / "two"
    run(out, small(denoise="false"))
    view = next(out.glob("houses/*/views/*"))
    before = array_from_png((view / "mlt_il_ol.png").read_bytes()).astype(int)
    outdoor = (view / "mlt_ol.png").read_bytes()
    for words in (("--lamp", "1=0"), ("--list",)):
        assert main(["relight", str(view), *words]) == 1
        assert "--groups lamps" in capsys.readouterr().err
    # Only light, develop and view run again.
    assert run(out, small(denoise="false", groups="lamps"), update=True) == 3
    assert (view / "mlt_ol.png").read_bytes() == outdoor
    after = array_from_png((view / "mlt_il_ol.png").read_bytes()).astype(int)
    assert np.abs(after - before).max() <= 1
    assert len(lamps_of(view)) == 2


def test_a_view_is_named_by_the_url_of_its_store_too(
    view: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["relight", view.as_uri()]) == 0
    out = tmp_path / f"{view.name}_relit.png"
    assert out.read_bytes() == (view / "mlt_il_ol.png").read_bytes()
    assert main(["relight", view.as_uri(), "--list"]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("lamp")
    # A folder without a view and a missing view each give one line that names the URL.
    for url in (view.parents[3].as_uri(), f"{view.as_uri()}_9"):
        assert main(["relight", url]) == 1
        assert url in capsys.readouterr().err
