"""A set's own files: checksums, markers, index, splits, selections and the card. Effects: reads files."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from pbrs_farm.check.cases import SetCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.stored_files import (
    BadFile,
    object_from_json,
    stored_bytes,
    stored_digest,
    stored_object,
)
from pbrs_farm.check.stored_set import CARD, INDEX, MODES, SPLITS, SUMS, StoredSet, home_of
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import Recipe, recipe_from_json

_LIT = ("mlt_il_ol", "mlt_ol")
# Lines of the card that no stored file repeats.
_UNCHECKED = ("- Layers beside", "pbrs-farm make", "sha256sum", "```", "The file has the digest")


def check_sums(case: SetCase) -> None:
    """SHA256SUMS lists exactly the files of the set, with their digests; parts that are not at hand are skipped."""
    stored, expect = case.stored, case.tally.expect
    files = set(stored.files())
    if not stored.sums:
        return  # not finished
    for name, digest in stored.sums.items():
        if name in files:
            try:
                fault = "" if stored_digest(stored.folder / name) == digest else "is damaged"
            except BadFile as error:
                fault = str(error)
            expect("checksums", name, not fault, fault)
        elif not _is_elsewhere(stored, name):
            expect("checksums", name, False, "is missing")
    for name in sorted(files - stored.sums.keys()):
        expect("checksums", name, False, f"is not in {SUMS}")


def _is_elsewhere(stored: StoredSet, name: str) -> bool:
    """True for a file of a part that is not at hand."""
    folder, _slash, rest = name.partition("/")
    part = rest.partition("/")[0]
    return folder == "parts" and part in stored.tables["part"] and part not in stored.roots


def check_step_markers(case: SetCase) -> None:
    """The markers of the set's steps have the digests of SHA256SUMS."""
    for file in sorted((case.stored.folder / "done").glob("*.json")):
        place = f"done/{file.name}"
        try:
            rows = stored_object(file)["files"].items()
        except (BadFile, KeyError, AttributeError):
            case.tally.expect("markers of steps", place, False, "is not a marker of a set")
            continue
        for name, digest in rows:
            fits = case.stored.sums.get(name, digest) == digest
            case.tally.expect("markers of steps", place, fits, f"{name} has another digest")


def check_index(case: SetCase) -> None:
    """index.csv has each view of the parts once, in the split of its home, as the selections keep it."""
    stored, tally = case.stored, case.tally
    try:
        rows = stored.index
    except BadFile as error:
        tally.expect("index", INDEX, False, str(error))
        return
    for row in rows:
        split = stored.split_of(row.house)
        place = f"{INDEX} {row.part}/{row.house}/{row.view}"
        tally.expect("splits", place, row.split == split, f"split is {row.split}, not {split}")
        tally.expect("index", place, row.part in stored.tables["part"], "has no such part")
    for part, root in stored.roots.items():
        of_part = Counter({(r.house, r.view, r.left_out): 1 for r in rows if r.part == part})
        views = Counter(
            p.parts[-3::2] for f in keys.FOLDERS for p in root.glob(f"{f}/*/views/*") if p.is_dir()
        )
        fits = Counter((r.house, r.view) for r in rows if r.part == part) == views
        tally.expect("index", f"{INDEX} {part}", fits, "has other views than the part")
        _check_selection(case, part, root, of_part)


def _check_selection(
    case: SetCase, part: str, root: Path, rows: Counter[tuple[str, str, str]]
) -> None:
    """Compare the selection of a part, by view and in sum, with its rows of the index."""
    name = Path(case.stored.file).stem
    expect = case.tally.at("index", f"parts/{part}/{keys.SELECTION}")
    try:
        lines = stored_bytes(root / keys.selection_key(name, "jsonl")).splitlines()
        verdicts = [object_from_json(line) for line in lines]
        summary = stored_object(root / keys.SELECTION)
        kept = Counter((v["house"], v["view"], v["reason"]) for v in verdicts)
        is_right = all(v["kept"] == (not v["reason"]) for v in verdicts)
        sums = summary["run"], summary["views"], summary["kept"], Counter(summary["reasons"])
    except (BadFile, KeyError, TypeError) as error:
        expect(False, f"cannot be read: {error}")
        return
    reasons = Counter(row[2] for row in rows.elements())
    n_kept = reasons.pop("", 0)
    expect(kept == rows and is_right, f"keeps other views than {INDEX}")
    expect(sums == (name, rows.total(), n_kept, reasons), "counts other views")


def check_card(case: SetCase) -> None:
    """Compare each line of README.md with the set's file, the index and the parts."""
    try:
        stored_lines = stored_bytes(case.stored.folder / CARD).decode("utf-8", "replace")
        expected = list(_card_lines(case.stored))
    except BadFile as error:
        case.tally.expect("card", CARD, False, str(error))
        return
    lines = [_counted(case.stored, line) for line in stored_lines.splitlines() if line]
    for line in expected:
        case.tally.expect("card", CARD, line in lines, f"lacks: {line}")
    for line in lines:
        is_known = line in expected or line.startswith(_UNCHECKED) or _is_of_absent(case, line)
        case.tally.expect("card", CARD, is_known, f"says: {line}")
    digest = keys.sha256(stored_bytes(case.stored.folder / case.stored.file))
    case.tally.expect("card", CARD, digest in stored_lines, "has another digest of the set's file")


