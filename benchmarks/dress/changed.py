"""Which surfaces of a home two seeds make visibly differently: another model, or another colour or pattern.

A texture that is only laid elsewhere, other noise of the same paint and a colour that is less than
2/255 away are the same look. Counted are the surfaces of the source, each where it was drawn.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import House, Item, Material, Surface
from pbrs_farm.core.mesh import distances_to_triangles, face_areas, triangle_corners

Floats = NDArray[np.float64]

LEAST_CHANGE = 2 / 255  # root mean square over a picture's places and channels, sRGB-encoded
_GLOSS = 0.1  # of the highlight's colour, sRGB-encoded
_THUMB = 8  # places along each side of a pattern that are compared
_MOST = 0.5  # of a surface's area that must differ


def looks_of(house: House, source: House) -> dict[str, Any]:
    """JSON: the home's looks, and for every surface of the source its model and what it shows.

    surfaces: [item, surface, square metres, model, [[look, share of the area], ...]]; model is ""
    where the item has the source's triangles, and walls and floors always have.
    """
    looks = [_look(m, house) for m in house.materials]
    rows = []
    for k, was in enumerate(source.items):
        now = house.items[k]
        own, its = _soup(was), _soup(now)
        model = "" if was.kind.is_structure or _same(own, its) else _digest(its)
        for j, surface in enumerate(was.surfaces):
            shown = _shares(now) if model else _shown(surface, now, its)
            rows.append([k, j, round(_area(surface), 4), model, shown])
    return {"looks": looks, "surfaces": rows}


def share_changed(a: Mapping[str, Any], b: Mapping[str, Any]) -> tuple[float, float]:
    """Of the surfaces of a home, and of their area, the share that two seeds make differently."""
    same = _same_looks(a["looks"], b["looks"])
    differs = np.array(
        [
            x[3] != y[3] or _differs(x[4], y[4], same)
            for x, y in zip(a["surfaces"], b["surfaces"], strict=True)
        ]
    )
    area = np.array([row[2] for row in a["surfaces"]])
    return float(differs.mean()), float((differs * area).sum() / area.sum())


def _same_looks(a: Sequence[Any], b: Sequence[Any]) -> NDArray[np.bool_]:
    """(A, B) whether looks could not be told apart."""
    x, y = (np.array([look["colours"] for look in looks], np.float64) / 255 for looks in (a, b))
    apart = np.sqrt(((x[:, None] - y[None]) ** 2).mean(2))
    gloss, other = (np.array([look["gloss"] for look in looks]) for looks in (a, b))
    glossier = np.abs(gloss[:, None] - other[None]).max(2)
    kinds = np.array([[p["kind"] == q["kind"] for q in b] for p in a])
    return (apart <= LEAST_CHANGE) & (glossier <= _GLOSS) & kinds


def _differs(a: Any, b: Any, same: NDArray[np.bool_]) -> bool:
    # Both list the same places in the same order, or other parts of one model.
    if len(a) != len(b):
        return True
    changed = sum(
        share for (look, share), (other, _s) in zip(a, b, strict=True) if not same[look, other]
    )
    return bool(changed > _MOST * sum(share for _look, share in a))


def _look(material: Material, house: House) -> dict[str, Any]:
    """Its kind, the colours of its pattern from afar (sRGB8, in a row) and of its highlight."""
    tint = linear_from_srgb(np.array(material.diffuse))
    texture = house.textures.get(material.texture_id or "")
    linear = np.broadcast_to(tint, (_THUMB, _THUMB, 3))
    if texture is not None:
        picture = Image.open(io.BytesIO(texture.data)).convert("RGB")
        small = np.asarray(picture.resize((_THUMB, _THUMB), Image.Resampling.BOX), np.float64) / 255
        linear = linear_from_srgb(small) * tint
    colours = np.rint(255 * srgb_from_linear(linear)).astype(int).ravel().tolist()
    gloss = [round(c, 3) for c in material.specular]
    return {"kind": material.kind.value, "colours": colours, "gloss": gloss}


def _soup(item: Item) -> Floats:
    """(F, 3, 3) its triangles, rounded to 0.1 mm."""
    found = [triangle_corners(s.positions, s.faces) for s in item.surfaces]
    return np.round(np.concatenate([np.zeros((0, 3, 3)), *found]), 4) + 0.0


def _same(a: Floats, b: Floats) -> bool:
    if a.shape != b.shape:
        return False
    rows = [x.reshape(len(x), 9) for x in (a, b)]
    return bool(np.array_equal(*(r[np.lexsort(r.T[::-1])] for r in rows)))


def _digest(soup: Floats) -> str:
    rows = soup.reshape(len(soup), 9)
    return hashlib.sha256(rows[np.lexsort(rows.T[::-1])].tobytes()).hexdigest()[:12]


def _shares(item: Item) -> list[list[Any]]:
    return [[s.material, round(_area(s), 4)] for s in item.surfaces]


def _shown(surface: Surface, now: Item, soup: Floats) -> list[list[Any]]:
    """[look, m2] of each triangle of a surface; of one that was cut, at four places of it."""
    corners = np.round(triangle_corners(surface.positions, surface.faces), 4) + 0.0
    looks = np.repeat([s.material for s in now.surfaces], [len(s.faces) for s in now.surfaces])
    number = {row.tobytes(): k for k, row in enumerate(soup)}
    shown: list[list[Any]] = []
    for triangle, area in zip(corners, face_areas(corners).tolist(), strict=True):
        k = number.get(triangle.tobytes())
        if k is not None:
            shown += [[int(looks[k]), round(area / 4, 5)]] * 4
            continue
        middle = triangle.mean(0)
        for place in (middle, *((middle + triangle) / 2)):
            nearest = int(distances_to_triangles(place, soup).argmin())
            shown.append([int(looks[nearest]), round(area / 4, 5)])
    return shown


def _area(surface: Surface) -> float:
    return float(face_areas(triangle_corners(surface.positions, surface.faces)).sum())
