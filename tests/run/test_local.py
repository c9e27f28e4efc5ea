"""A local run: stored outputs are kept, and a failure costs only its step."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from pbrs_farm.cli import main
from pbrs_farm.commands import making
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.run import local
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run, Summary
from pbrs_farm.run.plan import wanted
from pbrs_farm.run.processes import limits, pool
from pbrs_farm.run.processes.render_task import Event, Setting

FAKE = "tests.run.fakes:run_step"
N_STEPS = 3 + 2 * 6


@pytest.fixture(autouse=True)
def fake_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    def setting(*args: object) -> Setting:
        return replace(Setting(*args), runner=FAKE)  # type: ignore[arg-type]

    monkeypatch.setattr(local, "Setting", setting)
    # Fake steps need no library.
    for role in pool.HANDLERS:
        monkeypatch.setitem(pool.HANDLERS, role, pool.HANDLERS[pool.ALONE])


def named(name: str) -> Recipe:
    return recipe_from_name("preview").model_copy(update={"name": name})


def run(out: Path, name: str = "plain", **fields: object) -> Summary:
    return run_local(Run(["builtin"], str(out), named(name), **fields))  # type: ignore[arg-type]


def markers(out: Path) -> set[str]:
    return {p.name.removesuffix(".json") for p in out.glob("houses/*/done/*.json")}


def test_a_second_run_does_nothing(tmp_path: Path) -> None:
    first, second = run(tmp_path), run(tmp_path)
    assert (first.n_done, first.n_kept, first.failures) == (N_STEPS, 0, [])
    assert (second.n_done, second.n_kept, second.failures) == (0, N_STEPS, [])


def test_one_removed_marker_repeats_one_step(tmp_path: Path) -> None:
    run(tmp_path)
    next(tmp_path.glob("houses/*/done/opengl_dl.0_0_1.json")).unlink()
    assert run(tmp_path).n_done == 1


def test_a_crash_costs_one_step_and_names_the_command(tmp_path: Path) -> None:
    summary = run(tmp_path, "crash:opengl_il.0_0_0")
    assert [place.split("/")[1:] for place, _m, _c in summary.failures] == [["0_0_0", "opengl_il"]]
    assert "SIGSEGV" in summary.failures[0][1]
    assert summary.failures[0][2].startswith("pbrs-farm step opengl_il builtin --out")
    assert summary.n_done == N_STEPS - 1


def test_a_failed_step_skips_only_its_dependents(tmp_path: Path) -> None:
    summary = run(tmp_path, "refuse:light.0_0_1")
    assert len(summary.failures) == 1
    assert "wall w3: is made of cheese" in summary.failures[0][1]
    missing = {"light.0_0_1", "develop.0_0_1"}
    assert not missing & markers(tmp_path)
    assert summary.n_done == N_STEPS - len(missing)


def test_missing_opengl_is_skipped_with_one_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(making, "recipe_of", lambda _args: named("bare:opengl_dl"))
    assert main(["run", "builtin", "--out", str(tmp_path / "all")]) == 0
    output = capsys.readouterr()
    assert output.err.count("opengl_dl left out: no OpenGL here (install it)") == 1
    assert "0 failed" in output.out
    steps = markers(tmp_path / "all")
    assert not [m for m in steps if m.startswith("opengl_dl")]
    assert {"light.0_0_0", "opengl_il.0_0_0", "view.0_0_0", "view.0_0_1"} <= steps
    # If nothing else was requested it is a fault.
    assert main(["run", "builtin", "--out", str(tmp_path / "gl"), "--modes", "opengl_dl"]) == 1
    assert "FAILED: no OpenGL here" in capsys.readouterr().err


def test_failed_illuminance_is_reported_once_and_costs_the_light_of_every_view(
    tmp_path: Path,
) -> None:
    summary = run(tmp_path, "refuse:illuminance")
    assert [place.split("/")[1] for place, _m, _c in summary.failures] == ["illuminance"]
    done = {"house", "cameras"}
    for view in ("0_0_0", "0_0_1"):
        done |= {f"{step}.{view}" for step in ("truth", "opengl_dl", "opengl_il", "view")}
    assert markers(tmp_path) == done


def test_illuminance_is_computed_if_light_is_requested(tmp_path: Path) -> None:
    run(tmp_path, want=wanted(["opengl_dl"], []))
    assert "illuminance" not in markers(tmp_path)
    run(tmp_path, want=wanted(["mlt_ol"], []))
    assert "illuminance" in markers(tmp_path)


def test_views_of_a_room_measured_dark_are_skipped_and_reported(tmp_path: Path) -> None:
    summary = run(tmp_path, "dark")
    assert summary.n_views == 0
    assert "truth.0_0_0" not in markers(tmp_path)
    line = "room 0_0: 2 views left out: 0.3 lx on the floor by all light"
    assert summary.left_out[0][1].startswith(line)
    assert summary.without_views[0][1].startswith(line)


@pytest.mark.quick(1)
@pytest.mark.parametrize("fields", [{"selection.min_room_lx": "0"}, {"cameras.source": "stored"}])
def test_views_of_a_dark_room_are_made_if_the_recipe_or_the_user_requests_them(
    tmp_path: Path, fields: dict[str, str]
) -> None:
    recipe = recipe_from_name("preview", fields).model_copy(update={"name": "dark"})
    summary = run_local(Run(["builtin"], str(tmp_path), recipe))
    assert (summary.n_views, summary.left_out) == (2, [])


def test_a_black_view_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    summary = run(tmp_path, "black")
    assert [(v.split("/")[1], why) for v, why in summary.dark] == [
        ("0_0_0", "black"),
        ("0_0_1", "black"),
    ]
    making.print_summary(summary, 1.0, str(tmp_path), as_json=False)
    assert "0_0_1: dark: black" in capsys.readouterr().err
    # A second run finds them done and reports it again.
    assert len(run(tmp_path, "black").dark) == 2


def test_leaks_notes_and_lost_walls_are_reported_also_by_a_later_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        making.print_summary(run(tmp_path, "spoilt"), 1.0, str(tmp_path), as_json=False)
        output = capsys.readouterr()
        assert "LIGHT LEAKS IN: 833 of 20000 rays" in output.err
        assert "WALL LOST: w3: repair left 0.5 of 24.0 m2 of it" in output.err
        assert "2 views: 1 wall LOST, " in output.out
        assert "1 person and 2 plants removed: " in output.out
        assert "4 notes (3 missing-texture, 1 wall-lost): `notes` in" in output.out.splitlines()[-1]


@pytest.mark.quick(1)
@pytest.mark.parametrize(("name", "code"), [("spoilt", 1), ("plain", 0)])
def test_a_lost_wall_is_an_error_of_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, code: int
) -> None:
    monkeypatch.setattr(making, "recipe_of", lambda _args: named(name))
    assert main(["run", "builtin", "--out", str(tmp_path / "out")]) == code
    assert "truth.0_0_0" in markers(tmp_path / "out")


def test_progress_counts_the_views_that_will_be_made(tmp_path: Path) -> None:
    for name, views in (("dark", []), ("plain", ["0_0_0", "0_0_1"])):
        events: list[Event] = []
        run_local(Run(["builtin"], str(tmp_path / name), named(name)), events.append)
        assert [e.facts["views"] for e in events if e.kind == "planned"] == [views]


def test_what_was_refused_before_the_run_is_one_of_its_failures(tmp_path: Path) -> None:
    summary = run(tmp_path, refused=[("bad.sh3f", "bad.sh3f: is not a furniture library")])
    assert summary.failures == [("bad.sh3f", "bad.sh3f: is not a furniture library", "")]
    assert summary.n_views == 2


def test_a_bug_is_reported_by_its_type_and_the_run_continues(tmp_path: Path) -> None:
    summary = run(tmp_path, "bug:truth.0_0_0")
    assert summary.failures[0][1] == "ZeroDivisionError: a bug"
    assert {"opengl_dl.0_0_1", "view.0_0_1"} <= markers(tmp_path)


def test_a_step_that_hangs_is_killed(tmp_path: Path) -> None:
    summary = run(tmp_path, "hang:opengl_dl.0_0_0", step_timeout_s=3.0)
    assert "killed" in summary.failures[0][1]
    assert summary.n_done == N_STEPS - 1


def test_a_step_that_is_silent_is_killed(tmp_path: Path) -> None:
    summary = run(tmp_path, "hang:opengl_dl.0_0_0", silence_s=2.0)
    assert "silent for 2 s; killed" in summary.failures[0][1]
    assert summary.n_done == N_STEPS - 1


def test_a_process_over_its_memory_is_killed(tmp_path: Path) -> None:
    summary = run(tmp_path, "hang:cameras", memory_mb=1.0)
    assert any("MB resident, limit 1; killed" in why for _what, why, _again in summary.failures)


def test_a_home_that_is_missing_does_not_stop_the_others(tmp_path: Path) -> None:
    homes = [str(tmp_path / "nowhere.sh3d"), "builtin"]
    summary = run_local(Run(homes, str(tmp_path), named("plain")))
    assert summary.n_done == N_STEPS
    assert "no such file" in summary.failures[0][1]


def test_another_recipe_is_refused_with_the_fields_that_differ(tmp_path: Path) -> None:
    run(tmp_path)
    other_recipe = recipe_from_name("preview", {"tone.key": "0.3"})
    with pytest.raises(BadRecipe, match=r"tone\.key: 0\.18 -> 0\.3"):
        run_local(Run(["builtin"], str(tmp_path), other_recipe))


def test_update_renders_changed_steps_again(tmp_path: Path) -> None:
    run(tmp_path)
    other_recipe = recipe_from_name("preview", {"tone.key": "0.3"})
    summary = run_local(Run(["builtin"], str(tmp_path), other_recipe, update=True))
    assert summary.n_done == 4  # develop and view for both views
    assert summary.n_kept == N_STEPS - 4


def test_the_manifest_lists_every_object_of_the_house(tmp_path: Path) -> None:
    run(tmp_path)
    rows = [json.loads(line) for line in (tmp_path / "manifest.jsonl").read_text().splitlines()]
    listed = {row["key"] for row in rows}
    stored = {str(p.relative_to(tmp_path)) for p in tmp_path.glob("houses/*/**/*.txt")}
    assert listed == stored
    assert len(listed) == N_STEPS


def test_two_processes_give_the_output_of_one(tmp_path: Path) -> None:
    run(tmp_path / "one")
    run(tmp_path / "two", n_jobs=2)
    assert (tmp_path / "one/manifest.jsonl").read_bytes() == (
        tmp_path / "two/manifest.jsonl"
    ).read_bytes()


@pytest.fixture
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine on which one process renders light while another finishes views."""
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(limits, "machine_mb", lambda: 16_000.0)


