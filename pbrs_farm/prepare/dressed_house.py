"""Between read and repair: a source's house dressed by its seed, from the catalogue of the recipe.

Effects: reads the furniture package from the cache (or through apt) and the user's libraries.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.house import House
from pbrs_farm.core.made_home import VERSION as MADE_VERSION
from pbrs_farm.core.plugins import plugin
from pbrs_farm.core.recipe import DressFields, Recipe
from pbrs_farm.crash_notes import note_step
from pbrs_farm.prepare.dress_catalogue import catalogue_of_words, fetch_packages
from pbrs_farm.read.source import SourceRef

if TYPE_CHECKING:
    from pbrs_farm.dress.report import DressReport
    from pbrs_farm.repair import RepairReport

    Repaired = tuple[House, RepairReport]

VERSION: Final = 19
"""Of the stage: part of a dressed house's digest. Raised when it makes another house."""


_ROUNDS: Final = 3  # of repair and gates
_DRESSING: Final = 0.7  # of the time that dressing and repair take, about


TELLS_BOXES: Final = frozenset({"plan", "scenestate", "front3d", "habitat"})
"""Kinds of sources that may tell a thing by class and box alone."""

STAND_INS_VERSION: Final = 1
"""Of what stands in for such things."""


def seed_of(source: SourceRef, recipe: Recipe) -> int:
    """What a source is dressed by: its own seed, else the recipe's; 0 = not at all."""
    if source.kind == "object":
        return 0
    return source.dress_seed or recipe.dress.seed


def uses_catalogue(source: SourceRef, recipe: Recipe) -> bool:
    """Whether a source's house takes anything from the catalogue."""
    stands_in = source.kind in TELLS_BOXES and recipe.read.stand_ins == "pieces"
    return bool(seed_of(source, recipe)) or _is_furnished(source, recipe) or stands_in


def _is_furnished(source: SourceRef, recipe: Recipe) -> bool:
    return recipe.dress.furnish != "none" and source.kind != "object"


def furnished(house: House, source: SourceRef, recipe: Recipe) -> House:
    """The house with its empty rooms furnished, where the recipe asks for it, by the dressing's seed."""
    if not _is_furnished(source, recipe):
        return house
    from pbrs_farm.prepare.furnish_rooms import with_rooms_furnished

    note_step(source.location, "furnish")
    return with_rooms_furnished(house, catalogue_of(recipe.dress), seed_of(source, recipe))


def dressed_and_repaired(
    house: House,
    source: SourceRef,
    recipe: Recipe,
    repaired: Callable[[House], Repaired],
    tell: Callable[[float], None] = lambda _share: None,
) -> tuple[House, RepairReport, DressReport | None]:
    """A house as read, dressed by its source's seed and repaired; and what was done, None: not dressed.

    Gates hold for the house as it is rendered: what loses its wall to repair is hung on the wall
    that is left or taken out, and the house is repaired without it. tell: called with the share of
    the work that is done. Raises BadRecipe for an unknown
    style, BadInput for a library that is none, MachineFailed where the furniture package cannot be had.
    """
    seed = seed_of(source, recipe)
    if not seed:
        note_step(source.location, "repair")
        return *repaired(house), None
    from pbrs_farm.dress.dressing import dressed_house, kept_in
    from pbrs_farm.repair.repair_house import with_rooms_closed, without_persons_and_plants

    note_step(source.location, "dress")
    # Nothing makes way for people and plants that repair will take out; lamps hang from ceilings.
    bare, _removed = without_persons_and_plants(house, recipe.repair)
    bare = with_rooms_closed(bare, recipe.repair)
    catalogue = catalogue_of(recipe.dress)
    made = dressed_house(bare, catalogue, recipe.dress, seed, lambda share: tell(_DRESSING * share))
    for k in range(_ROUNDS):
        tell(_DRESSING + (1 - _DRESSING) * k / _ROUNDS)
        note_step(source.location, "repair")
        finished, report = repaired(made.house)
        kept = kept_in(finished, made, catalogue)
        if kept is made:
            break
        made = kept
    else:
        finished, report = repaired(made.house)
    return finished, report, made.report


def with_told_furnished(house: House, source: SourceRef, recipe: Recipe) -> House:
    """The house with furniture for what its source tells by class and box alone."""
    if source.kind not in TELLS_BOXES:
        return house
    from pbrs_farm.prepare.stand_ins import has_told, with_stand_ins

    if not has_told(house):
        return house
    note_step(source.location, "stand-ins")
    how = recipe.read.stand_ins
    catalogue = catalogue_of(recipe.dress) if how == "pieces" else EMPTY
    return with_stand_ins(house, catalogue, how)


def _stand_ins_digest(source: SourceRef, recipe: Recipe) -> list[object]:
    if source.kind not in TELLS_BOXES:
        return []
    how = recipe.read.stand_ins
    digest = catalogue_of(recipe.dress).digest if how == "pieces" else ""
    return ["stand-ins", STAND_INS_VERSION, digest]


def dressing_digest(source: SourceRef, recipe: Recipe) -> str:
    """Digest of all that dressing and furnishing depend on beside the house; "" where neither is done."""
    seed, is_furnished = seed_of(source, recipe), _is_furnished(source, recipe)
    told = _stand_ins_digest(source, recipe)
    if not seed and not is_furnished:
        return keys.digest(*told) if told else ""
    # Where the libraries lie is no matter: their content is.
    fields = recipe.dress.model_dump(
        mode="json", exclude={"seed", "catalogue", "furnish", "passes"}
    )
    passes = [plugin("passes", name).mark for name in recipe.dress.passes.split(":") if name]
    more = [*(["furnish", MADE_VERSION] if is_furnished else []), *told]
    return keys.digest(VERSION, seed, fields, catalogue_of(recipe.dress).digest, *more, *passes)


def fetch_catalogue(fields: DressFields) -> None:
    """Download the packages of the catalogue that a recipe names where they are not cached.

    Raises MachineFailed, with the command to type, where apt cannot give them, and BadInput for a
    library of the user's that is none.
    """
    fetch_packages(fields.catalogue)


def catalogue_of(fields: DressFields) -> Catalogue:
    """The catalogue that a recipe names, read once a process."""
    return catalogue_of_words(fields.catalogue)
