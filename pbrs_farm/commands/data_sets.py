"""Verbs of data sets: make, estimate. Effects: those of a run, and the set's folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from pbrs_farm.commands.arguments import Verb, counted, echo, echo_json, warn
from pbrs_farm.commands.options import add_options, request_from


def add_verbs(verb: Verb) -> None:
    """Add make and estimate."""
    from pbrs_farm.run.request import ProcessLimitOptions

    add_options(verb("make", _make), ProcessLimitOptions)
    verb("estimate", _estimate)


def _make(args: argparse.Namespace) -> int:
    from pbrs_farm.commands.making import run_and_report
    from pbrs_farm.commands.set_file import set_from_word
    from pbrs_farm.run.processes.render_task import Event
    from pbrs_farm.run.request import ProcessLimitOptions
    from pbrs_farm.sets.data_set import WHOLE, shard_from_text
    from pbrs_farm.sets.make_set import claim_folder, finish_set, part_run, take_prepared
    from pbrs_farm.settings import settings_from_environment

    how = request_from(args, ProcessLimitOptions)
    shard = shard_from_text(args.shard)
    data_set, out = set_from_word(args.set), Path(args.out)
    claim_folder(out, data_set)
    planned: dict[str, dict[str, list[str]]] = {}
    n_failed = n_lost = 0
    for number, part in enumerate(data_set.parts):
        views = planned.setdefault(part.name, {})

        def observe(event: Event, views: dict[str, list[str]] = views) -> None:
            if event.kind == "planned":
                views[event.house_id] = list(event.facts["views"])

        run = part_run(part, out, shard, how, settings_from_environment().store)
        if not run.homes:
            continue
        if not args.json:
            echo(f"{part.name}: {counted(len(run.homes), 'home')}")
        take_prepared(part, data_set.parts[:number], out, shard)
        n_houses = len(run.homes) * max(1, len(part.dress_seeds))
        summary = run_and_report(run, n_houses, as_json=args.json, observe=observe)
        n_failed += len(summary.failures)
        n_lost += len(summary.walls_lost)
    if n_failed:
        warn(
            f"{n_failed} failed: the set is not written. Run again; remove homes that keep failing from"
            f" {args.set}"
        )
        return 1
    if shard != WHOLE:
        text = f"shard {args.shard} is rendered; with all of them in {out}: pbrs-farm make {args.set} --out {out}"
        if not args.json:
            echo(text)
        return 0
    n_made = finish_set(data_set, out, planned, (lambda _line: None) if args.json else echo)
    n_views = sum(len(views) for of in planned.values() for views in of.values())
    if not args.json:
        done = "" if n_made else ", nothing to do"
        echo(f"{out}: {counted(n_views, 'view')}, SHA256SUMS{done}")
    return 1 if n_lost else 0


def _estimate(args: argparse.Namespace) -> None:
    from pbrs_farm.commands.set_file import set_from_word
    from pbrs_farm.sets.estimate_set import bill_text, clouds_of, estimate_set, estimate_text

    estimate = estimate_set(set_from_word(args.set))
    if args.cloud:
        bills = {cloud: estimate.bill(cloud) for cloud in clouds_of(args.cloud)}
        if args.json:
            echo_json(
                {
                    cloud: [line.model_dump(mode="json") for line in bill]
                    for cloud, bill in bills.items()
                }
            )
        else:
            echo("\n\n".join(f"{cloud}\n{bill_text(bill)}" for cloud, bill in bills.items()))
        return
    if args.json:
        echo_json(estimate.model_dump(mode="json"))
    else:
        echo(estimate_text(estimate))
