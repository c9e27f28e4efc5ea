"""Questions about space: answers by closed form, no doubtful question, no answer that a blind guesser has."""

import csv
import json
import math
import random
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyarrow.parquet as pq
import pytest

import pbrs_farm as pf
from benchmarks.question_check import wrong_answers
from pbrs_farm.core.house import House, Item
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.export.export_views import export, remarks_of
from pbrs_farm.export.questions import asking
from pbrs_farm.export.questions.asking import Asker, blind_scores, mean_relative_accuracy
from pbrs_farm.export.questions.clips import Clip, Thing, is_countable
from pbrs_farm.export.questions.kinds import KINDS, Draft, QuestionKind, bearing_deg
from pbrs_farm.export.questions.references import references_of
from tests.sample.sampled_rooms import box, room_house
from tests.scene.homes import small_home

KIND = {kind.name: kind for kind in KINDS}
ROOM_M = 8.0


def thing(number: int, noun: str, x: float, z: float, size: Any = (0.5, 0.5, 0.5), y=0.0, **seen):
    """A box whose middle stands at (x, z) in plan, its bottom at height y."""
    w, h, d = size
    item = box((x - w / 2, y, z - d / 2), (x + w / 2, y + h, z + d / 2), name=f"{noun} {number}")
    facts = {"first_glimpsed": 0, "first_seen": 0, "most_visible": 1.0} | seen
    return Thing(number, noun, item, **facts)


def house_of(*items: Item) -> House:
    return room_house(list(items), ROOM_M, ROOM_M)


def clip_of(*things: Thing, frames: int = 1, eye=(1.0, 1.5, 1.0), facts: Any = None) -> Clip:
    pose = np.eye(4)
    pose[:3, 3] = eye
    table = {"world_from_camera_opencv": pose.tolist(), "instances": [], "width_px": 100} | (
        facts or {}
    )
    view = SimpleNamespace(facts=table, entry=SimpleNamespace(file=lambda _name: None))
    house = house_of(*(t.item for t in things))
    return Clip("clip", [cast(ChosenView, view)] * frames, house, things)


def drafts(kind: str, clip: Clip):
    return list(KIND[kind].drafts(clip, random.Random(0)))


def test_distance_is_between_the_nearest_places_of_the_meshes():
    # Two boxes of half a metre, corner to corner: their middles are 3 m and 4 m apart along the axes.
    clip = clip_of(thing(1, "sofa", 1, 1), thing(2, "bed", 4, 5))
    for draft in drafts("object_abs_distance", clip):
        assert draft.answer == f"{math.hypot(2.5, 3.5):.1f}"
    # An edge over a face.
    assert clip.gap_m(*clip.things) == pytest.approx(math.hypot(2.5, 3.5), abs=1e-6)
    over = clip_of(thing(1, "table", 2, 2, (2, 0.5, 2)), thing(2, "lamp", 2.3, 2.1, y=1.75))
    assert over.gap_m(*over.things) == pytest.approx(1.25, abs=1e-6)


def test_things_that_nearly_touch_are_asked_no_distance():
    clip = clip_of(thing(1, "sofa", 1, 1), thing(2, "bed", 1.7, 1))
    assert drafts("object_abs_distance", clip) == []


def test_bearings_are_right_positive_seen_from_above():
    # World y is up and right-handed: who faces -z has +x at the right hand.
    here, ahead = np.array([0.0, 0.0]), np.array([0.0, -2.0])
    places = {"ahead": (0, -1), "right": (1, 0), "left": (-1, 0), "front-right": (1, -1)}
    got = {name: bearing_deg(here, ahead, np.array(at, float)) for name, at in places.items()}
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
def test_a_direction_is_that_of_one_who_stands_and_faces(kind, at, answer):
    stand, face = thing(1, "sofa", 4, 4), thing(2, "bed", 4, 1)
    clip = clip_of(stand, face, thing(3, "desk", *at))
    found = [d for d in drafts(kind, clip) if d.about == (1, 2, 3)]
    assert [d.answer for d in found] == [answer]
    assert answer in found[0].options


def test_a_direction_near_a_border_is_not_asked():
    clip = clip_of(thing(1, "sofa", 4, 4), thing(2, "bed", 4, 1), thing(3, "desk", 4.2, 2.4))
    assert not [d for d in drafts("object_rel_direction_hard", clip) if d.about == (1, 2, 3)]


def test_only_what_is_seen_without_doubt_is_asked_about():
    lamps = [thing(1, "lamp", 1, 1), thing(2, "lamp", 3, 1)]
    clip = clip_of(*lamps, thing(3, "sofa", 5, 5))
    assert [d.answer for d in drafts("object_counting", clip)] == ["2"]
    assert {t.noun for t in clip.single} == {"sofa"}
    # A third lamp may be noticed, but is hardly seen.
    doubtful = clip_of(*lamps, thing(4, "lamp", 6, 6, first_seen=None))
    assert drafts("object_counting", doubtful) == []
    assert not is_countable("row of books")


def test_the_size_of_what_is_half_hidden_is_not_asked():
    whole = clip_of(thing(1, "sofa", 2, 2, (2.13, 0.8, 0.9)))
    assert [d.answer for d in drafts("object_size_estimation", whole)] == ["213"]
    cut = clip_of(thing(1, "sofa", 2, 2, (2.13, 0.8, 0.9), most_visible=0.5))
    assert drafts("object_size_estimation", cut) == []


