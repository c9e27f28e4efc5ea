"""Verbs of selection: reference build, select. Effects: read photographs, write the output root."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import (
    Verb,
    echo,
    echo_json,
    fields_set,
    folder_of,
    put_files,
    store_of,
)
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import (
    HistogramFields,
    Recipe,
    SelectionFields,
    recipe_from_json,
    recipe_from_name,
)

if TYPE_CHECKING:
    from pbrs_farm.curate.selection_summary import SelectionSummary
    from pbrs_farm.selection.reference_set import Reference


def add_verbs(verb: Verb) -> None:
    """Add reference and select."""
    verb("reference", _reference)
    verb("select", _select)


def _overrides(arguments: list[str]) -> dict[str, str]:
    expected = "histogram.FIELD=value or selection.FIELD=value"
    return fields_set(arguments, expected, ("histogram.", "selection."))


def _built(
    args: argparse.Namespace, source: Path, histogram: HistogramFields, selection: SelectionFields
) -> Reference:
    """Build the reference from photographs, read according to the options."""
    from pbrs_farm.curate.reference_build import PhotoOptions, build_reference

    options = PhotoOptions(args.depth_scale, args.sun_rgbd, not args.no_crop)
    return build_reference(source, histogram, selection, options)


def _reference(args: argparse.Namespace) -> None:
    from pbrs_farm.selection.binning import table_text
    from pbrs_farm.selection.reference_set import bytes_from_reference

    recipe = recipe_from_name("fast", _overrides(args.set))
    reference = _built(args, args.source, recipe.histogram, recipe.selection)
    put_files(args.out.parent, {args.out.name: bytes_from_reference(reference)})
    echo(table_text(reference.facts.table, reference.facts.binning))
    echo(f"{args.out}: {len(reference.facts.ids)} photographs")


def _select(args: argparse.Namespace) -> int:
    from pbrs_farm.curate.reference_build import read_reference
    from pbrs_farm.curate.selection_run import select

    store = store_of(args.folder)
    if (args.reference is None) == (args.by is None):
        raise BadInput("select", "", "give either --reference or --by")
    if args.by is not None:
        return _select_by(args)
    recipe = recipe_from_json(store.get("recipe.json"), f"{store.url}: recipe.json")
    fields = _fields(recipe, args)
    # Read the reference, or build it from photographs with the settings of the views' recipe.
    path = args.reference
    is_file = path.is_file() and path.suffix != ".mat"
    reference = read_reference(path) if is_file else _built(args, path, recipe.histogram, fields)
    summary = select(store, reference, fields, reference_name=str(path), run=args.run)
    # Write the page from the stored run.
    if args.report:
        from pbrs_farm.curate.selection_report import selection_report

        shown = _photograph_files(args.photographs or path)
        html = selection_report(store, reference, fields, run=args.run, photographs=shown)
        store.put(keys.selection_key(args.run, "html"), html.encode())
    if args.json:
        echo_json(summary.model_dump(mode="json"))
        return 0
    _echo_summary(summary)
    echo(keys.selection_key(args.run, "html" if args.report else "parquet"))
    return 0


def _select_by(args: argparse.Namespace) -> int:
    """Judge every view, or those that a run keeps, by rules, and write selection/<run>.jsonl."""
    from pbrs_farm.curate.teaching_rules import judged_by, write_verdicts
    from pbrs_farm.export.export_views import finished_entries

    with folder_of(args.folder) as folder:
        verdicts = judged_by(finished_entries(folder, args.selection), args.by)
    summary = write_verdicts(store_of(args.folder), args.run, args.by, verdicts)
    if args.json:
        echo_json(summary)
        return 0
    echo(f"{summary['kept']} of {len(verdicts)} views kept")
    for reason, n in summary["reasons"].items():
        echo(f"  {n:>6}  {reason}")
    echo(keys.selection_key(args.run, "jsonl"))
    return 0


def _photograph_files(folder: Path) -> dict[str, Path]:
    """Id -> picture of the photographs in a folder; {} for a file."""
    from pbrs_farm.curate.photographs import pairs_in

    return {pair.id: pair.rgb for pair in pairs_in(folder)} if folder.is_dir() else {}


def _echo_summary(summary: SelectionSummary) -> None:
    """Print how many views are kept, and how many each reason rejects."""
    echo(f"{summary.kept} of {summary.views} views kept, {summary.scored} scored")
    for reason, n in summary.reasons.items():
        echo(f"  {n:>6}  {reason}")


def _fields(recipe: Recipe, args: argparse.Namespace) -> SelectionFields:
    """The thresholds: the stored recipe's, then --set, then the options."""
    changed = _overrides(args.set)
    for field in ("score_mode", "balance", "per_room_cap"):
        if getattr(args, field) is not None:
            changed[f"selection.{field}"] = str(getattr(args, field))
    # Validate all of them together, as a recipe.
    thresholds = {
        f"selection.{k}": str(v) for k, v in recipe.selection.model_dump(mode="json").items()
    }
    return recipe_from_name("fast", thresholds | changed).selection
