"""Questions of a set answered again from the stored files of its root, and their copies in other files.

Effects: reads files. Distances come from points on house.glb's triangles; everything else from view.json, house.json and
the question's words. Imports no code of export.
"""

from __future__ import annotations

import csv
import json
import re
from collections import Counter
from collections.abc import Container
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pbrs_farm.check.cases import FormCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.plan import is_within, polygon_area
from pbrs_farm.check.stored_files import object_from_json, stored_bytes
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles, triangles_from_glb
from pbrs_farm.images import array_from_png

Array = NDArray[np.float64]

_SPACING_M: Final = 0.008  # between points on a mesh
_ROUNDING_M: Final = 0.05  # of an answer in metres with one decimal
_SLACK_M: Final = 0.006  # of a distance between points of that spacing
_NOTICED: Final = 1e-4  # share of a picture's pixels
_CONE_DEG: Final = 10.0  # least angle of a direction from the border to the next
# Class -> words in names for which a question uses a more specific noun.
_OWN_WORDS: Final = {
    "bag": "suitcase|backpack", "bed": "crib|duvet|mattress", "box": "basket|crate", "cabinet": "wardrobe",
    "chair": "armchair|bench|stool|ottoman|pouf", "curtain": "curtains", "lamp": "candle|candlestick",
    "television": "monitor", "towel": "towels",
}  # fmt: skip
_ORDER: Final = ("leftmost", "second", "third", "fourth", "fifth")
_COLOURS: Final = (
    "black", "grey", "white", "red", "brown", "orange", "yellow", "beige", "green", "blue", "purple", "pink",
)  # fmt: skip
_COLUMNS = ("id", "dataset", "scene_name", "question_type", "question", "ground_truth", "options")


@lru_cache(maxsize=64)
def _tree_on(corners: bytes) -> cKDTree:
    """A search tree of points on triangles, none farther than _SPACING_M from the next."""
    # By bytes: versions of a home share most of their items.
    return cKDTree(_points_on(np.frombuffer(corners).reshape(-1, 3, 3)))


def _points_on(triangles: Array) -> Array:
    """(N, 3) corners of (M, 3, 3) triangles, whose longest edges are halved down to 2 _SPACING_M."""
    done = []
    while len(triangles):
        edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        is_short = edges.max(1) <= 2 * _SPACING_M
        done.append(triangles[is_short].reshape(-1, 3))
        long, first = triangles[~is_short], edges[~is_short].argmax(1)
        # Corners in turn, the longest edge first: a to b, with c across.
        a, b, c = (long[np.arange(len(long)), (first + k) % 3] for k in range(3))
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    points = np.concatenate(done)
    # Each point once, found by one number: unique rows take ten times as long.
    first_of_each = np.unique(points @ np.array([1.0, np.e, np.pi]), return_index=True)[1]
    return points[first_of_each]


@lru_cache(maxsize=2)
def _pixels(file: Path) -> NDArray[Any]:
    return array_from_png(file.read_bytes(), str(file))


@lru_cache(maxsize=1)
def _triangles(file: Path) -> Triangles:
    # Questions of a home follow each other.
    return triangles_from_glb(file.read_bytes())


class _Scene:
    """The files of one question: its frames' view.json, its house."""

    def __init__(self, root: Path, name: str, kept: Container[tuple[str, str]] | None) -> None:
        house, _, view = name.partition("__")
        self.folder = root / "houses" / house
        views = [part.removeprefix(f"{house}__") for part in name.split("+")]
        names = views if view else sorted(p.name for p in (self.folder / "views").iterdir())
        tables = [json.loads((self.folder / "views" / n / "view.json").read_text()) for n in names]
        if not view:
            frames = (t for t in tables if "frame" in t and "left" not in t)
            tables = [t for t in frames if kept is None or (house, t["view"]) in kept]
            tables.sort(key=lambda t: int(t["frame"]))
        self.views = tables
        self.eyes = [np.array(t["world_from_camera_opencv"])[:3, 3] for t in tables]
        self.house = json.loads((self.folder / "house.json").read_text())
        self.rows: dict[int, dict[str, Any]] = {}
        for table in tables:
            for row in table["instances"]:
                best = self.rows.setdefault(row["id"], row)
                if row["fraction"] > best["fraction"]:
                    self.rows[row["id"]] = row

    def tree(self, instance: int) -> cKDTree:
        """Points on an item's surface, read on demand."""
        triangles = _triangles(self.folder / "house.glb")
        corners = triangles.points_of(triangles.instance == instance)
        return _tree_on(np.ascontiguousarray(corners, np.float64).tobytes())

    def depth(self, instance: int) -> float:
        """Median depth of its pixels in the first view, mm; inf if unknown."""
        folder = self.folder / "views" / self.views[0]["view"]
        ids, depth = (_pixels(folder / f"{name}.png") for name in ("instance", "depth"))
        values = depth[(ids == instance) & (depth > 0)]
        return float(np.median(values)) if len(values) else np.inf

    def middle(self, instance: int) -> Array:
        """(x, z) of the middle of its box."""
        return np.array(self.rows[instance]["box3d"]["centre"])[[0, 2]]

    def namesakes(self, instance: int, rows: dict[int, dict[str, Any]] | None = None) -> list[int]:
        """Noticeable instances that a question would call by the same word; rows: of one picture, None = all."""
        rows = self.rows if rows is None else rows
        row = rows[instance]
        outside = {i["id"] for i in self.house["items"] if "outside" in i.get("tags", ())}
        return [
            k for k, other in rows.items()
            if _word(other) == _word(row) and other["fraction"] >= _NOTICED and other["item"] not in outside
        ]  # fmt: skip


