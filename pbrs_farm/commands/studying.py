"""Commands of the study: train, evaluate, predict, ablation, compare; with torch. Effects: read views, write runs."""

from __future__ import annotations

import argparse
import json
import shlex
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import Verb, at_least, counted, echo, echo_json, fields_set, warn
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.installation import install_command

if TYPE_CHECKING:
    from pbrs_farm.study.judging.evaluation import Evaluation, Trained
    from pbrs_farm.study.judging.others_predictions import OthersPredictions
    from pbrs_farm.study.training.view_sources import TrainingSource
    from pbrs_farm.study.training_plan import TrainingPlan


def add_verbs(verb: Verb) -> None:
    """Add train, evaluate, predict, ablation and compare."""
    verb("train", _train)
    p = verb("evaluate", _evaluate)
    p.usage = (
        "%(prog)s RUN [--on PLACE] [--out DIR] [--predictions DIR] [--views N] [--exact] [--[no-]mirror] [--json]\n"
        "       %(prog)s --task TASK [--on PLACE --out DIR] [--predictions DIR] [--views N] [--exact] [--[no-]mirror] [--json]"
    )
    p = verb("predict", _predict)
    p.usage = (
        "%(prog)s RUN PHOTO [PHOTO ...] --out DIR [--hfov DEG] [--[no-]mirror] [--json]\n"
        "       %(prog)s --task TASK PHOTO [PHOTO ...] --out DIR [--hfov DEG] [--[no-]mirror] [--json]"
    )
    verb("ablation", _ablation)
    verb("compare", _compare)


def _plan(args: argparse.Namespace, task: str) -> TrainingPlan:
    from pbrs_farm.study.training_plan import plan_of

    at_least("--views", args.views, 0)
    return plan_of(task, args.plan, fields_set(args.set, "field=value"))


def _hold_out(args: argparse.Namespace) -> frozenset[str] | None:
    words = args.hold_out
    return None if words is None else frozenset(words) - {"none"}


def _source(args: argparse.Namespace) -> TrainingSource:
    from pbrs_farm.study.training.view_sources import TrainingSource

    return TrainingSource(tuple(args.root), tuple(args.modes), _hold_out(args), most=args.views)


def _need_torch() -> None:
    if find_spec("torch") is None:
        raise MachineFailed("the study needs torch", hint=install_command("study"))


