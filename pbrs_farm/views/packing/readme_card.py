"""README.md of packed views: contents, loading, credits and limits; no effects."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final

from pbrs_farm.core.house_split import home_of
from pbrs_farm.core.shown_text import shown
from pbrs_farm.views.packing.data_card import AXES, SPLIT_RULE, TITLE, RootFacts
from pbrs_farm.views.packing.packing_plan import Packing, shard_plans
from pbrs_farm.views.stored_layers import STORED, array_names
from pbrs_farm.views.views import Views

_MOST_HOMES: Final = 100  # rows of the card


def card(views: Views, packing: Packing, facts: RootFacts, *, form: str) -> str:
    """README.md: front matter for Hugging Face, contents, how to load them, limits."""
    size = "x".join(map(str, packing.size)) if packing.size else "the rendered size"
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
        f"Axes of normals as stored: {AXES}. Classes are the NYU40's; 0 is no class.",
        _loading(form, next(shard_plans(views.refs, packing, form)).split),
        "## Homes and licences",
        _homes(facts),
        "\n".join(["Credits:", "", *(f"- {line.removeprefix('- ')}" for line in facts.credits)])
        if facts.credits
        else "",
        "## How it was made",
        _list(_making(packing, facts)),
        "## Classes",
        _class_table(facts),
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
        (_card_cell(h.id), h.n_views, _card_cell(h.licence) or "none named", _card_cell(h.author))
        for h in facts.homes[:_MOST_HOMES]
    ]
    n_more = len(facts.homes) - len(rows)
    more = f"\n\n... and {n_more} more homes." if n_more else ""
    return _table(("home", "views", "licence", "author"), rows) + more


def _card_cell(text: str) -> str:
    return shown(text).replace("|", "\\|")


def _making(packing: Packing, facts: RootFacts) -> Iterator[str]:
    """Sizes, cameras, light and seeds."""
    sizes = ", ".join(f"{width}x{height}" for width, height in facts.sizes)
    angles = " to ".join(f"{angle:.1f}" for angle in facts.hfov_deg)
    wide = f"; horizontal field of view {angles} degrees" if angles else ""
    yield f"Rendered at {sizes}{wide}."
    recipe = facts.recipe
    if recipe is None:
        yield "The output root has no recipe.json: cameras, light and seeds are not known."
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


def _class_table(facts: RootFacts) -> str:
    total = sum(facts.pixels_of_class.values())
    if not total:
        return "No view names an instance."
    rows = [
        (name, f"{100 * n / total:.2f} %") for name, n in facts.pixels_of_class.items() if n > 0
    ]
    return _table(("class", "share of labelled pixels"), rows)


def _limits(packing: Packing, facts: RootFacts) -> Iterator[str]:
    yield "The pictures are rendered, not photographed; networks trained on them alone see a domain gap."
    yield "Classes of furniture mostly follow from names and sizes by rules, without manual checks."
    if "depth" in packing.layers:
        yield "Depth is whole millimetres and ends at 65.535 m."
    if any(mode.startswith("opengl") for mode in packing.modes):
        yield "OpenGL pictures have no shadows and no light between surfaces."
    recipe = facts.recipe
    if recipe is not None:
        if recipe.light.denoise and any(mode.startswith("mlt") for mode in packing.modes):
            yield "Light is denoised: fine texture in dark places may be smoothed."
        if recipe.repair.remove_persons:
            yield "Persons are removed from homes."
        if recipe.repair.remove_plants:
            yield "Plants are removed from homes."
        if recipe.repair.fallback_light:
            yield "A room without light gets an added lamp."
    if packing.size is not None:
        yield f"Labels are the nearest pixel's at {packing.size[0]}x{packing.size[1]}."
    if "colour" in packing.layers and packing.colour == "jpeg":
        yield f"Colour is JPEG of quality {packing.quality}: it is lossy."
    if packing.shares is None:
        yield "It is not split. Split by home, not by view: rooms of a home share their furniture."
    if facts.n_warned:
        yield f"Views with a warning in view.json, such as a dark room: {facts.n_warned}."
    if facts.n_left_out:
        yield f"Views left out, since they are not finished or lack a layer: {facts.n_left_out}."
    n_unnamed = sum(not home.licence for home in facts.homes)
    if n_unnamed:
        yield f"Homes whose source names no licence: {n_unnamed}. Ask before you publish them."
