"""A sceneState file (HSSD-200, Rent3D++, text-to-scene generators) -> House. Effects: reads files."""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.source_files import SourceFiles


def read(path: Path, fields: ReadFields, models: str) -> House:
    """The House of the file. Raises BadHouse naming the place."""
    raise BadHouse(path, "", "is not read yet")


def companions(path: Path, models: str, files: SourceFiles) -> str:
    """Digest of what reading opens beside the file; "" where there is none."""
    return ""
