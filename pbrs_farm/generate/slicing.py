"""Slicing floor plans: a rectangle cut in two again and again, annealed until each room fits; no effects.

Wong and Liu, "A new algorithm for floorplan design" (DAC 1986). All coordinates are whole steps
of 5 cm on the walls' middle lines, so that rooms that share a wall share its numbers exactly. The
budget is counted in moves, never in seconds: the same seed gives the same plan on any machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.generate.slicing_goals import (
    STEP_M,
    Brief,
    Contact,
    IntRect,
    Rules,
    SliceLeaf,
    given_places,
)

N_MOVES: Final = 3000
N_TRIES: Final = 10
_T_START, _T_END = 6.0, 0.8
_SNAP: Final = 12  # steps that a cut moves to the side of a pinned rectangle

_GOOD: Final = 0.1  # cost that more moves hardly better


@dataclass(slots=True)
class _Tree:
    # Node k < n - 1 is a cut with two children; node n - 1 + i is a place for a leaf.
    vertical: list[bool]  # of each cut
    children: list[tuple[int, int]]
    leaf_at: list[int]  # leaf in place i

    def cut(self, a: int, b: int, vertical: bool) -> int:
        """Join two nodes by a new cut; gives its number."""
        self.vertical.append(vertical)
        self.children.append((a, b))
        return len(self.children) - 1

    def chain(self, leaves: list[int], vertical: bool, n: int) -> int:
        """Put leaves of n in the next places, in a row; gives the node of the row."""
        node = -1
        for leaf in leaves:
            self.leaf_at.append(leaf)
            place = n - 2 + len(self.leaf_at)
            node = place if node < 0 else self.cut(node, place, vertical)
        return node

    def copy(self) -> _Tree:
        return _Tree(self.vertical[:], self.children[:], self.leaf_at[:])


def drawn_outline(
    area: float, rng: np.random.Generator, ratios: tuple[float, float] = (0.6, 1.7)
) -> tuple[int, int]:
    """Width and depth in steps of a rectangle of that area; ratios: width by depth."""
    width = math.sqrt(area * float(rng.uniform(*ratios)))
    return round(width / STEP_M), round(area / width / STEP_M)


def solved(
    leaves: tuple[SliceLeaf, ...],
    contacts: tuple[Contact, ...],
    hall: int,
    lit_sides: tuple[bool, bool, bool, bool],
    rng: np.random.Generator,
    outline: tuple[int, int] | None = None,
    n_moves: int = N_MOVES,
    ratios: tuple[float, float] = (0.6, 1.7),
) -> tuple[Brief, list[IntRect]] | None:
    """An outline (given, or drawn by ratios) and a rectangle for each leaf that meet all hard rules; or None."""
    w, d = outline or drawn_outline(sum(leaf.area for leaf in leaves), rng, ratios)
    brief = Brief(leaves, contacts, hall, w, d, lit_sides, given_places(leaves))
    rects, unmet = _annealed(brief, _Random(rng), n_moves)
    return None if unmet else (brief, rects)


class _Random:
    """Uniform numbers drawn in blocks: a generator's call costs more than a move."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._block: list[float] = []

    def __call__(self) -> float:
        if not self._block:
            self._block = self._rng.random(4096).tolist()
        return self._block.pop()

    def below(self, n: int) -> int:
        return int(self() * n)


def _annealed(brief: Brief, draw: _Random, n_moves: int) -> tuple[list[IntRect], int]:
    """The best rectangles of one annealing and how many hard rules they break."""
    tree = _spine_tree(brief, draw)
    rules = Rules(brief)
    rects = _lay_out_tree(tree, brief)
    cost, unmet = rules.judge(rects) or (math.inf, 0)
    best, best_score = rects, (unmet, cost)

    def most() -> float:
        """Largest accepted cost of a worse move."""
        return cost - temperature * math.log(draw() or 1e-300)

    cooling = (_T_END / _T_START) ** (1 / n_moves)
    temperature = _T_START
    for _ in range(n_moves):
        temperature *= cooling
        moved = _neighbour_tree(tree, draw)
        new_rects = _lay_out_tree(moved, brief)
        judged = rules.judge(new_rects, cost, most)
        if judged is not None:
            tree, (cost, unmet) = moved, judged
            if (unmet, cost) < best_score:
                best, best_score = new_rects, (unmet, cost)
                if cost < _GOOD:
                    break
    return best, best_score[0]


def _spine_tree(brief: Brief, draw: _Random) -> _Tree:
    """The hall along the middle with a row of rooms on either side, in random order."""
    n = len(brief.leaves)
    rest = [i for i in range(n) if i != brief.hall]
    for i in range(len(rest) - 1, 0, -1):
        j = draw.below(i + 1)
        rest[i], rest[j] = rest[j], rest[i]
    # Fill the first row up to about half of the area.
    half = sum(brief.leaves[i].area for i in rest) * (0.35 + 0.3 * draw())
    rows: tuple[list[int], list[int]] = ([], [])
    for i in rest:
        rows[half < 0 and len(rows[0]) > 0].append(i)
        half -= brief.leaves[i].area
    # Join each row into a chain of cuts, then the rows and the hall.
    upright = draw() < 0.5
    tree = _Tree([], [], [])
    tops = [tree.chain(row, upright, n) for row in (rows[0], [brief.hall], rows[1]) if row]
    node = tops[0]
    for top in tops[1:]:
        node = tree.cut(node, top, not upright)
    return tree