def makers(out: Path, step: str) -> set[str]:
    """The processes that made a step of the houses or views, from their markers."""
    files = [*out.glob(f"houses/*/done/{step}.*.json"), *out.glob(f"houses/*/done/{step}.json")]
    return {json.loads(path.read_text())["worker"] for path in files}


@pytest.mark.usefixtures("two_cores")
def test_one_process_renders_light_while_another_finishes_the_views(tmp_path: Path) -> None:
    events: list[Event] = []
    summary = run_local(Run(["builtin"], str(tmp_path), named("plain")), events.append)
    assert summary.n_done == N_STEPS
    (light,) = makers(tmp_path, "light")
    (develop,) = makers(tmp_path, "develop")
    assert light != develop
    assert makers(tmp_path, "truth") == makers(tmp_path, "cameras") == {develop}
    assert makers(tmp_path, "illuminance") == {light}
    # The house and each view end once, with all their steps.
    ends = [event.view_id or "" for event in events if event.kind == "end"]
    assert sorted(ends) == ["", "0_0_0", "0_0_1"]


@pytest.mark.usefixtures("two_cores")
def test_several_houses_pass_through_both_processes_in_order(tmp_path: Path) -> None:
    events: list[Event] = []
    homes = ["builtin", "made:1", "made:2", "made:3"]
    summary = run_local(Run(homes, str(tmp_path), named("plain")), events.append)
    assert (summary.n_done, summary.n_views, summary.failures) == (4 * N_STEPS, 8, [])
    # All views of a house are known before the next house starts.
    kinds = [e.kind if e.kind == "planned" else e.step for e in events if e.view_id is None]
    order = [k for k in kinds if k in ("house", "planned")]
    assert order == ["house", "house", "planned"] * 4  # started, done, its views known


