"""Metrics of a training, each row a point of each curve, in TensorBoard or Weights & Biases. Effects: theirs."""

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
    """Context with an observer for `train` that sends each row to these programs (tensorboard, wandb).

    out: folder and name of the run; events of TensorBoard are in out/tensorboard, files of W&B in
    out/wandb. config: the plan, for W&B. W&B's environment applies (WANDB_MODE=offline,
    WANDB_PROJECT). Raises MachineFailed if a package is missing.

    Example:
        >>> with loggers(["tensorboard"], job.out, {}) as observe:  # doctest: +SKIP
        ...     train(job, views, observe=observe)
    """
    # Only the first process of torchrun logs.
    names = names if share_of_process().is_first else ()
    check_installed(names)
    with ExitStack() as stack:
        observers = [stack.enter_context(_OPENED[name](out, config)) for name in names]

        def observe(row: dict[str, float]) -> None:
            for observer in observers:
                observer(row)

        yield observe


def check_installed(names: Sequence[str]) -> None:
    """Raise MachineFailed if the package of one of these programs is missing."""
    for name in names:
        if find_spec(name) is None:
            raise MachineFailed(f"--log {name}: not installed", hint=install_command(name))


@contextmanager
def _tensorboard(out: Path, config: dict[str, Any]) -> Iterator[Observer]:
    from torch.utils.tensorboard import SummaryWriter

    with SummaryWriter(str(out / "tensorboard")) as writer:

        def observe(row: dict[str, float]) -> None:
            for name in row.keys() - {"step"}:
                writer.add_scalar(name, row[name], int(row["step"]))

        yield observe


@contextmanager
def _wandb(out: Path, config: dict[str, Any]) -> Iterator[Observer]:
    import wandb

    out.mkdir(parents=True, exist_ok=True)
    with wandb.init(name=out.name, dir=str(out), config=config) as run:
        # Losses and errors of one step come in two rows; W&B would count them as two steps.
        run.define_metric("*", step_metric="step")
        yield run.log


_OPENED: Final = {"tensorboard": _tensorboard, "wandb": _wandb}
