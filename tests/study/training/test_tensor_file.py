"""Checkpoints are safetensors files that the library reads, and damaged ones are told."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

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


def test_the_library_reads_what_is_written(tmp_path: Path) -> None:
    tensors, path = some_tensors(), tmp_path / "x.safetensors"
    write_tensor_file(path, tensors, {"position": "here"})
    with safe_open(path, framework="pt") as file:
        assert file.metadata() == {"position": "here"}
        assert set(file.keys()) == set(tensors)
        for name, tensor in tensors.items():
            assert torch.equal(file.get_tensor(name), tensor)


def test_what_the_library_writes_is_read(tmp_path: Path) -> None:
    tensors, path = some_tensors(), tmp_path / "x.safetensors"
    save_file(tensors, path, metadata={"position": "there"})
    found, words = read_tensor_file(path)
    assert words == {"position": "there"}
    assert found.keys() == tensors.keys()
    for name, tensor in tensors.items():
        assert found[name].dtype == tensor.dtype
        assert torch.equal(found[name], tensor)


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
