"""Verbs that run one stage and explain it: repair, cameras. Effects: read a home, write files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import Verb, add_recipe, dump, recipe_of, say

if TYPE_CHECKING:
    from pbrs_farm.sample import CameraReport
    from pbrs_farm.sample.report import SectorReport


def add_verbs(verb: Verb) -> None:
    """Add repair and cameras."""
    p = verb(
        "repair",
        _repair,
        "read and repair a home: bundle, report in plain words, a cut through the walls",
    )
    p.add_argument("home", help="file, SUNCG house folder, example home's name, or `builtin`")
    p.add_argument(
        "--out",
        type=Path,
        required=True,
        help="folder for house.glb, house.json, repair.json, cut_<level>.svg",
    )
    add_recipe(p)
    p = verb("cameras", _cameras, "choose views and say why every other candidate was refused")
    p.add_argument("home", help="file, SUNCG house folder, example home's name, or `builtin`")
    p.add_argument(
        "--map",
        type=Path,
        default=None,
        metavar="FILE",
        help="floor plan with candidates, refusals and winners: FILE.png and FILE.svg",
    )
    p.add_argument(
        "--out",
        type=Path,
        default=None,
        metavar="FILE",
        help="write the views to FILE (cameras.json)",
    )
    p.add_argument(
        "--per-sector", type=int, default=None, metavar="K", help="K diverse views a sector"
    )
    p.add_argument("--exact", action="store_true", help="score every candidate at full size")
    p.add_argument(
        "--cameras", choices=("sampled", "stored"), default=None, help="where viewpoints come from"
    )
    p.add_argument("--json", action="store_true", help="views and report as JSON")
    add_recipe(p)


def _repair(args: argparse.Namespace) -> int:
    from pbrs_farm.formats.house_bundle import bundle_from_house
    from pbrs_farm.formats.serialise import json_bytes
    from pbrs_farm.read.source import read_house, resolve
    from pbrs_farm.repair import cut_picture, plain_words
    from pbrs_farm.run.steps import repaired_house
    from pbrs_farm.store.folder import FolderStore

    recipe = recipe_of(args)
    source = resolve(args.home)
    house, report = repaired_house(source, recipe)
    store = FolderStore(args.out)
    glb, description = bundle_from_house(house)
    store.put("house.glb", glb)
    store.put("house.json", description)
    store.put("repair.json", json_bytes(report))
    before = read_house(source, recipe.read)
    cuts = [f"cut_{level.id}.svg" for level in house.levels]
    for level, name in zip(house.levels, cuts, strict=True):
        store.put(name, cut_picture(before, house, level.id).encode())
    say(plain_words(report))
    say(f"{args.out}: house.glb house.json repair.json {' '.join(cuts)}")
    return 1 if report.is_leaking else 0


def _cameras(args: argparse.Namespace) -> int:
    from pbrs_farm.core import keys
    from pbrs_farm.core.house import geometry_from_house
    from pbrs_farm.formats.cameras_json import cameras_document
    from pbrs_farm.formats.serialise import json_bytes
    from pbrs_farm.images import png_from_array
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.read.source import resolve
    from pbrs_farm.run.steps import camera_seed, repaired_house
    from pbrs_farm.sample import sample_cameras
    from pbrs_farm.sample.camera_map import camera_map_rgb, camera_map_svg
    from pbrs_farm.store.folder import FolderStore

    recipe = recipe_of(args)
    house, _report = repaired_house(resolve(args.home), recipe)
    counter = Caster(geometry_from_house(house)).item_counts
    sampling = sample_cameras(house, recipe.cameras, camera_seed(house.id, recipe), counter)
    document = cameras_document(sampling.views, sampling.report.model_dump(mode="json"))
    if args.out is not None:
        FolderStore(args.out.parent).put(args.out.name, json_bytes(document))
    if args.map is not None:
        folder, name = FolderStore(args.map.parent), keys.slug(args.map.stem)
        folder.put(f"{name}.png", png_from_array(camera_map_rgb(house, sampling)))
        folder.put(f"{name}.svg", camera_map_svg(house, sampling).encode())
    if args.json:
        dump(document)
    else:
        _tell(sampling.report)
    return 0


def _tell(report: CameraReport) -> None:
    for room in report.rooms:
        say(f"{room.room_id} {room.name}" + (f": no cameras: {room.reason}" if room.reason else ""))
        for s in room.sectors:
            refused = ", ".join(f"{n} {why}" for why, n in s.refused.items() if n)
            say(f"  sector {s.sector}: {_outcome(s)}; {s.n_candidates} candidates: {refused}")
    say(f"{report.n_views} views of {report.n_candidates} candidates")


def _outcome(sector: SectorReport) -> str:
    if sector.winner_score is None:
        return f"no view, {sector.reason}" if sector.reason else "no view"
    runner_up = sector.runner_up_score
    beside = "no runner-up" if runner_up is None else f"runner-up {runner_up:.5g}"
    return f"{', '.join(sector.views)} scores {sector.winner_score:.5g}, {beside}"
