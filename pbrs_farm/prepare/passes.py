"""The passes from a source to a finished house: a table of functions, versions and recipe groups.

    read -> stand-ins -> furnish -> dress -> repair -> open -> float -> surroundings -> edits

The table is the only list of passes: finished_house.py calls them in its order, and the digest of the step
`house`, the versions that workers compare and the keys of caches derive from it. Effects: those of the
passes, which read files and the cached packages and write nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import EMPTY, FAMILIES_VERSION, Catalogue
from pbrs_farm.core.house import House
from pbrs_farm.core.made_home import VERSION as GENERATE_VERSION
from pbrs_farm.core.plugins import marks_in_digest, plugins
from pbrs_farm.core.recipe import Recipe, groups_of_step
from pbrs_farm.prepare.dress_catalogue import catalogue_of
from pbrs_farm.prepare.formats import format_of_source
from pbrs_farm.prepare.home_kinds import HOME_KIND
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.read.common.format import PLAN

if TYPE_CHECKING:
    from pbrs_farm.dress.dressing import Dressed
    from pbrs_farm.dress.report import DressReport
    from pbrs_farm.repair import RepairReport

PLANS_VERSION: Final = 4
"""Version of the readers of floor plans; raising it invalidates no other homes."""
_MAX_ROUNDS: Final = (
    3  # maximum rounds of repairing a dressed house and rehanging items that lost their wall
)
_FURNISH_VERSION: Final = (
    4  # version of furnish_rooms.py, in addition to that of furnishing generated homes
)
_DRESS_SHARE: Final = 0.7  # approximate share of dressing in the time of dressing and repair


class FinishedHouse(NamedTuple):
    """A finished house, the report of repair, and that of dressing (None if not dressed)."""

    house: House
    report: RepairReport
    dressing: DressReport | None


@dataclass(frozen=True, slots=True)
class Preparation:
    """A source on its way through the passes; each pass returns it with its result added."""

    source: SourceRef
    recipe: Recipe
    tell_share: Callable[[float], None]  # called with the finished share of dressing and repair
    finish: Callable[[SourceRef, Recipe], FinishedHouse]  # the house of another source
    current: House | None = None
    report: RepairReport | None = None
    dressed: Dressed | None = None
    dressing: DressReport | None = None

    @property
    def house(self) -> House:
        """The house after the last pass; not available to the first pass."""
        assert self.current is not None
        return self.current

    @property
    def finished(self) -> FinishedHouse:
        """The result of the last pass, with the masses of what opens."""
        from pbrs_farm.home.masses import weighed

        assert self.report is not None
        return FinishedHouse(weighed(self.house), self.report, self.dressing)


_IsNeeded: TypeAlias = Callable[[SourceRef, Recipe], bool]
_Depends: TypeAlias = Callable[[SourceRef, Recipe], Sequence[object]]


@dataclass(frozen=True, slots=True)
class Pass:
    """One pass of a house.

    version: raised when the pass makes another house of the same input, which invalidates all results of
    the former version. depends: other inputs of its result, as JSON values. groups: recipe groups that
    it reads and that do not name the step `house`.
    """

    name: str
    version: int
    run: Callable[[Preparation], Preparation]
    is_needed: _IsNeeded
    depends: _Depends = field(default=lambda _source, _recipe: [])
    groups: tuple[str, ...] = ()


def dress_seed(source: SourceRef, recipe: Recipe) -> int:
    """Seed of dressing: that of the source's word, else the recipe's; 0 = not dressed, as objects are."""
    kind = HOME_KIND.get(source.kind)
    if kind is not None and not kind.is_home:
        return 0
    return source.dress_seed or recipe.dress.seed


def uses_catalogue(source: SourceRef, recipe: Recipe) -> bool:
    """True if a source's house takes anything from the catalogue of furniture."""
    stands_in = _has_stand_ins(source, recipe) and recipe.read.stand_ins == "pieces"
    return stands_in or _is_furnished(source, recipe) or bool(dress_seed(source, recipe))


def _is_home(source: SourceRef, _recipe: Recipe) -> bool:
    # An object without context has no walls to close; a plugin's homes are already finished.
    kind = HOME_KIND.get(source.kind)
    return kind is None or (kind.is_home and kind.finish is None)


def _has_stand_ins(source: SourceRef, _recipe: Recipe) -> bool:
    entry = format_of_source(source)
    return entry is not None and entry.has_box_only_items


def _is_furnished(source: SourceRef, recipe: Recipe) -> bool:
    return _is_home(source, recipe) and recipe.dress.furnish != "none"


def _is_dressed(source: SourceRef, recipe: Recipe) -> bool:
    return _is_home(source, recipe) and bool(dress_seed(source, recipe))


def _stands_open(source: SourceRef, recipe: Recipe) -> bool:
    return _is_dressed(source, recipe) and recipe.dress.open_share > 0


