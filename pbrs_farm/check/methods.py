"""How `verify` recomputes each file of a root; one without a row is compared by hash, size and type. No effects."""

from __future__ import annotations

import functools
from collections import Counter
from pathlib import Path
from typing import Literal

from pbrs_farm.check.checks import all_checks
from pbrs_farm.check.fields import field_lines
from pbrs_farm.check.pixel_checks import RAY_LAYERS
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.layers import LAYER, LAYERS, OWN_LAYERS
from pbrs_farm.core.record import Record, read_csv


class _Method(Record):
    """The method for a file."""

    of: Literal["view", "house"]
    file: str
    how: str


@functools.cache
def _methods(of: str) -> dict[str, str]:
    rows = read_csv(Path(__file__).with_name("methods.csv"), _Method)
    return {row.file: row.how for row in rows if row.of == of}


# Facts that no file of a root holds.
_NEVER = ("house.glb and house.json against their source, which is not stored",)
_UNTRACED = (
    "levels of light and its colour, except visible bulbs and the minimum from sun and bulbs: no light is"
    " traced; `pbrs-farm verify ROOT --light` traces it again"
)


def how_of_files() -> dict[str, str]:
    """File of a view -> how it is recomputed, also by checks of the table."""
    rays = {LAYER[name].file: "recomputed by rays" for name in RAY_LAYERS}
    by_checks = {file: how for check in all_checks() for file, how in check.files.items()}
    return rays | _methods("view") | by_checks


def looked_at(views: list[StoredView], fields: Counter[tuple[str, str]]) -> tuple[str, ...]:
    """A line for each kind of recomputed file, then how many kinds of fields of each JSON file are checked."""
    counts, how_of = _file_counts(views), how_of_files()
    files = tuple(f"{file} ({counts[file]}): {how}" for file, how in how_of.items() if counts[file])
    return (*files, *field_lines(fields)[0])


def not_looked_at(
    folders: list[Path],
    views: list[StoredView],
    fields: Counter[tuple[str, str]],
    n_halved: int = 0,
    *,
    is_traced: bool = False,
) -> tuple[str, ...]:
    """A line for each kind of file that only has a hash, or little more, and for each field without a check.

    folders: the roots and their houses. With each view whose light could not be developed again and why,
    the number of views that were denoised at half their size, light that was not traced again, and the
    lines that apply to every root.
    """
    counts, how_of = _file_counts(views), how_of_files()
    layers = {layer.file for layer in LAYERS}
    lines = []
    for file in sorted(counts):
        if file not in how_of:
            how = "hash, size and type alone" if file in layers else "hash alone"
            lines.append(f"{file} ({counts[file]}): {how}")
    lines += unknown_files(folders)
    lines += field_lines(fields)[1]
    lines += [f"light of {view.place}: {why}" for view in views if (why := _light_fault(view))]
    if n_halved:
        lines.append(
            f"light of {n_halved} views was denoised again at half its size: compared by tiles of 32 px; "
            "--all repeats it at full size"
        )
    if counts["radiance.exr"] and not is_traced:
        lines.append(_UNTRACED)
    return (*lines, *_NEVER)


def unknown_files(folders: list[Path]) -> list[str]:
    """A line for each file of roots and houses, beside the views, that no check opens."""
    counts = Counter(f.name for folder in folders for f in folder.glob("*") if f.is_file())
    return [
        f"{name} ({n}): no check knows it"
        for name, n in sorted(counts.items())
        if name not in _methods("house")
    ]


def unowned_layers() -> list[str]:
    """Files of layers of the package that no check recomputes."""
    return [layer.file for layer in OWN_LAYERS if layer.file not in how_of_files()]


def _file_counts(views: list[StoredView]) -> Counter[str]:
    return Counter(
        str(file.relative_to(view.folder).as_posix())
        for view in views
        for file in Path(view.folder).rglob("*")
        if file.is_file()
    )


def _light_fault(view: StoredView) -> str:
    """Why a view's light modes were not compared by pixels; "" if they were, or if there are no such modes."""
    if not (view.has("mlt_ol.png") or view.has("mlt_il_ol.png")):
        return ""
    if view.recipe is None:
        return "no recipe.json that says how it was developed"
    if not view.has("radiance.exr"):
        return "no radiance.exr to develop"
    if view.recipe.camera_of("", "").sensor.is_on:
        return "taken by a sensor: compared by tiles of 16 px, not by pixels"
    if view.recipe.tone.variants:
        return "its variants are taken by sensors: compared by tiles of 16 px, not by pixels"
    return ""
