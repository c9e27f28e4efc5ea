"""Questions about space: closed-form answers, no ambiguous question, no answer that a blind guesser could give."""

import csv
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import pbrs_farm as pf
from pbrs_farm.check.question_checks import wrong_answers
from pbrs_farm.core.house import MaterialKind
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.export.export_views import export, remarks_of
from pbrs_farm.export.nouns import noun_of
from pbrs_farm.export.questions import asking, clips
from pbrs_farm.export.questions.asking import Asker, Question, blind_scores, mean_relative_accuracy
from pbrs_farm.export.questions.clips import Clip, Thing, is_countable
from pbrs_farm.export.questions.kinds import Draft, QuestionKind, bearing_deg
from pbrs_farm.export.questions.references import references_of
from tests.inputs.asked_clips import ROOM_M, clip_of, drafts, house_of, visible_item
from tests.inputs.made_views import made_view


def test_distance_is_between_the_nearest_places_of_the_meshes():
    # Two boxes of half a metre whose middles are 3 m and 4 m apart along the axes.
    clip = clip_of(visible_item(1, "sofa", 1, 1), visible_item(2, "bed", 4, 5))
    for draft in drafts("object_abs_distance", clip):
        assert draft.answer == f"{math.hypot(2.5, 3.5):.1f}"
    # Nearest between an edge and a face.
    assert clip.gap_m(*clip.things) == pytest.approx(math.hypot(2.5, 3.5), abs=1e-6)
    over = clip_of(
        visible_item(1, "table", 2, 2, (2, 0.5, 2)), visible_item(2, "lamp", 2.3, 2.1, y=1.75)
    )
    assert over.gap_m(*over.things) == pytest.approx(1.25, abs=1e-6)


def test_no_distance_is_asked_for_nearly_touching_items():
    clip = clip_of(visible_item(1, "sofa", 1, 1), visible_item(2, "bed", 1.7, 1))
    assert drafts("object_abs_distance", clip) == []


def test_bearings_are_right_positive_seen_from_above():
    # World y is up and the axes are right-handed: facing -z, +x is on the right.
    origin, ahead = np.array([0.0, 0.0]), np.array([0.0, -2.0])
    places = {"ahead": (0, -1), "right": (1, 0), "left": (-1, 0), "front-right": (1, -1)}
    got = {
        name: bearing_deg(origin, ahead, np.array(place, float)) for name, place in places.items()
    }
    assert got == pytest.approx({"ahead": 0, "right": 90, "left": -90, "front-right": 45})


@pytest.mark.parametrize(
    ("kind", "at", "answer"),
    [
        ("object_rel_direction_easy", (6, 4), "right"), ("object_rel_direction_easy", (2, 4.5), "left"),
        ("object_rel_direction_medium", (4.2, 6.5), "back"),
        ("object_rel_direction_hard", (5.5, 2.5), "front-right"),
        ("object_rel_direction_hard", (2.5, 5.5), "back-left"),
    ],
)  # fmt: skip
def test_a_direction_is_relative_to_a_standing_and_facing_person(kind, at, answer):
    stand, face = visible_item(1, "sofa", 4, 4), visible_item(2, "bed", 4, 1)
    clip = clip_of(stand, face, visible_item(3, "desk", *at))
    directions = [d for d in drafts(kind, clip) if d.about == (1, 2, 3)]
    assert [d.answer for d in directions] == [answer]
    assert answer in directions[0].options


def test_a_direction_near_a_border_is_not_asked():
    clip = clip_of(
        visible_item(1, "sofa", 4, 4),
        visible_item(2, "bed", 4, 1),
        visible_item(3, "desk", 4.2, 2.4),
    )
    assert not [d for d in drafts("object_rel_direction_hard", clip) if d.about == (1, 2, 3)]


def test_a_direction_that_depends_on_the_standing_point_is_not_asked():
    # From the bed's middle the lamp is 33 degrees to the right; from the right front corner of a
    # bed 3 m wide
    # it is to the left of the direction to the desk.
    for width, answers in ((0.5, ["right"]), (3.0, [])):
        bed = visible_item(1, "bed", 4, 4, (width, 0.5, 1))
        clip = clip_of(
            bed, visible_item(2, "desk", 4, 1), visible_item(3, "lamp", 4.9, 2.6, (0.2, 1, 0.2))
        )
        directions = [d for d in drafts("object_rel_direction_easy", clip) if d.about == (1, 2, 3)]
        assert [d.answer for d in directions] == answers


