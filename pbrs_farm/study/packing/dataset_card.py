"""What packed views say of themselves: the rest of dataset.json, and README.md; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pbrs_farm.core.classes import NYU40_COLOURS
from pbrs_farm.core.house_split import home_of
from pbrs_farm.study.packing.packing_plan import Packing, shard_plans
from pbrs_farm.study.reading.stored_layers import STORED, array_names
from pbrs_farm.study.reading.views import Views

AXES = "x right, y forward, z up (published); pbrs_farm gives opencv, opengl or published"
SPLIT_RULE = (
    "by home: sha256 of the house's id without digest and variant (-d3), its first 8 bytes as a"
    " number of 0..1: train below train, val below train + val, else test"
)


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


def card(views: Views, packing: Packing, credits: Sequence[str], *, form: str) -> str:
    """README.md: front matter that Hugging Face reads, what is in it, how to load it, credits."""
    size = "x".join(map(str, packing.size)) if packing.size else "the size it was rendered in"
    arrays = [
        f"| {n} | {STORED[n].dtype} | {STORED[n].unit} |" for n in array_names(packing.layers)
    ]
    blocks = [
        _front_matter(views, packing) if form == "parquet" else "",
        "# Rendered rooms with exact labels",
        f"{len(views)} views, {len(views.homes)} homes or variants of homes, {size}, rendered by pbrs_farm."
        f" Lighting modes: {', '.join(packing.modes)}.",
        "\n".join(["| split | views | homes |", "|---|---|---|", *_split_rows(views, packing)]),
        f"Split {SPLIT_RULE}." if packing.shares else "",
        "\n".join(["| array | type | unit |", "|---|---|---|", *arrays]),
        f"Axes of normals as stored: {AXES}. Classes are the NYU40's; 0 is none.",
        _loading(form, next(shard_plans(views.refs, packing)).split),
        "\n".join(["Credits:", "", *(f"- {line.removeprefix('- ')}" for line in credits)])
        if credits
        else "",
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def _split_rows(views: Views, packing: Packing) -> list[str]:
    n_views: dict[str, int] = {}
    homes: dict[str, set[str]] = {}
    for plan in shard_plans(views.refs, packing):
        n_views[plan.split] = n_views.get(plan.split, 0) + len(plan.refs)
        homes.setdefault(plan.split, set()).update(home_of(ref.house) for ref in plan.refs)
    return [f"| {name} | {n} | {len(homes[name])} |" for name, n in n_views.items()]


def _front_matter(views: Views, packing: Packing) -> str:
    splits = dict.fromkeys(plan.split for plan in shard_plans(views.refs, packing))
    files = "".join(f"\n  - split: {s}\n    path: data/{s}-*.parquet" for s in splits)
    return f"---\nconfigs:\n- config_name: default\n  data_files:{files}\n---"


def _loading(form: str, split: str) -> str:
    if form == "shards":
        return (
            "```python\nfrom pbrs_farm.study.samples.sharded_views import ShardedViews\n\n"
            f"views = ShardedViews('.', split='{split}')  # dictionaries of torch tensors\n```\n\n"
            "webdataset reads the same files; normals, depth and instances are `.npz` of uint16."
        )
    return (
        "```python\nimport io\n\nimport numpy as np\nfrom datasets import load_dataset\n\n"
        f"row = load_dataset('.', split='{split}')[0]\n"
        "normal = np.load(io.BytesIO(row['normal']))['normal'] * (2 / 65535) - 1\n```"
    )
