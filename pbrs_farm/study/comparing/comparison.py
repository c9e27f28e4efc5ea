"""Rendered views compared with photographs: distances, histograms, the most unlike views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import torch

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
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
_BEYOND: Final = 0.95  # share of the photographs that a view must exceed for a reason
_MOST_REASONS: Final = 3
_LEAST_SPREAD: Final = 0.005  # minimum spread of a number; smaller ones are invisible
_HALF_LIGHT: Final = 0.5  # a stop less
HISTOGRAMS: Final = {
    "colour": "colours, 4 x 4 x 4 joint bins",
    "depth": "depth, 32 bins over 0 to 10 m",
    "normals": "directions of surfaces, 64 bins of equal area",
    "classes": "NYU40 classes",
}


@dataclass(frozen=True, slots=True, eq=False)
class Unlike:
    """A view, its nearest photograph, and its differences from the photographs."""

    view: PictureFacts
    photograph: PictureFacts
    times: float  # distance, in median distances of a photograph from the nearest other one
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Content of compare.json and of the page."""

    ours: PictureSet
    photographs: PictureSet
    report: dict[str, Any]
    unlike: tuple[Unlike, ...]


def compare_sets(ours: PictureSet, photographs: PictureSet, network: LiteFeatures) -> Comparison:
    """Compare two sets of two or more pictures of one size; network: of `imagenet_features`."""
    a, b = ours.pictures, photographs.pictures
    features = _features(network, a), _features(network, b)
    groups = tuple(
        groups_to_draw([p.group for p in pictures], [p.id for p in pictures]) for pictures in (a, b)
    )
    of_ours, of_photographs = (Grouped(*pair) for pair in zip(features, groups, strict=True))
    darker = Grouped(_features(network, b, light=_HALF_LIGHT), groups[1])
    unlike = _unlike(a, b, *features)
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
            {
                "view": u.view.id,
                "photograph": u.photograph.id,
                "times": u.times,
                "reasons": list(u.reasons),
            }
            for u in unlike
        ],
        "notes": [*ours.notes, *photographs.notes],
    }
    return Comparison(ours, photographs, _rounded(report), unlike)


def _features(network: LiteFeatures, pictures: Sequence[PictureFacts], light: float = 1) -> F64:
    """(n, 1280) features of the pictures, at that share of their light."""
    encoded = srgb_from_linear(light * linear_from_srgb(np.arange(256) / 255))
    table = np.rint(255 * encoded).astype(np.uint8)
    rows = []
    for first in range(0, len(pictures), _BATCH):
        colour = table[np.stack([picture.colour for picture in pictures[first : first + _BATCH]])]
        with torch.no_grad():
            batch = encode_colour(as_colour(torch.from_numpy(colour)), "lite")
            rows.append(network(batch).double().numpy())
    return np.concatenate(rows)


def _set_row(pictures: PictureSet, groups: Sequence[str]) -> dict[str, Any]:
    return {
        "place": pictures.place,
        "pictures": len(pictures.pictures),
        "groups": len({picture.group for picture in pictures.pictures}),
        "drawn": len(set(groups)),
        "left_out": list(pictures.left_out),
    }


def _shared(
    a: Sequence[PictureFacts], b: Sequence[PictureFacts], groups: Sequence[tuple[str, ...]]
) -> dict[str, Any]:
    """For each histogram of both sets: their overlap, and that of two halves of the photographs."""
    rows: dict[str, Any] = {}
    for name, title in HISTOGRAMS.items():
        ours, photographs = (
            _grouped(pictures, name, names) for pictures, names in zip((a, b), groups, strict=True)
        )
        if ours is None or photographs is None:
            continue
        rows[name] = {
            "title": title,
            "pictures": [len(ours.rows), len(photographs.rows)],
            "shared": asdict(shared_histogram(ours, photographs)),
            "halves": shared_of_halves(photographs),
        }
        if name in ("colour", "depth"):
            # The score of `select`: the overlap with the most similar photograph.
            queries, references = (s.rows.astype(np.float32) for s in (ours, photographs))
            scores = best_match(queries, references)[0]
            rows[name]["best_match"] = float(np.median(scores))
            scores = best_match(references, references, leave_out_self=True)[0]
            rows[name]["best_match_photographs"] = float(np.median(scores))
    return rows


