"""An evaluation as a folder: table.md, evaluation.json, and a page of the worst and best views. Effects: files."""

from __future__ import annotations

import base64
import json
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.resampling import resized_by_area, resized_nearest
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.study.judging.evaluation import (
    Evaluation,
    Trained,
    evaluation_text,
    notes,
    predictions_of,
    report,
)
from pbrs_farm.study.judging.figure_text import shown_figure, title_of
from pbrs_farm.study.tasks.study_task import Arrays, StudyTask
from pbrs_farm.study.training.run_folder import make_folder
from pbrs_farm.views.png_rows import png_of_rows

N_SHOWN: Final = 8  # of the worst views, and of the best


def write_evaluation(out: Path, run: Trained, evaluations: list[Evaluation]) -> Path:
    """Write the folder; the page's path. Raises BadInput where it cannot be written to.

    table.md, evaluation.json and index.html; files of an earlier evaluation are replaced.
    """
    make_folder(out)
    (out / "table.md").write_text(evaluation_text(run, evaluations) + "\n", "utf-8")
    (out / "evaluation.json").write_text(
        json.dumps(report(run, evaluations), indent=1) + "\n", "utf-8"
    )
    page = out / "index.html"
    page.write_text(error_page(run, evaluations), "utf-8")
    return page


def error_page(run: Trained, evaluations: list[Evaluation]) -> str:
    """HTML without scripts; every picture is inside it."""
    from pbrs_farm.gallery.html_page import page

    return page(
        "pbrs_farm.study.judging",
        "error_page.html",
        run=run.record,
        figure=title_of(run.task.figures[0]),
        notes=notes(run, evaluations),
        sets=[_set(run, one) for one in evaluations],
    )


def _set(run: Trained, evaluation: Evaluation) -> dict[str, Any]:
    """One set judged on: its figures, and its worst and best views."""
    judged, task = evaluation.rows["network"], run.task
    known = [k for k, error in enumerate(judged.errors) if math.isfinite(error)]
    order = sorted(known, key=lambda k: judged.errors[k])
    n = min(N_SHOWN, (len(order) + 1) // 2)
    chosen = {"worst": order[::-1][:n], "best": order[: min(n, len(order) - n)]}
    wanted = {k for rows in chosen.values() for k in rows}
    # Predict again, and keep the views that are shown.
    views = evaluation.views
    kept = {k: p for k, p in enumerate(predictions_of(run, views)) if k in wanted}
    cards = {k: _card(task, evaluation, k, prediction) for k, prediction in kept.items()}
    rows = [
        (name, [shown_figure(f, judged.figures[f]) for f in task.figures])
        for name, judged in evaluation.rows.items()
    ]
    return {
        "name": views.name,
        "n": len(views.ids),
        "credits": list(dict.fromkeys(views.credits)),
        "titles": [title_of(figure) for figure in task.figures],
        "rows": rows,
        "worst": [cards[k] for k in chosen["worst"]],
        "best": [cards[k] for k in chosen["best"]],
    }


def _card(
    task: StudyTask, evaluation: Evaluation, k: int, prediction: NDArray[Any]
) -> dict[str, Any]:
    views, truth = evaluation.views, evaluation.views.truths[k]
    error = evaluation.rows["network"].errors[k]
    pictures = {
        "picture": views.colour[k],
        "truth": task.picture(task.prediction_of(truth)),
        "prediction": task.picture(prediction),
        "error": _error_picture(task, prediction, truth),
    }
    height, width = views.colour[k].shape[:2]
    urls = {name: _url(_fitted(name, picture, width, height)) for name, picture in pictures.items()}
    place = shown(views.ids[k], MAX_PLACE)
    return {"id": place, "error": task.error_text(error), "pictures": urls}


def _fitted(name: str, picture: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """At the size of the network's picture; labels keep their colours."""
    if name == "truth":
        return resized_nearest(picture, width, height)
    return resized_by_area(picture, width, height)


def _error_picture(task: StudyTask, prediction: NDArray[Any], truth: Arrays) -> NDArray[np.uint8]:
    """Black is right, white is wrong; blue has no truth."""
    errors, known = task.error_map(prediction, truth)
    grey = np.rint(255 * np.clip(errors, 0, 1))
    picture = np.repeat(grey[..., None], 3, axis=-1).astype(np.uint8)
    picture[~known] = (24, 34, 72)
    return picture


def _url(picture: NDArray[np.uint8]) -> str:
    return "data:image/png;base64," + base64.b64encode(png_of_rows(picture)).decode()
