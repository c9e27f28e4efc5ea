"""What each property of pictures teaches: one is varied at a time, all else is equal.

    python -m benchmarks.study.sweep render --arms air1 air3 rays --seconds 1200 --jobs 2
    python -m benchmarks.study.sweep train  --arms air1 air3 rays --seconds 1400 --together 2
    python -m benchmarks.study.sweep table                what there is so far
    python -m benchmarks.study.sweep table --write        into docs/lab/study.md

render: the homes that judge, then made homes at 160x120 by recipe fast, a few of each arm in turn, so
that all have equally many when the seconds are over; the arm `plain` is always among them.
`pbrs-farm homes --furniture` goes before. train: normals by plan lite from ImageNet, equal homes,
views and steps, two seeds, judged on homes of the arm `plain` that never train and on --on. What is
cut off goes on with the same command. ARMS says what there is to vary.

Effects: out/study/sweep (or PBRS_STUDY_FOLDER/sweep): homes, runs, results.json and table.md.
"""

from __future__ import annotations

import argparse
import itertools
import json
import re
import statistics
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import commit, machine
from benchmarks.study.rendered import FOLDER
from benchmarks.study.trainings import (
    FIRST_JUDGE,
    SMALL_PICTURES,
    Training,
    gains_by_home,
    row_of_run,
    run_program,
    train_all,
)

SWEEP: Final = FOLDER / "sweep"
PLAIN: Final = "plain"
LAB_PAGE: Final = Path("docs/lab/study.md")


@dataclass(frozen=True, slots=True)
class Arm:
    """One property at one value; equal arms differ in nothing else."""

    subject: str
    said: str
    recipe: tuple[str, ...] = ()  # FIELD=VALUE of `run`
    plan: tuple[str, ...] = ()  # FIELD=VALUE of `train`
    pictures: tuple[str, ...] = ()  # arms whose homes it trains on, () = its own


ARMS: Final[dict[str, Arm]] = {
    PLAIN: Arm("-", "recipe fast as it is"),
    "air1": Arm("things in the air", "float_share .1", ("dress.float_share=0.1",)),
    "air3": Arm("things in the air", "float_share .3", ("dress.float_share=0.3",)),
    "rays": Arm("rays", "told", plan=("rays=true",), pictures=(PLAIN,)),
    "drawn": Arm("tone", "a camera drawn a view", ("tone.camera=drawn",)),
    "both": Arm("tone", "half neutral, half drawn", pictures=(PLAIN, "drawn")),
    "level": Arm("pitch and roll", "none", ("cameras.tilt_sd_deg=0", "cameras.roll_sd_deg=0")),
    "turned": Arm(
        "pitch and roll", "15 and 10 degrees", ("cameras.tilt_sd_deg=15", "cameras.roll_sd_deg=10")
    ),
    "lens45": Arm("lens", "45 degrees", ("cameras.hfov_rad=0.7854",), ("hfov_deg=45",)),
    "lens75": Arm("lens", "75 degrees", ("cameras.hfov_rad=1.309",), ("hfov_deg=75",)),
    "lens90": Arm("lens", "90 degrees", ("cameras.hfov_rad=1.5708",), ("hfov_deg=90",)),
    "zooms": Arm("lens", "50 to 80 degrees", ("cameras.hfov_rad=1.1", "cameras.hfov_spread=0.3")),
    "sky": Arm("surroundings", "none", ("surroundings.kind=none",)),
    "tidy": Arm("mess", "none", ("dress.mess=0",)),
    "messy": Arm("mess", "all of it", ("dress.mess=1",)),
}
"""What can be varied, by the words of --arms."""

_JUDGES: Final = SWEEP / "homes" / "judges"
_LOG: Final = SWEEP / "program.log"
_HELD_OUT: Final = "made"
_PORTION: Final = 4  # homes of an arm before the next arm has its turn
_FIELDS: Final = ("judge_every=0", "checkpoint_every=200", "log_every=50", "final_views=100", "threads=1")  # fmt: skip
_HEADING: Final = "## What each property of pictures teaches"
_BEGIN, _END = "<!-- bench:sweep -->", "<!-- /bench -->"


