"""Waiting time of a trainer of a stream; part of `make bench NAME=sets`.

The study's plan `lite` trains normals on 160x120 views of two generated homes, in batches of 8, on the cores that also
render. The share of waiting is that of the steady state: seconds in which the training loop waits for its next batch,
over all seconds of `reuse` epochs, in which each home gets new views once. They follow an epoch whose views are
rendered without a pause: the renderer is only as far ahead as it got beside the training. Steps take as
long as they do on the shared cores; `stream.step_s` is their time with idle cores.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pbrs_farm as pf

UNITS: Final = {
    "stream.wait_share": "share of the time that training waits for views with 4 epochs of reuse; two cores, 160x120",
    "stream.wait_share_2": "with 2 epochs of reuse",
    "stream.step_s": "s per step of 8 views of plan lite, with idle cores",
}
_SET: Final = """
[render]
recipe = "preview"
[part.views]
homes = ["made:70101..70102"]
views = 4
"""
_BATCH: Final = 8
# reuse -> first epoch; no two have a generation in common, and one of the homes has new views next
_STARTS: Final = {4: 40, 2: 60}


def stream_figures() -> dict[str, Any]:
    """The figures of UNITS; needs torch."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "two.toml")
        file.write_text(_SET)
        return _figures(file, Path(folder, "cache"))


def _figures(file: Path, cache: Path) -> dict[str, Any]:
    def stream(reuse: int) -> Any:
        layers = ("colour", "normal")
        return pf.stream(file, size=(160, 120), layers=layers, reuse=reuse, cache=cache)

    step = _trainer()
    shares: dict[str, float] = {}
    for reuse, first in _STARTS.items():
        epochs = stream(reuse)
        _waits(_batches(epochs.epoch(first), 1), step)
        waits = [_waits(_batches(epochs.epoch(first + 1 + k), 1), step) for k in range(reuse)]
        waited_s, total_s = (sum(column) for column in zip(*waits, strict=True))
        suffix = f"_{reuse}" if reuse != 4 else ""
        shares[f"stream.wait_share{suffix}"] = round(waited_s / total_s, 3)
        print(f"   reuse {reuse}: waited {waited_s:.1f} of {total_s:.1f} s", flush=True)
        batch = next(iter(_batches(epochs.epoch(first), 0)))
        epochs.close()
    return {
        **shares,
        "stream.step_s": round(min(_seconds(lambda: step(batch)) for _ in range(3)), 3),
    }


def _batches(epoch: Any, workers: int) -> Any:
    from torch.utils.data import DataLoader

    return DataLoader(epoch, batch_size=_BATCH, num_workers=workers)


def _waits(batches: Any, step: Callable[[Any], None]) -> tuple[float, float]:
    """Seconds of waiting, and of all, of an epoch."""
    began_s = last_s = time.perf_counter()
    waited_s = 0.0
    for batch in batches:
        waited_s += time.perf_counter() - last_s
        step(batch)
        last_s = time.perf_counter()
    return waited_s, last_s - began_s


def _trainer() -> Callable[[Any], None]:
    """A training step of the study's plan `lite` for normals."""
    import torch

    from pbrs_farm.study.networks.network_choice import network_of
    from pbrs_farm.study.tasks.losses import normal_loss
    from pbrs_farm.study.training.prediction import as_colour, network_output
    from pbrs_farm.study.training_plan import plan_of

    plan = plan_of("normals", "lite")
    network = network_of(plan.network, 3)
    optimiser = torch.optim.AdamW(network.parameters(), plan.rate)

    def step(batch: Any) -> None:
        output = network_output(network, as_colour(batch["colour"]), plan)
        normal = batch["normal"].permute(0, 3, 1, 2)
        losses = normal_loss(output, normal, batch["valid"], kind=plan.loss, over=plan.loss_over)
        optimiser.zero_grad()
        losses.mean().backward()
        optimiser.step()

    return step


def _seconds(act: Callable[[], None]) -> float:
    began_s = time.perf_counter()
    act()
    return time.perf_counter() - began_s


if __name__ == "__main__":
    for figure, measured in stream_figures().items():
        print(figure, measured, UNITS[figure])
