"""README.md of a set: content, number of views, recipe, checks. Effects: reads roots."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pbrs_farm
from pbrs_farm.core import keys
from pbrs_farm.core.house_split import SPLITS, empty_splits, home_of, split_of_house
from pbrs_farm.curate.teaching_rules import RuleVerdict
from pbrs_farm.regular_files import read_regular
from pbrs_farm.sets.data_set import DataSet, SetPart

MadeViews = tuple[SetPart, Path, Sequence[RuleVerdict], Mapping[str, int]]
"""A part, its root, the views of its forms, and reason -> number of views left out."""

_COMMAND = """```sh
pbrs-farm make {file} --out {name}   # makes the same files again, from this file and those that it names
sha256sum --check --quiet SHA256SUMS # prints nothing if no file has changed
```"""


def card_text(data_set: DataSet, made_views: Sequence[MadeViews]) -> str:
    """The card in Markdown; equal for equal sets."""
    card = data_set.card
    licence = card.licence and f"Licence: {card.licence}."
    blocks = [
        f"# {card.title}",
        card.text.strip(),
        licence,
        _table(
            ("part", "split", "homes", "houses", "views"), list(_split_rows(data_set, made_views))
        ),
        _split_text(data_set, made_views),
        *(_part_text(*of) for of in made_views),
        "## Forms",
        _forms_text(data_set),
        "## Reproduce and check",
        _COMMAND.format(file=data_set.file, name=data_set.name),
        f"The file has the digest `{keys.sha256(data_set.data)}` (SHA-256). Files are equal to the last bit by one version of "
        f"pbrs_farm (here {pbrs_farm.__version__}) on processors of one kind; another kind may round a last digit otherwise.",
        _licences(made_views),
        _credits(made_views),
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def _table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in line)} |" for line in lines)


def _split_rows(data_set: DataSet, made_views: Sequence[MadeViews]) -> Iterator[tuple[object, ...]]:
    for part, _root, verdicts, _reasons in made_views:
        of: dict[str, list[RuleVerdict]] = {}
        for verdict in verdicts:
            shares = data_set.shares
            split = split_of_house(verdict.house, shares) if shares else "all"
            of.setdefault(split, []).append(verdict)
        for split in (*SPLITS, "all"):
            if split_rows := of.get(split):
                houses = {verdict.house for verdict in split_rows}
                homes = {home_of(house) for house in houses}
                yield part.name, split, len(homes), len(houses), len(split_rows)


def _split_text(data_set: DataSet, made_views: Sequence[MadeViews]) -> str:
    shares = data_set.shares
    if shares is None:
        return (
            "It is not split. Split it by home, not by view: rooms of a home share their furniture."
        )
    text = "/".join(f"{100 * share:g}" for share in (shares.train, shares.val, shares.test))
    empty = empty_splits((v.house for _p, _r, verdicts, _n in made_views for v in verdicts), shares)
    warning = f" No home falls into {' and '.join(empty)}: use more homes." if empty else ""
    return f"Split {text} by home: all views of a home, however it is dressed, are in one part.{warning}"


def _part_text(
    part: SetPart, _root: Path, chosen: Sequence[RuleVerdict], reasons: Mapping[str, int]
) -> str:
    recipe, want = part.recipe, part.want
    left_out = [f"{n} {reason}" for reason, n in sorted(Counter(reasons).items()) if n]
    seeds = part.dress_seeds or ((recipe.dress.seed,) if recipe.dress.seed else ())
    rows = [
        f"Pictures: {', '.join(map(str, want.modes)) or 'none'}, {recipe.image.width_px}x{recipe.image.height_px}.",
        f"Layers beside those of every view: {', '.join(want.layers) or 'none'}.",
        f"Cameras: {recipe.cameras.source}, preset {recipe.cameras.preset}, lens {recipe.lens.model};"
        f" pictures by the camera {recipe.tone.camera}, {recipe.tone.variants} more by random cameras.",
        f"Light: {recipe.light.integrator}, {recipe.light.spp} samples a pixel; sky {recipe.sky.kind}, {recipe.sky.time}.",
        f"Recipe: {recipe.name}, digest {recipe.digest()}, seed {recipe.seed}.",
        f"Homes: {len(part.homes)}, {'dressed by ' + _shortened(seeds) if seeds else 'not dressed'}.",
        f"Views left out of the forms: {', '.join(left_out) or 'none'}.",
    ]
    return "\n".join(
        [
            f"## {part.name}: {len(chosen)} view{'s' * (len(chosen) != 1)}",
            "",
            *(f"- {row}" for row in rows),
        ]
    )


def _shortened(seeds: Sequence[int]) -> str:
    many = f" and {len(seeds) - 8} more" if len(seeds) > 8 else ""
    return ", ".join(map(str, seeds[:8])) + many


def _forms_text(data_set: DataSet) -> str:
    rows = ["- `parts/<part>`: all rendered files (docs/formats.md of pbrs_farm)"]
    rows += [f"- `forms/{f.name}/<part>`: {f.to}, of {', '.join(f.parts)}" for f in data_set.forms]
    return "\n".join([*rows, "- `index.csv`: each view, its split, and why it is left out"])


def _licences(made_views: Sequence[MadeViews]) -> str:
    """The licences of all that the views of the forms show."""
    names = {
        name
        for _part, root, chosen, _reasons in made_views
        for v in chosen
        for file in root.glob(f"*/{v.house}/views/{v.view}/view.json")
        for name in json.loads(read_regular(file)).get("licences", ())
    }
    return (
        f"The views show homes, models and pictures of: {', '.join(sorted(names))}."
        if names
        else ""
    )


def _credits(made_views: Sequence[MadeViews]) -> str:
    files = [
        f"`parts/{part.name}/{keys.ATTRIBUTION}`"
        for part, root, _kept, _reasons in made_views
        if (root / keys.ATTRIBUTION).is_file()
    ]
    if not files:
        return ""
    return (
        f"## Credits\n\nThe pictures show works of others, which must be named: {', '.join(files)}."
    )
