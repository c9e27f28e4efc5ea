"""Fills shelves from left to right: runs of books with their spines out, piles, boxes, ornaments. Effects: changes the house."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.dress.clutter.placing import Placing, take_for_room
from pbrs_farm.dress.clutter.stock import CLUTTER, KindShares
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.worktop import TopSpot, Worktop
from pbrs_farm.home.room_use import RoomKind

_LEAST_BOOK_M = 0.14  # free height that upright books need
_HEADROOM_M = 0.015
_TOUCH_M = 0.0003  # gap between a row of books and the book that leans on it


@dataclass(frozen=True, slots=True)
class ShelfPlan:
    """How a whole bookcase is filled."""

    books: float  # share of its length
    fullness: float
    others: KindShares
    inset_m: float  # of the spines behind the front edge


def plan_shelves(placing: Placing, kind: RoomKind) -> ShelfPlan:
    """Fill plan for the shelves of one bookcase, by its room."""
    rng = placing.rng
    theme, books = "decor", float(rng.uniform(0.08, 0.26))
    if kind is RoomKind.KITCHEN or (kind is RoomKind.DINING and rng.random() < 0.4):
        theme, books = "kitchen", 0.05
    elif kind is RoomKind.OFFICE:
        theme, books = "office", float(rng.uniform(0.15, 0.35))
    elif kind is RoomKind.BEDROOM and rng.random() < 0.35:
        theme, books = "child", float(rng.uniform(0.08, 0.25))
    fullness = float(np.clip(rng.uniform(0.55, 1.0) + placing.bias, 0.2, 1.0))
    inset_m = float(rng.uniform(0.01, 0.04))
    return ShelfPlan(books, fullness * min(placing.share, 1.0), CLUTTER.shelves[theme], inset_m)


def fill_shelf(placing: Placing, top: Worktop, plan: ShelfPlan) -> int:
    """Fill one shelf from left to right, with random gaps, maybe not at all; the number of items."""
    rng = placing.rng
    n, column = 0, top.columns[0]
    free = top.free_height()
    while column < top.columns[1] - 4:
        if rng.random() > plan.fullness:
            # Leave a gap.
            column += int(rng.uniform(0.08, 0.22) / top.grid.cell_m)
            continue
        if free > _LEAST_BOOK_M and rng.random() < plan.books:
            after = _put_books(placing, top, column, plan, free)
        else:
            after = _put_other(placing, top, column, plan, free)
        n += after is not None
        column = after if after is not None else column + 6
    return n


def _put_books(
    placing: Placing, top: Worktop, column: int, plan: ShelfPlan, free: float
) -> int | None:
    rng, stock = placing.rng, placing.stock
    tall = free - _HEADROOM_M - 0.01
    depth = min(top.depth - 0.01, 0.24)
    if depth < 0.1 or tall < 0.11:
        return None
    # Now and then they lie; a pile may carry nothing.
    mess = placing.house.mess
    if rng.random() < 0.08 + 0.14 * mess:
        return _leftmost(placing, top, column, [_lying(rng, placing, depth, tall)], plan.inset_m)
    most = min(float(rng.uniform(0.14, 0.6)), (top.columns[1] - column) * top.grid.cell_m - 0.012)
    leans = rng.random() < 0.2 + 0.4 * mess and most > 0.3
    for length in (most, 0.6 * most, 0.35 * most):
        if length < 0.03:
            return None
        books, last = content().run_of_books(rng, stock.covers, length - 0.09 * leans, tall, depth)
        row = [books]
        if leans and last > 0.14:
            row.append(content().leaning_book(rng, stock.covers, last * 0.97, depth))
        after = _leftmost(placing, top, column, row, plan.inset_m)
        if after is not None:
            return after
    return None


def _lying(rng: np.random.Generator, placing: Placing, depth: float, tall: float) -> Model:
    # A pile as high as the shelf lets it, its spines out.
    n = int(rng.integers(2, 6))
    while True:
        pile = content().stack_of_books(rng, placing.stock.covers, n, most=min(depth / 0.72, 0.32))
        if pile[0].size[2] < tall or n == 1:
            return pile
        n -= 1


def _put_other(
    placing: Placing, top: Worktop, column: int, plan: ShelfPlan, free: float
) -> int | None:
    rng = placing.rng
    share = np.array([p for _, p in plan.others])
    kind = plan.others[int(rng.choice(len(share), p=share / share.sum()))][0]
    model = take_for_room(placing, kind)
    if model is None or model[0].size[2] > free - _HEADROOM_M or model[0].size[1] > top.depth:
        return None
    return _leftmost(placing, top, column + 1, [model], plan.inset_m + float(rng.uniform(0, 0.04)))


def _leftmost(
    placing: Placing, top: Worktop, column: int, row: list[Model], inset_m: float
) -> int | None:
    """Put a row of touching items, fronts inset_m behind the edge, far left; the next column, or None."""
    sizes = np.array([model[1].bounds[1] - model[1].bounds[0] for model in row])
    width = float(sizes[:, 0].sum() + _TOUCH_M * (len(row) - 1))
    needed = (width, float(sizes[:, 1].max()), float(sizes[:, 2].max()))
    rows, columns, n = top.spots(needed, margin_m=0.0)
    usable = columns >= column
    if not usable.any():
        return None
    first = int(columns[usable].min())
    choices = rows[usable & (columns == first)]
    target = top.rows[1] - n[0] - inset_m / top.grid.cell_m
    spot = TopSpot(int(choices[np.argmin(np.abs(choices - target))]), first, *n)
    top.take(spot)
    _put_row(placing, top, spot, row, sizes)
    return spot.column + spot.n_columns


def _put_row(placing: Placing, top: Worktop, spot: TopSpot, row: list[Model], sizes: F64) -> None:
    # Line the items up from the left end, aligned at the front.
    cell, turn = top.grid.cell_m, top.grid.turn_rad
    front = (spot.row + spot.n_rows) * cell - 0.5 * cell
    x = spot.column * cell + 0.5 * cell
    for model, size in zip(row, sizes, strict=True):
        place = top.grid.plan_of((x + size[0] / 2) / cell, (front - size[2] / 2) / cell)
        placing.put(model, np.array([place[0], top.height, place[1]]), turn)
        x += float(size[0]) + _TOUCH_M