def test_the_nearest_of_four_is_clearly_the_nearest():
    others = [
        thing(k, noun, 1 + 1.5 * k, 1) for k, noun in enumerate(["bed", "desk", "lamp", "sofa"], 1)
    ]
    clip = clip_of(thing(9, "piano", 1, 1), *others)
    of_piano = [d for d in drafts("object_rel_distance", clip) if d.about[0] == 9]
    assert {d.answer for d in of_piano} == {"bed"}
    # Two at the same distance: no answer.
    same = [thing(k, noun, 4 + dx, 4 + dz) for k, (noun, dx, dz) in enumerate(
        [("bed", 2, 0), ("desk", -2, 0), ("lamp", 0, 2), ("sofa", 0, -2)], 1)]  # fmt: skip
    clip = clip_of(thing(9, "piano", 4, 4), *same)
    assert not [d for d in drafts("object_rel_distance", clip) if d.about[0] == 9]


def test_a_route_turns_where_its_places_do_and_passes_through_nothing():
    # From the sofa ahead (-z) to the bed, then to the desk on the right.
    stops = thing(1, "sofa", 2, 7), thing(2, "bed", 2, 2), thing(3, "desk", 6, 2)
    found = [d for d in drafts("route_planning", clip_of(*stops)) if d.about == (1, 2, 3)]
    assert [d.answer for d in found] == ["turn right"]
    blocked = clip_of(*stops, thing(4, "piano", 4, 2, (0.5, 1.0, 2.0)))
    assert not [d for d in drafts("route_planning", blocked) if d.about == (1, 2, 3)]


def test_order_of_appearance_and_rooms_are_asked_of_walks():
    things = [
        thing(k, noun, 1 + k, 1, first_glimpsed=20 * k, first_seen=20 * k + 2)
        for k, noun in enumerate(["bed", "desk", "lamp", "sofa"])
    ]
    clip = clip_of(*things, frames=100)
    assert {d.answer for d in drafts("obj_appearance_order", clip)} == {"bed, desk, lamp, sofa"}
    assert [d.answer for d in drafts("room_size_estimation", clip)] == [f"{ROOM_M**2:.1f}"]
    # One that is noticed before the other is well seen has no place in an order.
    things[1] = thing(1, "desk", 2, 1, first_glimpsed=3, first_seen=22)
    assert drafts("obj_appearance_order", clip_of(*things, frames=100)) == []
    asked = {q.kind for q in Asker().asked([clip_of(*things)])}
    assert not asked & {"obj_appearance_order", "room_size_estimation"}


def scattered(seed: int) -> Clip:
    rng = np.random.default_rng(seed)
    nouns = ["bed", "desk", "lamp", "sofa", "piano", "table", "chair", "sink"]
    cells = rng.permutation(16)[: len(nouns)]
    return clip_of(*(
        thing(k, noun, 1 + 2 * (c % 4), 1 + 2 * (c // 4)) for k, (noun, c) in enumerate(zip(nouns, cells, strict=True), 1)
    ))  # fmt: skip


def test_no_answer_and_no_letter_is_the_usual_one():
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


def test_a_relative_accuracy_is_the_share_of_thresholds_passed():
    # 10 % off passes .5, .55 ... .85 but not .9, whose limit it meets, nor .95.
    assert mean_relative_accuracy(1.1, 1.0) == pytest.approx(0.8)


def test_a_phrase_fits_one_thing_alone():
    rows = [
        {"id": k, "box2d": [x, 0, x + 10, 10]} for k, x in ((1, 5), (2, 60), (3, 30), (4, 80))
    ]  # fmt: skip
    table, stool = thing(3, "table", 4, 4, (1.5, 0.7, 1.5)), thing(4, "stool", 7, 7)
    on_table = thing(2, "vase", 4, 4, (0.2, 0.3, 0.2), y=0.7)
    clip = clip_of(thing(1, "vase", 1, 1), on_table, table, stool, facts={"instances": rows})
    phrases = {r.phrase: r.instance for r in references_of(clip)}
    assert phrases == {
        "the vase on the left": 1, "the vase on the right": 2, "the vase on the table": 2,
        "the table": 3, "the stool": 4,
    }  # fmt: skip


def test_questions_of_a_real_view_are_right_by_a_checker_that_shares_no_code(tmp_path):
    home = small_home()
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
    # The checker finds what is wrong.
    rows[0]["ground_truth"] = "77"
    (out / "questions.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    assert len(wrong_answers(tmp_path / "root", out)) == 1
    with (out / "blind_scores.csv").open() as file:
        assert {row["question_type"] for row in csv.DictReader(file)} == {
            r["question_type"] for r in rows
        }
    assert any("blindly" in remark for remark in remarks_of(out))
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
    asked = Asker().asked(clips)
    # Two "left"; then nothing is asked until a "right" may be, which makes room for one "left".
    assert [(q.clip, q.answer) for q in asked] == [
        ("c0", "left"), ("c0", "left"), ("c7", "right"), ("c7", "left"),
    ]  # fmt: skip
