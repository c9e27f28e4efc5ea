"""What packed views say of themselves: README.md, croissant.json, the rest of dataset.json.

Effects: reads the table of each view and the source of each home.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.classes import NYU40_COLOURS
from pbrs_farm.core.house_split import home_of
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.core.shown_text import shown
from pbrs_farm.study.packing.packing_plan import Packing, shard_plans
from pbrs_farm.views.stored_layers import STORED, array_names
from pbrs_farm.views.stored_root import StoredRoot
from pbrs_farm.views.views import Views

AXES = "x right, y forward, z up (published); pbrs_farm gives opencv, opengl or published"
SPLIT_RULE = (
    "by home: sha256 of the house's id without digest and variant (-d3), its first 8 bytes as a"
    " number of 0..1: train below train, val below train + val, else test"
)
TITLE = "Rendered rooms with exact labels"
_MOST_HOMES: Final = 100  # rows of the card


@dataclass(frozen=True, slots=True)
class HomeFacts:
    """A home of a pack."""

    id: str
    n_views: int
    licence: str  # "" where its source names none
    author: str


@dataclass(frozen=True, slots=True)
class RootFacts:
    """What is true of the packed views of an output root."""

    homes: tuple[HomeFacts, ...]
    credits: tuple[str, ...]  # lines that every product must carry
    recipe: Recipe | None  # None: the root holds none
    sizes: tuple[tuple[int, int], ...]  # as rendered, width and height
    hfov_deg: tuple[float, ...]  # least and most of the pin-holes, horizontal; () without one
    pixels_of_class: Mapping[str, int]  # most frequent first
    origins: tuple[str, ...]  # of the cameras
    n_warned: int  # views with a warning
    n_left_out: int  # views that lack something


def root_facts(views: Views, root: StoredRoot) -> RootFacts:
    """The facts of these views, by the tables of each."""
    pixels, origins, sizes = Counter[str](), set[str](), set[tuple[int, int]]()
    hfov_deg, n_warned = [], 0
    for ref in views.refs:
        facts, table = root.facts(ref), root.table(ref)
        sizes.add(facts.size)
        if "lens" not in table and facts.K[0][0] > 0:
            hfov_deg.append(math.degrees(2 * math.atan(0.5 * facts.size[0] / facts.K[0][0])))
        origins.add(str(table.get("origin", "")))
        n_warned += bool(table.get("warnings"))
        for row in table.get("instances", ()):
            pixels[str(row["class"])] += int(row["pixels"])
    n_views = Counter(ref.house for ref in views.refs)
    sources = {house: root.source_of(house) for house in views.homes}
    homes = [
        HomeFacts(house, n_views[house], source.get("licence", ""), source.get("author", ""))
        for house, source in sources.items()
    ]
    return RootFacts(
        tuple(homes), root.credits(views.homes), root.recipe, tuple(sorted(sizes)),
        (min(hfov_deg), max(hfov_deg)) if hfov_deg else (), dict(pixels.most_common()),
        tuple(sorted(filter(None, origins))), n_warned, len(views.left_out),
    )  # fmt: skip


def described(packing: Packing, credits: Sequence[str]) -> dict[str, Any]:
    """The fields of dataset.json that readers of other makers need."""
    colours = [bytes(row).hex() for row in NYU40_COLOURS.tolist()]
    arrays = {
        name: {
            "dtype": STORED[name].dtype,
            "unit": STORED[name].unit,
            "nothing": STORED[name].nothing,
        }
        for name in array_names(packing.layers)
    }
    return {
        "class_colours_srgb": colours,
        "arrays": arrays,
        "normal_axes": AXES,
        "camera": "K: (x right, y down, z forward) to pixels, centre of the first at (0.5, 0.5)",
        "split_rule": SPLIT_RULE if packing.shares else None,
        "colour": packing.colour if packing.colour == "png" else f"jpeg {packing.quality}",
        "seed": packing.seed,
        "credits": list(credits),
        "card": "README.md",
    }


# README.md.


def card(views: Views, packing: Packing, facts: RootFacts, *, form: str) -> str:
    """README.md: front matter that Hugging Face reads, what is in it, how to load it, its limits."""
    size = "x".join(map(str, packing.size)) if packing.size else "the size it was rendered in"
    arrays = [
        f"| {n} | {STORED[n].dtype} | {STORED[n].unit} |" for n in array_names(packing.layers)
    ]
    blocks = [
        _front_matter(views, packing) if form == "parquet" else "",
        f"# {TITLE}",
        f"{len(views)} views, {len(views.homes)} homes or variants of homes, {size}, rendered by pbrs_farm."
        f" Lighting modes: {', '.join(packing.modes)}.",
        _table(("split", "views", "homes"), _split_rows(views, packing, form)),
        f"Split {SPLIT_RULE}." if packing.shares else "Not split.",
        "\n".join(["| array | type | unit |", "|---|---|---|", *arrays]),
        f"Axes of normals as stored: {AXES}. Classes are the NYU40's; 0 is none.",
        _loading(form, next(shard_plans(views.refs, packing, form)).split),
        "## Homes and licences",
        _homes(facts),
        "\n".join(["Credits:", "", *(f"- {line.removeprefix('- ')}" for line in facts.credits)])
        if facts.credits
        else "",
        "## How it was made",
        _list(_making(packing, facts)),
        "## Classes",
        _classes(facts),
        "## Known limits",
        _list(_limits(packing, facts)),
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def _table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in line)} |" for line in lines)


def _list(lines: Iterator[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _split_rows(views: Views, packing: Packing, form: str) -> list[tuple[str, int, int]]:
    n_views: dict[str, int] = {}
    homes: dict[str, set[str]] = {}
    for plan in shard_plans(views.refs, packing, form):
        n_views[plan.split] = n_views.get(plan.split, 0) + len(plan.refs)
        homes.setdefault(plan.split, set()).update(home_of(ref.house) for ref in plan.refs)
    return [(name, n, len(homes[name])) for name, n in n_views.items()]


def _front_matter(views: Views, packing: Packing) -> str:
    splits = dict.fromkeys(plan.split for plan in shard_plans(views.refs, packing, "parquet"))
    files = "".join(f"\n  - split: {s}\n    path: data/{s}-*.parquet" for s in splits)
    return f"---\nconfigs:\n- config_name: default\n  data_files:{files}\n---"


def _loading(form: str, split: str) -> str:
    if form == "shards":
        return (
            "```python\nfrom pbrs_farm.study.samples.view_loader import ShardedViews\n\n"
            f"views = ShardedViews('.', split='{split}')  # dictionaries of torch tensors\n```\n\n"
            "webdataset reads the same files; normals, depth and instances are `.npz` of uint16."
        )
    return (
        "```python\nimport torch\nfrom datasets import load_dataset\n\n"
        f"views = load_dataset('.', split='{split}')\n"
        "depth = views.with_format('torch', columns=['depth'], dtype=torch.uint16)[0]['depth']  # (H, W)\n"
        "normal = views.with_format('numpy')[0]['normal'] * (2 / 65535) - 1  # (H, W, 3)\n```\n\n"
        "Pictures are `Image` columns, labels `Array2D` and `Array3D` of the types above; without `dtype` "
        "the formats torch and numpy of `datasets` make int64 of them, with the same values."
    )


def _homes(facts: RootFacts) -> str:
    rows = [
        (_cell(h.id), h.n_views, _cell(h.licence) or "none named", _cell(h.author))
        for h in facts.homes[:_MOST_HOMES]
    ]
    left = len(facts.homes) - len(rows)
    more = f"\n\n... and {left} more homes." if left else ""
    return _table(("home", "views", "licence", "author"), rows) + more


def _cell(text: str) -> str:
    return shown(text).replace("|", "\\|")


def _making(packing: Packing, facts: RootFacts) -> Iterator[str]:
    """Sizes, cameras, light and seeds."""
    sizes = ", ".join(f"{width}x{height}" for width, height in facts.sizes)
    angles = " to ".join(f"{angle:.1f}" for angle in facts.hfov_deg)
    wide = f"; horizontal field of view {angles} degrees" if angles else ""
    yield f"Rendered at {sizes}{wide}."
    recipe = facts.recipe
    if recipe is None:
        yield "The output root holds no recipe.json: cameras, light and seeds are not known."
        return
    origins = f" ({', '.join(facts.origins)})" if facts.origins else ""
    yield (
        f"Cameras: source {recipe.cameras.source}{origins}, preset {recipe.cameras.preset},"
        f" lens {recipe.lens.model}."
    )
    yield f"Recipe: {recipe.name}, digest {recipe.digest()}."
    if any(mode.startswith("mlt") for mode in packing.modes):
        light = recipe.light
        until = f", noise {light.noise:g}" if light.noise else ""
        yield (
            f"Light: integrator {light.integrator}, {light.spp} samples a pixel{until}, depth"
            f" {light.max_depth}, {'' if light.denoise else 'not '}denoised; emission"
            f" {recipe.emission.preset}, sky {recipe.sky.kind}, tone {recipe.tone.preset}."
        )
    variants = sorted({int(m[1]) for h in facts.homes if (m := re.search(r"-d(\d+)", h.id))})
    dressed = f"; homes dressed by {', '.join(map(str, variants[:20]))}" if variants else ""
    yield f"Seeds: {recipe.seed} of the recipe, {packing.seed} of the order of views{dressed}."


def _classes(facts: RootFacts) -> str:
    total = sum(facts.pixels_of_class.values())
    if not total:
        return "No view names an instance."
    rows = [
        (name, f"{100 * n / total:.2f} %") for name, n in facts.pixels_of_class.items() if n > 0
    ]
    return _table(("class", "share of labelled pixels"), rows)


def _limits(packing: Packing, facts: RootFacts) -> Iterator[str]:
    yield "The pictures are rendered, not photographed; a network trained on them alone meets a gap."
    yield "Classes of furniture mostly follow from words and sizes by rules, unchecked by hand."
    if "depth" in packing.layers:
        yield "Depth is whole millimetres and ends at 65.535 m."
    if any(mode.startswith("opengl") for mode in packing.modes):
        yield "OpenGL pictures have no shadows and no light between surfaces."
    recipe = facts.recipe
    if recipe is not None:
        if recipe.light.denoise and any(mode.startswith("mlt") for mode in packing.modes):
            yield "Light is denoised: fine texture in dark places may be smoothed."
        if recipe.repair.remove_persons:
            yield "Persons are taken out of homes."
        if recipe.repair.remove_plants:
            yield "Plants are taken out of homes."
        if recipe.repair.fallback_light:
            yield "A room that nothing lights gets a lamp that its designer did not draw."
    if packing.size is not None:
        yield f"Labels are the nearest pixel's at {packing.size[0]}x{packing.size[1]}."
    if "colour" in packing.layers and packing.colour == "jpeg":
        yield f"Colour is JPEG of quality {packing.quality}: it has lost a little."
    if packing.shares is None:
        yield "It is not split. Split by home, not by view: rooms of a home share their furniture."
    if facts.n_warned:
        yield f"Views with a warning in view.json, such as a dark room: {facts.n_warned}."
    if facts.n_left_out:
        yield f"Views left out, since they are not finished or lack a layer: {facts.n_left_out}."
    n_unnamed = sum(not home.licence for home in facts.homes)
    if n_unnamed:
        yield f"Homes whose source names no licence: {n_unnamed}. Ask before you publish them."


# croissant.json: what MLCommons' readers need of the Parquet files.


_CONTEXT: Final[dict[str, Any]] = {
    "@language": "en", "@vocab": "https://schema.org/", "citeAs": "cr:citeAs",
    "column": "cr:column", "conformsTo": "dct:conformsTo", "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"}, "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"}, "extract": "cr:extract",
    "field": "cr:field", "fileObject": "cr:fileObject", "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet", "format": "cr:format", "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset", "jsonPath": "cr:jsonPath", "key": "cr:key",
    "md5": "cr:md5", "parentField": "cr:parentField", "path": "cr:path",
    "rai": "http://mlcommons.org/croissant/RAI/", "recordSet": "cr:recordSet",
    "references": "cr:references", "regex": "cr:regex", "repeated": "cr:repeated",
    "replace": "cr:replace", "samplingRate": "cr:samplingRate", "sc": "https://schema.org/", "separator": "cr:separator",
    "source": "cr:source", "subField": "cr:subField", "transform": "cr:transform",
}  # fmt: skip
_PARQUET: Final = "application/x-parquet"


def croissant_json(files: Sequence[Path], columns: Mapping[str, str], facts: RootFacts) -> bytes:
    """Croissant 1.0: the Parquet files with their digests, and a record set for each split.

    columns: name -> data type. Labels are nested lists of integers.
    """
    splits = dict.fromkeys(file.name.partition("-")[0] for file in files)
    licences = sorted({home.licence for home in facts.homes if home.licence})
    row = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": "rendered-rooms",
        "description": f"{TITLE}: {sum(h.n_views for h in facts.homes)} views of"
        f" {len(facts.homes)} homes, rendered by pbrs_farm. README.md says what is in it.",
        "version": "1.0.0",
        **({"license": licences} if licences else {}),
        **({"creditText": "\n".join(facts.credits)} if facts.credits else {}),
        "distribution": [*map(_file_object, files), *map(_file_set, splits)],
        "recordSet": [
            {
                "@type": "cr:RecordSet", "@id": split, "name": split,
                "field": [_field(split, name, kind) for name, kind in columns.items()],
            }
            for split in splits
        ],
    }  # fmt: skip
    return (json.dumps(row, indent=1, ensure_ascii=False) + "\n").encode()


def _file_object(file: Path) -> dict[str, Any]:
    with file.open("rb") as data:
        digest = hashlib.file_digest(data, "sha256").hexdigest()
    return {
        "@type": "cr:FileObject", "@id": file.name, "name": file.name,
        "contentUrl": f"data/{file.name}", "contentSize": f"{file.stat().st_size} B",
        "encodingFormat": _PARQUET, "sha256": digest,
    }  # fmt: skip


def _file_set(split: str) -> dict[str, Any]:
    name = f"{split}-files"
    return {
        "@type": "cr:FileSet", "@id": name, "name": name, "encodingFormat": _PARQUET,
        "includes": f"data/{split}-*.parquet",
    }  # fmt: skip


def _field(split: str, name: str, kind: str) -> dict[str, Any]:
    source: dict[str, Any] = {
        "fileSet": {"@id": f"{split}-files"}, "extract": {"column": name},
    }  # fmt: skip
    if kind == "sc:ImageObject":
        source["transform"] = {"jsonPath": "bytes"}
    return {
        "@type": "cr:Field", "@id": f"{split}/{name}", "name": name, "source": source,
        "dataType": kind, **({"repeated": True} if kind == "sc:Integer" else {}),
    }  # fmt: skip
