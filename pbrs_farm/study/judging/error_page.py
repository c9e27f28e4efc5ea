"""An evaluation as a folder: table.md, evaluation.json, and a page of the worst and best views. Effects: files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.resampling import resized_by_area, resized_nearest
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.gallery.gallery_page import data_url
from pbrs_farm.study.judging.evaluation import (
    Evaluation,
    Trained,
    evaluation_text,
    notes,
    over_rooms_of,
    predictions_of,
    report,
)
from pbrs_farm.study.judging.figure_text import shown_figure, title_of
from pbrs_farm.study.tasks.study_task import WITHOUT_TRUTH, Arrays, StudyTask, grey_picture
from pbrs_farm.study.training.run_folder import write_report
from pbrs_farm.views.png_rows import png_of_rows

N_SHOWN: Final = 8  # number of worst views on the page, and of best ones


def write_evaluation(
    out: Path, run: Trained, evaluations: list[Evaluation], command: str = ""
) -> Path:
    """Write table.md, evaluation.json and index.html; the page's path. BadInput if not writable."""
    rows, html = report(run, evaluations, command), error_page(run, evaluations)
    page = write_report(out, "evaluation.json", rows, html)
    (out / "table.md").write_text(evaluation_text(run, evaluations) + "\n", "utf-8")
    return page


def error_page(run: Trained, evaluations: list[Evaluation]) -> str:
    """HTML without scripts, pictures included."""
    from pbrs_farm.gallery.html_page import page

    return page(
        "pbrs_farm.study.judging",
        "error_page.html",
        run=run.record,
        figure=title_of(run.task.figures[0]),
        notes=notes(run, evaluations),
        sets=[_set(run, evaluation) for evaluation in evaluations],
    )


def _set(run: Trained, evaluation: Evaluation) -> dict[str, Any]:
    """Figures, worst and best views of one test set."""
    errors, task, views = evaluation.rows["network"].errors, run.task, evaluation.views
    order = sorted((k for k, e in enumerate(errors) if math.isfinite(e)), key=lambda k: errors[k])
    n = min(N_SHOWN, (len(order) + 1) // 2)
    worst, best = order[::-1][:n], order[: min(n, len(order) - n)]
    # Predict again rather than keep all predictions in memory.
    cards = {
        k: _card(task, evaluation, k, prediction)
        for k, prediction in enumerate(predictions_of(run, views, mirror=evaluation.mirror))
        if k in worst or k in best
    }
    over_rooms = over_rooms_of(task)
    rows = []
    for name, judged in evaluation.rows.items():
        figures = judged.figures | {over_rooms: evaluation.over_rooms(name)}
        rows.append((name, [shown_figure(f, figures[f]) for f in (over_rooms, *task.figures)]))
    return {
        "name": views.name,
        "n": len(views.ids),
        "credits": list(dict.fromkeys(views.credits)),
        "titles": [title_of(figure) for figure in (over_rooms, *task.figures)],
        "rows": rows,
        "worst": [cards[k] for k in worst],
        "best": [cards[k] for k in best],
    }


def _card(
    task: StudyTask, evaluation: Evaluation, k: int, prediction: NDArray[Any]
) -> dict[str, Any]:
    views, truth = evaluation.views, evaluation.views.truths[k]
    height, width = views.colour[k].shape[:2]
    # Labels keep their colours in the truth.
    pictures = {
        "picture": views.colour[k],
        "truth": resized_nearest(task.picture(task.prediction_of(truth)), width, height),
        "prediction": resized_by_area(task.picture(prediction), width, height),
        "error": resized_by_area(_error_picture(task, prediction, truth), width, height),
    }
    error = task.error_text(evaluation.rows["network"].errors[k])
    urls = {name: data_url(png_of_rows(picture), "png") for name, picture in pictures.items()}
    return {"id": shown(views.ids[k], MAX_PLACE), "error": error, "pictures": urls}


def _error_picture(task: StudyTask, prediction: NDArray[Any], truth: Arrays) -> NDArray[np.uint8]:
    """Black for no error to white, blue without truth."""
    errors, has_truth = task.error_map(prediction, truth)
    picture = grey_picture(np.clip(errors, 0, 1))
    picture[~has_truth] = WITHOUT_TRUTH
    return picture
