"""Untrusted text is one printable line wherever it is shown."""

from __future__ import annotations

import json
import unicodedata

import pytest

from pbrs_farm.commands.arguments import echo, echo_json, warn
from pbrs_farm.core.errors import BadHouse, PbrsError
from pbrs_farm.core.shown_text import MAX_MESSAGE, MAX_NAME, escaped, printable, shown
from pbrs_farm.read.common.notes import Notes

HOSTILE = (
    "Hall\n[   0.1 s] forged",
    "Hall\r\n\x1b[2Jforged",
    "\u202eHall\u202c \u2066abc",
    "a\u2028b\u2029c\u0085d",
    "Hall\0\ud800",
    "H" + "\u0301" * 2000,
    "x" * 100_000,
)


@pytest.mark.parametrize("text", HOSTILE)
def test_a_name_is_one_short_line_without_controls(text):
    line = shown(text)
    assert len(line) <= MAX_NAME
    assert len(line.splitlines()) == 1
    assert not {unicodedata.category(c) for c in line} & {"Cc", "Cf", "Cs", "Zl", "Zp"}
    assert sum(map(unicodedata.combining, line)) <= 6 * 230


@pytest.mark.parametrize("text", ["Wohnküche", "Спальня", "寝室", "غرفة", "ห้องนอน", "a  b 🛏️"])
def test_a_name_in_any_script_is_unchanged(text):
    assert shown(text) == text


def test_a_long_name_keeps_its_ends():
    assert shown("abc" + "x" * 1000 + "/home.sh3d", 40).startswith("abcx")
    assert shown("abc" + "x" * 1000 + "/home.sh3d", 40).endswith("/home.sh3d")


@pytest.mark.parametrize("text", HOSTILE)
def test_errors_and_notes_are_one_line_for_any_quoted_text(text):
    for error in (BadHouse(text, text, text, hint=text), PbrsError(text)):
        assert len(str(error).splitlines()) == 1
        assert len(str(error)) <= 2 * MAX_MESSAGE + 10
    notes = Notes("home", strict=False)
    notes.add("kind", text, text)
    (note,) = notes.all()
    assert len(f"{note.place} {note.text}".splitlines()) == 1
    assert len(note.text) <= MAX_MESSAGE


def test_a_name_cannot_forge_a_line_of_the_console(capsys):
    for text in HOSTILE:
        warn(f"room {text}")
    output = capsys.readouterr().err
    assert output.count("\n") == len(HOSTILE)
    assert all(line.startswith("pbrs-farm: ") for line in output.splitlines())
    echo("one\ntwo \x1b[31m\u202e")
    assert capsys.readouterr().out == "one\ntwo  [31m \n"
    assert printable("a\nb") == "a\nb"


def test_json_for_machines_loses_nothing_and_steers_no_terminal(capsys):
    value = {"name": "Küche \u202e\u2028 \ud800 🛏"}
    echo_json(value)
    text = capsys.readouterr().out
    assert "Küche" in text
    assert json.loads(text) == value
    assert "\u202e" not in escaped(text)