def view_of_wall(cx: float, row: Any = None) -> ChosenView:
    """A camera at (4, 1, 0) that looks along +z, its world's y down: the column is 50 x / z + cx."""
    pose = np.eye(4)
    pose[:3, 3] = (4.0, 1.0, 0.0)
    facts = {
        "width_px": 100, "height_px": 100, "K": [[50, 0, cx], [0, 50, 50], [0, 0, 1]],
        "world_from_camera_opencv": pose.tolist(), "instances": [row] if row else [],
    }  # fmt: skip
    return made_view(facts)


def test_an_item_cut_by_the_edge_of_the_picture_is_not_visible():
    # A panel 2 m wide 4 m away: from 12.5 px left of cx to 12.5 px right of it.
    panel = visible_item(1, "cabinet", 4, 4, (2, 1, 0.002), y=0.5)
    assert panel.share_within(view_of_wall(50)) == 1.0
    assert panel.share_within(view_of_wall(0)) == pytest.approx(0.5, abs=0.02)
    assert panel.share_within(view_of_wall(-20)) == 0.0
    row = {
        "id": 1, "item": panel.item.id, "name": "Cabinet", "class": "cabinet", "kind": "object",
        "fraction": 0.05, "visible_fraction": 1.0, "truncated": True,
    }  # fmt: skip
    for cx, is_seen in ((0, True), (-7.5, False)):  # a half and a fifth are visible
        clip = clips.clip_of_views("clip", [view_of_wall(cx, row)], house_of(panel.item))
        assert bool(clip.single) is is_seen
        # Neither is asked for its size.
        assert drafts("object_size_estimation", clip) == []


def test_items_that_some_would_count_together_are_not_counted():
    shelves = [visible_item(1, "bookshelf", 1, 1), visible_item(2, "bookshelf", 3, 1)]
    assert [d.answer for d in drafts("object_counting", clip_of(*shelves))] == ["2"]
    assert (
        drafts("object_counting", clip_of(*shelves, visible_item(3, "set of shelves", 5, 5))) == []
    )


def test_an_item_whose_name_another_has_is_not_named():
    racks = [visible_item(1, "coat rack", 1, 1), visible_item(2, "clothes rail", 5, 5)]
    assert len(clip_of(*racks).single) == 2
    racks[1].item = replace(racks[1].item, name=racks[0].item.name)
    assert clip_of(*racks).single == []


def test_the_size_of_a_sink_which_may_be_that_of_its_cabinet_is_not_asked():
    assert drafts("object_size_estimation", clip_of(visible_item(1, "sink", 2, 2))) == []


@pytest.mark.parametrize(
    ("kind", "name", "noun"),
    [
        ("chair", "Bench", "bench"), ("chair", "Bar stool 2", "stool"), ("chair", "Desk chair", "chair"),
        ("curtain", "Curtains", "set of curtains"), ("curtain", "Curtain", "curtain"),
    ],
)  # fmt: skip
def test_a_bench_is_called_a_bench(kind, name, noun):
    row = {"class": kind, "kind": "object", "name": name}
    assert noun_of(view_of_wall(0), row) == noun


def test_only_clearly_visible_items_are_asked_about():
    lamps = [visible_item(1, "lamp", 1, 1), visible_item(2, "lamp", 3, 1)]
    clip = clip_of(*lamps, visible_item(3, "sofa", 5, 5))
    assert [d.answer for d in drafts("object_counting", clip)] == ["2"]
    assert {t.noun for t in clip.single} == {"sofa"}
    # A third lamp may be noticed, but is hardly visible.
    doubtful = clip_of(*lamps, visible_item(4, "lamp", 6, 6, first_seen=None))
    assert drafts("object_counting", doubtful) == []
    assert not is_countable("row of books")


def test_the_size_of_a_half_hidden_item_is_not_asked():
    whole = clip_of(visible_item(1, "sofa", 2, 2, (2.13, 0.8, 0.9)))
    assert [d.answer for d in drafts("object_size_estimation", whole)] == ["213"]
    cut = clip_of(visible_item(1, "sofa", 2, 2, (2.13, 0.8, 0.9), most_visible=0.5))
    assert drafts("object_size_estimation", cut) == []


