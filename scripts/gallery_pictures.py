"""The gallery's forty rooms: cameras, pictures, credits, and their table in docs/gallery.md.

    python scripts/gallery_pictures.py                the pictures missing in out/gallery, then the page
    python scripts/gallery_pictures.py --part 0 of 2  every second one: one process per core, then without it

docs/pictures/gallery/homes.csv lists the homes, and the room to show where it names one. The best of
a home's views is rendered with the page's command.
Effects: out/gallery, docs/pictures/gallery, docs/gallery.md. Remove out/gallery if homes have changed.
"""

from __future__ import annotations

import csv
import json
import math
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
from PIL import Image

import pbrs_farm as pf
from pbrs_farm.home.room_use import RoomKind, room_kind
from pbrs_farm.images import png_from_array
from pbrs_farm.prepare.passes import versions_of_passes

OUT, PAGE, PICTURES = Path("out/gallery"), Path("docs/gallery.md"), Path("docs/pictures/gallery")
HEADS: Final = (
    "Homes:",
    "Models and surface pictures that must be credited:",
    "Models and surface pictures free of conditions:",
)
CALLED: Final = {RoomKind.LIVING: "Living room", RoomKind.DINING: "Dining room"}
A_ROW: Final = 4
SIZE: Final[dict[str, Any]] = {"image.width_px": 640, "image.height_px": 480}


def main(words: Sequence[str]) -> None:
    """Render the missing pictures; write the page unless only a part was requested."""
    with (PICTURES / "homes.csv").open(encoding="utf-8") as file:
        homes = list(csv.DictReader(file))
    part, of = (int(words[1]), int(words[3])) if words[:1] == ["--part"] else (0, 1)
    for row in homes[part::of]:
        if not (OUT / row["number"] / "shown.json").exists():
            print(row["number"], row["home"], render(row), flush=True)
    if of == 1:
        write_page(homes)


def render(row: dict[str, str]) -> str:
    """Render a home's best view of the requested room, as a root in out/gallery and a picture; returns the view's id."""
    home = pf.load(row["home"], recipe="preview").set(**SIZE).dress(7)
    kinds = {
        room.id: room_kind(
            room,
            [item for item in home.house.items if item.room_id == room.id],
            shapely.Polygon(room.polygon).area,
        )
        for room in home.house.rooms
    }
    views = list(home.cameras())
    best = max(
        [v for v in views if kinds[v.room] == row["room"]] or views, key=lambda v: v.view.score
    )
    frame = pf.render(home, best.camera, modes=["mlt_il_ol"])
    root = OUT / row["number"]
    frame.save(root)
    (root / "picture.png").write_bytes(png_from_array(frame.colour))
    lens = best.camera.intrinsics
    camera = {
        "world_from_camera": np.asarray(best.camera.world_from_camera).tolist(),
        "hfov_rad": 2 * math.atan(0.5 * lens.width_px / lens.fx),
        "room": best.room,
    }
    kind = kinds[best.room]
    shown = {"camera": camera, "what": CALLED.get(kind, kind.value.capitalize())}
    (root / "shown.json").write_text(json.dumps(shown))
    return str(best.id)


def write_page(homes: Iterable[dict[str, str]]) -> None:
    """Write docs/pictures/gallery and the table of docs/gallery.md from out/gallery."""
    cells, credited = [], {head: set[str]() for head in HEADS}
    for row in homes:
        number, root = row["number"], OUT / row["number"]
        shown: dict[str, Any] = json.loads((root / "shown.json").read_text())
        (PICTURES / f"{number}.json").write_text(json.dumps([shown["camera"]]) + "\n")
        picture = Image.open(root / "picture.png").convert("RGB")
        picture.save(PICTURES / f"{number}.jpg", quality=85, optimize=True)
        cells.append(_cell(number, row["home"], shown["what"]))
        for head, lines in _credits((root / "ATTRIBUTION.txt").read_text()).items():
            credited[head] |= lines
    text = "The pictures of this folder show works of others, placed, scaled and recoloured.\n"
    for head, lines in credited.items():
        text += "\n" + "\n".join([head, *sorted(lines)]) + "\n"
    (PICTURES / "ATTRIBUTION.txt").write_text(text)
    cells += [""] * (-len(cells) % A_ROW)
    table = "\n".join(
        "| " + " | ".join(cells[k : k + A_ROW]) + " |" for k in range(0, len(cells), A_ROW)
    )
    page = PAGE.read_text(encoding="utf-8")
    page = re.sub(r"(?m)(^\| \[!\[.*\|\n)+", lambda _: table + "\n", page, count=1)
    PAGE.write_text(re.sub(VERSIONS, versions_line(), page), encoding="utf-8")


VERSIONS: Final = r"They show version [\d.]+ of furnishing and \d+ of dressing\."


def versions_line() -> str:
    """The page's line about the versions that made its pictures."""
    versions = versions_of_passes()
    return f"They show version {versions['furnish']} of furnishing and {versions['dress']} of dressing."


def _cell(number: str, home: str, what: str) -> str:
    name = home.partition(",")[0]
    words = re.sub(r",(?=.)", ",`<br>`", home)
    picture = f"pictures/gallery/{number}.jpg"
    return f"[![{what} of {name}]({picture})]({picture})<br>{number}<br>`{words}`"


def _credits(text: str) -> dict[str, set[str]]:
    """Head -> lines of an ATTRIBUTION.txt."""
    credits: dict[str, set[str]] = {}
    for line in text.splitlines():
        if line in HEADS:
            lines = credits.setdefault(line, set())
        elif credits and line.startswith("- "):
            lines.add(line)
    return credits


if __name__ == "__main__":
    main(sys.argv[1:])
