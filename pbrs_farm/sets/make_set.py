"""A set's folder: selection, splits, forms, card and checksums of rendered parts.

Effects: reads and writes the set's folder. A step is done when its marker `done/<name>.json` has the right
digest and its files exist; the marker is written last, so that a killed step is repeated.

    <set>.toml            the file, as it was given
    README.md             the card
    index.csv             each view: part, house, view, split, kept or why not
    SHA256SUMS            of all files but markers
    parts/<part>/         an output root
    forms/<form>/<part>/  the kept views in that form
"""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import pbrs_farm
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.core.house_split import split_of_house
from pbrs_farm.curate.teaching_rules import RuleVerdict, judged_by, write_verdicts
from pbrs_farm.export.export_views import export
from pbrs_farm.formats.manifest import lines_by_house, sha256_by_key
from pbrs_farm.formats.marker import copy_done
from pbrs_farm.formats.output_folder import views_of
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.regular_files import digest_of_regular, fault_of, read_regular
from pbrs_farm.run import plan
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.request import ProcessLimitOptions
from pbrs_farm.sets.data_set import DataSet, SetForm, SetPart
from pbrs_farm.sets.set_card import card_text
from pbrs_farm.store import StoreSettings
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.object_store import get_or_none
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.packing.pack_shards import pack

SUMS: Final = "SHA256SUMS"
_PARTS: Final = "parts"
_FORMS: Final = "forms"
_INDEX: Final = "index.csv"
_CARD: Final = "README.md"
_RENDER_AGAIN: Final = "remove the folder of its home, and run make again"
_ROOT_FILES: Final = (keys.RECIPE, keys.MANIFEST, keys.ATTRIBUTION)

Planned = Mapping[str, Sequence[str]]
"""House -> its planned views."""


@dataclass(frozen=True, slots=True)
class MadePart:
    """A rendered part with the verdicts on its views."""

    part: SetPart
    root: Path
    verdicts: tuple[RuleVerdict, ...]  # by house and view
    reasons: Mapping[str, int] = field(default_factory=dict)  # reason -> number of views left out

    @property
    def kept(self) -> tuple[RuleVerdict, ...]:
        """The views of the forms."""
        return tuple(verdict for verdict in self.verdicts if not verdict.reason)


def claim_folder(out: Path, data_set: DataSet) -> None:
    """Claim a folder for a set: write the set's file into it, if it has no foreign files.

    It may have rendered parts, as a farm made them. Raises BadInput if it has another set or other files.
    """
    file = out / data_set.file
    if file.is_file():
        if read_regular(file) != data_set.data:
            hint = f"name a new folder; move OUT/{_PARTS} there to avoid rendering again"
            raise BadInput(out, data_set.file, "has another set: the file differs", hint=hint)
        return
    if out.exists() and not out.is_dir():
        raise BadInput(out, "", "is not a folder")
    files = [path.name for path in sorted(out.iterdir())] if out.is_dir() else []
    ours = (_PARTS, data_set.file)
    files = [name for name in files if name not in ours and not name.startswith(".")]
    sets = [name for name in files if name.endswith(".toml")]
    if sets:
        raise BadInput(out, sets[0], "belongs to another set", hint="name a new folder")
    if files:
        raise BadInput(out, files[0], "is not a part of this set", hint="name a new folder")
    FolderStore(out).put(data_set.file, data_set.data)


def part_run(
    part: SetPart, out: Path, shard: tuple[int, int], how: ProcessLimitOptions, store: StoreSettings
) -> Run:
    """The run of a part, or of one shard of its homes, into its folder."""
    return Run(
        homes=part.homes_of(shard),
        models=part.models,
        store_url=str(root_of(part, out)),
        recipe=part.recipe,
        want=part.want,
        n_jobs=how.jobs,
        step_timeout_s=how.step_timeout,
        silence_s=how.silence,
        memory_mb=how.memory,
        # Forms are written of files.
        store=replace(store, layout="files"),
        dress_seeds=part.dress_seeds,
    )