def _counted(stored: StoredSet, line: str) -> str:
    """The line; lists in an order that the user chose as their sorted words, seeds of dressing as their number."""
    if line.startswith("- Pictures: "):
        words, _comma, size = line[12:].rpartition(", ")
        modes = set(words.split(", "))
        # either mode of light writes both pictures
        modes |= set(_LIT) if modes & set(_LIT) else set()
        return f"- Pictures: {', '.join(sorted(modes))}, {size}"
    match = re.fullmatch(r"(- Homes: \d+), dressed by ([\d, ]+?)(?: and (\d+) more)?\.", line)
    if match is None:
        return line
    seeds = match[2].split(", ")
    is_right = all(any(row.house.endswith(f"-d{seed}") for row in stored.index) for seed in seeds)
    return f"{match[1]}, {len(seeds) + int(match[3] or 0)} seeds." if is_right else line


def _is_of_absent(case: SetCase, line: str) -> bool:
    """True for a line about the recipe of a part, where one is not at hand."""
    is_whole = len(case.stored.roots) == len(case.stored.tables["part"])
    of_roots = "- Pictures:", "- Cameras:", "- Light:", "- Recipe:", "The views show homes"
    return not is_whole and line.startswith(of_roots)


def _card_lines(stored: StoredSet) -> Iterator[str]:
    head = stored.tables.get("card", {})
    yield f"# {head.get('title') or Path(stored.file).stem}"
    yield from (line for line in str(head.get("text", "")).strip().splitlines() if line)
    if head.get("licence"):
        yield f"Licence: {head['licence']}."
    kept = [row for row in stored.index if not row.left_out]
    yield from ("| part | split | homes | houses | views |", "| --- | --- | --- | --- | --- |")
    for part in stored.tables["part"]:
        for split in (*SPLITS, ""):
            houses = [row.house for row in kept if (row.part, row.split) == (part, split)]
            counts = len({home_of(h) for h in houses}), len(set(houses)), len(houses)
            if houses:
                yield f"| {part} | {split or 'all'} | {' | '.join(map(str, counts))} |"
    yield _split_line(stored, {row.split for row in kept})
    for part in stored.tables["part"]:
        yield from _part_lines(stored, part)
    yield from ("## Forms", "- `parts/<part>`: all rendered files (docs/formats.md of pbrs_farm)")
    for name, table in stored.tables.get("form", {}).items():
        parts = ", ".join(table.get("parts") or stored.tables["part"])
        yield f"- `forms/{name}/<part>`: {table.get('to') or name}, of {parts}"
    yield "- `index.csv`: each view, its split, and why it is left out"
    yield "## Reproduce and check"
    licences = {name for row in kept for name in stored.licences_of(row)}
    if licences:
        yield f"The views show homes, models and pictures of: {', '.join(sorted(licences))}."
    credits = [f"parts/{part}/{keys.ATTRIBUTION}" for part in stored.tables["part"]]
    credits = [f"`{file}`" for file in credits if file in stored.sums]
    if credits:
        yield "## Credits"
        yield f"The pictures show works of others, which must be named: {', '.join(credits)}."


def _split_line(stored: StoredSet, used: set[str]) -> str:
    if not stored.shares:
        return (
            "It is not split. Split it by home, not by view: rooms of a home share their furniture."
        )
    empty = [s for s, share in zip(SPLITS, stored.shares, strict=True) if share and s not in used]
    more = f" No home falls into {' and '.join(empty)}: use more homes." if empty else ""
    shares = "/".join(f"{100 * share:g}" for share in stored.shares)
    return f"Split {shares} by home: all views of a home, however it is dressed, are in one part.{more}"


def _part_lines(stored: StoredSet, part: str) -> Iterator[str]:
    rows = [row for row in stored.index if row.part == part]
    n = sum(not row.left_out for row in rows)
    yield f"## {part}: {n} view{'s' * (n != 1)}"
    reasons = sorted(Counter(row.left_out for row in rows if row.left_out).items())
    left_out = ", ".join(f"{n} {reason}" for reason, n in reasons)
    yield f"- Views left out of the forms: {left_out or 'none'}."
    homes = len({re.sub(r"-d\d+$", "", row.house) for row in rows})
    seeds = {match[1] for row in rows if (match := re.search(r"-d(\d+)$", row.house))}
    yield f"- Homes: {homes}, {f'{len(seeds)} seeds' if seeds else 'not dressed'}."
    if part not in stored.roots:
        return
    try:
        file = stored.roots[part] / keys.RECIPE
        recipe = recipe_from_json(stored_bytes(file), str(file))
    except BadRecipe as error:
        raise BadFile(f"recipe.json of {part}: {error}") from None
    yield from _recipe_lines(recipe, _modes(stored.roots[part]))


def _modes(root: Path) -> str:
    """The sorted modes of the part's first view."""
    view = min(root.glob("houses/*/views/*"), default=root)
    return ", ".join(sorted(m for m in MODES if (view / f"{m}.png").is_file())) or "none"


def _recipe_lines(recipe: Recipe, modes: str) -> Iterator[str]:
    image, cameras, tone = recipe.image, recipe.cameras, recipe.tone
    yield f"- Pictures: {modes}, {image.width_px}x{image.height_px}."
    yield (
        f"- Cameras: {cameras.source}, preset {cameras.preset}, lens {recipe.lens.model};"
        f" pictures by the camera {tone.camera}, {tone.variants} more by random cameras."
    )
    light, sky = recipe.light, recipe.sky
    yield f"- Light: {light.integrator}, {light.spp} samples a pixel; sky {sky.kind}, {sky.time}."
    yield f"- Recipe: {recipe.name}, digest {recipe.digest()}, seed {recipe.seed}."


CHECKS = (
    Check("checksums", "set", check_sums, 1),
    Check("markers of steps", "set", check_step_markers, 2),
    Check("index", "set", check_index, 3),
    Check("card", "set", check_card, 4),
)
