"""Every kind of falsehood, planted in a finished root with all its hashes mended, is found."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from numpy.typing import NDArray

from pbrs_farm.check import developing, fields, light_checks, methods, verify
from pbrs_farm.cli import main
from pbrs_farm.core import layers
from pbrs_farm.core.layers import optional_layer
from pbrs_farm.images import array_from_png, png_from_array
from pbrs_farm.run.light_again import LightAgain
from pbrs_farm.views.open_views import open_views
from tests.check.falsehoods import FALSEHOODS, edit_json, planted, view_of
from tests.check.roots import house_of, sign
from tests.check.sorts_of_roots import ROOTS
from tests.inputs.made_once import made_once

Root = Callable[[str], Path]
QUICK_SORTS = ("finished", "opened")
"""Sorts of roots that `make test` renders; `make test-all` renders every sort."""
KINDS = [(sort, kind) for sort, kinds in FALSEHOODS.items() for kind in kinds]


def _one_a_check() -> list[tuple[str, str]]:
    """One kind of falsehood for each check and sort of root."""
    first: dict[tuple[str, str], str] = {}
    for sort, kind in KINDS:
        first.setdefault((sort, FALSEHOODS[sort][kind][1]), kind)
    return [(sort, kind) for (sort, _check), kind in first.items()]


def _marked(sort: str) -> list[pytest.MarkDecorator]:
    return [] if sort in QUICK_SORTS else [pytest.mark.long]


SORTS = [pytest.param(sort, marks=_marked(sort)) for sort in ROOTS]


@pytest.fixture(scope="module")
def finished_root(tmp_path_factory: pytest.TempPathFactory) -> Root:
    """A root of a sort, rendered at its first use by any worker; only copies are changed."""
    return lambda sort: made_once(tmp_path_factory, f"root {sort}", ROOTS[sort])


@pytest.mark.parametrize("sort", SORTS)
def test_a_true_root_is_clean(finished_root: Root, sort: str) -> None:
    root = finished_root(sort)
    certificate = verify(root, all_pixels=True, tracer=LightAgain)
    assert certificate.is_clean, certificate.text()


def test_light_of_another_machine_is_not_traced_again(finished_root: Root, tmp_path: Path) -> None:
    root = Path(shutil.copytree(finished_root("finished"), tmp_path / "root"))
    tracer = LightAgain(root)
    tracer.__dict__["variant"] = "cuda_of_another"
    certificate = verify(root, sample=10, tracer=lambda _root: tracer)
    assert "light traced" not in certificate.counts
    assert any("this machine has cuda_of_another: not repeated" in n for n in certificate.notes)


def test_verify_light_traces_the_light_of_a_folder(
    finished_root: Root, capsys: pytest.CaptureFixture[str]
) -> None:
    root = finished_root("finished")
    assert main(["verify", str(root), "--light", "--sample", "10"]) == 0
    text = capsys.readouterr().out
    assert "light traced" in text
    assert "--light` traces it again" not in text
    assert "--light` traces it again" in verify(root, sample=10).text()


def test_a_certificate_lists_the_examined_files(finished_root: Root) -> None:
    root = finished_root("finished")
    certificate = verify(root, sample=10)
    text = certificate.text()
    assert "albedo.png (2): recomputed by rays" in text
    assert "mlt_ol.png (2): developed from radiance.exr again" in text
    assert "levels of light" in text.partition("not looked at:")[2]
    # Every file of a view is in one of the two lists.
    listed = " ".join((*certificate.looked_at, *certificate.not_looked_at))
    view = view_of(root)
    assert all(str(f.relative_to(view)) in listed for f in view.rglob("*") if f.is_file())


@pytest.mark.quick(12)
@pytest.mark.parametrize(
    ("sort", "kind"), [pytest.param(*pair, marks=_marked(pair[0])) for pair in _one_a_check()]
)
def test_a_falsehood_with_all_hashes_mended_is_found(
    finished_root: Root, tmp_path: Path, sort: str, kind: str
) -> None:
    root = Path(shutil.copytree(finished_root(sort), tmp_path / "root"))
    assert FALSEHOODS[sort][kind][1] in planted(root, sort, kind)


@pytest.mark.slow
@pytest.mark.parametrize(("sort", "kind"), [pair for pair in KINDS if pair not in _one_a_check()])
def test_another_falsehood_of_that_check_is_found(
    finished_root: Root, tmp_path: Path, sort: str, kind: str
) -> None:
    root = Path(shutil.copytree(finished_root(sort), tmp_path / "root"))
    assert FALSEHOODS[sort][kind][1] in planted(root, sort, kind)


def test_at_least_ninety_kinds_of_falsehood_are_planted() -> None:
    assert len(KINDS) >= 90


@pytest.mark.long
def test_further_pictures_by_other_cameras_are_developed_again(finished_root: Root) -> None:
    root = finished_root("cameras")
    certificate = verify(root, sample=10)
    assert "mlt_il_ol.3.png (1): developed from radiance.exr again" in certificate.text()
    (frame,) = open_views(str(root))
    assert len(frame.variants) == 3
    assert all((picture != frame.colour).any() for picture in frame.variants)


@pytest.mark.long
def test_a_true_root_of_dark_pictures_is_clean_by_its_tiles(finished_root: Root) -> None:
    certificate = verify(finished_root("dark"), sample=10)
    assert certificate.is_clean, certificate.text()
    # The first view is denoised at full size, the second at half: both modes and a variant.
    assert certificate.counts["light by tiles"].checked == 3
    assert any(
        line.startswith("light of 1 views was denoised again") for line in certificate.not_looked_at
    )


@pytest.mark.long
@pytest.mark.parametrize("file", ["mlt_ol.png", "mlt_il_ol.png", "mlt_il_ol.1.png"])
def test_a_patch_is_found_in_light_denoised_at_half_its_size(
    finished_root: Root, tmp_path: Path, file: str
) -> None:
    root = Path(shutil.copytree(finished_root("dark"), tmp_path / "root"))
    view = max((house_of(root) / "views").iterdir())
    picture = array_from_png((view / file).read_bytes()).copy()
    picture[:81, :108] = 255 - picture[:81, :108]
    (view / file).write_bytes(png_from_array(picture))
    sign(root, house_of(root))
    certificate = verify(root, sample=10)
    # It differs at half its size, so the full size is compared.
    assert "light by tiles" not in certificate.counts
    (fault,) = (line for line in certificate.failures if line.startswith("light developed"))
    assert f"{file}: " in fault
    assert "from radiance.exr" in fault


@pytest.mark.long
def test_a_doubt_at_half_size_is_settled_at_full_size(
    finished_root: Root, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As if a median depended on which half of the pixels is lit: gains that no halved light gives.
    halved = developing.white_balance

    def elsewhere(total: NDArray[Any], *words: Any, **named: Any) -> Any:
        gains = halved(total, *words, **named)
        return gains + 0.3 if total.shape[0] < 130 else gains

    monkeypatch.setattr(light_checks, "white_balance", elsewhere)
    certificate = verify(finished_root("dark"), sample=10)
    assert certificate.is_clean, certificate.text()


@pytest.mark.long
def test_a_damaged_variant_is_one_fault_and_the_others_are_checked(
    finished_root: Root, tmp_path: Path
) -> None:
    root = Path(shutil.copytree(finished_root("dark"), tmp_path / "root"))
    file = max((house_of(root) / "views").iterdir()) / "mlt_il_ol.1.png"
    file.write_bytes(file.read_bytes()[:300])
    sign(root, house_of(root))
    certificate = verify(root, sample=10)
    assert certificate.n_views == 2
    (fault,) = certificate.failures
    assert "mlt_il_ol.1.png" in fault


@pytest.mark.parametrize("sort", SORTS)
def test_every_stored_field_and_layer_has_an_owner(finished_root: Root, sort: str) -> None:
    root = finished_root(sort)
    houses = list(root.glob("houses/*"))
    assert fields.unowned(fields.stored_fields(root, houses)) == []
    assert methods.unknown_files([root, *houses]) == []
    assert methods.unowned_layers() == []


def test_a_new_field_and_a_new_layer_are_listed_as_unexamined(
    finished_root: Root, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = Path(shutil.copytree(finished_root("finished"), tmp_path / "root"))
    view = view_of(root)
    for file, change in (
        (view / "view.json", lambda t: t["instances"][0].update(weight_kg=3.5)),
        (view / "view.json", lambda t: t["modes"]["light"]["sky"].update(moon_lx=0.2)),
        (house_of(root) / "house.json", lambda t: t["rooms"][0].update(wallpaper="roses")),
        (house_of(root) / "cameras.json", lambda t: t["views"][0].update(focus_m=2.0)),
    ):
        edit_json(file, change)
    new = optional_layer("incidence", "Y", "uint8", "degrees between normal and ray", "255")
    (view / new.file).write_bytes((view / "valid.png").read_bytes())
    marker = house_of(root) / f"done/truth.{view.name}.json"
    stored = json.loads(marker.read_text())
    stored["files"].append({"key": f"houses/{house_of(root).name}/views/{view.name}/{new.file}"})
    marker.write_text(json.dumps(stored))
    sign(root, house_of(root))
    for name in ("LAYERS", "OWN_LAYERS"):
        monkeypatch.setattr(methods, name, (*getattr(layers, name), new))
    lines = verify(root, sample=10).not_looked_at
    assert "view.json instances[].weight_kg, modes.light.sky.moon_lx: no check covers it" in lines
    assert "house.json rooms[].wallpaper: no check covers it" in lines
    assert "cameras.json views[].focus_m: no check covers it" in lines
    assert "incidence.png (1): hash, size and type alone" in lines
    assert methods.unowned_layers() == [new.file]