def main(words: Sequence[str]) -> None:
    """One of the three commands."""
    args = _arguments(words)
    {"render": _render, "train": _train, "table": _table}[args.command](args)


def _table(args: argparse.Namespace) -> None:
    print(_tell())
    if args.write:
        write_into(LAB_PAGE, sweep_section(_rows(), hidden_shares(), _where()))


def _arguments(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="benchmarks.study.sweep")
    commands = parser.add_subparsers(dest="command", required=True)
    render, train = commands.add_parser("render"), commands.add_parser("train")
    for command in (render, train):
        command.add_argument("--arms", nargs="+", choices=ARMS, default=list(ARMS), metavar="ARM")
        command.add_argument("--seconds", type=float, default=0, help="stop then; 0 = at the end")
    render.add_argument("--homes", type=int, default=40, help="of each arm, that train")
    render.add_argument("--judges", type=int, default=8, help="homes that judge")
    render.add_argument("--views", type=int, default=8, help="of a home, at most")
    render.add_argument("--jobs", type=int, default=2, help="processes")
    train.add_argument("--steps", type=int, default=300, help="of each training")
    train.add_argument("--batch", type=int, default=16, help="views a step")
    train.add_argument("--seeds", type=int, default=2)
    train.add_argument("--together", type=int, default=2, help="trainings at a time, a thread each")
    train.add_argument("--on", nargs="+", default=[], metavar="NAME=PLACE", help="judges, too")
    train.add_argument("--set", nargs="+", default=[], metavar="FIELD=VALUE", help="of the plan")
    table = commands.add_parser("table")
    table.add_argument("--write", action="store_true", help=f"into {LAB_PAGE}")
    return parser.parse_args(words)


def arms_to_do(names: Sequence[str]) -> list[str]:
    """The arms of these names, with those whose pictures they need, `plain` first.

    Example:
        >>> arms_to_do(["rays", "both"])
        ['plain', 'rays', 'drawn', 'both']
    """
    needed = ((*ARMS[name].pictures, name) for name in names)
    return list(dict.fromkeys((PLAIN, *(arm for arms in needed for arm in arms))))


def _roots_of(arm: str) -> list[Path]:
    return [SWEEP / "homes" / one for one in ARMS[arm].pictures or (arm,)]


def render_words(arm: str, first: int, last: int, views: int, jobs: int) -> list[str]:
    """The `run` of made homes first..last of an arm, without its --out."""
    fields = [word for field in ARMS[arm].recipe for word in ("--set", field)]
    size = ["--views", str(views), "--jobs", str(jobs)]
    return ["run", f"made:{first}..{last}", *SMALL_PICTURES, "--modes", "mlt_il_ol", *size, *fields]


def _render(args: argparse.Namespace) -> None:
    deadline = time.monotonic() + args.seconds if args.seconds else None
    arms = [arm for arm in arms_to_do(args.arms) if not ARMS[arm].pictures]
    # The judges are views of the plain arm, of homes that no arm trains on.
    turns = [(PLAIN, _JUDGES, FIRST_JUDGE, FIRST_JUDGE + args.judges - 1)]
    for first in range(1, args.homes + 1, _PORTION):
        last = min(first + _PORTION - 1, args.homes)
        turns += [(arm, _roots_of(arm)[0], first, last) for arm in arms]
    for arm, root, first, last in turns:
        if deadline and time.monotonic() >= deadline:
            break
        began = time.monotonic()
        words = render_words(arm, first, last, args.views, args.jobs)
        code = run_program([*words, "--out", str(root)], deadline, _LOG)
        ended = "done" if not code else f"code {code}, {_LOG} says why"
        print(f"{root.name} {first}..{last}: {time.monotonic() - began:.0f} s, {ended}", flush=True)