@pytest.mark.quick(1)
@pytest.mark.usefixtures("two_cores")
@pytest.mark.parametrize("wrong", ["refuse", "crash"])
def test_a_failed_house_costs_only_itself(tmp_path: Path, wrong: str) -> None:
    homes = ["builtin", "made:1"]
    summary = run_local(Run(homes, str(tmp_path), named(f"{wrong}:house@builtin")))
    ((place, _message, _command),) = summary.failures
    assert place.startswith("builtin")
    assert place.endswith("/house")
    # The other view is complete.
    assert (summary.n_done, summary.n_views) == (N_STEPS, 2)
    assert not list(tmp_path.glob("houses/builtin*/done/*"))


@pytest.mark.usefixtures("two_cores")
def test_a_crash_of_cameras_costs_no_illuminance(tmp_path: Path) -> None:
    summary = run(tmp_path, "crash:cameras")
    assert [place.split("/")[1] for place, _message, _command in summary.failures] == ["cameras"]
    assert markers(tmp_path) == {"house", "illuminance"}


@pytest.mark.usefixtures("two_cores")
def test_a_view_whose_light_crashes_is_finished_without_it(tmp_path: Path) -> None:
    summary = run(tmp_path, "crash:light.0_0_0")
    ((place, message, _command),) = summary.failures
    assert place.endswith("0_0_0/light")
    assert "SIGSEGV" in message
    assert summary.n_done == N_STEPS - 2  # its light and the step developed from it
    assert {"truth.0_0_0", "view.0_0_0", "develop.0_0_1"} < markers(tmp_path)
    assert "develop.0_0_0" not in markers(tmp_path)


