"""The docs contain the table of material fields by format, as the code has it."""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.read.common.material_fields import material_fields, noted_fields, rows_of_docs


def test_the_docs_hold_the_table() -> None:
    assert rows_of_docs() in Path("docs/houses/surfaces.md").read_text("utf-8")


def test_each_field_is_read_or_noted_or_changes_nothing() -> None:
    assert {field.use for field in material_fields()} == {"read", "note", "-"}
    assert {field.format for field in material_fields()} == {"glTF", "USD", "MTL"}
    assert "map_bump" in noted_fields("MTL")
