"""Questions of a set answered again, and their copies in other files. Effects: reads files."""

from __future__ import annotations

import csv
import json
from collections import Counter
from pathlib import Path
from typing import Any

from pbrs_farm.check.cases import FormCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.question_answers import wrong_answers, wrong_references
from pbrs_farm.check.stored_files import object_from_json, stored_bytes

_COLUMNS = ("id", "dataset", "scene_name", "question_type", "question", "ground_truth", "options")


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
