"""What stored JSON is read into; no effects."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Record(BaseModel):
    """A frozen value whose JSON has these fields and no others."""

    model_config = ConfigDict(frozen=True, extra="forbid")