def test_the_nearest_of_four_is_clearly_the_nearest():
    rest = [
        visible_item(k, noun, 1 + 1.5 * k, 1)
        for k, noun in enumerate(["bed", "desk", "lamp", "sofa"], 1)
    ]
    clip = clip_of(visible_item(9, "piano", 1, 1), *rest)
    of_piano = [d for d in drafts("object_rel_distance", clip) if d.about[0] == 9]
    assert {d.answer for d in of_piano} == {"bed"}
    # Two at the same distance: no answer.
    same = [visible_item(k, noun, 4 + dx, 4 + dz) for k, (noun, dx, dz) in enumerate(
        [("bed", 2, 0), ("desk", -2, 0), ("lamp", 0, 2), ("sofa", 0, -2)], 1)]  # fmt: skip
    clip = clip_of(visible_item(9, "piano", 4, 4), *same)
    assert not [d for d in drafts("object_rel_distance", clip) if d.about[0] == 9]


def test_a_route_turns_at_its_places_and_passes_through_nothing():
    # From the sofa ahead (-z) to the bed, then right to the desk.
    stops = (
        visible_item(1, "sofa", 2, 7),
        visible_item(2, "bed", 2, 2),
        visible_item(3, "desk", 6, 2),
    )
    routes = [d for d in drafts("route_planning", clip_of(*stops)) if d.about == (1, 2, 3)]
    assert [d.answer for d in routes] == ["turn right"]
    blocked = clip_of(*stops, visible_item(4, "piano", 4, 2, (0.5, 1.0, 2.0)))
    assert not [d for d in drafts("route_planning", blocked) if d.about == (1, 2, 3)]


def test_order_of_appearance_and_rooms_are_asked_of_walks():
    things = [
        visible_item(k, noun, 1 + k, 1, first_glimpsed=20 * k, first_seen=20 * k + 2)
        for k, noun in enumerate(["bed", "desk", "lamp", "sofa"])
    ]
    clip = clip_of(*things, frames=100)
    assert {d.answer for d in drafts("obj_appearance_order", clip)} == {"bed, desk, lamp, sofa"}
    assert [d.answer for d in drafts("room_size_estimation", clip)] == [f"{ROOM_M**2:.1f}"]
    # An item noticed before the other is clearly visible has no place in an order.
    things[1] = visible_item(1, "desk", 2, 1, first_glimpsed=3, first_seen=22)
    assert drafts("obj_appearance_order", clip_of(*things, frames=100)) == []
    kinds = {q.kind for q in Asker().asked([clip_of(*things)])}
    assert not kinds & {"obj_appearance_order", "room_size_estimation"}


