"""Depth against the planes of the normals, from a view's own pictures; no rays, no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored_view import StoredView

# Share of neighbours with one normal that may lie on different planes: steps, shelves, slats.
# Real views have less than 0.01; depth along the ray, or normals in another frame, nearly 1.
MAX_OFF = 0.05

_NORMAL_ERROR = 1e-4  # of a component stored in 16 bits


def check_planes(view: StoredView, arrays: dict[str, NDArray[Any]], tally: Tally) -> None:
    """Where two neighbours show one instance with one normal, the plane through the first predicts
    the depth of the second: to rounding, and what a normal of 16 bits loses on slanting faces."""
    # Rays of unit depth through the pixels, in the camera's frame.
    depth, normal, instance = arrays["depth"] / 1000, arrays["normal"], arrays["instance"]
    height, width = view.size
    rows, columns = (g.reshape(-1) for g in np.mgrid[0:height, 0:width])
    _, rays = view.rays(rows, columns)
    rays = (rays @ view.world_from_camera[:3, :3]).reshape(height, width, 3)
    decoded = normal * (2 / 65535) - 1
    # Published axes are x right, y forward, z up; the rays' are x right, y down, z forward.
    facing = np.stack([decoded[..., 0], -decoded[..., 2], decoded[..., 1]], axis=-1)

    # Pair each pixel with its right neighbour, where both show one surface.
    left, right = np.s_[:, :-1], np.s_[:, 1:]
    same = (normal[left] == normal[right]).all(-1) & (instance[left] == instance[right])
    same &= (depth[left] > 0) & (depth[right] > 0)
    here = np.einsum("ni,ni->n", facing[left][same], rays[left][same])
    there = np.einsum("ni,ni->n", facing[left][same], rays[right][same])
    near, far = depth[left][same], depth[right][same]
    # Follow the plane through the first to the ray of the second.
    with np.errstate(divide="ignore", invalid="ignore"):
        predicted = near * here / there
        slack = 0.0012 * (1 + np.abs(predicted / near)) + _NORMAL_ERROR * far / np.abs(there)
        off = int((~(np.abs(predicted - far) <= slack)).sum())
    allowed = off <= max(10, MAX_OFF * len(near))
    tally.add("depth on planes", len(near), ties=off if allowed else 0)
    if not allowed:
        what = f"{off} of {len(near)} neighbours do not lie on the plane of their normal"
        tally.fail("depth on planes", view.place, what, off)