def _open_depends(source: SourceRef, recipe: Recipe) -> list[object]:
    return [dress_seed(source, recipe), recipe.dress.open_share]


def _has_floating_things(source: SourceRef, recipe: Recipe) -> bool:
    return _is_home(source, recipe) and recipe.dress.float_share > 0


def _float_depends(source: SourceRef, recipe: Recipe) -> list[object]:
    from pbrs_farm.dress.content import content

    # Generated items float, too.
    things = [content().families_digest(), PASS["dress"].version]
    return [_float_seed(source, recipe), recipe.dress.float_share, *things]


def _float_seed(source: SourceRef, recipe: Recipe) -> int:
    return dress_seed(source, recipe) or recipe.seed


def _read_depends(source: SourceRef, recipe: Recipe) -> list[object]:
    if source.kind == PLAN:
        return [PLANS_VERSION]
    kind = HOME_KIND.get(source.kind)
    if kind is None or kind.finish is None:
        return [*recipe.dress.licences] if source.kind == "made" else []
    # The passes of a plugin's home are unknown before it is made, so all versions count.
    return [versions_of_passes(), recipe.digest("dress")]


def _stand_ins_depend(_source: SourceRef, recipe: Recipe) -> list[object]:
    how = recipe.read.stand_ins
    return [catalogue_of(recipe.dress).digest if how == "pieces" else ""]


def _furnish_depends(source: SourceRef, recipe: Recipe) -> list[object]:
    return [dress_seed(source, recipe), catalogue_of(recipe.dress).digest, recipe.dress.furnish]


def _dress_depends(source: SourceRef, recipe: Recipe) -> list[object]:
    # The content of the libraries counts, not their paths.
    fields = recipe.dress.model_dump(
        mode="json", exclude={"seed", "catalogue", "furnish", "passes", "open_share", "float_share"}
    )
    names = filter(None, recipe.dress.passes.split(":"))
    catalogue, marks = catalogue_of(recipe.dress), marks_in_digest("passes", names)
    if not catalogue.own:
        del fields["library_share"]
    return [dress_seed(source, recipe), fields, catalogue.digest, marks]


def _repair_depends(_source: SourceRef, _recipe: Recipe) -> list[object]:
    # Ceiling lamps are pieces of our families and of plugins.
    return [FAMILIES_VERSION, *marks_in_digest("furniture", plugins("furniture"))]


def _read(work: Preparation) -> Preparation:
    """Read the house of the source; for an object or a plugin's home it is the finished house."""
    from pbrs_farm.home.room_use import with_uses
    from pbrs_farm.prepare.read_source import read_house
    from pbrs_farm.prepare.source import check_unchanged
    from pbrs_farm.repair import RepairReport

    source, recipe = work.source, work.recipe
    kind = HOME_KIND.get(source.kind)
    if kind is not None and kind.finish is not None:
        check_unchanged(source)
        house, report, dressing = kind.finish(source, recipe, work.finish)
        return replace(work, current=house, report=report, dressing=dressing)
    # An object without context has no walls to close and no rooms.
    is_whole = kind is not None and not kind.is_home
    house = read_house(source, recipe.read, recipe.dress.licences)
    house = house if is_whole else with_uses(house)
    unrepaired = RepairReport(house_id=house.id, was_repaired=True) if is_whole else None
    return replace(work, current=house, report=unrepaired)


def _stand_in(work: Preparation) -> Preparation:
    """Furnish items that the source describes by class and box alone."""
    from pbrs_farm.prepare.stand_ins import has_box_only_items, with_stand_ins

    if not has_box_only_items(work.house):
        return work
    how = work.recipe.read.stand_ins
    catalogue = catalogue_of(work.recipe.dress) if how == "pieces" else EMPTY
    return replace(work, current=with_stand_ins(work.house, catalogue, how))


def _furnish(work: Preparation) -> Preparation:
    """Furnish empty or nearly empty rooms, by the seed of dressing."""
    from pbrs_farm.prepare.furnish_rooms import furnish_rooms

    catalogue, seed = catalogue_of(work.recipe.dress), dress_seed(work.source, work.recipe)
    which = work.recipe.dress.furnish
    return replace(work, current=furnish_rooms(work.house, catalogue, seed, which=which))


def _dress(work: Preparation) -> Preparation:
    """Add surfaces, parts, lamps, textiles and clutter by seed; BadRecipe, BadInput, MachineFailed."""
    from pbrs_farm.dress.dressing import dressed_house
    from pbrs_farm.repair.small_repairs import with_rooms_closed, without_persons_and_plants

    fields = work.recipe.repair
    # Do not clear space for people and plants that repair will remove; lamps hang from ceilings.
    bare, _removed = without_persons_and_plants(work.house, fields)
    bare = with_rooms_closed(bare, fields)
    dressed = dressed_house(
        bare,
        catalogue_of(work.recipe.dress),
        work.recipe.dress,
        dress_seed(work.source, work.recipe),
        lambda share: work.tell_share(_DRESS_SHARE * share),
    )
    return replace(work, current=dressed.house, dressed=dressed)


