"""The choice of a home's views: the best of each sector, jointly similar to photographs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.recipe import CameraFields, recipe_from_name
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.sample.candidates import Candidates
from pbrs_farm.sample.photo_choice import (
    MOST_WORSE,
    NYUV2_SHARES,
    PhotoChoice,
    RoomCandidates,
    share_distance,
)
from pbrs_farm.sample.view_overlap import DEPTH_SIZE
from tests.sample.sampled_rooms import room_house, shell

FIELDS: CameraFields = recipe_from_name("fast").cameras
PHOTOGRAPH = {name: share / sum(NYUV2_SHARES.values()) for name, share in NYUV2_SHARES.items()}


def shows(**shares: float) -> list[float]:
    return [shares.get(name, 0.0) for name in NYU13_NAMES]


WALLS, LIKE_ALL = shows(wall=1.0), shows(**PHOTOGRAPH)


def room(
    rows: Sequence[tuple[int, float, list[float]]],
    name: str = "0_0",
    framing: float = 0.0,
    foreground: float = 0.0,
) -> RoomCandidates:
    """A room of candidates (sector, score, shares), each 10 m from the next: no twins.

    framing, foreground: penalties of the first candidate.
    """
    n = len(rows)
    eye = np.stack([10.0 * np.arange(n), np.full(n, 1.5), np.full(n, float(int(name[-1])))], 1)
    return RoomCandidates(
        room=room_house(shell(3, 3), 3, 3, id=name).rooms[0],
        candidates=Candidates(
            eye=eye,
            towards=np.tile([0.0, 0.0, 1.0], (n, 1)),
            sector=np.array([row[0] for row in rows], np.int32),
            cell=np.zeros((n, 2), np.int32),
            zoom=np.ones(n),
            roll=np.zeros(n),
        ),
        verdict=np.full(n, Verdict.LOWER_SCORE, np.uint8),
        score=np.array([row[1] for row in rows]),
        nyu13=np.array([row[2] for row in rows]),
        framing=framing * np.eye(n)[0],
        foreground=foreground * np.eye(n)[0],
    )


def chosen(*rooms: RoomCandidates, **fields: object) -> dict[tuple[str, int], list[int]]:
    """Choose, with depths of 2 m everywhere."""

    def depth_of(cameras: Sequence[Camera]) -> F32:
        return np.full((len(cameras), DEPTH_SIZE[1], DEPTH_SIZE[0]), 2.0, np.float32)

    lens = Intrinsics.from_hfov(*DEPTH_SIZE, FIELDS.hfov_rad)
    return PhotoChoice(FIELDS.model_copy(update=fields), lens, depth_of).choose(rooms)


def test_of_equal_views_the_most_photographic_is_chosen() -> None:
    rows = [(0, 1.05, WALLS), (0, 1.0, LIKE_ALL)]
    assert chosen(room(rows), likeness=2.0) == {("0_0", 0): [1]}


def test_without_likeness_the_best_score_is_chosen() -> None:
    scored = room([(0, 1.05, WALLS), (0, 1.0, LIKE_ALL)])
    assert chosen(scored, likeness=0.0) == {("0_0", 0): [0]}
    assert scored.verdict.tolist() == [Verdict.WINNER, Verdict.LOWER_SCORE]


def test_a_much_better_view_is_taken_despite_its_contents() -> None:
    rows = [(0, 2.0, WALLS), (0, 2.0 - MOST_WORSE - 0.01, LIKE_ALL)]
    assert chosen(room(rows), likeness=50.0) == {("0_0", 0): [0]}


def test_views_complement_each_other_across_rooms() -> None:
    # The first room can show only walls and floor; the second, floor or the missing classes.
    missing = {k: v for k, v in PHOTOGRAPH.items() if k not in ("wall", "floor")}
    first = room([(0, 1.2, shows(wall=PHOTOGRAPH["wall"], floor=PHOTOGRAPH["floor"]))])
    second = room([(0, 1.1, LIKE_ALL), (0, 1.1, shows(**missing))], "0_1")
    pair = chosen(first, second, likeness=2.0)
    assert pair["0_1", 0] == [1]


def test_an_early_choice_is_exchanged_when_later_views_change_the_whole() -> None:
    # Alone, the first sector's best view resembles a photograph; beside two views of walls, one
    # without walls does.
    no_wall = {k: v for k, v in PHOTOGRAPH.items() if k != "wall"}
    rows = [(0, 1.3, LIKE_ALL), (0, 1.3, shows(**no_wall)), (1, 1.2, WALLS), (2, 1.1, WALLS)]
    assert chosen(room(rows), likeness=2.0)["0_0", 0] == [1]


def test_every_room_has_a_view_even_if_unlike_photographs() -> None:
    rooms = [room([(0, 1.2, LIKE_ALL)]), room([(0, 0.3, WALLS)], "0_1")]
    assert chosen(*rooms, likeness=50.0)["0_1", 0] == [0]


def test_a_weak_view_is_not_taken_for_its_likeness() -> None:
    scored = room([(0, FIELDS.min_score, WALLS), (0, FIELDS.min_score - 0.01, LIKE_ALL)])
    assert chosen(scored, likeness=50.0) == {("0_0", 0): [0]}
    assert scored.verdict[1] == Verdict.BELOW_MIN_SCORE


def test_a_badly_framed_view_is_not_taken_for_its_likeness() -> None:
    rows = [(0, 1.1, LIKE_ALL), (0, 1.0, LIKE_ALL)]
    assert chosen(room(rows, framing=0.3), likeness=2.0)["0_0", 0] == [1]
    assert chosen(room(rows, framing=0.0), likeness=2.0)["0_0", 0] == [0]
    assert chosen(room(rows, framing=0.3), likeness=0.0)["0_0", 0] == [0]


def test_a_view_past_a_lampshade_yields_to_an_unobstructed_one_of_its_sector() -> None:
    rows = [(0, 1.3, LIKE_ALL), (0, 1.1, LIKE_ALL)]
    for likeness in (0.0, 2.0):
        assert chosen(room(rows), likeness=likeness)["0_0", 0] == [0]
        assert chosen(room(rows, foreground=0.3), likeness=likeness)["0_0", 0] == [1]
    # The unobstructed view may be below the threshold of the better score.
    rows = [(0, 2.0, LIKE_ALL), (0, 2.0 - MOST_WORSE - 0.05, LIKE_ALL)]
    assert chosen(room(rows, foreground=1.0), likeness=2.0)["0_0", 0] == [1]


def test_a_sector_keeps_a_view_despite_obstructions() -> None:
    rows = [(0, FIELDS.min_score, LIKE_ALL)]
    assert chosen(room(rows, foreground=3.0))["0_0", 0] == [0]


def test_several_views_of_a_sector_are_chosen_together() -> None:
    no_wall = {k: v for k, v in PHOTOGRAPH.items() if k != "wall"}
    rows = [(0, 1.2, LIKE_ALL), (0, 1.2, shows(**no_wall)), (0, 1.2, shows(wall=0.285))]
    selected = chosen(room(rows), likeness=2.0, per_sector=2)["0_0", 0]
    assert len(selected) == len(set(selected)) == 2
    assert share_distance(room(rows).nyu13[selected].sum(0)) < 0.35


def test_the_choice_is_the_same_every_time() -> None:
    rng = np.random.default_rng(0)
    shown = rng.dirichlet([1] * 14, 90).tolist()
    rows = [(k % 6, 0.8 + k / 180, shown[k]) for k in range(90)]
    assert chosen(room(rows), likeness=2.0) == chosen(room(rows), likeness=2.0)