def _word(row: dict[str, Any]) -> str:
    name = str(row["class"])
    own = _OWN_WORDS.get(name) and re.search(rf"\b({_OWN_WORDS[name]})\b", str(row["name"]).lower())
    if own:
        return own[0]
    return re.sub(r"[\d ]+$", "", str(row["name"])).lower() if name.startswith("other") else name


def wrong_answers(
    root: Path, export: Path, kept: Container[tuple[str, str]] | None = None
) -> list[str]:
    """A line for each question of EXPORT/questions.jsonl whose answer contradicts the files of ROOT.

    kept: (house, view) of the frames of walks, None for all.
    """
    scenes: dict[str, _Scene] = {}
    pairs: dict[int, list[dict[str, Any]]] = {}
    wrong = []
    lines = (export / "questions.jsonl").read_text("utf-8").splitlines()
    # By home: the pairs alternate between versions of a home, whose meshes are slow to read.
    for row in sorted(map(json.loads, lines), key=lambda row: str(row["scene_name"])):
        if row["question_type"].startswith("pair_"):
            pairs.setdefault(row["pair"], []).append(row)
        name = row["scene_name"]
        if name not in scenes:
            scenes.clear()
            scenes[name] = _Scene(root, name, kept)
        fault = _fault(scenes[name], row)
        if fault:
            wrong.append(f"{row['id']} {row['question_type']}: {fault}: {row['question']}")
    for number, rows in pairs.items():
        is_one = len({(row["question"], *row["options"]) for row in rows}) == 1
        n_other = [len({row[name] for row in rows}) for name in ("ground_truth", "scene_name")]
        if not is_one or len(rows) != 2 or n_other != [2, 2]:
            wrong.append(f"pair {number}: is not one question with another answer in two pictures")
    return wrong


