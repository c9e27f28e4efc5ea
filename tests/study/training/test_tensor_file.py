"""Checkpoints hold every type of tensor, and a damaged one is an error."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from pbrs_farm.study.training.checkpoint import read_tensor_file, write_tensor_file

pytestmark = pytest.mark.study


def some_tensors() -> dict[str, torch.Tensor]:
    dice = torch.Generator().manual_seed(0)
    return {
        "a.weight": torch.randn(3, 4, 5, generator=dice),
        "b": torch.randn(7, generator=dice).to(torch.bfloat16),
        "flags": torch.tensor([True, False, True]),
        "state": torch.arange(9, dtype=torch.uint8),
        "step": torch.tensor(12.0),
        "number": torch.tensor(2**40),
        "none": torch.empty(0, 3),
    }


def test_written_tensors_are_read_back(tmp_path: Path) -> None:
    tensors, path = some_tensors(), tmp_path / "x.safetensors"
    write_tensor_file(path, tensors, {"position": "there"})
    tensors_read, words = read_tensor_file(path)
    assert words == {"position": "there"}
    assert tensors_read.keys() == tensors.keys()
    for name, tensor in tensors.items():
        assert tensors_read[name].dtype == tensor.dtype
        assert torch.equal(tensors_read[name], tensor)


@pytest.mark.parametrize("damage", ["empty", "cut", "words", "huge"])
def test_a_damaged_file_is_an_error(damage: str, tmp_path: Path) -> None:
    path = tmp_path / "x.safetensors"
    write_tensor_file(path, some_tensors(), {})
    whole = path.read_bytes()
    damaged = {
        "empty": b"", "cut": whole[:-4], "words": b"no tensors at all, only words",
        "huge": (2**60).to_bytes(8, "little") + whole[8:],
    }  # fmt: skip
    path.write_bytes(damaged[damage])
    with pytest.raises(ValueError, match="safetensors"):
        read_tensor_file(path)
