"""Views of ours beside photographs: distances, histograms, the views that are most unlike; torch, no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.selection.similarity import best_match
from pbrs_farm.study.comparing.compared_pictures import PictureSet
from pbrs_farm.study.comparing.picture_facts import KINDS, NUMBERS, PictureFacts
from pbrs_farm.study.comparing.set_distance import (
    Grouped,
    groups_to_draw,
    kernel_distance,
    nearest_of,
    shared_histogram,
    shared_of_halves,
)
from pbrs_farm.study.networks.efficient_unet import LiteFeatures
from pbrs_farm.study.networks.network_choice import encode_colour
from pbrs_farm.study.training.prediction import as_colour

N_UNLIKE: Final = 20
_BATCH: Final = 16
_BEYOND: Final = 0.95  # share of the photographs that a view lies beyond, to be told
_MOST_REASONS: Final = 3
_LEAST_SPREAD: Final = 0.005  # of a plain number: less is not seen
_HALF_LIGHT: Final = 0.5  # of the yardstick: a stop
HISTOGRAMS: Final = {
    "colour": "colours, 4 x 4 x 4 joint bins",
    "depth": "depth, 32 bins over 0 to 10 m",
    "normals": "directions of surfaces, 64 bins of equal area",
    "classes": "NYU40 classes",
}


@dataclass(frozen=True, slots=True, eq=False)
class Unlike:
    """A view, the photograph nearest to it, and what no or few photographs have."""

    view: PictureFacts
    photograph: PictureFacts
    times: float  # the photographs' own median distance from the nearest of the others
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """What compare.json and the page say."""

    ours: PictureSet
    photographs: PictureSet
    report: dict[str, Any]
    unlike: tuple[Unlike, ...]


def compare_sets(ours: PictureSet, photographs: PictureSet, network: LiteFeatures) -> Comparison:
    """Compare two sets of two or more pictures of one size.

    network: what says how pictures look, as `imagenet_features` gives it.
    """
    a, b = ours.pictures, photographs.pictures
    features = _features(network, a), _features(network, b)
    groups = tuple(
        groups_to_draw([one.group for one in each], [one.id for one in each]) for each in (a, b)
    )
    of_ours, of_photographs = (Grouped(*pair) for pair in zip(features, groups, strict=True))
    darker = Grouped(_features(network, b, light=_HALF_LIGHT), groups[1])
    found = _unlike(a, b, *features)
    report = {
        "views": _set_row(ours, groups[0]),
        "photographs": _set_row(photographs, groups[1]),
        "size_px": list(a[0].colour.shape[1::-1]),
        "appearance": {
            "kernel_distance": asdict(kernel_distance(of_ours, of_photographs)),
            "photographs_a_stop_darker": kernel_distance(darker, of_photographs).value,
        },
        "histograms": _shared(a, b, groups),
        "numbers": _medians(a, b),
        "kinds": _kinds(a, b),
        "classes": _classes(a, b),
        "unlike": [
            {"view": one.view.id, "photograph": one.photograph.id, "times": one.times, "reasons": list(one.reasons)}
            for one in found
        ],
        "notes": [*ours.notes, *photographs.notes],
    }  # fmt: skip
    return Comparison(ours, photographs, _rounded(report), found)


def _features(network: LiteFeatures, pictures: Sequence[PictureFacts], light: float = 1) -> F64:
    """(n, 1280) of the pictures, or of them with that share of their light."""
    found = []
    for at in range(0, len(pictures), _BATCH):
        colour = np.stack([one.colour for one in pictures[at : at + _BATCH]])
        if light != 1:
            colour = _with_less_light(colour, light)
        with torch.no_grad():
            picture = encode_colour(as_colour(torch.from_numpy(colour)), "lite")
            found.append(network(picture).double().numpy())
    return np.concatenate(found)


def _with_less_light(colour: NDArray[np.uint8], light: float) -> NDArray[np.uint8]:
    """sRGB of the light times a share (IEC 61966-2-1)."""
    value = np.arange(256) / 255
    linear = light * np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    srgb = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * srgb).astype(np.uint8)[colour])


def _set_row(one: PictureSet, groups: Sequence[str]) -> dict[str, Any]:
    return {
        "place": one.place, "pictures": len(one.pictures),
        "groups": len({facts.group for facts in one.pictures}), "drawn": len(set(groups)),
        "left_out": list(one.left_out),
    }  # fmt: skip


def _shared(
    a: Sequence[PictureFacts], b: Sequence[PictureFacts], groups: Sequence[tuple[str, ...]]
) -> dict[str, Any]:
    """Of each histogram that both sets have: what they share, and what two halves of the photographs do."""
    rows: dict[str, Any] = {}
    for name, title in HISTOGRAMS.items():
        sets = [_grouped(pictures, name, own) for pictures, own in zip((a, b), groups, strict=True)]
        ours, photographs = sets
        if ours is None or photographs is None:
            continue
        rows[name] = {
            "title": title, "pictures": [len(ours.rows), len(photographs.rows)],
            "shared": asdict(shared_histogram(ours, photographs)),
            "halves": shared_of_halves(photographs),
        }  # fmt: skip
        if name in ("colour", "depth"):
            # As `select` scores a view: by the photograph whose histogram is most like its own.
            own, theirs = (each.rows.astype(np.float32) for each in (ours, photographs))
            rows[name]["best_match"] = float(np.median(best_match(own, theirs)[0]))
            rows[name]["best_match_photographs"] = float(
                np.median(best_match(theirs, theirs, leave_out_self=True)[0])
            )
    return rows


def _grouped(
    pictures: Sequence[PictureFacts], name: str, groups: tuple[str, ...]
) -> Grouped | None:
    """The pictures that have a histogram; None for fewer than two."""
    has = [k for k, one in enumerate(pictures) if name in one.histograms]
    if len(has) < 2:
        return None
    rows = np.stack([pictures[k].histograms[name] for k in has])
    return Grouped(rows, tuple(groups[k] for k in has))


def _medians(a: Sequence[PictureFacts], b: Sequence[PictureFacts]) -> list[dict[str, Any]]:
    rows = []
    for name, title, _, _ in NUMBERS:
        values = [[one.numbers[name] for one in each if name in one.numbers] for each in (a, b)]
        if all(values):
            ours, photographs = (float(np.median(each)) for each in values)
            rows.append({"title": title, "views": ours, "photographs": photographs})
    return rows


def _kinds(a: Sequence[PictureFacts], b: Sequence[PictureFacts]) -> list[dict[str, Any]]:
    """Mean share of each kind of surface; none where a set has no normals."""
    sets = [[one.numbers for one in each if KINDS[0] in one.numbers] for each in (a, b)]
    if not all(sets):
        return []
    means = [{kind: float(np.mean([row[kind] for row in each])) for kind in KINDS} for each in sets]
    return [
        {"name": kind, "views": means[0][kind], "photographs": means[1][kind]} for kind in KINDS
    ]


def _classes(a: Sequence[PictureFacts], b: Sequence[PictureFacts]) -> list[dict[str, Any]]:
    """Mean share of each class among labelled pixels, by how far the sets are apart."""
    sets = [
        [one.histograms["classes"] for one in each if "classes" in one.histograms]
        for each in (a, b)
    ]
    if not all(sets):
        return []
    ours, photographs = (np.mean(each, axis=0) for each in sets)
    order = np.argsort(-np.abs(ours - photographs), kind="stable")
    return [
        {"name": NYU40_NAMES[k], "views": float(ours[k]), "photographs": float(photographs[k])}
        for k in order.tolist()
        if k and (ours[k] or photographs[k])
    ]


def _unlike(
    a: Sequence[PictureFacts], b: Sequence[PictureFacts], ours: F64, photographs: F64
) -> tuple[Unlike, ...]:
    """The views that are farthest from their nearest photograph, the farthest first."""
    distance, nearest = nearest_of(ours, photographs)
    own, _ = nearest_of(photographs, photographs, leave_out_self=True)
    unit = max(float(np.median(own)), 1e-9)
    order: I64 = np.argsort(-distance, kind="stable")[:N_UNLIKE]
    return tuple(
        Unlike(a[k], b[nearest[k]], float(distance[k]) / unit, _reasons(a[k], b))
        for k in order.tolist()
    )


def _reasons(view: PictureFacts, photographs: Sequence[PictureFacts]) -> tuple[str, ...]:
    """What of its plain numbers lies beyond those of nearly all photographs, the farthest out first."""
    found: list[tuple[float, str]] = []
    for name, _, less, more in NUMBERS:
        values = np.array([one.numbers[name] for one in photographs if name in one.numbers])
        if name not in view.numbers or len(values) < 2:
            continue
        value = view.numbers[name]
        low, high = np.quantile(values, [0.1, 0.9])
        spread = max(float(high - low), _LEAST_SPREAD)
        for share, word in (((values > value).mean(), less), ((values < value).mean(), more)):
            if share >= _BEYOND:
                middle = float(np.median(values))
                of = "all" if share == 1 else f"{100 * share:.0f} % of"
                text = f"{word} than {of} photographs: {value:.2g}, they {middle:.2g}"
                found.append((abs(value - middle) / spread, text))
    return tuple(text for _, text in sorted(found, key=lambda one: -one[0])[:_MOST_REASONS])


def _rounded(value: Any) -> Any:
    """Numbers to five significant digits: more would be noise."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    return [_rounded(each) for each in value] if isinstance(value, list) else value
