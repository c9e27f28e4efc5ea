"""Metrics of a training sent to TensorBoard or Weights & Biases as they are made. Effects: theirs.

A row of metrics.jsonl is a point of each of its values' curves, at the row's step.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.installation import install_command
from pbrs_farm.study.training.training_loop import Observer, share_of_process


@contextmanager
def loggers(names: Sequence[str], out: Path, config: dict[str, Any]) -> Iterator[Observer]:
    """An observer for `train` that hands each row to every program that is named (tensorboard, wandb); closed behind it.

    out: the run's folder, which a run is called by; TensorBoard's events go below out/tensorboard,
    W&B's files below out/wandb. config: what W&B shows of the plan. W&B's own environment holds
    (WANDB_MODE=offline, WANDB_PROJECT). Raises MachineFailed where a package is missing.

    Example:
        >>> with loggers(["tensorboard"], job.out, {}) as observe:  # doctest: +SKIP
        ...     train(job, views, observe=observe)
    """
    # Of several processes of torchrun the first one tells.
    names = names if share_of_process().is_first else ()
    check_installed(names)
    with ExitStack() as stack:
        heard = [stack.enter_context(_OPENED[name](out, config)) for name in names]

        def observe(row: dict[str, float]) -> None:
            for one in heard:
                one(row)

        yield observe


def check_installed(names: Sequence[str]) -> None:
    """Raise MachineFailed for the first of these programs whose package is missing."""
    for name in names:
        if find_spec(name) is None:
            raise MachineFailed(f"--log {name}: not installed", hint=install_command(name))


@contextmanager
def _tensorboard(out: Path, config: dict[str, Any]) -> Iterator[Observer]:
    from torch.utils.tensorboard import SummaryWriter

    with SummaryWriter(str(out / "tensorboard")) as writer:

        def observe(row: dict[str, float]) -> None:
            for name, value in _values(row).items():
                writer.add_scalar(name, value, int(row["step"]))

        yield observe


@contextmanager
def _wandb(out: Path, config: dict[str, Any]) -> Iterator[Observer]:
    import wandb

    out.mkdir(parents=True, exist_ok=True)
    with wandb.init(name=out.name, dir=str(out), config=config) as run:
        # Losses and errors of one step come in two rows: W&B's own count goes on between them.
        run.define_metric("*", step_metric="step")
        yield run.log


def _values(row: dict[str, float]) -> dict[str, float]:
    return {name: value for name, value in row.items() if name != "step"}


_OPENED: Final = {"tensorboard": _tensorboard, "wandb": _wandb}
