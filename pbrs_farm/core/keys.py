"""Ids, the key of every stored object built and parsed, digests and seeds; no effects.

A key is a path with "/" below the output root. Equal inputs give equal digests on every machine:
digests are over canonical JSON, never over Python's own hash.

    houses/<house>/<file>                        recipe.json   manifest.jsonl   ATTRIBUTION.txt
    houses/<house>/views/<view>/<file>           selection.json
    houses/<house>/done/<step>[.<view>].json     selection/<run>.<ending>
    houses/<house>/unfinished/<step>.<view>.npz  selection/histograms/<house>.bin
    objects/<house>/...  for objects
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from typing import Any, Final

from pbrs_farm.core.errors import BadInput

RECIPE: Final = "recipe.json"
RECIPE_REPLACED: Final = "recipe_replaced.json"  # there once another recipe was put in its place
MANIFEST: Final = "manifest.jsonl"
ATTRIBUTION: Final = "ATTRIBUTION.txt"
DRESS: Final = "dress.json"  # of a dressed house
ARTICULATION: Final = "articulation.json"  # of a view that has the layer `part`
SELECTION: Final = "selection.json"
# The folders of an output root that hold a folder per house and per object without context.
FOLDERS: Final = ("houses", "objects")

_HOUSE_KEY: Final = re.compile(
    r"(?P<root>houses|objects)/(?P<house>[^/]+)/"
    r"(?:(?P<file>[^/]+)|views/(?P<view>[^/]+)/(?P<view_file>.+)"
    r"|done/(?P<step>[^/.]+)(?:\.(?P<step_view>[^/]+))?\.json)"
)
_RUN_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,60}")


@dataclass(frozen=True, slots=True)
class HouseKey:
    """The parts of a key below a house's folder: of its file, a view's file, or a step's marker."""

    house: str
    file: str = ""  # below the house's or the view's folder; "" for a marker
    view: str | None = None
    step: str = ""  # of a marker, else ""


def slug(name: str) -> str:
    """name in lower case with only a-z, 0-9 and single dashes; "house" if nothing is left.

    At most 60 characters. Different names can have one slug, so ids add a digest to it.

        >>> slug("Mein Haus (2).sh3d")
        'mein-haus-2-sh3d'
    """
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:60] or "house"


def house_id(file_stem: str, source_sha256: str) -> str:
    """`<slug of the file name>-<first 8 hex of the source's sha256>`: another content is another id."""
    return f"{slug(file_stem)}-{source_sha256[:8]}"


def dressed_id(house: str, seed: int) -> str:
    """The id of a house dressed by a seed: `<house>-d<seed>`."""
    return f"{house}-d{seed}"


# Ids of objects without context begin so; no house's id can (a slug has no underscore).
OBJECT_PREFIX: Final = "object_"


def is_object(house: str) -> bool:
    """The id is of an object without context (paper section 4.1), not of a house."""
    return house.startswith(OBJECT_PREFIX)


def house_key(house: str, file: str = "") -> str:
    """Key of a house's or object's file, perhaps with slashes; of its folder, with a trailing one, for ""."""
    return f"{FOLDERS[is_object(house)]}/{house}/{file}"


def view_key(house: str, view: str, file: str = "") -> str:
    """Key of a view's file; of its folder, with a trailing slash, when file is ""."""
    return house_key(house, f"views/{view}/{file}")


def marker_name(step: str, view: str | None = None) -> str:
    """`<step>` or `<step>.<view>`: a marker's name among those of its house."""
    return step if view is None else f"{step}.{view}"


def marker_key(house: str, step: str, view: str | None = None) -> str:
    """Key of the marker, which alone says that a step (of a view, if given) is done."""
    return house_key(house, f"done/{marker_name(step, view)}.json")


def unfinished_key(house: str, step: str = "", view: str = "") -> str:
    """Key of an unfinished step's checkpoint, which may be deleted; of their folder when step is ""."""
    return house_key(house, f"unfinished/{step}.{view}.npz" if step else "unfinished/")


def parse_house_key(key: str) -> HouseKey | None:
    """The parts of a house's, view's or marker's (`file` "", `step` set) key; None for any other."""
    match = _HOUSE_KEY.fullmatch(key)
    if match is None or match["root"] != FOLDERS[is_object(match["house"])]:
        return None
    file = match["file"] or match["view_file"] or ""
    return HouseKey(match["house"], file, match["view"] or match["step_view"], match["step"] or "")


def selection_key(run: str, ending: str) -> str:
    """Key of a selection's "parquet", "jsonl" or "html"; BadInput for a name that could leave the folder."""
    if not _RUN_NAME.fullmatch(run):
        raise BadInput("--run", run, "the name of a run may have letters, digits, dots and dashes")
    return f"selection/{run}.{ending}"


def histogram_pack_key(house: str) -> str:
    """Key of a house's pack of histograms: made by selection, safe to delete."""
    return f"selection/histograms/{house}.bin"


def canonical_json(value: Any) -> str:
    """JSON of a model or value with sorted keys, no spaces, ASCII: equal values give equal text. TypeError."""
    if hasattr(value, "model_dump"):
        value = value.model_dump(mode="json")
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True)


def sha256(data: bytes) -> str:
    """Hex sha256 of data."""
    return hashlib.sha256(data).hexdigest()


def digest(*parts: Any) -> str:
    """First 32 hex of the sha256 over the parts' canonical JSON, in their order."""
    return sha256("\n".join(canonical_json(p) for p in parts).encode())[:32]


def seed(*parts: str | int) -> int:
    """A 32-bit seed from names (rule 7), equal on every machine; each purpose needs another word."""
    return int(digest(*parts)[:8], 16)