def _neighbour_tree(tree: _Tree, draw: _Random) -> _Tree:
    """A neighbour: leaves swapped, a cut turned, children swapped, a subtree turned or moved."""
    new = tree.copy()
    n_cuts, kind = len(new.children), draw()
    if kind < 0.40:
        i, j = draw.below(n_cuts + 1), draw.below(n_cuts + 1)
        new.leaf_at[i], new.leaf_at[j] = new.leaf_at[j], new.leaf_at[i]
    elif kind < 0.60:
        k = draw.below(n_cuts)
        new.vertical[k] = not new.vertical[k]
    elif kind < 0.72:
        k = draw.below(n_cuts)
        a, b = new.children[k]
        new.children[k] = (b, a)
    elif kind < 0.85:
        # Turn all cuts below one.
        stack = [draw.below(n_cuts)]
        while stack:
            k = stack.pop()
            if k < n_cuts:
                new.vertical[k] = not new.vertical[k]
                stack += new.children[k]
    else:
        _exchange_subtrees(new, draw.below(n_cuts), draw.below(n_cuts), draw)
    return new


def _exchange_subtrees(tree: _Tree, i: int, j: int, draw: _Random) -> None:
    """Swap a child of cut i with a child of cut j, unless one is an ancestor of the other."""
    side_i, side_j = draw.below(2), draw.below(2)
    a, b = tree.children[i][side_i], tree.children[j][side_j]
    if i == j or _is_below(tree, j, a) or _is_below(tree, i, b):
        return
    for k, side, child in ((i, side_i, b), (j, side_j, a)):
        pair = tree.children[k]
        tree.children[k] = (child, pair[1]) if side == 0 else (pair[0], child)


def _is_below(tree: _Tree, node: int, top: int) -> bool:
    stack = [top]
    while stack:
        k = stack.pop()
        if k == node:
            return True
        if k < len(tree.children):
            stack += tree.children[k]
    return False


def _lay_out_tree(tree: _Tree, brief: Brief) -> list[IntRect]:
    """The rectangle of each leaf: every cut divides its rectangle by the areas of its children."""
    n_cuts = len(tree.children)
    leaves, leaf_at, children = brief.leaves, tree.leaf_at, tree.children
    # The root is the cut that no other has as a child: exchanges keep it the last one.
    area = [0.0] * (2 * n_cuts + 1)
    for i, leaf in enumerate(leaf_at):
        area[n_cuts + i] = leaves[leaf].area
    order = [n_cuts - 1]
    for k in order:
        order += [c for c in children[k] if c < n_cuts]
    for k in reversed(order):
        a, b = children[k]
        area[k] = area[a] + area[b]
    limits = _limits(tree, brief, order)
    # Go down from the outline.
    rects: list[IntRect] = [(0, 0, 0, 0)] * (n_cuts + 1)
    stack = [(n_cuts - 1, 0, 0, brief.width, brief.depth)]
    while stack:
        k, x0, z0, x1, z1 = stack.pop()
        if k >= n_cuts:
            rects[leaf_at[k - n_cuts]] = (x0, z0, x1, z1)
            continue
        a, b = children[k]
        share = area[a] / area[k]
        if tree.vertical[k]:
            cut = x0 + round((x1 - x0) * share)
            if k in limits:
                cut = _kept_off(cut, limits[k])
            stack += ((a, x0, z0, cut, z1), (b, cut, z0, x1, z1))
        else:
            cut = z0 + round((z1 - z0) * share)
            if k in limits:
                cut = _kept_off(cut, limits[k])
            stack += ((a, x0, z0, x1, cut), (b, x0, cut, x1, z1))
    return rects


_Limit = tuple[int, bool, float]  # of a cut: a side, whether it is the least one, its reach


def _limits(tree: _Tree, brief: Brief, order: list[int]) -> dict[int, list[_Limit]]:
    """Bounds for the cuts around leaves with a given place; those of the pinned leaf last."""
    limits: dict[int, list[_Limit]] = {}
    n_cuts = len(tree.children)
    for leaf, place, is_exact in brief.places:
        node = n_cuts + tree.leaf_at.index(leaf)
        # Process cuts from leaves to root: the order lists every cut before its children.
        for k in reversed(order):
            if node in tree.children[k]:
                is_first = node == tree.children[k][0]
                side = place[2 * is_first + (not tree.vertical[k])]
                reach = 0 if not is_exact else math.inf if node >= n_cuts else _SNAP
                limits.setdefault(k, []).append((side, is_first, reach))
                node = k
    return limits


def _kept_off(cut: int, limits: list[_Limit]) -> int:
    """A cut moved to each side that it is near to, or to the one that it would lie beyond."""
    for side, is_least, reach in limits:
        if abs(cut - side) <= reach or (cut < side) == is_least:
            cut = side
    return cut
