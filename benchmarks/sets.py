"""Exports read back, questions answered again, a set made three ways: `make bench NAME=sets` -> out/bench/sets.json.

The loaders are those of tests/export, written from each form's documentation; they share no code with the writers. A form is
equal if no label differs in any pixel, depth is within the form's step, and K and poses are the view's. Questions are about
pictures and walks of dressed homes that nobody tunes on; pbrs_farm/check/question_checks.py answers them again from the stored
files. A set of two homes must have the same bytes from one process, from two killed ones, and from two shards.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from benchmarks.blind_pairs import UNITS as UNITS_OF_PAIRS
from benchmarks.blind_pairs import blind_figures, render_edits
from benchmarks.figures import write_report
from benchmarks.stream_wait import UNITS as UNITS_OF_STREAM
from benchmarks.stream_wait import stream_figures
from pbrs_farm.check.question_checks import wrong_answers
from pbrs_farm.curate.teaching_rules import REASONS, judged_by
from pbrs_farm.export.export_views import finished_entries
from tests.core.lenses.opencv_points import error_px
from tests.inputs.layered_homes import wrong_pixels

UNITS: Final = {
    "sets.forms": "forms of views read back equal by code of its own",
    "sets.forms_written": "forms of views",
    "sets.forms_wrong": "names of the other forms",
    "sets.same_bytes": "1: one set's file gave the same bytes in each of three folders",
    "sets.licences_wrong": "views of homes for CC0 alone that name another licence, and files of credits",
    "sets.questions": "questions of pictures and walks",
    "sets.questions_wrong": "questions with another answer by a checker of its own",
    "sets.blind_best": "largest share of right answers by always giving the same one of four",
    "sets.blind": "score of the best blind answer, by type",
    **UNITS_OF_STREAM,
    **UNITS_OF_PAIRS,
    "layers.depth_layers_wrong": "pixels of panes, a box of glass and a wall whose surfaces along the ray are not those of the closed form",
    "lens.error_px": "largest distance of 40 points from the pixels of cv2.projectPoints, and of these found again",
    "sets.curated": "views that each rule of `select --by` leaves out of the pictures and walks of the questions",
}
_PICTURES: Final = "made:70101..70104"
_WALKS: Final = "made:70115"
_CHOICES_OF_FOUR: Final = (
    "object_rel_distance",
    "object_rel_direction_hard",
    "obj_appearance_order",
)
READ_BACK: Final[dict[str, tuple[str, tuple[str, ...]]]] = {
    "bop": ("bop", ()),
    "captions": ("captions", ()),
    "coco": ("export", ("coco", "panoptic")),
    "colmap": ("sequences", ("colmaps",)),
    "cosmos": ("trainer_forms", ("cosmos",)),
    "cotracker": ("tapvid", ("cotracker", "behind")),
    "fsd": ("trainer_forms", ("fsd",)),
    "hdf5": ("export", ("hdf5",)),
    "hypersim": ("hypersim", ()),
    "interiorverse": ("trainer_forms", ("interiorverse",)),
    "kitti": ("sequences", ("kittis",)),
    "layered-depth": ("trainer_forms", ("layered_depth",)),
    "layoutnet": ("training_forms", ("horizonnet",)),
    "lerobot": ("trainer_forms", ("lerobot",)),
    "lidar": ("lidar_form", ()),
    "lingbot": ("trainer_forms", ("lingbot",)),
    "marigold": ("training_forms", ("marigold",)),
    "moge": ("trainer_forms", ("moge",)),
    "nerfstudio": ("sequences", ("nerfstudios",)),
    "openspatial": ("trainer_forms", ("openspatial",)),
    "ply": ("point_clouds", ()),
    "questions": ("questions", ("real_view",)),
    "released": ("export", ("released",)),
    "tapvid": ("tapvid", ("tap_vid", "some_frames")),
    "tum": ("sequences", ("tum",)),
    "wai": ("trainer_forms", ("wai", "covisibility")),
    "webdataset": ("export", ("webdataset",)),
    "yolo": ("export", ("yolo_boxes", "data_yaml")),
    "yolo-depth": ("training_forms", ("yolo_reads", "yolos_depth")),
    "yolo-seg": ("export", ("polygons",)),
    "yolo-semantic": ("training_forms", ("yolos_masks",)),
}
"""Form of views -> tests/export/test_<name>.py that reads it back, and words of the names of its tests; () for all."""


def main() -> None:
    """Read every form back, ask and answer, make a set, and write the report."""
    # The forms' tests run in another process, beside the other parts.
    with ThreadPoolExecutor(1) as beside:
        passing = beside.submit(_passed)
        figures_of_sets = {
            "sets.same_bytes": int(_is_made_alike()),
            "sets.licences_wrong": _licences_wrong(),
            **_questions(),
        }
        passed = passing.result()
    figures_of_sets |= stream_figures()
    wrong = [form for form in READ_BACK if not _is_equal(form, passed)]
    figures: dict[str, Any] = {
        "sets.forms": len(READ_BACK) - len(wrong),
        "sets.forms_written": len(READ_BACK),
        "sets.forms_wrong": wrong,
        **figures_of_sets,
        "layers.depth_layers_wrong": wrong_pixels(),
        "lens.error_px": max(error_px()),
    }
    write_report("sets", figures, UNITS)


_SET: Final = """
split = "50/25/25"
[card]
title = "Two homes"
[render]
recipe = "preview"
dress = "1"
modes = ["mlt_il_ol", "opengl_dl"]
layers = ["albedo", "depth_z"]
set = ["tone.variants=1"]
[part.views]
homes = ["builtin", "made:70118"]
size = "96x72"
views = 3
select = ["black", "plane", "cut", "twins"]
[part.panoramas]
homes = ["builtin"]
size = "96x48"
views = 1
set = ["lens.model=equirect"]
[form.coco]
parts = ["views"]
[form.hdf5]
[form.parquet]
parts = ["views"]
size = "48x36"
"""


def _is_made_alike() -> bool:
    """True if one process, two killed processes and two shards make the same bytes."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "two-homes.toml")
        file.write_text(_SET)
        plain, killed, shards = (Path(folder, name) for name in ("plain", "killed", "shards"))
        _pbrs_farm("make", str(file), "--out", str(plain))
        _killed("make", str(file), "--out", str(killed), "--jobs", "2")
        _pbrs_farm("make", str(file), "--out", str(killed), "--jobs", "2")
        for shard in ("2/2", "1/2"):
            _pbrs_farm("make", str(file), "--out", str(shards), "--shard", shard)
        _pbrs_farm("make", str(file), "--out", str(shards))
        sums = [(out / "SHA256SUMS").read_bytes() for out in (plain, killed, shards)]
        checked = [
            subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=out, check=False)
            for out in (plain, killed, shards)
        ]
    print("   a set of", len(sums[0].splitlines()), "files", flush=True)
    return len(set(sums)) == 1 and not any(done.returncode for done in checked)