def _train(args: argparse.Namespace) -> None:
    from pbrs_farm.study.judging.judged_places import open_judged_place
    from pbrs_farm.study.training_plan import plan_of

    deadline = time.monotonic() + args.seconds if args.seconds else None
    arms = arms_to_do(args.arms)
    roots = {root: _views_by_home(root) for arm in arms for root in _roots_of(arm)}
    homes = equal_homes(list(roots.values()))
    if not homes:
        raise RuntimeError(
            f"{SWEEP}: no home that all of {', '.join(arms)} have: render goes first"
        )
    n_views = min(sum(own[home] for home in homes) for own in roots.values())
    print(f"{len(homes)} homes and {n_views} views of each arm train", flush=True)
    plan = plan_of("normals", "lite")
    for on in args.on:  # what cannot judge is told now, not after the first training
        open_judged_place(on, plan, mode="mlt_il_ol")
    trainings = []
    for seed, arm in itertools.product(range(args.seeds), arms):
        fields = [
            f"steps={args.steps}",
            f"batch={args.batch}",
            *_FIELDS,
            *ARMS[arm].plan,
            *args.set,
        ]
        others = sorted({home for root in _roots_of(arm) for home in roots[root]} - homes)
        train = (
            "train", "normals", *map(str, _roots_of(arm)), "--plan", "lite", "--init", "imagenet",
            "--views", str(n_views), "--seed", str(seed), "--hold-out", *(others or ["none"]),
            *(word for field in fields for word in ("--set", field)),
        )  # fmt: skip
        folder = SWEEP / "runs" / f"{arm}_{len(homes)}homes_{args.steps}steps_seed{seed}"
        trainings.append(Training(folder, train, (f"{_HELD_OUT}={_JUDGES}", *args.on)))
    train_all(trainings, args.together, deadline, _tell)
    print(_tell(), flush=True)


def _views_by_home(root: Path) -> dict[str, int]:
    """Home -> how many views of it are whole."""
    from pbrs_farm.core.house_split import home_of
    from pbrs_farm.views.open_views import open_views

    found: dict[str, int] = {}
    for ref in open_views(str(root)).refs if (root / "houses").is_dir() else ():
        home = home_of(ref.house)
        found[home] = found.get(home, 0) + 1
    return found


def equal_homes(views: Sequence[Mapping[str, int]]) -> frozenset[str]:
    """The homes that every arm has, of each arm's views by home."""
    return frozenset.intersection(*(frozenset(own) for own in views)) if views else frozenset()


def _rows() -> list[dict[str, Any]]:
    """What each training that is judged was, and its evaluations."""
    rows = []
    for path in sorted((SWEEP / "runs").glob("*/evaluation/evaluation.json")):
        arm, _homes, _steps, seed = path.parents[1].name.split("_")
        rows.append(row_of_run(path) | {"arm": arm, "seed": int(seed.removeprefix("seed"))})
    return rows


def hidden_shares() -> dict[str, float]:
    """Arm -> the share of its pictures that things in the air hide, of arms that have any."""
    found = {}
    for arm in ARMS:
        files = list((SWEEP / "homes" / arm).glob("houses/*/views/*/view.json"))
        rows = [json.loads(file.read_bytes())["instances"] for file in files]
        shares = [sum(r["fraction"] for r in own if r.get("floating")) for own in rows]
        if any(shares):
            found[arm] = statistics.fmean(shares)
    return found


def _tell() -> str:
    """Write results.json and table.md; the table."""
    rows = _rows()
    if not rows:
        return "nothing is judged yet"
    text = sweep_table(rows, hidden_shares())
    (SWEEP / "results.json").write_text(json.dumps({"rows": rows}, indent=1))
    (SWEEP / "table.md").write_text(text)
    return text


