"""Verbs that hand labels on: export, pack, classes, label-sheet. Effects: read a folder, write files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import VIEW, Verb, counted, echo, echo_json, size_of, warn
from pbrs_farm.commands.options import add_options, request_from
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.form import HomeForm, form_names, form_of

if TYPE_CHECKING:
    from pbrs_farm.export.chosen_view import Choice
    from pbrs_farm.export.export_options import ExportOptions

SPLIT = "by home: train/val/test (default 80/10/10); without it all views are one"


def add_verbs(verb: Verb) -> None:
    """Add export, pack, classes and label-sheet."""
    from pbrs_farm.export.export_options import ExportOptions
    from pbrs_farm.run.request import ModelsOption

    p = verb("export", _export)
    add = p.add_argument
    add("folder", metavar="ROOT", help="an output folder, or s3://bucket/prefix")
    add(
        "--to",
        required=True,
        choices=form_names(),
        help="docs/formats/export.md describes the forms",
    )
    add("--out", type=Path, help="new folder (default FOLDER_<form>)")
    add("--selection", metavar="RUN", help="only what this run keeps")
    add_options(p, ExportOptions)
    add("--split", nargs="?", const="80/10/10", metavar="SHARES", help=SPLIT)

    p = verb("pack", _pack_views)
    add = p.add_argument
    add("root", metavar="ROOT", help="an output folder, or s3://bucket/prefix")
    add("--out", type=Path, required=True, help="new folder")
    add("--to", choices=("shards", "parquet"), default="shards", help="default shards")
    add("--selection", metavar="RUN", help="only what this run keeps")
    layers = "colour normal depth class40 instance boundary (default all)"
    add("--layers", nargs="+", metavar="LAYER", help=layers)
    modes = "opengl_dl opengl_il mlt_ol mlt_il_ol (default all there are)"
    add("--modes", nargs="+", metavar="MODE", help=modes)
    add("--size", metavar="WxH", help="resize to, e.g. 320x240 (default as rendered)")
    add("--split", nargs="?", const="80/10/10", metavar="SHARES", help=SPLIT)
    add("--shard-size", type=int, default=200, metavar="N", help="views a shard (default 200)")
    text = "png (default) keeps every bit; jpeg:95 is a quarter as large and loses a little"
    add("--colour", default="png", metavar="FORM", help=text)
    add("--seed", type=int, default=0, help="of the order of views (default 0)")

    p = verb("classes", _count_classes)
    p.add_argument("folder", metavar="FOLDER|HOME", help="an output folder, or a home to read")
    add_options(p, ModelsOption)
    p.add_argument("--json", action="store_true", help="as JSON")

    p = verb("label-sheet", _label_sheet)
    p.add_argument("view", type=Path, help=VIEW)
    p.add_argument("--out", type=Path, help="PNG (default VIEW_labels.png here)")


def _export(args: argparse.Namespace) -> int:
    if isinstance(form_of(args.to), HomeForm):
        return _export_homes(args)
    from pbrs_farm.core.house_split import shares_from_text
    from pbrs_farm.export.export_options import ExportOptions
    from pbrs_farm.export.export_views import export, remarks_of
    from pbrs_farm.run.output_root import as_files
    from pbrs_farm.settings import settings_from_environment

    choice = choice_of(request_from(args, ExportOptions))
    shares = shares_from_text(args.split) if args.split else None
    out = args.out or Path(f"{Path(args.folder).resolve().name}_{args.to}")
    with as_files(args.folder, settings_from_environment().store) as folder:
        n_views, n_files = export(
            folder, out, args.to, selection=args.selection, choice=choice, shares=shares
        )
    echo(f"{out}: {counted(n_views, 'view')}, {counted(n_files, 'file')}")
    for remark in remarks_of(out):
        warn(remark)
    return 0


def choice_of(options: ExportOptions) -> Choice:
    """What is exported by options; BadInput for a layer, mode, size or table that there is not."""
    from pbrs_farm.export.chosen_view import Choice
    from pbrs_farm.formats.class_map import class_map

    # None is all there is: layers (but radiance), modes, the stored size.
    return Choice(
        layers=options.layers or None,
        modes=options.modes or None,
        size=size_of(options.size),
        views_per_shard=options.shard_size,
        classes=class_map(options.classes) if options.classes else None,
        lidar=options.lidar,
    )


def _export_homes(args: argparse.Namespace) -> int:
    from pbrs_farm.export.export_homes import export_homes
    from pbrs_farm.run.output_root import as_files
    from pbrs_farm.settings import settings_from_environment

    options = {"--selection": args.selection, "--layers": args.layers, "--modes": args.modes}
    options |= {"--size": args.size, "--classes": args.classes, "--split": args.split}
    for option, value in options.items():
        if value:
            raise BadInput(option, "", f"chooses of views; --to {args.to} writes homes")
    out = args.out or Path(f"{Path(args.folder).resolve().name}_{args.to}")
    with as_files(args.folder, settings_from_environment().store) as folder:
        n_homes, n_files, remarks = export_homes(folder, out, args.to)
    echo(f"{out}: {counted(n_homes, 'home')}, {n_files} files")
    for remark in remarks:
        warn(remark)
    return 0


def _pack_views(args: argparse.Namespace) -> int:
    from pbrs_farm.core.house_split import shares_from_text
    from pbrs_farm.views.open_views import open_views
    from pbrs_farm.views.packing.pack_shards import pack
    from pbrs_farm.views.packing.packing_plan import Packing
    from pbrs_farm.views.view_sample import LAYERS

    colour, _, quality = args.colour.partition(":")
    if quality and not quality.isdigit():
        raise BadInput("--colour", args.colour, "expected png, jpeg or jpeg:QUALITY")
    views = open_views(args.root)
    if args.selection is not None:
        views = views.only(selection=args.selection)
    packing = Packing(
        size=size_of(args.size),
        layers=tuple(args.layers or LAYERS),
        modes=tuple(args.modes or views[:1].modes),
        shares=shares_from_text(args.split) if args.split else None,
        views_per_shard=args.shard_size,
        colour=colour,
        quality=int(quality or 95),
        seed=args.seed,
    )
    packed = pack(views, args.out, packing, form=args.to, tell=echo)
    # Say what was left out: a run may still go on.
    if packed.left_out:
        at, why = next(iter(packed.left_out.items()))
        warn(f"{counted(len(packed.left_out), 'view')} left out, {at}: {why}")
    said = ", ".join(f"{split} {n}" for split, n in packed.n_views.items())
    echo(f"{args.out}: {said} views, {packed.n_files} files, {packed.n_bytes / 1e6:.1f} MB")
    return 0


def _count_classes(args: argparse.Namespace) -> int:
    from pbrs_farm.gallery.class_statistics import class_statistics

    if not (Path(args.folder) / "houses").is_dir() and _is_home(args.folder):
        return _home_classes(args)
    statistics = class_statistics(Path(args.folder))
    if args.json:
        echo_json(statistics.model_dump(mode="json"))
    else:
        echo(statistics.text())
    return 0


def _is_home(word: str) -> bool:
    path = Path(word)
    return not path.is_dir() or (path / "house.json").is_file()


def _home_classes(args: argparse.Namespace) -> int:
    """What a home's pieces are and why, without rendering it."""
    from pbrs_farm.core.recipe import ReadFields
    from pbrs_farm.gallery.class_decisions import class_decisions, decisions_text
    from pbrs_farm.prepare.read_source import read_house
    from pbrs_farm.prepare.source import resolve

    house = read_house(resolve(args.folder, models=args.models), ReadFields())
    fields = ("kind", "nyu40", "name", "source_class", "tags")
    decisions = class_decisions({f: getattr(item, f) for f in fields} for item in house.items)
    if args.json:
        echo_json([d.model_dump(mode="json") for d in decisions])
    else:
        echo(decisions_text(decisions))
    return 0


def _label_sheet(args: argparse.Namespace) -> int:
    from pbrs_farm.formats.output_folder import views_of
    from pbrs_farm.gallery.label_sheet import label_sheet
    from pbrs_farm.images import png_from_array
    from pbrs_farm.store.folder import FolderStore

    # The root is OUT of OUT/houses/<house>/views/<view>.
    folder = args.view.resolve()
    root = folder.parents[3] if len(folder.parents) > 3 else folder
    view = next((v for v in views_of(root) if v.folder.resolve() == folder), None)
    if view is None:
        raise BadInput(args.view, "", "no view's folder", hint="OUT/houses/<house>/views/<view>")
    out = args.out or Path(f"{folder.name}_labels.png")
    FolderStore(out.parent).put(out.name, png_from_array(label_sheet(view)))
    echo(str(out))
    return 0