def _grouped(
    pictures: Sequence[PictureFacts], name: str, groups: tuple[str, ...]
) -> Grouped | None:
    """The pictures with a histogram; None for fewer than two."""
    indices = [k for k, picture in enumerate(pictures) if name in picture.histograms]
    if len(indices) < 2:
        return None
    rows = np.stack([pictures[k].histograms[name] for k in indices])
    return Grouped(rows, tuple(groups[k] for k in indices))


def _medians(a: Sequence[PictureFacts], b: Sequence[PictureFacts]) -> list[dict[str, Any]]:
    """Median of each number that both sets have."""
    rows = []
    for name, title, _, _ in NUMBERS:
        ours, photographs = _values_of(a, name), _values_of(b, name)
        if len(ours) and len(photographs):
            rows.append({"title": title} | _both_sets(np.median(ours), np.median(photographs)))
    return rows


def _values_of(pictures: Sequence[PictureFacts], name: str) -> F64:
    return np.array([picture.numbers[name] for picture in pictures if name in picture.numbers])


def _both_sets(ours: Any, photographs: Any) -> dict[str, float]:
    return {"views": float(ours), "photographs": float(photographs)}


def _kinds(a: Sequence[PictureFacts], b: Sequence[PictureFacts]) -> list[dict[str, Any]]:
    """Mean share of each kind of surface; [] if a set has no normals."""
    if not all(len(_values_of(pictures, KINDS[0])) for pictures in (a, b)):
        return []
    means = ((kind, *(_values_of(pictures, kind).mean() for pictures in (a, b))) for kind in KINDS)
    return [{"name": kind} | _both_sets(*pair) for kind, *pair in means]


def mean_histogram(pictures: Sequence[PictureFacts], name: str) -> F64 | None:
    """Mean histogram of the pictures with one, if any."""
    rows = [picture.histograms[name] for picture in pictures if name in picture.histograms]
    return np.asarray(np.mean(rows, axis=0)) if rows else None


def _classes(a: Sequence[PictureFacts], b: Sequence[PictureFacts]) -> list[dict[str, Any]]:
    """Mean share of each class among labelled pixels, largest difference first."""
    ours, photographs = mean_histogram(a, "classes"), mean_histogram(b, "classes")
    if ours is None or photographs is None:
        return []
    order = np.argsort(-np.abs(ours - photographs), kind="stable")
    return [
        {"name": NYU40_NAMES[k]} | _both_sets(ours[k], photographs[k])
        for k in order.tolist()
        if k and (ours[k] or photographs[k])
    ]


def _unlike(
    a: Sequence[PictureFacts], b: Sequence[PictureFacts], ours: F64, photographs: F64
) -> tuple[Unlike, ...]:
    """The views with the largest distance to their nearest photograph, largest first."""
    distance, nearest = nearest_of(ours, photographs)
    between, _ = nearest_of(photographs, photographs, leave_out_self=True)
    unit = max(float(np.median(between)), 1e-9)
    order: I64 = np.argsort(-distance, kind="stable")[:N_UNLIKE]
    return tuple(
        Unlike(a[k], b[nearest[k]], float(distance[k]) / unit, _reasons(a[k], b))
        for k in order.tolist()
    )


def _reasons(view: PictureFacts, photographs: Sequence[PictureFacts]) -> tuple[str, ...]:
    """The view's numbers outside those of nearly all photographs, largest difference first."""
    reasons: list[tuple[float, str]] = []
    for name, _, less, more in NUMBERS:
        values = _values_of(photographs, name)
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
                reasons.append((abs(value - middle) / spread, text))
    return tuple(text for _, text in sorted(reasons, key=lambda reason: -reason[0])[:_MOST_REASONS])


def _rounded(value: Any) -> Any:
    """The value with numbers of five significant digits."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return [_rounded(item) for item in value] if isinstance(value, list) else value
