"""Minimal pairs: one question with another answer in each of two pictures; hidden items; visits of rooms."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.check.question_checks import wrong_answers
from pbrs_farm.core.edits import unedited_id
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import LightPart
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.export.export_views import export
from pbrs_farm.export.questions.asking import Question
from pbrs_farm.export.questions.clips import Clip, Thing, lamps_off
from pbrs_farm.export.questions.kinds import KINDS
from pbrs_farm.export.questions.pairs import HIDDEN, pair_questions
from tests.inputs.asked_clips import clip_of, drafts, house_of, visible_item
from tests.inputs.made_views import made_view


def picture(
    name: str, *things: Thing, eye: Any = (4.0, 1.0, 0.0), hidden: Any = (), yaw_deg: float = 0.0
) -> Clip:
    """A picture from an eye that looks along +z, turned towards +x; hidden: items without a pixel."""
    pose = np.eye(4)
    pose[:3, :3] = rotation_y(np.radians(yaw_deg))
    pose[:3, 3] = eye
    house = house_of(*(thing.item for thing in (*things, *hidden)))
    room = house.rooms[0].id
    house = replace(house, items=tuple(replace(i, room_id=room) for i in house.items))
    facts = {
        "width_px": 100, "height_px": 100, "K": [[50, 0, 50], [0, 50, 50], [0, 0, 1]], "room": room,
        "world_from_camera_opencv": pose.tolist(), "instances": [{"id": t.instance, "box2d": column_of(t, eye)} for t in things],
    }  # fmt: skip
    view = made_view(facts, id=name, file={"mlt_il_ol.png": "mlt_il_ol.png"}.get)
    return Clip(name, [view], house, things)


def column_of(thing: Thing, eye: Any) -> list[float]:
    """A box one column wide, farther right at a greater x."""
    column = 50 + 5 * (thing.middle[0] - eye[0])
    return [column, 0, column, 100]


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


def lamps(*lm: float) -> list[Thing]:
    """A sofa and lamps in a row, the first on the left, of these fluxes."""
    items = [visible_item(1 + k, "lamp", 2 + 4 * k, 4) for k in range(len(lm))]
    light = LightPart((4, 1, 4), 0.05, 800.0, PowerUnit.LUMEN)
    sofa = visible_item(9, "sofa", 4, 6)
    return [sofa] + [
        replace(t, item=replace(t.item, lights=(replace(light, power=flux),)))
        for t, flux in zip(items, lm, strict=True)
    ]


def test_which_of_two_lamps_is_on_is_not_a_matter_of_brightness() -> None:
    left, right = picture("left", *lamps(800, 0)), picture("right", *lamps(0, 800))
    questions = asked("pair_lamp", left, right)
    check_pairs(questions)
    assert {(q.clip, q.answer) for q in questions} == {("left", "left"), ("right", "right")}
    assert asked("pair_lamp", left, picture("both", *lamps(800, 800))) == []
    assert asked("pair_lamp", left, picture("three", *lamps(0, 800, 0))) == []
    # Daylight and a headlight do not show lamps.
    vars(right.views[0].entry)["file"] = {"opengl_dl.png": "opengl_dl.png"}.get
    assert asked("pair_lamp", left, right) == []


def test_a_lamp_that_the_recipe_has_off_is_lit_for_neither_question_nor_check(
    tmp_path: Path,
) -> None:
    half = recipe_from_name("fast", {"emission.lamps_on": "0.5"})
    (tmp_path / "recipe.json").write_text(half.model_dump_json())
    pictures: dict[str, Clip] = {}
    for home in (f"home-{k}" for k in range(40)):
        clip = picture(f"{home}__v", *lamps(800, 800))
        house = replace(clip.house, id=home)
        off = lamps_off(tmp_path / "recipe.json", house)
        if len(off) == 1:
            pictures[min(off)] = replace(clip, house=house, lamps_off=off)
    left, right = pictures["lamp 2"], pictures["lamp 1"]
    questions = asked("pair_lamp", left, right)
    check_pairs(questions)
    assert {(q.clip, q.answer) for q in questions} == {(left.name, "left"), (right.name, "right")}
    # The check draws the same from the files.
    for clip in (left, right):
        view = tmp_path / "houses" / clip.house.id / "views" / "v"
        view.mkdir(parents=True)
        items = [{"instance": n, "id": f"lamp {n}", "lights": [{"power": 800}]} for n in (1, 2)]
        (view.parents[1] / "house.json").write_text(json.dumps({"items": items}))
        rows = [
            {"class": "lamp", "name": "lamp", "item": f"lamp {row['id']}", "fraction": 0.1} | row
            for row in clip.views[0].facts["instances"]
            if row["id"] < 3
        ]
        (view / "view.json").write_text(json.dumps(clip.views[0].facts | {"instances": rows}))
    lines = [json.dumps(q.row(k) | q.facts()) for k, q in enumerate(questions)]
    (tmp_path / "questions.jsonl").write_text("\n".join(lines))
    assert wrong_answers(tmp_path, tmp_path) == []
    (tmp_path / "recipe.json").write_text(recipe_from_name("fast").model_dump_json())
    assert [line.partition(": ")[2][:18] for line in wrong_answers(tmp_path, tmp_path)] == [
        "the lit lamps are "
    ] * 2
    # opengl_il shows all lamps.
    vars(right.views[0].entry)["file"] = {"opengl_il.png": "opengl_il.png"}.get
    assert asked("pair_lamp", left, right) == []


def door(share: float) -> Thing:
    thing = visible_item(1, "cabinet", 4, 4)
    joint = Joint("door", JointKind.REVOLUTE, (0, 0, 0), (0, 1, 0), 1.0, value=share)
    return replace(thing, item=replace(thing.item, joints=(joint,)))


def test_an_open_door_is_open_and_a_door_ajar_is_not_asked_about() -> None:
    closed, ajar, wide = (picture(f"at {share}", door(share)) for share in (0.0, 0.1, 0.9))
    questions = asked("pair_open", closed, wide)
    check_pairs(questions)
    assert {(q.clip, q.answer) for q in questions} == {("at 0.0", "no"), ("at 0.9", "yes")}
    assert asked("pair_open", closed, ajar) == asked("pair_open", ajar, wide) == []


def test_films_that_differ_by_an_edit_make_a_pair() -> None:
    films = [
        replace(clip, name=name, views=clip.views * 2)
        for name, clip in (("before", picture("v", door(0.0))), ("after", picture("v", door(0.9))))
    ]
    questions = asked("pair_open", *films)
    check_pairs(questions)
    assert {q.text for q in questions} == {"Is the cabinet in the video open?"}
    other = replace(films[1], views=picture("w", door(0.9)).views * 2)
    assert asked("pair_open", films[0], other) == []


def test_the_side_of_a_turn_depends_on_the_order_of_two_pictures() -> None:
    things = visible_item(1, "sofa", 2, 4), visible_item(2, "desk", 6, 4)
    one = picture("one", *things)
    # Facing +z with y up, +x is on the left.
    two = picture("two", *things, yaw_deg=40)
    questions = asked("pair_views_turn", one, two)
    check_pairs(questions)
    assert {(q.clip, q.answer) for q in questions} == {("one+two", "left"), ("two+one", "right")}
    assert asked("pair_views_turn", one, picture("ahead", *things, yaw_deg=5)) == []
    # Nothing relates two cameras without common items.
    assert asked("pair_views_turn", one, picture("two", things[0], yaw_deg=40)) == []


def test_the_distance_of_two_cameras() -> None:
    things = visible_item(1, "sofa", 2, 4), visible_item(2, "desk", 6, 4)
    clips = [picture(f"at {x}", *things, eye=(x, 1, 0)) for x in (1.0, 2.0, 6.0)]
    questions = asked("pair_views_moved", *clips)
    check_pairs(questions)
    answers = {q.clip: q.answer for q in questions}
    assert answers.items() <= {
        "at 1.0+at 2.0": "1.0 m", "at 1.0+at 6.0": "5.0 m", "at 2.0+at 1.0": "1.0 m",
        "at 2.0+at 6.0": "4.0 m",
    }.items()  # fmt: skip
    assert answers


def test_the_only_chair_of_another_picture_may_be_another_chair() -> None:
    common = visible_item(1, "sofa", 2, 4), visible_item(2, "desk", 6, 4)
    chair, other = visible_item(3, "chair", 4, 4), visible_item(4, "chair", 4, 6)
    clips = [
        picture("one", *common, chair), picture("two", *common, chair, eye=(4, 1, 1)),
        picture("three", *common, other, eye=(4, 1, 2)),
    ]  # fmt: skip
    questions = asked("pair_views_same", *clips)
    check_pairs(questions)
    answers = {(q.clip, q.about, q.answer) for q in questions if q.clip.startswith("one")}
    assert answers == {("one+two", (3, 3), "yes"), ("one+three", (3, 4), "no")}


def test_what_is_near_an_item_of_the_second_picture() -> None:
    bed, desk = visible_item(1, "bed", 1, 4), visible_item(2, "desk", 7, 4)
    seconds = [visible_item(3, "vase", x, 4, (0.2, 0.2, 0.2)) for x in (2.0, 6.0)]
    clips = []
    for vase in seconds:
        clips += [picture("a", bed, desk), picture("b", bed, desk, vase)]
    clips = [replace(clip, name=f"{clip.name}{k // 2}") for k, clip in enumerate(clips)]
    for k, clip in enumerate(clips):
        clip.house = replace(clip.house, id=f"home-{k // 2}")
    questions = asked("pair_views_nearest", *clips)
    check_pairs(questions)
    assert {(q.clip, q.answer) for q in questions} == {("a0+b0", "bed"), ("a1+b1", "desk")}
    assert {q.about[0] for q in questions} == {3}


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
        views.append(made_view({"world_from_camera_opencv": pose.tolist()}))
    return replace(clip, views=views)


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
@pytest.mark.filterwarnings("ignore:.*is open by")
def test_pairs_of_an_edited_home_are_right_by_a_checker_that_shares_no_code(tmp_path):
    home = pf.load("made:2,rooms=1", "preview")
    cameras = home.cameras(n=3)
    doors = home.open([item.id for item in home.house.items if item.joints], 0.8)
    for version in (home, doors):
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
