"""Which steps a house's work consists of, what each depends on, and their digests; pure.

    house -> cameras, illuminance -> per view: truth, opengl_dl, opengl_il, light -> develop -> view

A step's digest covers its version, its ids, the recipe groups it uses and the digests of the
steps it reads. So a changed recipe field runs again exactly the steps that use it and those after.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LIGHT_LAYERS
from pbrs_farm.core.lighting import ALL_MODES, Mode
from pbrs_farm.core.recipe import Recipe, groups_of_step
from pbrs_farm.prepare import passes
from pbrs_farm.run.request import Wanted, wanted_of
from pbrs_farm.sample.camera_source import source_of


@dataclass(frozen=True, slots=True)
class Step:
    """One function of run/steps.py with its inputs."""

    name: str
    version: int  # raised when its output changes
    after: tuple[str, ...] = ()  # steps whose files it reads where they are: part of its digest
    per_view: bool = True
    needs: tuple[str, ...] = ()  # steps without which it cannot run

    @property
    def groups(self) -> tuple[str, ...]:
        """The recipe groups that its digest covers as a whole."""
        return passes.STEP_GROUPS if self.name == "house" else groups_of_step(self.name)


_VIEW_READS: Final = ("cameras", "truth", "opengl_dl", "opengl_il", "light", "develop")

STEPS: Final = {
    step.name: step
    for step in (
        Step("house", 1, per_view=False),
        Step("cameras", 9, ("house",), per_view=False),
        Step("pairs", 2, ("house", "cameras"), per_view=False, needs=("house", "cameras")),
        Step("tracks", 3, ("house", "cameras"), per_view=False, needs=("house", "cameras")),
        Step("truth", 4, ("house", "cameras")),
        Step("opengl_dl", 4, ("house", "cameras")),
        Step("opengl_il", 4, ("house", "cameras")),
        Step("illuminance", 10, ("house",), per_view=False),
        # Every change of illuminance also changes light's digest, so it is not listed in `after`.
        Step("light", 30, ("house", "cameras"), needs=("illuminance",)),
        Step("develop", 9, ("light",), needs=("light",)),
        Step("view", 4, _VIEW_READS, needs=("truth",)),
    )
}


OPENGL_STEPS: Final = ("opengl_dl", "opengl_il")


def wanted(
    modes: Iterable[str], layers: Iterable[str], n_views: int = 0, *, pairs: bool = False
) -> Wanted:
    """`Wanted` from words; no modes mean all of them. BadInput for an unknown word."""
    chosen_modes = tuple(modes) or ALL_MODES
    return wanted_of(Wanted(modes=chosen_modes, layers=tuple(layers), n_views=n_views, pairs=pairs))


def check_layers(want: Wanted, recipe: Recipe) -> None:
    """Raise BadInput for what views under a recipe cannot have, before anything is rendered."""
    from pbrs_farm.truth.optional_layers import check_lens

    if want.tracks and source_of(recipe.cameras).is_sequence is False:
        text = f"needs a walk, but cameras are {recipe.cameras.source}"
        raise BadInput("--tracks", "", text, hint="--cameras walk")

    for lens in recipe.lenses.values():
        check_lens(want.layers, lens.lens)
    of_light = [name for name in want.layers if name in LIGHT_LAYERS]
    if of_light and recipe.light.integrator != "path":
        text = f"needs light by `path`, but the recipe has {recipe.light.integrator}"
        raise BadInput("--layers", of_light[0], text, hint="--set light.integrator=path")


def house_steps(want: Wanted, house_id: str) -> tuple[str, ...]:
    """Steps of a house in the order they run, before those of its views; no pairs and tracks of objects."""
    needed = [n for step in view_steps(want) for n in needed_of_house(step, house_id)]
    extra_steps = ("pairs",) * want.pairs + ("tracks",) * want.tracks
    return ("house", "cameras", *needed, *(() if keys.is_object(house_id) else extra_steps))


def needed_of_house(step: str, house_id: str) -> tuple[str, ...]:
    """Steps of the house that a step of its view needs and does not read: none of an object."""
    if keys.is_object(house_id):
        return ()
    return tuple(name for name in STEPS[step].needs if not STEPS[name].per_view)


def has_light(want: Wanted) -> bool:
    """Whether pictures are made besides those of OpenGL, which a machine without it then leaves out."""
    return any(mode.groups for mode in want.modes)


def view_steps(want: Wanted) -> tuple[str, ...]:
    """Steps of one view in the order they run; either light mode makes both, since one trace fills both."""
    names = ["truth"]
    names += [name for name in OPENGL_STEPS if Mode(name) in want.modes]
    if has_light(want):
        names += ["light", "develop"]
    return (*names, "view")


def step_digest(
    step: Step,
    recipe: Recipe,
    house_id: str,
    view_id: str | None,
    inputs: Mapping[str, str],
    extra: object = None,
) -> str:
    """Digest of a step by its inputs (step -> digest of its marker) and extra dependencies."""
    return keys.digest(
        step.name,
        step.version,
        house_id,
        view_id,
        recipe.digest(*step.groups),
        dict(sorted(inputs.items())),
        extra,
    )


def leaves_out_dark_rooms(recipe: Recipe, want: Wanted, house_id: str) -> bool:
    """True if light is wanted and the recipe chooses the cameras: then illuminance decides on views."""
    is_chosen = source_of(recipe.cameras).is_ranked and recipe.selection.min_room_lx > 0
    return is_chosen and "illuminance" in house_steps(want, house_id)


def lit_views(
    rows: Iterable[tuple[str, str, float]],
    floor_lux: Mapping[str, Mapping[str, float]],
    least_lx: float,
) -> tuple[list[tuple[str, str, float]], list[str]]:
    """(view id, room id, score) of bright rooms (or without lx), and the reasons for omitting others."""
    bright: list[tuple[str, str, float]] = []
    left_out: dict[str, int] = {}
    for row in rows:
        lux = floor_lux.get(row[1])
        if lux is None or sum(lux.values()) >= least_lx:
            bright.append(row)
        else:
            left_out[row[1]] = left_out.get(row[1], 0) + 1
    return bright, [
        f"room {room}: {n} view{'s' * (n != 1)} left out: {sum(floor_lux[room].values()):g} lx on"
        f" the floor by all light, less than selection.min_room_lx = {least_lx:g}"
        for room, n in left_out.items()
    ]


def chosen_views(rows: Iterable[tuple[str, str, float]], n_views: int, recipe: Recipe) -> list[str]:
    """The n_views (0 = all) ids to make: first frames, else spread over rooms; a rig's instant is one."""
    all_rows = {row[0]: row for row in rows}
    first_of = {view: recipe.shot(view).first.id for view in all_rows}
    # A plugin's id may end like that of a rig's camera: then there is no such first view.
    first_of = {view: first if first in all_rows else view for view, first in first_of.items()}
    firsts = [row for view, row in all_rows.items() if first_of[view] == view]
    if source_of(recipe.cameras).is_sequence:
        chosen = {view for view, _room, _score in firsts[: n_views or None]}
    else:
        chosen = set(spread(firsts, n_views))
    return [view for view in first_of if first_of[view] in chosen]


def spread(view_rooms: Iterable[tuple[str, str, float]], n_views: int) -> list[str]:
    """The n_views ids of (view id, room id, score): best first, room after room; all, in order, for 0."""
    rows = list(view_rooms)
    if n_views <= 0 or n_views >= len(rows):
        return [view for view, _room, _score in rows]
    # A room's best view is in the first round, its second best in the next.
    rounds: dict[str, int] = {}
    ranked: list[tuple[int, float, str]] = []
    for view, room, score in sorted(rows, key=lambda r: (-r[2], r[0])):
        turn = rounds.get(room, 0)
        rounds[room] = turn + 1
        ranked.append((turn, -score, view))
    chosen = {view for _turn, _score, view in sorted(ranked)[:n_views]}
    return [view for view, _room, _score in rows if view in chosen]