def _train(args: argparse.Namespace) -> None:
    _need_torch()
    from pbrs_farm.study.judging.judged_places import judge_of_places, open_judged_places
    from pbrs_farm.study.judging.packed_weights import shipped_run
    from pbrs_farm.study.networks.initial_weights import credits_of_init
    from pbrs_farm.study.training.loggers import check_installed, loggers
    from pbrs_farm.study.training.photograph_views import digests_of, facts_of, mix_of
    from pbrs_farm.study.training.prediction import check_onnx, device_of
    from pbrs_farm.study.training.training_job import Job, train
    from pbrs_farm.study.training.training_views import ViewArrays
    from pbrs_farm.study.training.view_sources import (
        credits_of,
        held_out_views,
        left_out,
        photographs_that_train,
        training_views,
    )
    from pbrs_farm.study.training_plan import plan_as_json

    plan, source = _plan(args, args.task), _source(args)
    source = replace(source, mix=tuple(mix_of(word) for word in args.mix))
    init = str(shipped_run(args.task)) if args.init == "shipped" else args.init
    # Report missing packages before reading views.
    device_of(plan)
    check_installed(args.log)
    check_onnx(args.export)
    views, held_out = training_views(source, plan), held_out_views(source, plan)
    n_held = len(held_out) if held_out else 0
    lacking = left_out(source, plan)
    if lacking:
        view, why = next(iter(lacking.items()))
        echo(f"{counted(len(lacking), 'view')} left out, {view}: {why}")
    how = "" if isinstance(views, ViewArrays) else ", read from disk in each step"
    homes = f"{counted(len(views), 'view')} of {counted(len(views.homes), 'home')}"
    echo(f"{homes}{how}, {n_held} held out")
    photographs = photographs_that_train(source, plan)
    for row in photographs:
        share = f", {row['share']:g} of each batch" if "share" in row else ""
        echo(f"{counted(len(row['pictures']), 'photograph')} of {row['name']}{share}")
    trained_on = frozenset(views.homes) | digests_of(photographs)
    held_out_homes = frozenset(held_out.homes) if held_out else None
    judged_on = open_judged_places(
        args.on,
        plan,
        mode=source.modes[0],
        trained_on=trained_on,
        known_held_out=held_out_homes,
        most=plan.final_views,
    )
    credits = (*credits_of(source, views.homes), *credits_of_init(init))
    stop_on = _stop_on(args.stop_on, [on.name for on in judged_on], plan)
    job = Job(
        plan,
        args.out,
        args.seed,
        source.light,
        source.name,
        init,
        stop_on=stop_on,
        facts={"credits": list(dict.fromkeys(credits)), "command": _command(args)}
        | facts_of(photographs, plan),
    )
    # Print about twenty of the logged steps.
    period = max(plan.steps // 20 // plan.log_every, 1) * plan.log_every

    with loggers(args.log, args.out, plan_as_json(plan)) as log:

        def observe(row: dict[str, float]) -> None:
            log(row)
            is_shown = row["step"] % period == 0 or row["step"] == plan.steps
            if is_shown and "loss" in row:
                echo(f"step {row['step']:>7,} loss {row['loss']:.4f} {row['views_s']:.1f} views/s")

        figures = train(job, views, held_out, observe, judge_of_places(judged_on, plan))
    if figures:
        _print_run(args.out)
        if args.export:
            _EXPORTS[args.export](args.out)


def _command(args: argparse.Namespace) -> str:
    return shlex.join(["pbrs-farm", *args.words])


def _stop_on(name: str, places: list[str], plan: TrainingPlan) -> str:
    """Name in the metrics of the error that selects the weights; "" for the last step."""
    if not name:
        return ""
    if name not in places:
        hint = f"of {', '.join(places)}" if places else f"--on {name}=PLACE"
        raise BadInput("--stop-on", name, "no --on with this name", hint=hint)
    if not plan.judge_every:
        raise BadInput("--stop-on", name, "needs judge_every > 0", hint="--set judge_every=200")
    return f"on_{name}"


def _pack_run(out: Path) -> None:
    from pbrs_farm.study.judging.packed_weights import pack_weights

    packed = pack_weights(out, out / "packed")
    echo(f"{packed.root}: {packed.weights.stat().st_size / 1e6:.1f} MB, README.md is its card")


def _export(out: Path) -> None:
    from pbrs_farm.study.judging.evaluation import open_run
    from pbrs_farm.study.training.prediction import write_onnx

    run, path = open_run(out), out / "model.onnx"
    write_onnx(run.network, run.plan, path)
    echo(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


_EXPORTS = {"onnx": _export, "weights": _pack_run}


def _print_run(out: Path) -> None:
    from pbrs_farm.study.judging.evaluation import figures_table, notes, open_run

    run = open_run(out)
    echo("\n".join([figures_table(run, []), "", *notes(run, []), str(out)]))


def _evaluate(args: argparse.Namespace) -> None:
    at_least("--views", args.views, 0)
    _check_judged(args)
    _need_torch()
    from pbrs_farm.study.judging.evaluation import evaluate, evaluation_text, open_run, report
    from pbrs_farm.study.judging.judged_places import open_judged_places
    from pbrs_farm.study.judging.others_predictions import others_predictions
    from pbrs_farm.study.judging.packed_weights import shipped_run
    from pbrs_farm.study.training.photograph_views import digests_of
    from pbrs_farm.study.training.run_folder import make_folder
    from pbrs_farm.study.training.view_sources import NYU_LIGHT, PHOTO_LIGHT

    columns = [others_predictions(word) for word in args.predictions]
    folder = shipped_run(args.task) if args.task else args.run
    run = open_run(folder, exact=args.exact)
    out = args.out or folder / "evaluation"
    if args.on:
        make_folder(out)  # before anything is judged
    record = run.record
    trained_on = frozenset(record["homes"]["train"]) | digests_of(record.get("photographs", ()))
    # Use the light of the run, unless it trained on photographs.
    light = record["mode"].split("+")[0]
    mode = "mlt_il_ol" if light in (NYU_LIGHT, PHOTO_LIGHT) else light
    places = open_judged_places(
        args.on,
        run.plan,
        mode=mode,
        trained_on=trained_on,
        most=args.views,
        known_held_out=frozenset(record["homes"]["held_out"]) or None,
    )
    mirror = _is_mirrored(args, run) if places else False
    evaluations = [evaluate(run, place, mirror=mirror) for place in places]
    for predictions in columns:
        evaluations = _with_column(run, evaluations, predictions)
    if args.json:
        echo_json(report(run, evaluations, _command(args)))
    else:
        echo(evaluation_text(run, evaluations))
    if evaluations:
        from pbrs_farm.study.judging.error_page import write_evaluation

        page = write_evaluation(out, run, evaluations, _command(args))
        if not args.json:
            echo(str(page))


def _is_mirrored(args: argparse.Namespace, run: Trained) -> bool:
    from pbrs_farm.study.training.prediction import is_mirror_cheap

    is_chosen: bool | None = args.mirror
    return is_mirror_cheap(run.network, run.task, run.plan) if is_chosen is None else is_chosen


def _check_judged(args: argparse.Namespace) -> None:
    """Raises BadInput unless `evaluate` names one network and, for shipped weights, an output folder.

    --mirror without --on is refused, since stored figures are not computed again.
    """
    if args.mirror is not None and not args.on:
        raise BadInput("--mirror", "", "needs --on", hint="--on NAME=PLACE")
    if (args.run is None) == (args.task is None):
        text, hint = "give either a RUN or --task", "pbrs-farm evaluate RUN, or --task normals"
        raise BadInput("evaluate", str(args.run or ""), text, hint=hint)
    if args.task and args.on and not args.out:
        raise BadInput("--task", args.task, "needs --out", hint="--out DIR")


def _with_column(
    run: Trained, evaluations: list[Evaluation], others: OthersPredictions
) -> list[Evaluation]:
    """The evaluations, with a column of others' predictions for those with files."""
    from pbrs_farm.study.judging.evaluation import with_others
    from pbrs_farm.study.judging.others_predictions import predictions_in

    columns = [predictions_in(others, evaluation.views, run.plan) for evaluation in evaluations]
    if all(predictions is None for predictions in columns):
        text = "has no prediction for any evaluated view"
        raise BadInput(others.folder, "", text, hint="--on gives the views to evaluate")
    return [
        with_others(run, evaluation, others.name, predictions) if predictions else evaluation
        for evaluation, predictions in zip(evaluations, columns, strict=True)
    ]


def _predict(args: argparse.Namespace) -> int:
    _need_torch()
    from pbrs_farm.study.judging.evaluation import open_run
    from pbrs_farm.study.judging.packed_weights import shipped_run
    from pbrs_farm.study.judging.photo_predictions import photograph_files, predict_photographs

    run, photographs = (
        (shipped_run(args.task), args.places) if args.task else (args.places[0], args.places[1:])
    )
    if not photographs:
        hint = "pbrs-farm predict RUN PHOTO..., or --task normals PHOTO..."
        raise BadInput("predict", str(run), "no photograph given", hint=hint)
    files = photograph_files(photographs)
    n_failed = 0
    trained = open_run(run)
    if args.hfov and not trained.plan.rays:
        raise BadInput("--hfov", f"{args.hfov:g}", "this network does not use rays: omit --hfov")
    if args.hfov and not 1 <= args.hfov <= 170:
        raise BadInput("--hfov", f"{args.hfov:g}", "expected degrees, 1 to 170")
    mirror = _is_mirrored(args, trained)
    for row in predict_photographs(trained, files, args.out, args.hfov, mirror=mirror):
        n_failed += "error" in row
        if args.json:
            echo(json.dumps(row))
        elif "error" in row:
            echo(row["error"])
        else:
            camera = (
                f", {row['hfov_deg']} degrees wide ({row['camera']})" if "camera" in row else ""
            )
            echo(f"{row['file']}: {row['seconds']:.2f} s{camera}")
    if not args.json:
        echo(f"{counted(len(files) - n_failed, 'photograph')}; {args.out / 'index.html'}")
    return int(n_failed > 0)


def _ablation(args: argparse.Namespace) -> None:
    _need_torch()
    from pbrs_farm.study.judging.ablation import (
        Comparison,
        TrainingSet,
        ablation_table,
        compare,
        hold_out_notes,
        training_sets,
    )
    from pbrs_farm.study.judging.evaluation import check_exact
    from pbrs_farm.study.judging.judged_places import homes_that_train, open_judged_places
    from pbrs_farm.study.training.run_folder import make_folder
    from pbrs_farm.study.training.view_sources import TrainingSource

    at_least("--seeds", args.seeds, 1)
    check_exact(args.task, exact=args.exact)
    plan, common = _plan(args, args.task), TrainingSource((), (), _hold_out(args), most=args.views)
    make_folder(args.out)
    # Rows share the plan, the seeds and the held-out homes.
    sets = training_sets(args.root, args.modes, replace(common, all_there=False))
    for note in hold_out_notes(sets):
        echo(note)
    if args.objects:
        objects = TrainingSource((args.objects,), ("mlt_il_ol",), frozenset(), True, args.views)
        sets = (*sets, TrainingSet("objects", objects))
    # No row is tested on a training home of any row.
    trained_on = homes_that_train([row.source for row in sets])
    judged_on = open_judged_places(
        args.on, plan, mode="mlt_il_ol", trained_on=trained_on, hold_out=common.hold_out
    )
    comparison = Comparison(sets, plan, args.out, args.seeds, exact=args.exact)
    result = compare(comparison, judged_on, echo)
    text = ablation_table(result)
    (args.out / "table.md").write_text(text, "utf-8")
    (args.out / "ablation.json").write_text(json.dumps(result, indent=1) + "\n", "utf-8")
    echo(f"\n{text}\n{args.out / 'table.md'}")


def _compare(args: argparse.Namespace) -> None:
    _need_torch()
    from pbrs_farm.study.comparing.compare_page import write_comparison
    from pbrs_farm.study.comparing.compared_pictures import (
        read_photographs,
        read_views,
        size_of_views,
    )
    from pbrs_farm.study.comparing.comparison import compare_sets
    from pbrs_farm.study.networks.initial_weights import imagenet_features
    from pbrs_farm.study.training.run_folder import make_folder

    at_least("--views", args.views, 0)
    # Report missing packages before reading pictures.
    network, size = imagenet_features(), size_of_views(args.root)
    make_folder(args.out)
    photographs = read_photographs(args.photographs, size, most=args.views)
    ours = read_views(args.root, size, mode=args.mode, most=args.views)
    for line in (*photographs.left_out, *ours.left_out):
        warn(f"left out: {line}")
    comparison = compare_sets(ours, photographs, network)
    path = write_comparison(args.out, comparison)
    if args.json:
        echo_json(comparison.report)
        return
    appearance, histograms = comparison.report["appearance"], comparison.report["histograms"]
    value, low, high = (appearance["kernel_distance"][key] for key in ("value", "low", "high"))
    sizes = (
        f"{counted(len(ours.pictures), 'view')}, {counted(len(photographs.pictures), 'photograph')}"
    )
    echo(f"{sizes}, {size[0]}x{size[1]} pixels")
    darker = f"the photographs a stop darker: {appearance['photographs_a_stop_darker']:.1f}"
    echo(f"kernel distance {value:.1f} [{low:.1f}, {high:.1f}] in thousandths; {darker}")
    for row in histograms.values():
        value, low, high = (row["shared"][key] for key in ("value", "low", "high"))
        halves = "" if row["halves"] is None else f"; halves of the photographs {row['halves']:.3f}"
        echo(f"{row['title']}: {value:.3f} [{low:.3f}, {high:.3f}] shared{halves}")
    echo(str(path))