def take_prepared(
    part: SetPart, earlier: Sequence[SetPart], out: Path, shard: tuple[int, int]
) -> None:
    """Copy finished steps of a part's homes from the roots of earlier parts that have the same homes.

    Prepares each home of a set once. The run compares the digests of the copies, and repeats steps with
    other inputs. Unreadable homes are left to the run.
    """
    to, files = FolderStore(root_of(part, out)), SourceFiles()
    seeds = part.dress_seeds or (part.recipe.dress.seed,)
    for other in earlier:
        groups = plan.STEPS["house"].groups
        if part.recipe.digest(*groups) != other.recipe.digest(*groups):
            continue
        store, homes = FolderStore(root_of(other, out)), set(other.homes)
        for word in filter(homes.__contains__, part.homes_of(shard)):
            with suppress(PbrsError):
                for source in variants(resolve(word, files, models=part.models), seeds):
                    for step in plan.house_steps(part.want, source.house_id):
                        key = keys.marker_key(source.house_id, step)
                        if to.head(key) is None:
                            copy_done(store, to, key)


def root_of(part: SetPart, out: Path) -> Path:
    """The output root of a part."""
    return out / _PARTS / part.name


def finish_set(
    data_set: DataSet,
    out: Path,
    planned: Mapping[str, Planned],
    tell: Callable[[str], None] = lambda _line: None,
) -> int:
    """Select views and write forms, index, card and checksums of a set whose parts are all rendered.

    planned: part's name -> its views. Finished steps are skipped. tell: called with a line for each new
    step. Returns the number of new steps. Raises BadInput for foreign houses in a part's folder, for
    missing or damaged rendered files, and as export and pack.
    """
    steps = _Steps(out, tell)
    parts = [
        _judged_part(data_set, part, out, planned[part.name], steps) for part in data_set.parts
    ]
    by_name = {of.part.name: of for of in parts}
    for form in data_set.forms:
        for name in form.parts:
            _write_form(data_set, form, by_name[name], out, steps)
    texts = {
        _INDEX: _index_text(data_set, parts),
        _CARD: card_text(data_set, [(of.part, of.root, of.kept, of.reasons) for of in parts]),
    }
    for file, text in texts.items():
        steps.sums[file] = keys.sha256(text.encode())
        steps.write(file, text.encode())
    steps.sums[data_set.file] = keys.sha256(data_set.data)
    for of in parts:
        steps.sums |= _root_sums(of, out)
    # in the order of names, to compare two lists line by line
    lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(steps.sums.items()))
    if get_or_none(steps.store, SUMS) != lines.encode():
        for of in parts:
            steps.check_rendered(of.root)
        steps.write(SUMS, lines.encode())
    return steps.n_made


class _Steps:
    """The steps of one call; finished ones, by their markers, are skipped."""

    def __init__(self, out: Path, tell: Callable[[str], None]) -> None:
        self.out = out
        self.store = FolderStore(out)
        self.sums: dict[str, str] = {}  # file -> sha256, of all steps
        self.n_made = 0
        self._tell = tell
        self._checked: set[Path] = set()  # roots

    def check_rendered(self, root: Path) -> None:
        """Raise BadInput for the first file of a root that is not as its manifest lists it; once a root."""
        if root in self._checked:
            return
        for key, digest in _listed_sums(root):
            try:
                is_whole = digest_of_regular(root / key) == digest
            except OSError as error:
                raise BadInput(root / key, "", fault_of(error), hint=_RENDER_AGAIN) from None
            if not is_whole:
                raise BadInput(root / key, "", "is damaged: not as rendered", hint=_RENDER_AGAIN)
        self._checked.add(root)

    def unless_done(
        self, name: str, digest: str, make: Callable[[], object], files: Callable[[], Sequence[str]]
    ) -> None:
        """Make a step unless its marker has the digest and all its files exist.

        files: its files, below the set's folder.
        """
        key = f"done/{name}.json"
        marker = json.loads(get_or_none(self.store, key) or b"{}")
        sums = marker.get("files", {})
        is_done = marker.get("digest") == digest and all((self.out / f).is_file() for f in sums)
        if not is_done:
            make()
            sums = {file: digest_of_regular(self.out / file) for file in sorted(files())}
            row = {"digest": digest, "files": sums}
            self.store.put(key, json.dumps(row, indent=1).encode())
            self.n_made += 1
            self._tell(f"{name}: {len(sums)} files")
        self.sums |= sums

    def write(self, file: str, data: bytes) -> None:
        """Write a file of the set's folder unless it has these bytes."""
        if get_or_none(self.store, file) != data:
            self.store.put(file, data)
            self.n_made += 1


