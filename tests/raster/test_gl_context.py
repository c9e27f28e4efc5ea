"""A context comes through EGL, else through what the system has; without one it is said clearly."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import moderngl
import pytest

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.installation import system_command
from pbrs_farm.raster.gl_device import open_context


def test_where_egl_fails_the_systems_own_way_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    found = SimpleNamespace(enable=lambda _flag: None)

    def create(**settings: Any) -> Any:
        asked.append(settings.get("backend", "default"))
        if asked[-1] == "egl":
            raise Exception("eglInitialize failed")
        return found

    monkeypatch.setattr(moderngl, "create_context", create)
    assert open_context() is found
    assert asked == ["egl", "egl", "default"]


def test_egl_by_its_usual_name_needs_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, Any]] = []
    found = SimpleNamespace(enable=lambda _flag: None)

    def create(**settings: Any) -> Any:
        asked.append(settings)
        if len(asked) == 1:
            raise Exception("libEGL.so.1 not loaded")
        return found

    monkeypatch.setattr(moderngl, "create_context", create)
    assert open_context() is found
    assert (asked[0]["libgl"], asked[0]["libegl"]) == ("libGL.so.1", "libEGL.so.1")
    assert "libegl" not in asked[1]


def test_without_any_the_reason_of_each_and_the_remedy_are_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def create(**settings: Any) -> Any:
        raise Exception("no library" if settings.get("backend") else "cannot open display")

    monkeypatch.setattr(moderngl, "create_context", create)
    with pytest.raises(MachineFailed) as caught:
        open_context()
    told = str(caught.value)
    assert "EGL: no library; the system's own: cannot open display" in told
    assert system_command("gl") in told
    assert "\n" not in told