@pytest.mark.parametrize(
    ("fields", "cores", "memory_mb", "is_apart"),
    [
        ({}, 2, 16_000.0, True),
        ({"n_jobs": 2}, 4, 16_000.0, False),
        ({"want": wanted(["opengl_dl"], [])}, 2, 16_000.0, False),
        ({}, 1, 16_000.0, False),
        ({}, 2, 4_000.0, False),
    ],
)
def test_views_are_finished_in_another_process_if_one_job_leaves_cores_idle(
    fields: dict[str, object], cores: int, memory_mb: float, is_apart: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    monkeypatch.setattr(limits, "machine_mb", lambda: memory_mb)
    request = Run(["builtin"], "somewhere", named("plain"), **fields)  # type: ignore[arg-type]
    assert local.finishes_apart(request) is is_apart


@pytest.mark.parametrize(
    ("width_px", "fields", "cores", "n_threads"),
    [
        (160, {}, 2, 1),
        (160, {}, 16, 15),
        (640, {}, 2, 2),
        (160, {"n_jobs": 2}, 4, 2),
        (160, {"n_jobs": 4}, 2, 1),
    ],
)
def test_small_views_leave_a_core_to_the_process_that_finishes_them(
    width_px: int, fields: dict[str, object], cores: int, n_threads: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    monkeypatch.setattr(limits, "machine_mb", lambda: 16_000.0)
    image = named("plain").image.model_copy(update={"width_px": width_px, "height_px": 120})
    recipe = named("plain").model_copy(update={"image": image})
    request = Run(["builtin"], "somewhere", recipe, **fields)  # type: ignore[arg-type]
    assert local.threads_of_process(request) == n_threads