def scattered(seed: int) -> Clip:
    rng = np.random.default_rng(seed)
    nouns = ["bed", "desk", "lamp", "sofa", "piano", "table", "chair", "sink"]
    cells = rng.permutation(16)[: len(nouns)]
    return clip_of(*(
        visible_item(k, noun, 1 + 2 * (c % 4), 1 + 2 * (c // 4)) for k, (noun, c) in enumerate(zip(nouns, cells, strict=True), 1)
    ))  # fmt: skip


@pytest.mark.long
def test_no_answer_and_no_letter_is_the_most_common():
    questions = Asker().asked([scattered(seed) for seed in range(16)])
    scores = blind_scores(questions)
    assert scores["object_rel_distance"][1] <= 0.35
    assert scores["object_rel_direction_hard"][1] <= 0.35
    assert scores["object_rel_direction_medium"][1] <= 0.45
    assert scores["object_rel_direction_easy"][1] <= 0.55
    for question in questions:
        if question.options:
            assert f"{question.ground_truth}. {question.answer}" in question.options
    assert questions == Asker().asked([scattered(seed) for seed in range(16)])


def test_the_noun_of_a_question_may_give_its_answer_away():
    def size_of(noun: str, cm: int) -> Question:
        return Question(
            "room", "object_size_estimation", f"How long is the {noun}?", str(cm), (), ()
        )

    questions = [size_of(noun, cm) for noun, cm in (("cup", 10), ("bed", 200)) for _ in range(4)]
    ((n, constant, by_words),) = blind_scores(questions).values()
    assert (n, constant, by_words) == (8, 0.5, 1.0)


def test_a_relative_accuracy_is_the_share_of_thresholds_passed():
    # An error of 10 % passes .5, .55 ... .85 but not .9, whose limit it equals, nor .95.
    assert mean_relative_accuracy(1.1, 1.0) == pytest.approx(0.8)


def test_a_phrase_fits_exactly_one_item():
    rows = [
        {"id": k, "box2d": [x, 0, x + 24, 24], "truncated": False}
        for k, x in ((1, 5), (2, 60), (3, 30), (4, 80))
    ]  # fmt: skip
    table, sofa = visible_item(3, "table", 4, 4, (1.5, 0.7, 1.5)), visible_item(4, "sofa", 7, 7)
    on_table = visible_item(2, "vase", 4, 4, (0.2, 0.3, 0.2), y=0.7)
    clip = clip_of(visible_item(1, "vase", 1, 1), on_table, table, sofa, facts={"instances": rows})
    phrases = {r.phrase: r.instance for r in references_of(clip)}
    assert phrases == {
        "the vase on the left": 1, "the vase on the right": 2, "the vase on the table": 2,
        "the table": 3, "the sofa": 4,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("noun", "side_px", "seen", "neighbour"),
    [
        ("vase", 23, {}, None), ("vase", 24, {"most_visible": 0.5}, None), ("ornament", 24, {}, None),
        ("vase", 24, {"first_seen": None}, None), ("vase", 24, {"is_cut": True}, None), ("door", 24, {}, None),
        ("vase", 24, {}, ("bin", 5)), ("cabinet", 24, {}, ("cabinet", 1.52)),
    ],
)  # fmt: skip
def test_no_phrase_names_an_item_that_a_person_cannot_recognize(noun, side_px, seen, neighbour):
    def phrased(
        noun: str, side_px: int, others: list[Thing], is_cut: bool = False, **seen: Any
    ) -> set[int]:
        items = [visible_item(1, noun, 1, 1, **seen), *others]
        rows = [
            {"id": t.instance, "box2d": [0, 0, side_px + 60 * k, 70], "truncated": is_cut}
            for k, t in enumerate(items)
        ]
        clip = clip_of(*items, facts={"instances": rows, "width_px": 200})
        return {reference.instance for reference in references_of(clip)}

    others = [] if neighbour is None else [visible_item(2, neighbour[0], neighbour[1], 1)]
    assert not phrased(noun, side_px, others, **seen)
    assert phrased("vase", 24, [visible_item(2, "sofa", 5, 1)]) == {1, 2}
    assert phrased("cabinet", 24, [visible_item(2, "cabinet", 5, 1)]) == {1, 2}


def test_three_items_have_an_order_only_side_by_side():
    def phrases(width_px: int) -> set[str]:
        rows = [
            {"id": k, "box2d": [x, 0, x + width_px, 50], "truncated": False}
            for k, x in ((1, 5), (2, 40), (3, 70))
        ]
        vases = [visible_item(k, "vase", k, 1, (0.2, 0.3, 0.2)) for k in (1, 2, 3)]
        return {r.phrase for r in references_of(clip_of(*vases, facts={"instances": rows}))}

    ordered = {"the leftmost vase", "the second vase from the left", "the rightmost vase"}
    assert phrases(30) == ordered
    assert phrases(40) == set()


def test_a_basket_is_no_box_and_a_candle_no_lamp():
    for kind, name, noun in (("box", "Shopping basket", "basket"), ("lamp", "Candle 2", "candle")):
        row = {"class": kind, "kind": "object", "name": name}
        assert noun_of(view_of_wall(0), row) == noun


@pytest.mark.parametrize(
    ("kind", "rgb", "colour"),
    [
        (MaterialKind.OPAQUE, (181, 98, 59), "brown"), (MaterialKind.OPAQUE, (240, 130, 20), "orange"),
        (MaterialKind.OPAQUE, (230, 230, 230), "white"), (MaterialKind.MIRROR, (230, 230, 230), ""),
    ],
)  # fmt: skip
def test_a_phrase_names_the_colour_of_a_coloured_item(kind, rgb, colour):
    row = {"id": 1, "box2d": [0, 0, 30, 30], "truncated": False}
    clip = clip_of(visible_item(1, "cabinet", 1, 1), facts={"instances": [row]})
    layers = {
        "instance": np.ones((10, 10), np.uint16),
        "albedo": np.full((10, 10, 3), rgb, np.uint8),
    }
    view = made_view(
        clip.views[0].facts,
        array=layers.__getitem__,
        file=lambda name: name if name == "albedo.png" else None,
    )
    house = replace(clip.house, materials=[replace(m, kind=kind) for m in clip.house.materials])
    phrases = {r.phrase for r in references_of(Clip("clip", [view], house, clip.things))}
    assert phrases == {"the cabinet"} | ({f"the {colour} cabinet"} if colour else set())


@pytest.mark.long
def test_questions_of_a_real_view_are_right_by_a_checker_that_shares_no_code(tmp_path):
    home = pf.load("made:2,rooms=1", "preview")
    frames = pf.render(home, home.cameras(n=3), modes=["opengl_dl"], layers=["albedo"])
    frames.save(tmp_path / "root")
    out = tmp_path / "out"
    export(tmp_path / "root", out, "questions")
    rows = [json.loads(line) for line in (out / "questions.jsonl").read_text().splitlines()]
    table = pq.read_table(out / "questions.parquet")
    assert table.column_names == [
        "id", "dataset", "scene_name", "question_type", "question", "ground_truth", "options",
    ]  # fmt: skip
    assert table.num_rows == len(rows) > 4
    assert all((out / row["media"]).is_file() for row in rows)
    assert wrong_answers(tmp_path / "root", out) == []
    # The checker finds the wrong answer.
    rows[0]["ground_truth"] = "77"
    (out / "questions.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    assert len(wrong_answers(tmp_path / "root", out)) == 1
    with (out / "blind_scores.csv").open() as file:
        assert {row["question_type"] for row in csv.DictReader(file)} == {
            r["question_type"] for r in rows
        }
    assert any("without the picture" in remark for remark in remarks_of(out))
    refs = json.loads((out / "refs.json").read_text())
    annotations = {
        a["id"]: a for a in json.loads((out / "instances.json").read_text())["annotations"]
    }
    assert refs
    assert all(annotations[ref["ann_id"]]["image_id"] == ref["image_id"] for ref in refs)
    talks = [json.loads(line) for line in (out / "conversations.jsonl").read_text().splitlines()]
    assert [turn["from"] for turn in talks[0]["conversations"]] == ["human", "gpt"]


def test_how_often_the_few_answers_of_a_kind_are_right_differs_by_two_at_most(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def drafts(clip: Any, _rng: Any) -> Iterator[Draft]:
        for k in range(4):
            answer = "right" if clip.name == "c7" and k == 0 else "left"
            yield Draft({"a": "lamp"}, answer, ("left", "right"), (k,))

    kind = QuestionKind("side", drafts, ("Where is the {a} {here}?",), answers=("left", "right"))
    monkeypatch.setattr(asking, "KINDS", (kind,))
    clips = [SimpleNamespace(name=f"c{k}", is_walk=False) for k in range(12)]
    questions = Asker().asked(clips)
    # Two "left"; the next question waits for a "right", after which one more "left" fits.
    assert [(q.clip, q.answer) for q in questions] == [
        ("c0", "left"), ("c0", "left"), ("c7", "right"), ("c7", "left"),
    ]  # fmt: skip


def test_no_number_is_the_answer_more_often_than_all_others_and_two(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def drafts(clip: Any, _rng: Any) -> Iterator[Draft]:
        yield Draft({"a": "lamp"}, "3" if clip.name == "c5" else "2", (), (1,))

    kind = QuestionKind("count", drafts, ("How many {a} {here}?",))
    monkeypatch.setattr(asking, "KINDS", (kind,))
    clips = [SimpleNamespace(name=f"c{k}", is_walk=False) for k in range(9)]
    questions = Asker().asked(clips)
    assert [(q.clip, q.answer) for q in questions] == [
        ("c0", "2"),
        ("c1", "2"),
        ("c5", "3"),
        ("c6", "2"),
    ]
