"""`pbrs-farm export`: the views of an output folder in the forms of other tools.

Effects: reads an output folder, writes a new folder; it appears whole or not at all. The forms are
the modules of `forms/`; docs/formats/export.md describes them.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from pbrs_farm.core import keys
from pbrs_farm.core.checked_calls import as_words, checked_call
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SPLITS, SplitShares, empty_splits, split_of_house
from pbrs_farm.export.chosen_view import Choice, ChosenView, require_lens
from pbrs_farm.export.form import (
    LEFT_OUT,
    LICENCES,
    REMARKS,
    ViewForm,
    all_forms,
    form_of,
    options_from,
)
from pbrs_farm.formats.class_map import class_map
from pbrs_farm.formats.output_folder import ViewEntry, views_of
from pbrs_farm.regular_files import files_below, new_folder, read_given

if TYPE_CHECKING:
    from pbrs_farm.views.views import Views


@checked_call
def export(
    folder: str | Path,
    out: str | Path,
    name: str,
    *,
    selection: str | None = None,
    choice: Choice | None = None,
    shares: SplitShares | None = None,
    views: Collection[tuple[str, str]] | None = None,
    **options: Any,
) -> tuple[int, int]:
    """Write the finished views of folder to out in the form of that name: (views, files written).

    out must not exist, or be empty. selection: only the views that selection/<selection>.jsonl keeps;
    views: only these (house, view). choice: layers, modes, size and classes. shares: a folder for each
    split that has views (train, val, test, by home), each whole in itself. options: of the form, as
    `scanner="vlp16"` of lidar. Views without labels are left out. licences.txt lists the licences of all that
    the views show. Raises BadInput for an unknown form
    or one of homes, an option that the form does not have, classes of the user's for a form without
    classes, a folder without finished views, a missing selection, or an out that is not empty.

    >>> frame.save("out/detect")
    >>> n_views, n_files = pf.export_views("out/detect", "out/coco", "coco")
    >>> n_views
    1
    """
    folder, out = Path(folder), Path(out)
    form = form_of(name)
    if not isinstance(form, ViewForm):
        raise BadInput("--to", name, "exports homes", hint="export_homes writes it")
    choice = choice or Choice()
    if options or choice.options is None:
        choice = replace(choice, options=options_from(form, options))
    if choice.classes is not None and not form.has_classes:
        owners = [f.name for f in all_forms() if isinstance(f, ViewForm) and f.has_classes]
        hint = f"--to {', '.join(owners)}"
        raise BadInput("--classes", "", f"{name} has fixed classes", hint=hint)
    entries = finished_entries(folder, selection)
    if views is not None:
        entries = [v for v in entries if (v.house.id, v.id) in views]
    if not entries:
        raise BadInput(folder, "", "no finished view to export")
    with new_folder(out) as scratch:
        by_split = _by_split(entries, shares)
        for split, split_entries in by_split.items():
            part = scratch / split
            part.mkdir(exist_ok=True)
            write_views(form, [ChosenView(v, choice) for v in split_entries], part, choice)
        if form.finish is not None:
            form.finish(scratch, tuple(filter(None, by_split)), choice)
        licences = sorted({name for v in entries for name in v.facts.get("licences", ())})
        if licences:
            (scratch / LICENCES).write_text("".join(f"{name}\n" for name in licences), "utf-8")
        if shares is not None and (empty := empty_splits((v.house.id for v in entries), shares)):
            with (scratch / REMARKS).open("a", encoding="utf-8") as remarks:
                remarks.write(f"no home falls into {' and '.join(empty)}: export more homes\n")
        return len(entries), len(files_below(scratch))


def write_views(form: ViewForm, views: list[ChosenView], out: Path, choice: Choice) -> None:
    """Write views in a form, and left_out.txt with those that it does not take, `<house>/<view>: <why>` a line.

    Raises BadInput if it takes none, or if one has a lens that it cannot describe.
    """
    takes, taken = form.takes, views if form.takes is None else form.takes.of(views)
    if takes is not None and not taken:
        raise BadInput("--to", form.name, takes.none, hint=takes.hint)
    for view in taken if form.lenses else ():
        require_lens(view, form.name, *form.lenses)
    form.write(taken, out, choice)
    kept = set(map(id, taken))
    left = [view for view in views if id(view) not in kept]
    if takes is not None and takes.left_out and left:
        lines = [f"{view.house.id}/{view.id}: {takes.left_out}\n" for view in left]
        (out / LEFT_OUT).write_text("".join(lines), "utf-8")


def finished_entries(folder: Path, selection: str | None = None) -> list[ViewEntry]:
    """The finished views of a folder, or those that selection/<selection>.jsonl keeps; BadInput as export."""
    # A view is finished if it has labels.
    entries = [v for v in views_of(folder) if "instances" in v.facts and v.file("instance.png")]
    if selection is None:
        return entries
    names = _selected(folder, selection)
    return [v for v in entries if (v.house.id, v.id) in names]


def export_frames(
    frames: Views,
    out: Path,
    name: str,
    *,
    layers: str | Sequence[str] | None = None,
    modes: str | Sequence[str] | None = None,
    size: tuple[int, int] | None = None,
    classes: str | Path | None = None,
    shares: SplitShares | None = None,
    **options: Any,
) -> Path:
    """Write frames to the new folder out in the form of that name, as `Views.export`; returns out.

    Frames without a folder are saved into one first. Raises BadInput as `export`, and for frames of
    shards.
    """
    choice = Choice(
        layers=None if layers is None else as_words(layers),
        modes=None if modes is None else as_words(modes),
        size=size,
        classes=None if classes is None else class_map(classes),
    )
    with _stored(frames) as (folder, chosen):
        export(folder, out, name, choice=choice, shares=shares, views=chosen, **options)
    return out


def questions_of(frames: Views) -> list[dict[str, Any]]:
    """Rows of questions about frames, as in questions.jsonl, for `Views.questions`.

    Walks are asked about as wholes. Raises BadInput for frames of shards.
    """
    from pbrs_farm.export.questions.clips import clips_of
    from pbrs_farm.export.questions.pairs import all_questions

    with _stored(frames) as (folder, chosen):
        entries = [v for v in views_of(folder) if (v.house.id, v.id) in chosen]
        questions = all_questions(clips_of([ChosenView(v, Choice()) for v in entries]))
    return [q.row(k) | q.facts() for k, q in enumerate(questions)]


@contextmanager
def _stored(frames: Views) -> Iterator[tuple[Path, frozenset[tuple[str, str]]]]:
    """A folder with the frames, temporary unless they have one, and the names of house and view."""
    chosen = frozenset((ref.house, ref.view) for ref in frames.refs)
    with TemporaryDirectory(prefix="pbrs-export-") as scratch:
        folder = Path(frames.source.url)
        if not (folder / keys.FOLDERS[0]).is_dir():
            frames.save(scratch)
            folder = Path(scratch)
        yield folder, chosen


def _by_split(views: list[ViewEntry], shares: SplitShares | None) -> dict[str, list[ViewEntry]]:
    """Split -> its views, in the order train, val, test; all under "" without shares."""
    if shares is None:
        return {"": views}
    split_of = {v.house.id: split_of_house(v.house.id, shares) for v in views}
    parts = {name: [v for v in views if split_of[v.house.id] == name] for name in SPLITS}
    return {name: entries for name, entries in parts.items() if entries}


def _selected(folder: Path, run: str) -> set[tuple[str, str]]:
    file = folder / keys.selection_key(run, "jsonl")
    if not file.is_file():
        raise BadInput(file, "", "no such selection", hint="run pbrs-farm select")
    try:
        # Each line has the view and `kept`.
        rows = [json.loads(line) for line in read_given(file).splitlines()]
        return {(row["house"], row["view"]) for row in rows if row["kept"]}
    except (ValueError, KeyError, TypeError):
        raise BadInput(file, "", "not a selection", hint="run pbrs-farm select") from None


def remarks_of(out: Path) -> list[str]:
    """Remarks for the user of an export: comments of data.yaml, remarks, omitted views.

    They are read from the files of the export, so they are also available for an earlier export.
    """
    files = [out / "data.yaml", out / LEFT_OUT, *(out / split / LEFT_OUT for split in SPLITS)]
    lines = [
        line for file in files if file.is_file() for line in file.read_text("utf-8").splitlines()
    ]
    notes = [
        line.removeprefix("# ") for line in lines if line.startswith("# ") or ": has no " in line
    ]
    remarks = [out / REMARKS, *(out / split / REMARKS for split in SPLITS)]
    return notes + [
        line for file in remarks if file.is_file() for line in file.read_text("utf-8").splitlines()
    ]
