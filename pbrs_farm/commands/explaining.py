"""Verbs that run one stage and explain it: dress, catalogue, repair, cameras. Effects: read a home, write files."""

from __future__ import annotations

import argparse
import csv
import io
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pbrs_farm.commands.arguments import (
    Verb,
    at_least,
    counted,
    dress_seeds,
    echo,
    echo_json,
    put_files,
    recipe_of,
    warn,
)
from pbrs_farm.commands.options import add_options
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.shown_text import shown
from pbrs_farm.installation import need

if TYPE_CHECKING:
    from pbrs_farm.core.house import House
    from pbrs_farm.core.recipe import Recipe
    from pbrs_farm.progress import ShareTeller
    from pbrs_farm.sample.camera_report import CameraReport, SectorReport
    from pbrs_farm.sample.camera_source import Sampling


# Approximate shares of the time of `dress`; its pictures take the rest.
_SHARE_OF_CATALOGUE: Final = 0.05
_SHARE_OF_HOUSE: Final = 0.65


def add_verbs(verb: Verb) -> None:
    """Add dress, catalogue, repair and cameras."""
    from pbrs_farm.run.request import (
        CameraOptions,
        LibraryOptions,
        ModelsOption,
        RecipeOptions,
        SeededRecipeOptions,
    )

    models = {
        "dress": (_dress, (ModelsOption, LibraryOptions, RecipeOptions)),
        "catalogue": (_catalogue, ()),
        "repair": (_repair, (ModelsOption, SeededRecipeOptions)),
        "cameras": (_cameras, (ModelsOption, CameraOptions, SeededRecipeOptions)),
    }
    for name, (handler, options) in models.items():
        p = verb(name, handler)
        for model in options:
            add_options(p, model)


def _catalogue(args: argparse.Namespace) -> int:
    from pbrs_farm.prepare.dress_catalogue import own_catalogue

    loaded = own_catalogue(args.libraries)
    groups = Counter(piece.group for piece in loaded.pieces)
    kinds = Counter(note.kind for note in loaded.notes)
    is_usable = bool(loaded.pieces or loaded.pictures)
    if args.refused is not None:
        rows = [(note.kind, note.place, note.text) for note in loaded.notes]
        text = io.StringIO(newline="")
        csv.writer(text).writerows([("kind", "model", "reason"), *rows])
        args.refused.parent.mkdir(parents=True, exist_ok=True)
        args.refused.write_text(text.getvalue(), encoding="utf-8")
    if args.json:
        echo_json(
            {
                "pieces": len(loaded.pieces),
                "groups": groups,
                "notes": kinds,
                "digest": loaded.digest,
            }
        )
        return 0 if is_usable else 1
    echo(f"{counted(len(loaded.pieces), 'piece')}, {counted(len(loaded.pictures), 'picture')}")
    for group, n in sorted(groups.items(), key=lambda pair: (-pair[1], pair[0])):
        echo(f"  {n:6} {group.replace('_', ' ')}")
    for kind, n in kinds.most_common():
        first = next(note for note in loaded.notes if note.kind == kind)
        echo(f"{n} {kind}: {first.place}: {first.text}{' ...' if n > 1 else ''}")
    if not is_usable:
        warn(f"{', '.join(map(str, args.libraries))}: no usable piece or picture")
    return 0 if is_usable else 1


def _dress(args: argparse.Namespace) -> int:
    from pbrs_farm.core import keys
    from pbrs_farm.crash_notes import note_step
    from pbrs_farm.dress.report import summary_of_dressing
    from pbrs_farm.formats.house_bundle import bundle_from_house
    from pbrs_farm.formats.serialise import json_bytes
    from pbrs_farm.prepare.dress_catalogue import fetch_catalogue
    from pbrs_farm.prepare.finished_house import finished_house
    from pbrs_farm.prepare.source import resolve, variants
    from pbrs_farm.progress import share_bar
    from pbrs_farm.run.attributions import attribution_text

    at_least("--views", args.views, 0)
    if args.out.exists() and not args.out.is_dir():
        raise BadInput(args.out, "", "is not a folder")
    need("mitsuba", "drjit", *(["moderngl"] if args.views else []))
    seeds = dress_seeds(args.dress, "--seed")
    if len(seeds) != 1:
        raise BadInput("--seed", args.dress, "expected one seed, such as 3")
    recipe = recipe_of(args)
    (source,) = variants(resolve(args.home, models=args.models), seeds)
    with share_bar("dress") as tell:
        note_step(args.home, "catalogue")
        tell("furniture", 0.0)
        fetch_catalogue(recipe.dress)
        tell(args.home, _SHARE_OF_CATALOGUE)
        of_house = _SHARE_OF_HOUSE if args.views else 1.0 - _SHARE_OF_CATALOGUE
        house, repairs, report = finished_house(
            source, recipe, lambda share: tell(args.home, _SHARE_OF_CATALOGUE + of_house * share)
        )
        if report is None:
            raise BadInput(args.home, "", "a single object cannot be dressed")
        pictures = _before_after(args, house, recipe, tell) if args.views else {}
    glb, description = bundle_from_house(house)
    text = attribution_text([house.source.attribution], report.credits)
    files = {
        "house.glb": glb,
        "house.json": description,
        keys.DRESS: json_bytes(report),
        "repair.json": json_bytes(repairs),
        keys.ATTRIBUTION: text.encode(),
    }
    files = {name: data for name, data in files.items() if data}
    files |= pictures
    put_files(args.out, files)
    echo(summary_of_dressing(report))
    echo(f"{args.out}: {' '.join(files)}")
    return 0 if report.is_sound else 1


