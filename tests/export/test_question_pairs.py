"""Minimal pairs: one question with another answer in each of two pictures; hidden items; visits of rooms."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.check.question_answers import wrong_answers
from pbrs_farm.core.edits import unedited_id
from pbrs_farm.core.house import LightPart
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.export_views import export
from pbrs_farm.export.questions.asking import Question
from pbrs_farm.export.questions.clips import Clip, Thing
from pbrs_farm.export.questions.kinds import KINDS
from pbrs_farm.export.questions.pairs import HIDDEN, pair_questions
from tests.inputs.asked_clips import clip_of, drafts, house_of, visible_item


def picture(name: str, *things: Thing, eye: Any = (4.0, 1.0, 0.0), hidden: Any = ()) -> Clip:
    """A picture of things from an eye that looks along +z; hidden: items of the room without a pixel."""
    pose = np.eye(4)
    pose[:3, 3] = eye
    house = house_of(*(thing.item for thing in (*things, *hidden)))
    room = house.rooms[0].id
    house = replace(house, items=tuple(replace(i, room_id=room) for i in house.items))
    facts = {
        "width_px": 100, "height_px": 100, "K": [[50, 0, 50], [0, 50, 50], [0, 0, 1]], "room": room,
        "world_from_camera_opencv": pose.tolist(), "instances": [{"id": t.instance} for t in things],
    }  # fmt: skip
    view = SimpleNamespace(facts=facts, id=name, choice=Choice())
    return Clip(name, [cast(ChosenView, view)], house, things)


def asked(kind: str, *pictures: Clip) -> list[Question]:
    return [q for q in pair_questions(pictures, 0) if q.kind == kind]


def check_pairs(questions: list[Question]) -> None:
    """Each pair has the same words and options, and two answers."""
    for one, two in zip(questions[::2], questions[1::2], strict=True):
        assert (one.text, one.options, one.pair) == (two.text, two.options, two.pair)
        assert {one.ground_truth, two.ground_truth} == {"A", "B"}
        assert one.clip != two.clip


def test_a_moved_item_gives_a_question_with_two_answers() -> None:
    sofa, desk = visible_item(1, "sofa", 4, 4), visible_item(2, "desk", 4, 7)
    one = picture("one", sofa, desk, visible_item(3, "lamp", 6, 5))
    two = picture("two", sofa, desk, visible_item(3, "lamp", 2, 5))
    questions = asked("pair_side", one, two)
    check_pairs(questions)
    of_lamp = {(q.clip, q.answer) for q in questions if "the lamp to my" in q.text}
    assert of_lamp <= {("one", "left"), ("two", "right"), ("one", "right"), ("two", "left")}
    assert len(questions) == 4 or len(questions) == 2
    assert asked("pair_side", one, picture("same", *one.things)) == []


def test_the_nearer_item_depends_on_the_camera() -> None:
    things = visible_item(1, "sofa", 2, 4), visible_item(2, "desk", 6, 4)
    one, two = picture("one", *things, eye=(1, 1, 4)), picture("two", *things, eye=(7, 1, 4))
    questions = asked("pair_nearer", one, two)
    check_pairs(questions)
    assert {(q.clip, q.answer) for q in questions} == {("one", "sofa"), ("two", "desk")}
    assert asked("pair_nearer", one, picture("middle", *things, eye=(4, 1, 4))) == []
    # Other items of the same nouns make no pair.
    others = visible_item(3, "sofa", 2, 4), visible_item(4, "desk", 6, 4)
    assert asked("pair_nearer", one, picture("others", *others, eye=(7, 1, 4))) == []


def test_a_lamp_that_is_out_is_not_on() -> None:
    lamp = visible_item(1, "lamp", 4, 4)
    light = LightPart((4, 1, 4), 0.05, 800.0, PowerUnit.LUMEN)
    on, off = (
        replace(lamp, item=replace(lamp.item, lights=(replace(light, power=lm),)))
        for lm in (800.0, 0.0)
    )
    questions = asked("pair_lamp", picture("on", on), picture("off", off))
    check_pairs(questions)
    assert {(q.clip, q.answer) for q in questions} == {("on", "yes"), ("off", "no")}


def test_a_question_about_a_hidden_item_is_declined() -> None:
    sofa, vase = visible_item(1, "sofa", 4, 3), visible_item(2, "vase", 4, 6, (0.3, 0.3, 0.3))
    shown = picture("shown", sofa, vase)
    questions = asked("pair_hidden", shown, picture("hides", sofa, hidden=[vase]))
    check_pairs(questions)
    assert {(q.clip, q.answer) for q in questions} == {("shown", "sofa"), ("hides", HIDDEN)}
    # Neither an item outside the frame nor one with a few pixels is hidden.
    beside = visible_item(2, "vase", 30, 6, (0.3, 0.3, 0.3))
    assert asked("pair_hidden", shown, picture("beside", sofa, hidden=[beside])) == []
    partly = picture("partly", sofa, hidden=[vase])
    partly.views[0].facts["instances"].append({"id": 2})
    assert asked("pair_hidden", shown, partly) == []


def walk(*xs: float) -> Clip:
    """A walk along x through a room of 8 m."""
    clip = clip_of(visible_item(1, "sofa", 1, 1), frames=len(xs))
    views = []
    for x in xs:
        pose = np.eye(4)
        pose[:3, 3] = (x, 1.5, 1.0)
        views.append(SimpleNamespace(facts={"world_from_camera_opencv": pose.tolist()}))
    return replace(clip, views=cast(Any, views))


def test_a_walk_that_returns_to_a_room_visits_it_twice() -> None:
    inside, outside = [2.0] * 6, [9.0] * 6
    answers = {
        n: [d.answer for d in drafts("room_visits", walk(*inside, *(outside + inside) * n))]
        for n in range(3)
    }
    assert answers == {0: ["1"], 1: ["2"], 2: ["3"]}
    # Nobody counts a step into a room.
    assert drafts("room_visits", walk(*inside, *outside, 2.0, *outside)) == []
    assert next(kind for kind in KINDS if kind.name == "room_visits").of_walks_only


@pytest.mark.long
def test_pairs_of_an_edited_home_are_right_by_a_checker_that_shares_no_code(tmp_path):
    home = pf.load("made:2,rooms=1", "preview")
    cameras = home.cameras(n=3)
    lamps = [item.id for item in home.house.items if item.lights]
    dark = home.light(lamps, lm=0)
    for version in (home, dark):
        frames = pf.render(version, [camera.camera for camera in cameras], modes=["opengl_dl"])
        frames.save(tmp_path / "root")
    out = tmp_path / "out"
    export(tmp_path / "root", out, "questions")
    rows = [json.loads(line) for line in (out / "questions.jsonl").read_text().splitlines()]
    pairs = [row for row in rows if "pair" in row]
    assert pairs
    assert {row["question_type"][:5] for row in pairs} == {"pair_"}
    assert len({unedited_id(row["scene_name"].partition("__")[0]) for row in pairs}) == 1
    assert wrong_answers(tmp_path / "root", out) == []
    pairs[0]["ground_truth"] = pairs[1]["ground_truth"]
    (out / "questions.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    wrong = wrong_answers(tmp_path / "root", out)
    assert len(wrong) == 2
    assert "another answer" in wrong[1]
