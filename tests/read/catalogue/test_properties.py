from __future__ import annotations

from pbrs_farm.read.catalogue.library_files import numbered_entries, parse_properties


def test_a_property_file_is_read_as_java_reads_it() -> None:
    text = (
        "# no\n! no\n\na = 1\nb:two words \nc three\nd=long \\\n   line\ne=\\u00e9\\t!\nf\\ g=x\n"
    )
    properties = parse_properties(text.encode())
    assert properties == {
        "a": "1", "b": "two words", "c": "three", "d": "long line", "e": "é\t!", "f g": "x",
    }  # fmt: skip


def test_latin_1_is_read_if_utf_8_does_not_decode() -> None:
    assert parse_properties("a=é".encode("latin-1")) == parse_properties("a=é".encode())


def test_entries_come_in_order_of_their_numbers() -> None:
    rows = numbered_entries({"id#10": "b", "id#2": "a", "name#2": "A", "id": "whole", "x#y": "no"})
    assert rows == [{"id": "a", "name": "A"}, {"id": "b"}]
