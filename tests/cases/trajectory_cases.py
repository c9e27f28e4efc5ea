"""Cases of trajectories from other systems; writers write files."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.regular_files import MAX_TEXT_BYTES, read_regular, text_from_bytes
from pbrs_farm.sample.walks.trajectory_file import poses_from_tum
from tests.cases.case import Case

_STAMPS: Final = (1305031102.1758, 1305031102.2091, 1305031102.2425, 1305031102.2758)


def cases() -> list[Case]:
    """Named by their unusual feature."""
    return [
        Case("bom_crlf", partial(_write, "\ufeff", "\r\n", 1.0), _ask_for_the_stamps),
        Case("nanoseconds", partial(_write, "", "\n", 1e9), _ask_for_the_stamps),
        Case("twice", _twice, _ask_for_both_stamps_in_full),
    ]


def _write(start: str, end: str, per_second: float, folder: Path) -> Path:
    stamps = [f"{t:.4f}" if per_second == 1 else f"{int(t * per_second)}" for t in _STAMPS]
    return _written(folder, start + end.join(_rows(stamps)))


def _rows(stamps: list[str]) -> list[str]:
    return [f"{t} {2 + 0.02 * k:.4f} 1.5 3 1 0 0 0" for k, t in enumerate(stamps)]


def _written(folder: Path, text: str) -> Path:
    path = folder / "way.txt"
    path.write_text(text, encoding="utf-8", newline="")
    return path


def _twice(folder: Path) -> Path:
    stamps = [f"{_STAMPS[k]:.4f}" for k in (0, 1, 1, 2)]
    return _written(folder, "\n".join(_rows(stamps)))


def _read(path: Path) -> list[float]:
    text = text_from_bytes(read_regular(path, MAX_TEXT_BYTES))
    return [pose.time_s for pose in poses_from_tum(text, path.name)]


def _ask_for_the_stamps(path: Path) -> None:
    assert np.allclose(_read(path), _STAMPS, rtol=0, atol=1e-4)


def _ask_for_both_stamps_in_full(path: Path) -> None:
    with pytest.raises(BadInput, match=r"1305031102\.2091 is not after 1305031102\.2091"):
        _read(path)
