"""Number of different models in dressed generated homes: `make bench NAME=variety` -> out/bench/variety.json.

`python -m benchmarks.homes.variety [N]`: N homes (60) of seeds that nobody tunes on, not rendered. Generated models count by
their construction, the faces of each surface, and by the kind of their pictures: variants in size or colour are one model.
Rows are kept in out/bench/variety/ and not measured again.
"""

from __future__ import annotations

import inspect
import json
import os
import re
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.figures import write_report
from pbrs_farm.core.house import House, Item
from pbrs_farm.core.made_home import MadeHome
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.furnishings.things import case_goods, hung, radiators
from pbrs_farm.furnishings.things.families import families
from pbrs_farm.furnishings.things.maker import Family, Thing, described_in
from pbrs_farm.furnishings.things.things import THINGS

FOLDER: Final = Path("out/bench/variety")
FIRST_SEED: Final = 61001
N_HOMES: Final = 60
N_CLASSES: Final = 25  # the commonest ones
DRESS_SEED: Final = 1
UNITS: Final = {
    "variety.homes": "homes",
    "variety.things": "items",
    "variety.effective_models": "models, the fewest of the 25 commonest classes",
    "variety.effective_models_median": "models, median of the 25 commonest classes",
    "variety.classes_below_12": "of the 25 commonest classes",
    "variety.top_share": "share of all items with the commonest model",
    "variety.generated_share": "share of all items",
    "variety.generated_share_of_furniture": "share of the items of the undressed home",
}

Row = tuple[str, str, bool]  # class, model, whether dressing added it


def main(words: list[str] | None = None) -> None:
    """Measure homes without a row and write out/bench/variety.json."""
    n = next((int(word) for word in words or () if word.isdigit()), N_HOMES)
    FOLDER.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), get_context("spawn")) as pool:
        seeds = range(FIRST_SEED, FIRST_SEED + n)
        rows = [row for of_home in pool.map(_rows_of, seeds) for row in of_home]
    write_report("variety", {"variety.homes": n, **_figures(rows)}, UNITS)


def _rows_of(seed: int) -> list[Row]:
    path = FOLDER / f"{seed}.json"
    if not path.exists():
        path.write_text(json.dumps(list(_things(seed))))
        print(f"made:{seed}", flush=True)
    return [(group, model, added) for group, model, added in json.loads(path.read_text())]


def _things(seed: int) -> Iterator[Row]:
    """Class and model of every item of a dressed generated home, and whether dressing added it."""
    from pbrs_farm.dress.dressing import dress
    from pbrs_farm.dress.old_place import pieces_by_plain_id, plain_id
    from pbrs_farm.prepare.dress_catalogue import catalogue_of
    from pbrs_farm.prepare.read_source import read_house
    from pbrs_farm.prepare.source import resolve

    recipe = recipe_from_name("fast")
    source: House = read_house(resolve(MadeHome(seed).word), recipe.read)
    catalogue = catalogue_of(recipe.dress)
    # Surfaces and colours do not change a model.
    fields = recipe.dress.model_copy(update={"surfaces": 0.0, "parts": 0.0})
    house, _report = dress(source, catalogue, fields, DRESS_SEED)
    groups = {key: piece.group for key, piece in pieces_by_plain_id(catalogue).items()}
    generated_groups = _groups_of_generated()
    for number, item in enumerate(house.items):
        if item.kind.is_structure or not item.n_faces:
            continue
        name = item.source_class.partition("#")[2]
        group = groups.get(plain_id(item.source_class)) or generated_groups.get(name, name)
        if group:
            yield group, model_of(house, item), number >= len(source.items)


def _groups_of_generated() -> dict[str, str]:
    """Name of every generated item, family and form -> its group."""
    books = ("books", "stack_of_books", "leaning_book", "open_book", "magazines")
    groups = dict.fromkeys(books, "book")
    groups |= dict.fromkeys(("framed_picture", "canvas", "poster"), "picture_frame")
    more_things = described_in((case_goods, hung, radiators), Thing)
    generated: list[Thing[...] | Family] = [
        *THINGS.values(),
        *more_things.values(),
        *families().values(),
    ]
    for item in generated:
        forms = re.findall(r'm\.name = "(\w+)"', inspect.getsource(item.build))
        groups |= dict.fromkeys((item.name, item.called, *forms), item.group)
    return groups


def model_of(house: House, item: Item) -> str:
    """A model's identity: its id in a library, or its construction if it is generated.

    Its pictures count by kind ("print abstract"), not by pixels.
    """
    library, _, name = item.source_class.partition("#")
    if library not in ("generated", "pbrs_farm"):
        return item.source_class
    # Names of variants end with a number and a taste, which do not change the construction.
    family = re.sub(r"-\d+-[a-z-]+$", "", name)
    shown = {house.materials[s.material].texture_id for s in item.surfaces} - {None}
    names = {house.textures[i].name for i in shown if i in house.textures}
    pictures = sorted(n for n in names if n.startswith(("rug ", "print ")))
    return " ".join(
        [f"{library}#{family}", str(sorted(len(s.faces) for s in item.surfaces)), *pictures]
    )


def effective(counts: Mapping[str, int]) -> float:
    """The exponential of the entropy of counts: as many equally common models are as varied."""
    shares = np.array([n for n in counts.values() if n], np.float64)
    shares /= shares.sum()
    return float(np.exp(-(shares * np.log(shares)).sum()))


def _figures(rows: list[Row]) -> dict[str, Any]:
    by_class: dict[str, Counter[str]] = {}
    for group, model, _added in rows:
        by_class.setdefault(group, Counter())[model] += 1
    common = sorted(by_class, key=lambda g: -by_class[g].total())[:N_CLASSES]
    effective_models = {group: effective(by_class[group]) for group in common}
    everything = Counter(model for _g, model, _a in rows)
    for group in sorted(by_class, key=lambda g: -by_class[g].total())[: 3 * N_CLASSES]:
        n, most = by_class[group].total(), by_class[group].most_common(1)[0]
        print(f"   {group:18} {n:5} things {effective(by_class[group]):6.1f} models   {most}")
    print(
        "   commonest", *(f"\n      {m} {n / len(rows):.3f}" for m, n in everything.most_common(12))
    )
    families = Counter(model.partition(" ")[0] for model in everything.elements())
    print("   families", *(f"\n      {m} {n / len(rows):.3f}" for m, n in families.most_common(12)))
    is_generated = [model.startswith(("generated#", "pbrs_farm#")) for _g, model, _a in rows]
    drawn = [
        is_made for (_g, _m, added), is_made in zip(rows, is_generated, strict=True) if not added
    ]
    return {
        "variety.things": len(rows),
        "variety.effective_models": round(min(effective_models.values()), 1),
        "variety.effective_models_median": round(
            float(np.median(list(effective_models.values()))), 1
        ),
        "variety.classes_below_12": sum(n < 12 for n in effective_models.values()),
        "variety.top_share": round(everything.most_common(1)[0][1] / len(rows), 4),
        "variety.generated_share": round(float(np.mean(is_generated)), 3),
        "variety.generated_share_of_furniture": round(float(np.mean(drawn)), 3),
    }


if __name__ == "__main__":
    main(sys.argv[1:])
