"""The verb scatter: place the user's models in homes, with cameras aimed at them. Effects: those of rendering."""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import (
    Verb,
    at_least,
    counted,
    dress_seeds,
    echo,
    echo_notes,
    recipe_of,
    warn,
)
from pbrs_farm.commands.options import add_options
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.number_ranges import ends_of

if TYPE_CHECKING:
    from pbrs_farm.core.recipe import Recipe
    from pbrs_farm.scene.home import Home


def add_verbs(verb: Verb) -> None:
    """Add scatter."""
    from pbrs_farm.run.request import SeededRecipeOptions

    add_options(verb("scatter", _scatter), SeededRecipeOptions)


def _scatter(args: argparse.Namespace) -> None:
    from pbrs_farm.formats.bop_camera import camera_of_bop
    from pbrs_farm.progress import counting_bar
    from pbrs_farm.scene.models import models
    from pbrs_farm.scene.pictures import render
    from pbrs_farm.store import store_from_url
    from pbrs_farm.views.stored_root import finished_views

    for name in ("count", "scenes", "views"):
        at_least(f"--{name}", getattr(args, name), 1)
    nearest, farthest = (_metres(end) for end in ends_of(args.distance))
    distance = nearest, farthest
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", UserWarning)
        items = [
            model
            for pattern in args.models
            for model in models(
                pattern, unit=args.unit, size_m=args.size_m, up=args.up, credit=args.credit
            )
        ]
    for warning in heard:
        warn(str(warning.message))
    recipe = recipe_of(args)
    size, k = (recipe.image.width_px, recipe.image.height_px), None
    if args.camera is not None:
        size, k = camera_of_bop(args.camera)
    seeds = dress_seeds(args.dress)
    notes: Counter[str] = Counter()
    finished = finished_views(store_from_url(args.out))
    n_made = n_kept = 0
    n_scenes = len(args.homes) * max(1, len(seeds)) * args.scenes
    with counting_bar("views") as tell:
        tell(0, n_scenes * args.views)
        for home in _homes_of(args.homes, recipe, seeds):
            for seed in range(recipe.seed, recipe.seed + args.scenes):
                scene = home.scatter(
                    items,
                    args.count,
                    on=args.on or None,
                    in_=args.room,
                    seed=seed,
                    physics=args.physics,
                    floating=args.floating,
                )
                cameras = scene.cameras_around(
                    n=args.views,
                    distance_m=distance,
                    min_visible=args.visible,
                    size=size,
                    K=k,
                    seed=seed,
                )
                notes.update(note.kind for note in scene.house.notes)
                todo = [c for c in cameras if (scene.id, c.id) not in finished]
                n_kept += len(cameras) - len(todo)
                # One by one, so that a killed command loses at most one view.
                for camera in todo:
                    frame = render(scene, camera, modes=args.modes, layers=args.layers)
                    frame.save(args.out)
                    n_made += 1
                    n_seen = sum("model" in row for row in frame.instances)
                    echo(f"{frame.id}: {n_seen} models seen")
                    tell(n_made + n_kept, n_scenes * args.views)
    total = counted(n_made + n_kept, "view")
    echo(f"{args.out}: {total}, {n_kept} already there; `pbrs-farm export {args.out} --to bop`")
    echo_notes(notes, args.out)


def _homes_of(words: Sequence[str], recipe: Recipe, seeds: Sequence[int]) -> Iterator[Home]:
    """Each home, dressed by each seed if there are any; loaded one at a time."""
    from pbrs_farm.scene.home import load

    for word in words:
        bare = load(word, recipe)
        yield from (bare.dress(seed) for seed in seeds) if seeds else [bare]


def _metres(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < 100:
        raise BadInput("--distance", text, "expected metres, as 0.5..1.2")
    return value
