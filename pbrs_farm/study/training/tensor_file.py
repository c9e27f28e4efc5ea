"""Tensors by name <-> a safetensors file, with torch alone: a machine may have nothing else. Effects: files.

The format: 8 bytes, the length of a JSON header (little-endian); the header, name -> type, shape and
place; then the tensors' bytes one behind the other. The library `safetensors` reads what is
written here, and the other way round (tests).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor

_TYPES: Final = {
    "F64": torch.float64, "F32": torch.float32, "F16": torch.float16, "BF16": torch.bfloat16,
    "I64": torch.int64, "I32": torch.int32, "U8": torch.uint8, "BOOL": torch.bool,
}  # fmt: skip
_NAMES: Final = {kind: name for name, kind in _TYPES.items()}
_METADATA: Final = "__metadata__"
_MAX_HEADER_BYTES: Final = 100_000_000


def write_tensor_file(path: Path, tensors: Mapping[str, Tensor], metadata: dict[str, str]) -> None:
    """Write tensors and words about them; the file is whole or not at all."""
    header: dict[str, Any] = {_METADATA: metadata}
    plain = {name: tensor.detach().to("cpu").contiguous() for name, tensor in tensors.items()}
    at = 0
    for name, tensor in plain.items():
        end = at + tensor.numel() * tensor.element_size()
        header[name] = {
            "dtype": _NAMES[tensor.dtype], "shape": list(tensor.shape), "data_offsets": [at, end],
        }  # fmt: skip
        at = end
    text = json.dumps(header, separators=(",", ":")).encode()
    # Fill the header up with blanks, so that the tensors begin at a multiple of 8.
    text += b" " * (-len(text) % 8)
    beside = path.with_suffix(".part")
    with beside.open("wb") as file:
        file.write(len(text).to_bytes(8, "little") + text)
        for tensor in plain.values():
            file.write(tensor.reshape(-1).view(torch.uint8).numpy().data)
    beside.replace(path)


def read_tensor_file(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """All tensors of a file, on the CPU, and its words. Raises OSError, ValueError where it is none."""
    with path.open("rb") as file:
        n_header = int.from_bytes(file.read(8), "little")
        if not 2 <= n_header <= min(_MAX_HEADER_BYTES, path.stat().st_size):
            raise ValueError("not a safetensors file")
        header = json.loads(file.read(n_header))
        data = bytearray(file.read())
    if not isinstance(header, dict):
        raise ValueError("not a safetensors file")
    metadata = header.pop(_METADATA, {})
    return {name: _tensor(row, data) for name, row in header.items()}, metadata


def _tensor(row: Any, data: bytearray) -> Tensor:
    try:
        kind, shape, (start, end) = _TYPES[row["dtype"]], row["shape"], row["data_offsets"]
        n = math.prod(shape)
    except (KeyError, TypeError):
        raise ValueError("not a safetensors file") from None
    if not 0 <= start <= end <= len(data) or end - start != n * kind.itemsize:
        raise ValueError("truncated, or not a safetensors file")
    if n == 0:
        return torch.empty(shape, dtype=kind)
    return torch.frombuffer(data, dtype=kind, count=n, offset=start).reshape(shape).clone()
