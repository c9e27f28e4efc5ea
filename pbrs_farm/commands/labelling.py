"""Verbs that hand labels on: export, classes, label-sheet. Effects: read a folder, write files."""

from __future__ import annotations

import argparse
from pathlib import Path

from pbrs_farm.commands.arguments import VIEW, Verb, echo, echo_json
from pbrs_farm.core.errors import BadInput

FORMS = ("coco", "hdf5", "webdataset", "released")


def add_verbs(verb: Verb) -> None:
    """Add export, classes and label-sheet."""
    p = verb("export", _export, "finished views in the form another tool reads")
    add = p.add_argument
    add("folder", type=Path)
    add("--to", required=True, choices=FORMS, help="docs/formats.md describes the forms")
    add("--out", type=Path, help="new folder (default FOLDER_<form>)")
    add("--selection", metavar="RUN", help="only what this run keeps")

    p = verb("classes", _classes, "how often each class is seen, and by which rule")
    p.add_argument("folder", metavar="FOLDER|HOME", help="an output folder, or a home to read")
    p.add_argument("--json", action="store_true", help="as JSON")

    p = verb("label-sheet", _label_sheet, "a view's labels over its picture, an edge magnified")
    p.add_argument("view", type=Path, help=VIEW)
    p.add_argument("--out", type=Path, help="PNG (default VIEW_labels.png here)")


def _export(args: argparse.Namespace) -> int:
    from pbrs_farm.export.export_views import export

    out = args.out or Path(f"{args.folder.resolve().name}_{args.to}")
    n_views, n_files = export(args.folder, out, args.to, selection=args.selection)
    echo(f"{out}: {n_views} views, {n_files} files")
    return 0


def _classes(args: argparse.Namespace) -> int:
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
    from pbrs_farm.read.source import resolve
    from pbrs_farm.run.house_of_source import house_of_source

    house = house_of_source(resolve(args.folder), ReadFields())
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