def _repair(work: Preparation) -> Preparation:
    """Repair; items hung on walls that it changed are rehung or removed, and the house repaired again."""
    from pbrs_farm.dress.dressing import refit_after_repair
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.repair import repair

    def occluder_from(some: House) -> Caster:
        return Caster.of_house(some)

    def lamps_from() -> Catalogue:
        from pbrs_farm.dress.content import content

        return content().with_families(EMPTY)

    repaired = partial(
        repair, fields=work.recipe.repair, occluder_from=occluder_from, lamps_from=lamps_from
    )
    dressed = work.dressed
    if dressed is None:
        house, report = repaired(work.house)
        return replace(work, current=house, report=report)
    for k in range(_MAX_ROUNDS):
        work.tell_share(_DRESS_SHARE + (1 - _DRESS_SHARE) * k / _MAX_ROUNDS)
        house, report = repaired(dressed.house)
        refitted = refit_after_repair(house, dressed, catalogue_of(work.recipe.dress))
        if refitted is dressed:
            break
        dressed = refitted
    else:
        house, report = repaired(dressed.house)
    return replace(work, current=house, report=report, dressing=dressed.report)


def _leave_open(work: Preparation) -> Preparation:
    """Leave a share of the doors and drawers of a lived-in home open, by the seed of dressing."""
    from pbrs_farm.prepare.open_joints import left_open

    share, seed = work.recipe.dress.open_share, dress_seed(work.source, work.recipe)
    return replace(work, current=left_open(work.house, share, seed))


def _float(work: Preparation) -> Preparation:
    """Add floating items, by the seed of dressing, else by the recipe's."""
    from pbrs_farm.dress.floating import with_floating_things

    share, seed = work.recipe.dress.float_share, _float_seed(work.source, work.recipe)
    return replace(work, current=with_floating_things(work.house, share, seed))


def _surround(work: Preparation) -> Preparation:
    """Add streets, gardens and courts outside the windows."""
    from pbrs_farm.dress.content import content

    kind, seed = work.recipe.surroundings.kind, work.recipe.seed
    return replace(work, current=content().with_surroundings(work.house, kind, seed))


def _edit(work: Preparation) -> Preparation:
    """Apply the source's edits, in their order."""
    from pbrs_farm.prepare.apply_edits import apply_edits

    return replace(work, current=apply_edits(work.house, work.source, work.recipe.read))


PASSES: Final = (
    Pass("read", 13, _read, lambda _source, _recipe: True, _read_depends),
    Pass("stand-ins", 4, _stand_in, _has_stand_ins, _stand_ins_depend),
    Pass("furnish", GENERATE_VERSION + _FURNISH_VERSION, _furnish, _is_furnished, _furnish_depends),
    Pass("dress", 17, _dress, _is_dressed, _dress_depends),
    Pass("repair", 6, _repair, _is_home, _repair_depends),
    Pass("open", 2, _leave_open, _stands_open, _open_depends),
    Pass("float", 2, _float, _has_floating_things, _float_depends),
    Pass(
        "surroundings",
        3,
        _surround,
        lambda source, recipe: _is_home(source, recipe) and recipe.surroundings.kind != "none",
    ),
    Pass("edits", 4, _edit, lambda source, _recipe: bool(source.edits)),
)

PASS: Final = {p.name: p for p in PASSES}

GROUPS: Final = tuple(
    dict.fromkeys([*groups_of_step("house"), *(g for p in PASSES for g in p.groups)])
)
"""Every recipe group that a finished house may depend on."""

STEP_GROUPS: Final = tuple(group for group in GROUPS if group != "dress")
"""The recipe groups of the step `house`; for a dressed house, step_depends adds the fields of dressing."""


def versions_of_passes() -> dict[str, int]:
    """Pass -> version, with one for readers of plans; equal ones make equal houses."""
    return {p.name: p.version for p in PASSES} | {"plans": PLANS_VERSION}


def cache_key(source: SourceRef, recipe: Recipe) -> str:
    """Equal for equal finished houses: digest of a source, its edits, and the fields that passes read."""
    return keys.digest(source, recipe.digest(*GROUPS))


def step_depends(source: SourceRef, recipe: Recipe) -> list[object]:
    """Inputs of the step `house` beside STEP_GROUPS: files, then each pass's version and own inputs."""
    passes = [p for p in PASSES if p.is_needed(source, recipe)]
    return [source.fingerprint, *([p.name, p.version, *p.depends(source, recipe)] for p in passes)]
