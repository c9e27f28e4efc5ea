"""Questions about space with their answers, of pictures and walks, and referring expressions.

    questions.parquet questions.jsonl conversations.jsonl refs.json instances.json blind_scores.csv
    pbrs_farm/<scene_name>.png|mp4

Effects: reads views and their houses, writes files.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import pyarrow as pa

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Files, parquet_bytes, write_files
from pbrs_farm.export.form import PICTURES, REMARKS, Convention, ViewForm
from pbrs_farm.export.forms.coco import categories_of, compact_json, numbered_annotations
from pbrs_farm.export.questions.asking import DATASET, Question, blind_scores
from pbrs_farm.export.questions.clips import Clip, clips_of
from pbrs_farm.export.questions.pairs import all_questions
from pbrs_farm.export.questions.references import references_of
from pbrs_farm.export.sequences import pace_of
from pbrs_farm.formats.film_mp4 import film

_SCHEMA: Final = pa.schema(
    [
        ("id", pa.int64()),
        ("dataset", pa.string()),
        ("scene_name", pa.string()),
        ("question_type", pa.string()),
        ("question", pa.string()),
        ("ground_truth", pa.string()),
        ("options", pa.list_(pa.string())),
    ]
)


def write_questions(views: list[ChosenView], out: Path, choice: Choice) -> None:
    """Write questions, answers and references of views, and their pictures and films.

    A walk is one film and its questions are about all of it; every other view is a picture. Views without
    a picture, and models without a home, are left out. Raises BadInput for a damaged house, MachineFailed
    for walks without PyAV.
    """
    media: dict[str, str] = {}
    pictures: list[Clip] = []

    def keep(clip: Clip) -> None:
        media[clip.name] = f"{DATASET}/{clip.name}.{'mp4' if clip.is_walk else 'png'}"
        write_files(out, [{media[clip.name]: _medium(clip)}])
        pictures.extend(() if clip.is_walk else (clip,))

    questions = all_questions(clips_of(views), keep)
    scores = blind_scores(questions)
    write_files(
        out, [_lists(questions, media), _references(pictures, media, choice), _blind(scores)]
    )


def _medium(clip: Clip) -> bytes:
    """The clip's picture or film, at the path of VSI-Bench's readers: <dataset>/<scene_name>."""
    if not clip.is_walk:
        return clip.views[0].shown
    return film((view.colours for view in clip.views), pace_of(clip.views))


def _lists(questions: Sequence[Question], media: dict[str, str]) -> Files:
    """The questions as a table, as lines and as conversations."""
    rows = [question.row(k) for k, question in enumerate(questions)]
    lines = [
        row | {"media": _media_of(q, media)} | q.facts()
        for row, q in zip(rows, questions, strict=True)
    ]
    talks = [_conversation(k, q, _media_of(q, media)) for k, q in enumerate(questions)]
    return {
        "questions.parquet": parquet_bytes(rows, _SCHEMA),
        "questions.jsonl": _lines(lines),
        "conversations.jsonl": _lines(talks),
    }


def _media_of(question: Question, media: dict[str, str]) -> str | list[str]:
    """The picture or film of a question; its two pictures in a list."""
    files = [media[name] for name in question.clip.split("+")]
    return files if len(files) > 1 else files[0]


def _conversation(number: int, question: Question, medium: str | list[str]) -> dict[str, Any]:
    """A training record of LLaVA and SIMS-V: the person's question and the model's answer."""
    text, answer = question.text, question.ground_truth
    if question.options:
        text = "\n".join([text, *question.options])
        answer = f"{question.ground_truth}. {question.answer}"
    kind = "video" if str(medium).endswith(".mp4") else "image"
    marks = f"<{kind}>\n" * len(question.clip.split("+"))
    return {
        "id": f"{DATASET}__{number}",
        "type": "mc" if question.options else "oe",
        "data_source": DATASET,
        kind: medium,
        "conversations": [
            {"from": "human", "value": f"{marks}{text}", "task": question.kind},
            {"from": "gpt", "value": answer},
        ],
    }


def _references(pictures: Sequence[Clip], media: dict[str, str], choice: Choice) -> Files:
    """refs.json and instances.json, as RefCOCO's refs and COCO's instances."""
    annotations = numbered_annotations(clip.views[0] for clip in pictures)
    images: list[dict[str, Any]] = []
    phrases: dict[tuple[int, int], list[str]] = {}  # image, instance -> phrases
    refs: list[dict[str, Any]] = []
    n_sentences = 0
    for number, clip in enumerate(pictures, start=1):
        width, height = clip.views[0].size
        images.append(
            {"id": number, "file_name": media[clip.name], "width": width, "height": height}
        )
        for reference in references_of(clip):
            phrases.setdefault((number, reference.instance), []).append(reference.phrase)
    for row in annotations:
        sentences = [
            {"sent_id": k, "sent": phrase, "raw": phrase, "tokens": phrase.split()}
            for k, phrase in enumerate(
                phrases.get((row["image_id"], row["instance_id"]), ()), start=n_sentences
            )
        ]
        n_sentences += len(sentences)
        if sentences:
            refs.append(
                {
                    "ref_id": len(refs),
                    "ann_id": row["id"],
                    "image_id": row["image_id"],
                    "category_id": row["category_id"],
                    "file_name": images[row["image_id"] - 1]["file_name"],
                    "sent_ids": [s["sent_id"] for s in sentences],
                    "sentences": sentences,
                }
            )
    document = {"images": images, "annotations": annotations, "categories": categories_of(choice)}
    phrases_json = json.dumps(refs, ensure_ascii=False) + "\n"
    return {"instances.json": compact_json(document), "refs.json": phrases_json}


def _blind(scores: dict[str, tuple[int, float, float]]) -> Files:
    """blind_scores.csv, and a remark a kind."""
    rows = ["question_type,questions,constant_score,words_score"]
    rows += [f"{kind},{n},{best:.3f},{words:.3f}" for kind, (n, best, words) in scores.items()]
    remarks = [
        f"{kind}: {n} question{'s' * (n != 1)}; without the picture, the best constant answer scores {best:.2f}"
        f" and the usual answer to the same words {words:.2f}\n"
        for kind, (n, best, words) in scores.items()
    ]
    table = "".join(f"{row}\r\n" for row in rows)
    return {"blind_scores.csv": table, REMARKS: "".join(remarks)}


def _lines(rows: Iterable[dict[str, Any]]) -> str:
    return "".join(f"{json.dumps(row, ensure_ascii=False)}\n" for row in rows)


FORM = ViewForm(
    "questions",
    write_questions,
    "`questions.parquet` and `questions.jsonl` (columns and kinds of VSI-Bench), `conversations.jsonl`"
    " (a record a question, as LLaVA and SIMS-V train on), `refs.json` and `instances.json` (phrases"
    " that fit a single item, as RefCOCO), `blind_scores.csv`; `pbrs_farm/<scene_name>.png`, of walks `.mp4`",
    takes=PICTURES,
    has_classes=True,
    convention=Convention(0.5, axes=""),
)
