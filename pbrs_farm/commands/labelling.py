"""Verbs that export labels: export, pack, classes, label-sheet. Effects: read a folder, write files."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import (
    Verb,
    counted,
    echo,
    echo_json,
    folder_of,
    put_files,
    size_of,
    warn,
)
from pbrs_farm.commands.options import add_options, request_from
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.form import HomeForm, form_names, form_of

if TYPE_CHECKING:
    from pbrs_farm.core.house_split import SplitShares
    from pbrs_farm.export.chosen_view import Choice
    from pbrs_farm.export.form import Form
    from pbrs_farm.export.view_options import ViewOptions
    from pbrs_farm.views.packing.pack_options import PackOptions
    from pbrs_farm.views.packing.packing_plan import Packing


def add_verbs(verb: Verb) -> None:
    """Add export, pack, classes and label-sheet."""
    from pbrs_farm.export.view_options import ViewOptions
    from pbrs_farm.run.request import ModelsOption
    from pbrs_farm.views.packing.pack_options import PackOptions

    p = verb("export", _export)
    p.options_by_words = _add_form_options
    text = "format (docs/formats/export.md); `--to FORMAT --help` lists its options"
    p.add_argument("--to", required=True, choices=form_names(), help=text)
    add_options(p, ViewOptions)
    add_options(verb("pack", _pack_views), PackOptions)
    add_options(verb("classes", _count_classes), ModelsOption)
    verb("label-sheet", _label_sheet)


def _add_form_options(p: argparse.ArgumentParser, words: Sequence[str] | None) -> None:
    """Add the options of the named form, or of all; an option of other forms alone is an error."""
    from pbrs_farm.export.form import all_forms, form_options, no_such_option

    if words is None:
        for form in all_forms():
            if not any(f"--{name}" in p._option_string_actions for name in form_options(form)):
                _add_options_of(p, form)
        return
    chosen = argparse.ArgumentParser(add_help=False, exit_on_error=False)
    chosen.add_argument("--to")
    try:
        name = chosen.parse_known_args(words)[0].to
    except argparse.ArgumentError:
        return
    if name not in form_names():
        return
    form = form_of(name)
    _add_options_of(p, form)
    unknown = {word.partition("=")[0] for word in words if word.startswith("--")}
    for option in sorted(unknown - p._option_string_actions.keys()):
        field = option.removeprefix("--").replace("-", "_")
        if any(field in form_options(f) for f in all_forms()):
            p.error(str(no_such_option(form, field)))


def _add_options_of(p: argparse.ArgumentParser, form: Form) -> None:
    if form.options is not None:
        add_options(p, form.options, group=f"{form.name} (--to {form.name})")


def _export(args: argparse.Namespace) -> int:
    form = form_of(args.to)
    if isinstance(form, HomeForm):
        return _export_homes(args, form)
    from pbrs_farm.core.house_split import shares_from_text
    from pbrs_farm.export.export_views import export, remarks_of
    from pbrs_farm.export.view_options import ViewOptions

    choice = choice_of(request_from(args, ViewOptions))
    if form.options is not None:
        choice = replace(choice, options=request_from(args, form.options))
    shares = shares_from_text(args.split) if args.split else None
    out = args.out or Path(f"{Path(args.folder).resolve().name}_{args.to}")
    with folder_of(args.folder) as folder:
        n_views, n_files = export(
            folder, out, args.to, selection=args.selection, choice=choice, shares=shares
        )
    echo(f"{out}: {counted(n_views, 'view')}, {counted(n_files, 'file')}")
    for remark in remarks_of(out):
        warn(remark)
    return 0


def choice_of(options: ViewOptions) -> Choice:
    """The exported layers, modes, size and classes; BadInput for unknown or damaged ones."""
    from pbrs_farm.export.chosen_view import Choice
    from pbrs_farm.formats.class_map import class_map

    # None: all layers but radiance, all modes, the stored size.
    return Choice(
        layers=options.layers or None,
        modes=options.modes or None,
        size=size_of(options.size),
        classes=class_map(options.classes) if options.classes else None,
    )


def _export_homes(args: argparse.Namespace, form: HomeForm) -> int:
    from pbrs_farm.export.export_homes import export_homes
    from pbrs_farm.export.form import form_options

    of_views = {"--selection": args.selection, "--layers": args.layers, "--modes": args.modes}
    of_views |= {"--size": args.size, "--classes": args.classes, "--split": args.split}
    for option, value in of_views.items():
        if value:
            raise BadInput(option, "", f"selects views, but --to {args.to} exports homes")
    out = args.out or Path(f"{Path(args.folder).resolve().name}_{args.to}")
    options = {name: getattr(args, name) for name in form_options(form)}
    with folder_of(args.folder) as folder:
        n_homes, n_files, remarks = export_homes(folder, out, args.to, **options)
    echo(f"{out}: {counted(n_homes, 'home')}, {n_files} files")
    for remark in remarks:
        warn(remark)
    return 0


def _pack_views(args: argparse.Namespace) -> None:
    from pbrs_farm.core.house_split import shares_from_text
    from pbrs_farm.views.open_views import open_views
    from pbrs_farm.views.packing.pack_options import PackOptions
    from pbrs_farm.views.packing.pack_shards import pack

    views = open_views(args.root)
    if args.selection is not None:
        views = views.only(selection=args.selection)
    shares = shares_from_text(args.split) if args.split else None
    packing = packing_of(request_from(args, PackOptions), shares, views[:1].modes, args.seed)
    packed = pack(views, args.out, packing, form=args.to, tell=echo)
    # The run may still be in progress: name the skipped views.
    if packed.left_out:
        view, why = next(iter(packed.left_out.items()))
        warn(f"{counted(len(packed.left_out), 'view')} left out, {view}: {why}")
    counts = ", ".join(f"{split} {n}" for split, n in packed.n_views.items())
    echo(f"{args.out}: {counts} views, {packed.n_files} files, {packed.n_bytes / 1e6:.1f} MB")


def packing_of(
    options: PackOptions, shares: SplitShares | None, modes: Sequence[str], seed: int = 0
) -> Packing:
    """The packing for these options; modes: default if the options name none. BadInput for a wrong colour or size."""
    from pbrs_farm.views.packing.packing_plan import Packing
    from pbrs_farm.views.view_sample import LAYERS

    colour, _, quality = options.colour.partition(":")
    if quality and not quality.isdigit():
        raise BadInput("--colour", options.colour, "expected png, jpeg or jpeg:QUALITY")
    return Packing(
        size=size_of(options.size),
        layers=options.layers or LAYERS,
        shares=shares,
        modes=options.modes or tuple(modes),
        views_per_shard=options.shard_size,
        colour=colour,
        quality=int(quality or 95),
        seed=seed,
    )


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
    """Print the class of each item of a home, and the rule that chose it, without rendering the home."""
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


def _label_sheet(args: argparse.Namespace) -> None:
    from pbrs_farm.formats.output_folder import views_of
    from pbrs_farm.gallery.label_sheet import label_sheet
    from pbrs_farm.images import png_from_array

    # The root is OUT of OUT/houses/<house>/views/<view>.
    folder = args.view.resolve()
    root = folder.parents[3] if len(folder.parents) > 3 else folder
    view = next((v for v in views_of(root) if v.folder.resolve() == folder), None)
    if view is None:
        raise BadInput(
            args.view, "", "not the folder of a view", hint="OUT/houses/<house>/views/<view>"
        )
    out = args.out or Path(f"{folder.name}_labels.png")
    put_files(out.parent, {out.name: png_from_array(label_sheet(view))})
    echo(str(out))
