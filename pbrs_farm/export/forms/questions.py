"""Questions about space with their answers, of pictures and walks, and referring expressions.

    questions.parquet questions.jsonl conversations.jsonl refs.json instances.json blind_scores.csv
    pbrs_farm/<scene_name>.png|mp4

Effects: reads views and their houses, writes files.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.form import REMARKS, Convention, ViewForm, name_left_out
from pbrs_farm.export.forms.coco import annotations_of, categories_of
from pbrs_farm.export.questions.asking import DATASET, Asker, Question, blind_scores
from pbrs_farm.export.questions.clips import Clip, clips_of
from pbrs_farm.export.questions.pairs import clips_by_home, pair_questions
from pbrs_farm.export.questions.references import Reference, references_of
from pbrs_farm.export.sequences import pace_of, picture_of, required_picture
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
    shown = [view for view in views if view.picture is not None]
    asker, questions, media = Asker(), [], {}
    pictures: list[tuple[Clip, list[Reference]]] = []
    (out / DATASET).mkdir()
    pairs: list[Question] = []
    for clips in clips_by_home(clips_of(shown)):
        for clip in clips:
            media[clip.name] = _write_medium(clip, out)
            questions += asker.asked([clip])
            if not clip.is_walk:
                pictures.append((clip, references_of(clip)))
        pairs += pair_questions(clips, len(pairs) // 2)
    questions += pairs
    _write_rows(questions, media, out)
    _write_references(pictures, media, choice, out)
    remarks = _write_blind_scores(questions, out)
    (out / REMARKS).write_text("".join(f"{line}\n" for line in remarks), "utf-8")
    hidden = [view for view in views if view.picture is None]
    name_left_out(out, hidden, "has no picture")


def _write_medium(clip: Clip, out: Path) -> str:
    """The clip's picture or film, at the path of VSI-Bench's readers: <dataset>/<scene_name>."""
    mode = required_picture(clip.views[0], "questions")
    if not clip.is_walk:
        name = f"{DATASET}/{clip.name}.png"
        (out / name).write_bytes(clip.views[0].data(mode))
        return name
    name = f"{DATASET}/{clip.name}.mp4"
    frames = (picture_of(view, "questions") for view in clip.views)
    (out / name).write_bytes(film(frames, pace_of(clip.views)))
    return name


def _write_rows(questions: Sequence[Question], media: dict[str, str], out: Path) -> None:
    rows = [question.row(k) for k, question in enumerate(questions)]
    pq.write_table(pa.Table.from_pylist(rows, _SCHEMA), out / "questions.parquet")
    _write_lines(
        (
            row | {"media": _media_of(q, media)} | q.facts()
            for row, q in zip(rows, questions, strict=True)
        ),
        out / "questions.jsonl",
    )
    _write_lines(
        (_conversation(k, q, _media_of(q, media)) for k, q in enumerate(questions)),
        out / "conversations.jsonl",
    )


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


def _write_references(
    pictures: Sequence[tuple[Clip, list[Reference]]],
    media: dict[str, str],
    choice: Choice,
    out: Path,
) -> None:
    """refs.json and instances.json, as RefCOCO's refs and COCO's instances."""
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    refs: list[dict[str, Any]] = []
    n_sentences = 0
    for number, (clip, references) in enumerate(pictures, start=1):
        facts = clip.views[0].facts
        size = {"width": facts["width_px"], "height": facts["height_px"]}
        images.append({"id": number, "file_name": media[clip.name], **size})
        by_instance: dict[int, list[str]] = {}
        for reference in references:
            by_instance.setdefault(reference.instance, []).append(reference.phrase)
        for row in annotations_of(clip.views[0]):
            row = {"id": len(annotations) + 1, "image_id": number, **row}
            annotations.append(row)
            phrases = by_instance.get(row["instance_id"], [])
            if not phrases:
                continue
            sentences = [
                {
                    "sent_id": n_sentences + k,
                    "sent": phrase,
                    "raw": phrase,
                    "tokens": phrase.split(),
                }
                for k, phrase in enumerate(phrases)
            ]
            n_sentences += len(phrases)
            refs.append(
                {
                    "ref_id": len(refs),
                    "ann_id": row["id"],
                    "image_id": number,
                    "category_id": row["category_id"],
                    "file_name": media[clip.name],
                    "sent_ids": [s["sent_id"] for s in sentences],
                    "sentences": sentences,
                }
            )
    document = {"images": images, "annotations": annotations, "categories": categories_of(choice)}
    (out / "instances.json").write_text(json.dumps(document, separators=(",", ":")) + "\n", "utf-8")
    (out / "refs.json").write_text(json.dumps(refs, ensure_ascii=False) + "\n", "utf-8")


def _write_blind_scores(questions: Sequence[Question], out: Path) -> list[str]:
    scores = blind_scores(questions)
    with (out / "blind_scores.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["question_type", "questions", "constant_score", "words_score"])
        writer.writerows(
            [kind, n, f"{constant:.3f}", f"{words:.3f}"]
            for kind, (n, constant, words) in scores.items()
        )
    return [
        f"{kind}: {n} question{'s' * (n != 1)}; without the picture, the best constant answer scores {constant:.2f}"
        f" and the usual answer to the same words {words:.2f}"
        for kind, (n, constant, words) in scores.items()
    ]


def _write_lines(rows: Iterable[dict[str, Any]], file: Path) -> None:
    file.write_text("".join(f"{json.dumps(row, ensure_ascii=False)}\n" for row in rows), "utf-8")


FORM = ViewForm(
    "questions",
    write_questions,
    "`questions.parquet` and `questions.jsonl` (columns and kinds of VSI-Bench), `conversations.jsonl`"
    " (a record a question, as LLaVA and SIMS-V train on), `refs.json` and `instances.json` (phrases"
    " that fit a single item, as RefCOCO), `blind_scores.csv`; `pbrs_farm/<scene_name>.png`, of walks `.mp4`",
    has_classes=True,
    convention=Convention(0.5, axes=""),
)