def sweep_table(rows: Sequence[dict[str, Any]], hidden: Mapping[str, float]) -> str:
    """Markdown: a row an arm, those trained on as many homes with as many steps in one table.

    rows: as row_of_run has them, with arm and seed. hidden: as of hidden_shares. The gain is over
    `plain`, at equal seeds, the mean over the homes that judge with the bounds that 90 % of resamples
    of these homes lie in; positive is better.
    """
    from pbrs_farm.study.judging.evaluation import mean_interval
    from pbrs_farm.study.judging.figure_text import markdown, spread_text

    tables = []
    for homes, steps, batch in sorted({(r["homes"], r["steps"], r["batch"]) for r in rows}):
        same = [r for r in rows if (r["homes"], r["steps"], r["batch"]) == (homes, steps, batch)]
        others = [
            name
            for name in dict.fromkeys(n for r in same for n in r["judged"])
            if name != _HELD_OUT
        ]
        plain = _groups(same, PLAIN)
        lines = []
        for arm in (name for name in ARMS if any(r["arm"] == name for r in same)):
            own = [r for r in same if r["arm"] == arm]
            gains = gains_by_home(plain, _groups(same, arm)) if arm != PLAIN else []
            gain = "-"
            if gains:
                low, high = mean_interval(gains)
                gain = f"{statistics.fmean(gains):+.2f} [{low:+.2f}, {high:+.2f}]"
            cells = [
                spread_text("mean_deg", [_mean(r, judge) for r in own if judge in r["judged"]])
                for judge in (_HELD_OUT, *others)
            ]
            air = f"{100 * hidden[arm]:.0f} %" if arm in hidden else "-"
            seen = statistics.fmean(r["training_deg"] for r in own)
            lines.append([ARMS[arm].subject, ARMS[arm].said, air, str(len(own)), f"{seen:.1f}", cells[0], gain, *cells[1:]])  # fmt: skip
        still = same[0]["baseline"]
        means = [same[0]["judged"][j]["figures"][still]["mean_deg"] for j in (_HELD_OUT, *others)]
        base = [f"{mean:.2f}" for mean in means]
        lines.append(["-", still, "-", "-", "-", base[0], "-", *base[1:]])
        judged = same[0]["judged"][_HELD_OUT]
        said = (
            f"Normals, plan lite at 160x120 from ImageNet, {steps:,} steps of {batch} views of {homes} homes, degrees;"
            f" `{_HELD_OUT}` is {judged['n_views']} views of {len(judged['groups'])} homes of the arm as it is, which never train."
        )
        titles = ["varied", "how", "in the air", "seeds", "training", _HELD_OUT, "better [90 %]", *others]  # fmt: skip
        tables.append(f"{said}\n\n{markdown(titles, lines)}")
    return "\n\n".join(tables) + "\n"


def _groups(rows: Sequence[dict[str, Any]], arm: str) -> dict[int, dict[str, float]]:
    return {r["seed"]: r["judged"][_HELD_OUT]["groups"] for r in rows if r["arm"] == arm}


def _mean(row: dict[str, Any], judge: str) -> float:
    return float(row["judged"][judge]["figures"]["network"]["mean_deg"])


def _where() -> str:
    """Commit and machine, as the lab book tells them."""
    here = machine()
    return f"Commit {commit()[:7]}; {here['cores']} cores of {here['cpu']}."


def sweep_section(rows: Sequence[dict[str, Any]], hidden: Mapping[str, float], where: str) -> str:
    """The lab book's chapter, between its marks: how it was made, where, and the tables."""
    command = "`python -m benchmarks.study.sweep render`, then `train` and `table --write`"
    made = f"Made by {command}, with --arms {' '.join(sorted({r['arm'] for r in rows}))}. {where}"
    return f"{_BEGIN}\n{made}\n\n{sweep_table(rows, hidden)}{_END}"


def write_into(page: Path, section: str) -> None:
    """Put the chapter in the place of the one that the page has, or at its end."""
    text = page.read_text("utf-8")
    old = re.compile(re.escape(_BEGIN) + ".*?" + re.escape(_END), re.DOTALL)
    if old.search(text):
        text = old.sub(lambda _match: section, text)
    else:
        text = f"{text.rstrip()}\n\n{_HEADING}\n\n{section}\n"
    page.write_text(text, "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