def _before_after(
    args: argparse.Namespace, house: House, recipe: Recipe, tell: ShareTeller
) -> dict[str, bytes]:
    """File name -> picture of the home before and after."""
    from pbrs_farm.crash_notes import note_step
    from pbrs_farm.gallery.contact_sheet import before_after_png
    from pbrs_farm.prepare.finished_house import repaired_house
    from pbrs_farm.prepare.source import resolve
    from pbrs_farm.run.view_pairs import pairs

    # the same recipe without dressing
    undressed = recipe.model_copy(update={"dress": type(recipe.dress)()})
    bare, _report = repaired_house(resolve(args.home, models=args.models), undressed)
    note_step(args.home, "before and after")
    files = {}
    done = _SHARE_OF_CATALOGUE + _SHARE_OF_HOUSE
    tell("before and after", done)
    for n, pair in enumerate(pairs(bare, house, recipe, args.views)):
        caption = f"{house.name}, view {pair.view.id}, bare and dressed"
        # Licences of homes require a credit on every picture.
        caption = "; ".join(t for t in (caption, house.source.attribution) if t)
        name = f"before_after{f'_{n + 1}' if n else ''}.png"
        files[name] = before_after_png(pair.before, pair.after, caption)
        tell("before and after", done + (1 - done) * (n + 1) / args.views)
    if not files:
        warn("no room has a view, so no before and after picture")
    return files


def _repair(args: argparse.Namespace) -> int:
    from pbrs_farm.formats.house_bundle import bundle_from_house
    from pbrs_farm.formats.serialise import json_bytes
    from pbrs_farm.prepare.finished_house import repaired_house
    from pbrs_farm.prepare.read_source import read_house
    from pbrs_farm.prepare.source import resolve
    from pbrs_farm.repair import section_svg, summary_of_report

    recipe = recipe_of(args)
    source = resolve(args.home, models=args.models)
    house, report = repaired_house(source, recipe)
    glb, description = bundle_from_house(house)
    files = {"house.glb": glb, "house.json": description, "repair.json": json_bytes(report)}
    # Each level's walls before and after.
    before = read_house(source, recipe.read)
    files |= {
        f"cut_{level.id}.svg": section_svg(before, house, level.id).encode()
        for level in house.levels
    }
    put_files(args.out, files)
    echo(summary_of_report(report))
    echo(f"{args.out}: {' '.join(files)}")
    return 1 if report.is_leaking or report.structure.walls_lost else 0


def _cameras(args: argparse.Namespace) -> None:
    from pbrs_farm.crash_notes import note_step
    from pbrs_farm.formats.cameras_json import cameras_document
    from pbrs_farm.formats.serialise import json_bytes
    from pbrs_farm.prepare.finished_house import repaired_house
    from pbrs_farm.prepare.source import resolve
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.run.chosen_cameras import chosen_cameras
    from pbrs_farm.run.steps import camera_seed

    recipe = recipe_of(args)
    house, _report = repaired_house(resolve(args.home, models=args.models), recipe)
    # Score candidates by the items that their rays hit.
    caster = Caster.of_house(house)
    note_step(args.home, "cameras")
    seed = camera_seed(house.id, recipe)
    sampling = chosen_cameras(house, recipe, seed, caster)
    document = cameras_document(sampling.views, sampling.report.model_dump(mode="json"))
    if args.out is not None:
        put_files(args.out.parent, {args.out.name: json_bytes(document)})
    if args.map is not None:
        write_map(args.map, house, sampling)
    if args.json:
        echo_json(document)
    else:
        _echo_report(sampling.report)


def write_map(path: Path, house: House, sampling: Sampling) -> None:
    """Write the floor plan with the candidates as PNG and as SVG."""
    from pbrs_farm.images import png_from_array
    from pbrs_farm.sample.camera_map import camera_map_rgb, camera_map_svg

    # Only these endings are removed; other dots are part of the name.
    name = path.stem if path.suffix.lower() in (".png", ".svg") else path.name
    png = png_from_array(camera_map_rgb(house, sampling))
    svg = camera_map_svg(house, sampling).encode()
    put_files(path.parent, {f"{name}.png": png, f"{name}.svg": svg})


def _echo_report(report: CameraReport) -> None:
    """Print each room and, for each of its sectors, the outcome and the rejections by rule."""
    for room in report.rooms:
        reason = f": no cameras: {room.reason}" if room.reason else ""
        echo(f"{room.room_id} {shown(room.name)}{reason}")
        for s in room.sectors:
            rejected = ", ".join(f"{n} {rule}" for rule, n in s.refused.items() if n)
            echo(f"  sector {s.sector}: {_outcome(s)}; {s.n_candidates} candidates: {rejected}")
    for note in report.notes:
        echo(shown(note))
    echo(f"{report.n_views} views of {report.n_candidates} candidates")


def _outcome(sector: SectorReport) -> str:
    if sector.winner_score is None:
        return f"no view, {sector.reason}" if sector.reason else "no view"
    runner_up = sector.runner_up_score
    beside = "no runner-up" if runner_up is None else f"runner-up {runner_up:.5g}"
    return f"{', '.join(sector.views)} scores {sector.winner_score:.5g}, {beside}"