def _fault(scene: _Scene, row: dict[str, Any]) -> str:
    kind, about = row["question_type"], row["instances"]
    truth = row["ground_truth"]
    if row["options"]:
        options = {option[0]: option[3:] for option in row["options"]}
        if truth not in options:
            return f"has no option {truth}"
        truth = options[truth]
    if kind == "pair_hidden" and truth == "cannot be told":
        return _fault_of_hidden(scene, about)
    if kind in ("pair_views_turn", "pair_views_moved"):
        return _fault_of_cameras(scene, kind, truth, row["options"])
    if kind == "pair_views_same":
        tables = [{r["id"]: r for r in view["instances"]} for view in scene.views]
        sizes = [len(scene.namesakes(k, rows)) for k, rows in zip(about, tables, strict=True)]
        is_same = about[0] == about[1]
        fits = sizes == [1, 1] and _word(tables[0][about[0]]) == _word(tables[1][about[1]])
        return "" if fits and is_same == (truth == "yes") else f"the instances are {about}"
    if kind == "pair_lamp":
        return _fault_of_lamps(scene, about, truth)
    if kind != "object_counting" and any(len(scene.namesakes(k)) != 1 for k in about):
        return "a word fits more than one thing"
    if kind == "object_counting":
        namesakes = scene.namesakes(about[0])
        return "" if len(namesakes) == int(truth) == len(about) else f"there are {len(namesakes)}"
    if kind == "object_abs_distance":
        gap = _gap_m(scene, *about)
        return "" if abs(gap - float(truth)) <= _ROUNDING_M + _SLACK_M else f"it is {gap:.3f} m"
    if kind == "object_size_estimation":
        longest = 200 * max(scene.rows[about[0]]["box3d"]["half"])
        return "" if abs(longest - float(truth)) <= 0.501 else f"it is {longest:.1f} cm"
    if kind == "room_size_estimation":
        area = _area_entered_m2(scene)
        return "" if abs(area - float(truth)) <= 0.0501 else f"it is {area:.2f} m2"
    if kind == "room_visits":
        n_visits = _n_visits(scene, row["question"])
        return "" if n_visits == int(truth) else f"there are {n_visits}"
    if kind == "pair_open":
        values = [joint["value"] for joint in scene.house["items"][about[0] - 1].get("joints", ())]
        return "" if values and any(values) == (truth == "yes") else f"it is {values}"
    if kind in ("pair_nearer", "pair_hidden"):
        eye = np.array(scene.views[0]["world_from_camera_opencv"])[:3, 3]
        nearest = min(about, key=lambda k: float(scene.tree(k).query(eye)[0]))
        return "" if _fits(scene.rows[nearest], truth) else f"instance {nearest} is nearer"
    if kind == "pair_views_nearest" and any(
        row["id"] == about[0] and row["fraction"] >= _NOTICED for row in scene.views[0]["instances"]
    ):
        return f"the first picture shows instance {about[0]}"
    if kind in ("object_rel_distance", "pair_nearest", "pair_views_nearest"):
        gaps = {_gap_m(scene, about[0], k): k for k in about[1:]}
        nearest = gaps[min(gaps)]
        return "" if _fits(scene.rows[nearest], truth) else f"instance {nearest} is nearer"
    if kind.startswith("object_rel_direction") or kind == "pair_side":
        angle = _angle_deg(*(scene.middle(k) for k in about))
        return "" if _is_there(kind, angle, truth) else f"it is at {angle:.0f} degrees"
    if kind == "obj_appearance_order":
        order = sorted(about, key=lambda k: _first_frame(scene, k))
        words = truth.split(", ")
        fits = all(_fits(scene.rows[k], word) for k, word in zip(order, words, strict=True))
        return "" if fits else f"the order is {order}"
    if kind == "route_planning":
        return _fault_of_route(scene, about, truth.split(", "))
    return "no such kind"


def _fits(row: dict[str, Any], word: str) -> bool:
    """True if the word is the class, contains it ("row of books"), or is the item's name or kind."""
    synonyms = {"night stand": "nightstand", "floor mat": "rug", "shelves": "shelves"}
    noun = synonyms.get(row["class"], row["class"])
    return noun in word or word in noun or word == _word(row) or word == row["kind"]