def _judged_part(
    data_set: DataSet, part: SetPart, out: Path, planned: Planned, steps: _Steps
) -> MadePart:
    """Choose the views of the forms by the part's rules."""
    root = root_of(part, out)
    _check_nothing_else(root, planned)
    files = [keys.SELECTION, keys.selection_key(data_set.name, "jsonl")]

    def judge() -> None:
        steps.check_rendered(root)
        chosen = {(house, view) for house, views in planned.items() for view in views}
        entries = [e for e in views_of(root) if (e.house.id, e.id) in chosen]
        verdicts = judged_by(entries, part.rules)
        write_verdicts(FolderStore(root), data_set.name, part.rules, verdicts)

    digest = keys.digest("select", part.rules, _manifest_digest(root), pbrs_farm.__version__)
    below = root.relative_to(out).as_posix()
    steps.unless_done(
        f"select.{part.name}", digest, judge, lambda: [f"{below}/{file}" for file in files]
    )
    rows = [json.loads(line) for line in FolderStore(root).get(files[1]).splitlines()]
    verdicts = tuple(RuleVerdict(r["house"], r["view"], r["reason"], {}) for r in rows)
    summary: dict[str, Any] = json.loads(FolderStore(root).get(files[0]))
    return MadePart(part, root, verdicts, summary["reasons"])


def _check_nothing_else(root: Path, planned: Planned) -> None:
    """Raise BadInput if the root has houses or views that are not of the set."""
    folder = root / keys.FOLDERS[0]
    for house in sorted(folder.iterdir()) if folder.is_dir() else ():
        hint = "name a new folder, or remove it"
        if house.name not in planned:
            raise BadInput(root, house.name, "is not a home of the set", hint=hint)
        views = house / "views"
        for view in sorted(views.iterdir()) if views.is_dir() else ():
            if view.name not in planned[house.name]:
                place = f"{house.name}/{view.name}"
                raise BadInput(root, place, "is not a view of the set", hint=hint)


def _manifest_digest(root: Path) -> str:
    return digest_of_regular(root / keys.MANIFEST)


def _write_form(
    data_set: DataSet, form: SetForm, made_part: MadePart, out: Path, steps: _Steps
) -> None:
    """Write the kept views of a part in a form."""
    if not made_part.kept:
        return
    folder = out / _FORMS / form.name / made_part.part.name

    def write() -> None:
        steps.check_rendered(made_part.root)
        # remains of a killed call
        shutil.rmtree(folder, ignore_errors=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
        if form.packing is None:
            export(
                made_part.root,
                folder,
                form.to,
                selection=data_set.name,
                choice=form.choice,
                shares=data_set.shares,
            )
        else:
            views = open_views(str(made_part.root)).only(selection=data_set.name)
            modes = form.packing.modes or tuple(map(str, made_part.part.want.modes))
            pack(views, folder, replace(form.packing, modes=modes), form=form.to)

    def files() -> list[str]:
        return [p.relative_to(out).as_posix() for p in folder.rglob("*") if p.is_file()]

    verdicts = [[v.house, v.view, v.reason] for v in made_part.verdicts]
    choice = repr(form.packing or form.choice)
    digest = keys.digest(
        form.to,
        choice,
        repr(data_set.shares),
        verdicts,
        _manifest_digest(made_part.root),
        pbrs_farm.__version__,
    )
    steps.unless_done(f"{form.name}.{made_part.part.name}", digest, write, files)


def _index_text(data_set: DataSet, made_parts: Sequence[MadePart]) -> str:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(("part", "house", "view", "split", "left_out"))
    for of in made_parts:
        for verdict in of.verdicts:
            split = split_of_house(verdict.house, data_set.shares) if data_set.shares else ""
            rows.writerow((of.part.name, verdict.house, verdict.view, split, verdict.reason))
    return text.getvalue()


def _listed_sums(root: Path) -> Iterator[tuple[str, str]]:
    """(key, sha256) of the rendered files of a root, from its manifest."""
    for house, lines in lines_by_house(FolderStore(root).get(keys.MANIFEST)):
        # the manifest of a home has these lines
        yield keys.house_key(house, keys.MANIFEST), keys.sha256(lines)
        yield from sha256_by_key(lines).items()


def _root_sums(made_part: MadePart, out: Path) -> Iterator[tuple[str, str]]:
    """(file, sha256) of the files of a part's root."""
    below = made_part.root.relative_to(out).as_posix()
    for key, digest in _listed_sums(made_part.root):
        yield f"{below}/{key}", digest
    for file in _ROOT_FILES:
        if (made_part.root / file).is_file():
            yield f"{below}/{file}", digest_of_regular(made_part.root / file)
