"""State of a training in one safetensors file, which a new one replaces in one step. Effects: files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from pbrs_farm.core.errors import BadInput
from pbrs_farm.regular_files import naming_kind


def write_tensor_file(path: Path, tensors: Mapping[str, Tensor], metadata: dict[str, str]) -> None:
    """Write tensors and metadata; the file is complete or unchanged."""
    plain = {name: tensor.detach().to("cpu").contiguous() for name, tensor in tensors.items()}
    beside = path.with_suffix(".part")
    save_file(plain, beside, metadata)
    beside.replace(path)


def read_tensor_file(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Tensors of a file, on the CPU, and its metadata. Raises OSError or ValueError."""
    with path.open("rb"):  # the library gives no reason for a file that it cannot open
        pass
    try:
        with safe_open(path, framework="pt") as file:
            tensors = {str(name): file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            return tensors, file.metadata() or {}
    except SafetensorError as error:
        raise ValueError(f"not a safetensors file, or truncated: {error}") from None


@dataclass(frozen=True, slots=True)
class Position:
    """Step of a training, and its task, plan, views and seed."""

    step: int  # steps done
    task: str
    plan_digest: str
    views_digest: str
    seed: int


def save_checkpoint(
    path: Path,
    network: nn.Module,
    optimiser: torch.optim.Optimizer,
    position: Position,
    average: nn.Module | None = None,
) -> None:
    """Write the whole state of a training; average: running mean of the weights."""
    tensors = {f"model.{name}": tensor for name, tensor in network.state_dict().items()}
    if average is not None:
        tensors |= {f"average.{name}": tensor for name, tensor in average.state_dict().items()}
    for number, state in optimiser.state_dict()["state"].items():
        for key, value in state.items():
            if value is not None:
                tensors[f"optimiser.{number}.{key}"] = torch.as_tensor(value)
    tensors["generator"] = torch.get_rng_state()
    _write_whole(path, tensors, position)


def save_weights(path: Path, network: nn.Module, position: Position) -> None:
    """Write the weights only, for evaluation and fine-tuning."""
    named = {f"model.{name}": tensor for name, tensor in network.state_dict().items()}
    _write_whole(path, named, position)


def load_checkpoint(
    path: Path,
    network: nn.Module,
    optimiser: torch.optim.Optimizer | None = None,
    average: nn.Module | None = None,
) -> Position:
    """Load network, optimiser with generator, and mean, if given; BadInput for damage or other networks."""
    tensors, position = read_tensors(path)
    _into(network, _below(tensors, "model."), path)
    if average is not None:
        _into(average, _below(tensors, "average."), path)
    if optimiser is not None:
        state: dict[int, dict[str, Tensor]] = {}
        for name, tensor in _below(tensors, "optimiser.").items():
            number, _, key = name.partition(".")
            state.setdefault(int(number), {})[key] = tensor
        groups = optimiser.state_dict()["param_groups"]
        optimiser.load_state_dict({"state": state, "param_groups": groups})
        torch.set_rng_state(tensors["generator"])
    return position


def read_tensors(path: Path) -> tuple[dict[str, Tensor], Position]:
    """Tensors of a checkpoint, on the CPU, and its position; BadInput for any other file."""
    try:
        tensors, metadata = read_tensor_file(path)
        return tensors, Position(**json.loads(metadata["position"]))
    except FileNotFoundError:
        raise BadInput(path, "", "no such file") from None
    except (OSError, KeyError, TypeError, ValueError):
        with naming_kind(path):
            raise BadInput(path, "", "not a checkpoint of `train`, or damaged") from None


def _into(network: nn.Module, weights: dict[str, Tensor], path: Path) -> None:
    state = network.state_dict()
    wrong = [n for n in state if n not in weights or weights[n].shape != state[n].shape]
    if wrong or len(state) != len(weights):
        name = (wrong or sorted(set(weights) - set(state)))[0]
        raise BadInput(path, name, "a checkpoint of another network, task or plan")
    network.load_state_dict(weights)


def _below(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}


def _write_whole(path: Path, tensors: dict[str, Tensor], position: Position) -> None:
    text = json.dumps(asdict(position), sort_keys=True)
    write_tensor_file(path, tensors, {"position": text})