def _licences_wrong() -> int:
    """Files of credits and views that name another licence, in dressed homes for which CC0 is chosen."""
    with tempfile.TemporaryDirectory() as folder:
        _pbrs_farm(
            "run", _PICTURES, "--dress", "1", "--set", "dress.licences=CC0", "--recipe", "preview",
            "--size", "64x48", "--modes", "opengl_dl", "--views", "4", "--jobs", "2", "--out", folder,
        )  # fmt: skip
        entries = finished_entries(Path(folder))
        wrong = [v for v in entries if set(v.facts["licences"]) != {"CC0"}]
        return len(wrong) + len(list(Path(folder).rglob("ATTRIBUTION.txt")))


def _killed(*words: str) -> None:
    """Start a command that makes a set, and send SIGKILL after the first view."""
    out = Path(words[words.index("--out") + 1])
    command = [sys.executable, "-m", "pbrs_farm.cli", *words]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        while process.poll() is None and not list(out.glob("parts/*/houses/*/done/view.*")):
            time.sleep(0.05)
        process.kill()


def _questions() -> dict[str, Any]:
    """Figures of the questions about pictures and walks."""
    scores: dict[str, float] = {}
    n = n_wrong = 0
    curated: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for name, homes, how in (
            ("pictures", _PICTURES, ["--views", "6"]),
            ("walks", _WALKS, ["--cameras", "walk", "--frames", "150", "--fps", "10"]),
        ):
            root, out = Path(folder, name), Path(folder, f"{name}_questions")
            _pbrs_farm(
                "run", homes, "--dress", "1", "--recipe", "preview", "--size", "320x240",
                "--modes", "opengl_dl", *how, "--jobs", "2", "--out", str(root),
            )  # fmt: skip
            _pbrs_farm("export", str(root), "--to", "questions", "--out", str(out))
            verdicts = judged_by(finished_entries(root), list(REASONS))
            curated.update(f"{name} {verdict.reason or 'kept'}" for verdict in verdicts)
            wrong = wrong_answers(root, out)
            print(*wrong, sep="\n", flush=True)
            n_wrong += len(wrong)
            with (out / "blind_scores.csv").open() as file:
                for row in csv.DictReader(file):
                    n += int(row["questions"])
                    scores[f"{name} {row['question_type']}"] = float(row["constant_score"])
        edits, of_edits = Path(folder, "edits"), Path(folder, "edits_questions")
        render_edits(edits)
        _pbrs_farm("export", str(edits), "--to", "questions", "--out", str(of_edits))
        n_wrong += len(wrong_answers(edits, of_edits))
        of_pairs = blind_figures([Path(folder, "pictures_questions"), of_edits])
    best = [score for name, score in scores.items() if name.split()[1] in _CHOICES_OF_FOUR]
    return {
        "sets.questions": n, "sets.questions_wrong": n_wrong, "sets.blind_best": max(best),
        **of_pairs, "sets.blind": scores, "sets.curated": dict(sorted(curated.items())),
    }  # fmt: skip


def _pbrs_farm(*words: str) -> None:
    subprocess.run(
        [sys.executable, "-m", "pbrs_farm.cli", *words], check=True, stdout=subprocess.DEVNULL
    )


def _passed() -> dict[tuple[str, str], bool]:
    """(file's name, test's name) -> whether it passed."""
    files = [f"tests/export/test_{name}.py" for name in {file for file, _ in READ_BACK.values()}]
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "junit.xml"
        command = [sys.executable, "-m", "pytest", "-q", *sorted(files), f"--junit-xml={report}"]
        subprocess.run(command, capture_output=True, check=False)
        return outcomes(report.read_text()) if report.is_file() else {}


def outcomes(report: str) -> dict[tuple[str, str], bool]:
    """(file's name, test's name) -> whether it passed, from pytest's report in XML."""
    return {
        (row.get("classname", "").rpartition(".test_")[2], row.get("name", "")): not any(
            row.find(outcome) is not None for outcome in ("failure", "error", "skipped")
        )
        for row in ElementTree.fromstring(report).iter("testcase")
    }


def _is_equal(form: str, passed: dict[tuple[str, str], bool]) -> bool:
    """True if the form has a test and all of them passed."""
    file, words = READ_BACK[form]
    verdicts = [
        is_right
        for (name, test), is_right in passed.items()
        if name == file and (not words or any(word in test for word in words))
    ]
    is_right = bool(verdicts) and all(verdicts)
    print(f"   {'right' if is_right else 'wrong'} {form}: {len(verdicts)} tests", flush=True)
    return is_right