def _gap_m(scene: _Scene, a: int, b: int) -> float:
    tree, points = scene.tree(b), scene.tree(a).data
    # A sample of the points bounds the distance, which excludes most others.
    bound = float(np.min(tree.query(points[:: max(1, len(points) // 500)])[0]))
    nearer = tree.query(points, distance_upper_bound=bound + 1e-9)[0]
    return min(bound, float(np.min(nearer)))


def _angle_deg(stand: Array, face: Array, to: Array) -> float:
    """Clockwise seen from above (y up): right is positive. Plan angles of x and z, subtracted."""
    ahead, target = face - stand, to - stand
    turn = np.arctan2(target[1], target[0]) - np.arctan2(ahead[1], ahead[0])
    return float(np.degrees((turn + np.pi) % (2 * np.pi) - np.pi))


def _is_there(kind: str, angle: float, word: str) -> bool:
    left_right = angle > 0 if "right" in word else angle < 0
    if kind.endswith(("easy", "side")):
        return left_right and _CONE_DEG <= abs(angle) <= 180 - _CONE_DEG
    if kind.endswith("medium"):
        return abs(angle) > 135 if word == "back" else left_right and abs(angle) < 135
    return left_right and (abs(angle) < 90 if word.startswith("front") else abs(angle) > 90)


def _fault_of_hidden(scene: _Scene, about: list[int]) -> str:
    """Why nothing hides exactly one of two items of the camera's room; "" if something does."""
    hidden = [k for k in about if k not in scene.rows]
    if len(hidden) != 1:
        return f"{len(hidden)} of the two are hidden"
    item, table = scene.house["items"][hidden[0] - 1], scene.views[0]
    pose = np.array(table["world_from_camera_opencv"])
    ahead = (scene.tree(item["instance"]).data - pose[:3, 3]) @ pose[:3, 2]
    is_there = item["room_id"] == table["room"] and bool((ahead > 0).mean() > 0.5)
    return "" if is_there else f"instance {hidden[0]} is not in front of the camera"


def _fault_of_cameras(scene: _Scene, kind: str, truth: str, options: list[str]) -> str:
    """Why the cameras of two pictures are not so turned or so far apart; "" if they are."""
    first, second = (np.array(view["world_from_camera_opencv"]) for view in scene.views)
    if kind == "pair_views_moved":
        apart = float(np.linalg.norm(first[:3, 3] - second[:3, 3]))
        nearest = min((option[3:] for option in options), key=lambda o: abs(float(o[:-2]) - apart))
        fits = nearest == truth and abs(float(truth[:-2]) - apart) <= _ROUNDING_M + _SLACK_M
        return "" if fits else f"they are {apart:.2f} m apart"
    angle = _angle_deg(np.zeros(2), first[[0, 2], 2], second[[0, 2], 2])
    return "" if _is_there("side", angle, truth) else f"it turns by {angle:.0f} degrees"


def _fault_of_lamps(scene: _Scene, about: list[int], truth: str) -> str:
    """Why the lit one of two lamps is not on that side of the picture; "" if it is."""
    if sorted(scene.namesakes(about[0])) != sorted(about) or len(about) != 2:
        return "the lamps are not two"
    left, right = sorted(about, key=lambda k: int(sum(scene.rows[k]["box2d"][::2])))
    house = StoredHouse(scene.folder, scene.house)
    powered = {house.lamps[name][0] for name in house.lamps if house.light(name)["power"] > 0}
    lit = [k for k in (left, right) if k in powered]
    return "" if lit == [{"left": left, "right": right}[truth]] else f"the lit lamps are {lit}"


def _n_visits(scene: _Scene, question: str) -> int:
    """Number of stays of the camera in the room of a question."""
    rooms = [r for r in scene.house["rooms"] if f"in the {r['name'].lower()}" in question]
    if not rooms:
        return 0
    room = max(rooms, key=lambda r: len(r["name"]))
    is_in = [_is_in(room, eye) for eye in scene.eyes]
    return sum(now and not before for before, now in zip([False, *is_in], is_in, strict=False))


def _first_frame(scene: _Scene, instance: int) -> int:
    for k, table in enumerate(scene.views):
        for row in table["instances"]:
            if row["id"] == instance and row["fraction"] >= _NOTICED:
                return k
    return len(scene.views)


def _area_entered_m2(scene: _Scene) -> float:
    entered = (room for room in scene.house["rooms"] if any(_is_in(room, e) for e in scene.eyes))
    return sum(polygon_area(np.array(room["polygon"], np.float64)) for room in entered)


def _is_in(room: dict[str, Any], eye: Array) -> bool:
    is_level = room["floor_y"] <= eye[1] <= room["ceiling_y"]
    return bool(is_level and is_within(room["polygon"], eye[[0, 2]]))


def _fault_of_route(scene: _Scene, stops: list[int], turns: list[str]) -> str:
    places = [scene.middle(k) for k in stops]
    for k, turn in enumerate(turns):
        before, place, after = places[k : k + 3]
        angle = _angle_deg(place, place + (place - before), after)
        right = {"turn right": 55 < angle < 125, "turn left": -125 < angle < -55}.get(
            turn, abs(angle) > 145
        )
        if not right:
            return f"the turn at stop {k + 2} is {angle:.0f} degrees"
    return ""


def wrong_references(root: Path, export: Path) -> list[str]:
    """A line for each phrase of EXPORT/refs.json that fits another item than its own, or none.

    Nouns, sides, orders from the left and distances are judged; colours and supports are not.
    """
    document = json.loads((export / "instances.json").read_text("utf-8"))
    rows = {row["id"]: row for row in document["annotations"]}
    names = {image["id"]: image["file_name"] for image in document["images"]}
    scene_of = lru_cache(maxsize=1)(lambda name: _Scene(root, name, None))
    wrong = []
    for ref in json.loads((export / "refs.json").read_text("utf-8")):
        row, scene = rows[ref["ann_id"]], scene_of(Path(ref["file_name"]).stem)
        stored = ref["image_id"], ref["category_id"], ref["file_name"]
        if stored != (row["image_id"], row["category_id"], names[row["image_id"]]):
            wrong.append(f"{ref['ref_id']}: its annotation is of another image or class")
        for sentence in ref["sentences"]:
            phrase = sentence["sent"]
            is_whole = sentence["raw"] == phrase and sentence["tokens"] == phrase.split()
            fault = fault_of_phrase(scene, row["instance_id"], phrase)
            if fault or not is_whole:
                wrong.append(f"{ref['ref_id']}: {fault or 'has other tokens'}: {phrase}")
    return wrong


def fault_of_phrase(scene: Any, instance: int, phrase: str) -> str:
    """Why a phrase does not name an instance; "" if it does. scene: rows, namesakes and depths of instances."""
    row, names = scene.rows[instance], scene.namesakes(instance)
    noun, best = phrase.removeprefix("the ").removesuffix(" from the left"), instance
    order = sorted(names, key=lambda k: int(sum(scene.rows[k]["box2d"][::2])))
    first, _space, rest = noun.partition(" ")
    before, _on, side = noun.rpartition(" on the ")
    if first in (*_ORDER, "rightmost"):
        noun, best = rest, order[-1 if first == "rightmost" else _ORDER.index(first)]
    elif side in ("left", "right") and before:
        noun, best = before, order[-1 if side == "right" else 0]
    elif noun.endswith(" nearest to the camera"):
        noun, best = noun.removesuffix(" nearest to the camera"), min(names, key=scene.depth)
    elif noun.endswith(" farthest from the camera"):
        noun, best = noun.removesuffix(" farthest from the camera"), max(names, key=scene.depth)
    elif before or first in _COLOURS:
        noun = before or rest  # neither supports nor colours are judged
    elif names != [instance]:
        return "fits several items"
    if not noun or not _fits(row, noun):
        return "is of another noun"
    return "" if best == instance else f"fits instance {best}"


def check_questions(case: FormCase) -> None:
    """Every answer by the stored house and views; the same questions in each file."""
    if case.form.to != "questions":
        return
    rows = _rows(case, "questions.jsonl")
    scenes = {house for house, _view in case.kept} | case.keys.keys()
    for row in rows:
        place = f"{case.place('questions.jsonl')} {row['id']}"
        expect = case.tally.at("questions", place)
        names = row["scene_name"].split("+")
        expect(scenes.issuperset(names), f"is about {row['scene_name']}, not kept here")
        ending = ".mp4" if "__" not in row["scene_name"] else ".png"
        media = [f"{row['dataset']}/{name}{ending}" for name in names]
        is_shown = row["media"] == (media if len(media) > 1 else media[0])
        expect(is_shown and all(name in case.files for name in media), f"shows {row['media']}")
    case.tally.add("questions", len(rows))
    for line in wrong_answers(case.root, case.folder, case.kept):
        case.tally.fail("questions", case.place("questions.jsonl"), line)
    _check_copies(case, rows)
    case.tally.add("references", len(json.loads(stored_bytes(case.folder / "refs.json"))))
    for line in wrong_references(case.root, case.folder):
        case.tally.fail("references", case.place("refs.json"), line)


def _rows(case: FormCase, file: str) -> list[dict[str, Any]]:
    return [object_from_json(line) for line in stored_bytes(case.folder / file).splitlines()]


def _check_copies(case: FormCase, rows: list[dict[str, Any]]) -> None:
    """questions.parquet, conversations.jsonl and blind_scores.csv have the questions of questions.jsonl."""
    import pyarrow.parquet as pq

    expected = [{name: row[name] for name in _COLUMNS} for row in rows]
    stored = pq.read_table(case.folder / "questions.parquet").to_pylist()
    expect = case.tally.expect
    for name, fits in (
        ("questions.parquet", stored == expected),
        (
            "conversations.jsonl",
            _rows(case, "conversations.jsonl") == list(map(_conversation, rows)),
        ),
    ):
        expect("questions", case.place(name), fits, "has other questions than questions.jsonl")
    lines = stored_bytes(case.folder / "blind_scores.csv").decode().splitlines()
    counts = {row["question_type"]: int(row["questions"]) for row in csv.DictReader(lines)}
    fits = counts == Counter(row["question_type"] for row in rows)
    expect("questions", case.place("blind_scores.csv"), fits, f"counts {counts}")


def _conversation(row: dict[str, Any]) -> dict[str, Any]:
    options, answer = row["options"] or [], row["ground_truth"]
    media = [row["media"]] if isinstance(row["media"], str) else row["media"]
    kind = "video" if Path(media[0]).suffix == ".mp4" else "image"
    text = "\n".join([f"<{kind}>"] * len(media) + [row["question"], *options])
    answer = next((f"{answer}. {o[3:]}" for o in options if o.startswith(f"{answer}. ")), answer)
    return {
        "id": f"{row['dataset']}__{row['id']}", "type": "mc" if options else "oe",
        "data_source": row["dataset"], kind: row["media"],
        "conversations": [
            {"from": "human", "value": text, "task": row["question_type"]},
            {"from": "gpt", "value": answer},
        ],
    }  # fmt: skip


CHECKS = (Check("questions", "form", check_questions, 20, ("NYU40",)),)
