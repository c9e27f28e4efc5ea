"""A picture of the pages shows the current views of its command: docs/pictures/views.csv has picture, command, views.

Whoever renders a picture again updates its row; captions inside the pictures name the same views.
"""

from __future__ import annotations

import csv
import json
import re
import shlex
from pathlib import Path

import pytest

from pbrs_farm.cli import MODULES, build_parser
from pbrs_farm.commands.arguments import recipe_of
from pbrs_farm.prepare.passes import versions_of_passes
from pbrs_farm.run import plan
from tests.docs.fenced import PAGES, REPO

PICTURES = REPO / "docs/pictures"
with (PICTURES / "views.csv").open(encoding="utf-8") as _file:
    ROWS = list(csv.DictReader(_file))
_MAKE = {"make demo": "pbrs-farm demo"}  # commands of the targets


def name_of(row: dict[str, str]) -> str:
    return Path(row["picture"]).stem


@pytest.mark.parametrize("row", ROWS, ids=name_of)
def test_a_picture_of_the_table_is_on_a_page(row: dict[str, str]) -> None:
    assert (PICTURES / row["picture"]).is_file()
    pages = [page.read_text(encoding="utf-8") for page in PAGES]
    assert any(f"pictures/{row['picture']})" in text for text in pages)
    assert row["views"].split()


def test_every_picture_with_a_command_that_chooses_views_has_a_row() -> None:
    text = (REPO / "docs/gallery.md").read_text(encoding="utf-8")
    pairs = {(row["picture"], row["command"]) for row in ROWS}
    shown = []
    for above, below in zip(text.splitlines(), text.splitlines()[1:], strict=False):
        if above.startswith("![") and below.startswith(("`make demo", "`pbrs-farm dress")):
            picture = above.partition("](pictures/")[2].partition(")")[0]
            command = below.strip("`").split(" --out ")[0]
            shown.append((picture, command))
    assert len(shown) >= 4
    assert set(shown) <= pairs


def test_each_home_of_the_gallery_is_shown_by_its_number_and_has_a_camera() -> None:
    text = (REPO / "docs/gallery.md").read_text(encoding="utf-8")
    with (PICTURES / "gallery/homes.csv").open(encoding="utf-8") as file:
        homes = {row["number"]: row["home"] for row in csv.DictReader(file)}
    cells = re.findall(r"gallery/(\d\d)\.jpg\)<br>(\d\d)<br>((?:`[^`]+`(?:<br>)?)+)", text)
    shown = {number: "".join(re.findall("`([^`]+)`", words)) for _, number, words in cells}
    assert [picture for picture, _, _ in cells] == list(shown)
    assert shown == homes
    for number in homes:
        (camera,) = json.loads((PICTURES / f"gallery/{number}.json").read_text())
        assert {"world_from_camera", "hfov_rad", "room"} == set(camera)


@pytest.mark.pages
def test_the_gallery_shows_the_current_homes() -> None:
    """Otherwise its cameras are in other rooms: scripts/gallery_pictures.py renders it again."""
    text = (REPO / "docs/gallery.md").read_text(encoding="utf-8")
    now = versions_of_passes()
    assert (
        f"They show version {now['furnish']} of furnishing and {now['dress']} of dressing." in text
    )


@pytest.mark.pages
@pytest.mark.parametrize("row", ROWS, ids=name_of)
def test_a_command_makes_the_views_that_its_picture_shows(row: dict[str, str]) -> None:
    assert views_of(_MAKE.get(row["command"], row["command"])) == row["views"].split()


def views_of(command: str) -> list[str]:
    """The ids of the views of demo or dress, without rendering them."""
    from pbrs_farm.core.house import geometry_from_house
    from pbrs_farm.prepare.finished_house import finished_house
    from pbrs_farm.prepare.source import resolve, variants
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.run.chosen_cameras import chosen_cameras
    from pbrs_farm.run.steps import camera_seed

    words = shlex.split(command)[1:] + ([] if "demo" in command else ["--out", "out"])
    module = next(name for name, verbs in MODULES.items() if words[0] in verbs)
    args = build_parser(module).parse_args(words)
    recipe = recipe_of(args)
    (source,) = variants(resolve(args.home), (int(args.dress or 1),))
    house, _report, _dressing = finished_house(source, recipe)
    caster = Caster(geometry_from_house(house))
    seed = camera_seed(house.id, recipe)
    views = chosen_cameras(house, recipe, seed, caster).views
    rows = [(view.id, view.room_id, view.score) for view in views]
    return sorted(plan.spread(rows, args.views))
