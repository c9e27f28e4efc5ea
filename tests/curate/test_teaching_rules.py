"""Rules exclude useless views: planes, black pictures, items cut by the edge, twins."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.teaching_rules import judged_by
from pbrs_farm.export.export_views import export, finished_entries
from pbrs_farm.images import array_from_png, png_from_array
from tests.check.roots import SIZE, make_root

EYE = (3.0, 1.5, 1.5)


def look(eye, towards, hfov_deg: float = 60.0) -> Camera:
    return Camera.look(
        Intrinsics.from_hfov(*SIZE, np.radians(hfov_deg)),
        np.array(eye, float),
        np.array(towards, float),
    )


CAMERAS = {
    "a_room": look(EYE, (-1, -0.25, 0.4)),
    # A few centimetres away, hardly turned: the same picture.
    "b_twin": look((3.02, 1.5, 1.5), (-1, -0.25, 0.42)),
    # The same place in another direction.
    "c_other": look(EYE, (-0.3, -0.5, 1)),
    # Straight up: only the ceiling.
    "d_ceiling": look(EYE, (0.01, 1, 0), 50),
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    house = make_root(folder, cameras=CAMERAS)
    for file in house.glob("views/*/view.json"):
        table = json.loads(file.read_text()) | {"room": "0_0"}
        file.write_text(json.dumps(table))
        picture = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
        (file.parent / "mlt_il_ol.png").write_bytes(png_from_array(picture))
    return folder


def reasons(root: Path, *names: str) -> dict[str, str]:
    return {v.view: v.reason for v in judged_by(finished_entries(root), names)}


def numbers(root: Path, name: str) -> dict[str, float]:
    return {v.view: v.numbers.get(name, np.nan) for v in judged_by(finished_entries(root), [name])}


def test_a_view_of_a_single_plane_is_left_out(root: Path) -> None:
    plane_numbers = numbers(root, "plane")
    # Computed differently: the share of pixels with the most common instance, if that one is flat.
    house = next((root / "houses").iterdir())
    for view, share in plane_numbers.items():
        depth = array_from_png((house / "views" / view / "depth.png").read_bytes())
        assert 0 < share <= (depth > 0).mean() + 0.02
    assert plane_numbers["d_ceiling"] > 0.95
    assert plane_numbers["a_room"] < 0.6
    assert reasons(root, "plane")["d_ceiling"] == "one-plane"
    assert reasons(root, "plane")["a_room"] == ""


def test_a_black_picture_is_left_out(root: Path, tmp_path: Path) -> None:
    assert set(reasons(root, "black").values()) == {""}
    copy = shutil.copytree(root, tmp_path / "copy")
    for name, level in (("a_room", 1), ("c_other", 2)):
        picture = np.full((SIZE[1], SIZE[0], 3), level, np.uint8)
        picture[:20] = 200  # a bright window does not lighten the other pixels
        file = next((copy / "houses").iterdir()) / "views" / name / "mlt_il_ol.png"
        file.write_bytes(png_from_array(picture))
    assert reasons(copy, "black") == {
        "a_room": "black",
        "b_twin": "",
        "c_other": "",
        "d_ceiling": "",
    }


def test_of_near_twins_the_first_stays(root: Path) -> None:
    twin_reasons = reasons(root, "twins")
    assert twin_reasons == {"a_room": "", "b_twin": "twin", "c_other": "", "d_ceiling": ""}
    share = numbers(root, "twins")
    assert share["b_twin"] > 0.9
    assert share["c_other"] < 0.1


def test_items_cut_by_the_edge_are_counted(root: Path, tmp_path: Path) -> None:
    house = next((root / "houses").iterdir())
    cut_numbers = numbers(root, "cut")
    for view, share in cut_numbers.items():
        rows = json.loads((house / "views" / view / "view.json").read_text())["instances"]
        things = [r for r in rows if r["kind"] not in ("wall", "floor", "ceiling", "ground")]
        things = [r for r in things if r["fraction"] >= 0.01]
        cut = [r for r in things if r["truncated"]]
        assert share == pytest.approx(len(cut) / len(things) if things else 0, abs=1e-9)
    assert max(cut_numbers.values()) > 0


def test_a_view_counts_for_the_first_rule_that_it_breaks_and_rules_are_off(root: Path) -> None:
    assert set(reasons(root).values()) == {""}
    # Two ceilings are planes before they are twins.
    verdict_rows = judged_by(finished_entries(root), ["twins", "plane"])
    assert [v.reason for v in verdict_rows] == ["", "twin", "", "one-plane"]
    with pytest.raises(BadInput, match=r"--by: dull: no such rule.*black, plane, cut, twins"):
        judged_by([], ["dull"])


def test_the_verb_counts_each_rule_and_exports_the_kept_views(root, tmp_path, capsys) -> None:
    assert main(["select", str(root), "--by", "plane", "twins", "--run", "taught"]) == 0
    output = capsys.readouterr().out
    assert "2 of 4 views kept" in output
    assert "1  one-plane" in output
    assert "1  twin" in output
    assert export(root, tmp_path / "coco", "coco", selection="taught")[0] == 2
    # Among the views of another selection.
    assert main(["select", str(root), "--by", "plane", "--selection", "taught", "--run", "b"]) == 0
    assert "2 of 2 views kept" in capsys.readouterr().out
    assert json.loads((root / "selection.json").read_text())["reasons"] == {"one-plane": 0}
    assert main(["select", str(root)]) != 0
    assert "--reference or --by" in capsys.readouterr().err
