"""An OpenGL context comes through EGL, else through the system's library; failing both, the error is clear."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import moderngl
import pytest

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.installation import system_command
from pbrs_farm.raster.gl_device import open_context


def test_without_egl_the_systems_library_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    context = SimpleNamespace(enable=lambda _flag: None)

    def create(**settings: Any) -> Any:
        calls.append(settings.get("backend", "default"))
        if calls[-1] == "egl":
            raise Exception("eglInitialize failed")
        return context

    monkeypatch.setattr(moderngl, "create_context", create)
    assert open_context() is context
    assert calls == ["egl", "egl", "default"]


def test_egl_by_its_usual_name_needs_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[dict[str, Any]] = []
    context = SimpleNamespace(enable=lambda _flag: None)

    def create(**settings: Any) -> Any:
        calls.append(settings)
        if len(calls) == 1:
            raise Exception("libEGL.so.1 not loaded")
        return context

    monkeypatch.setattr(moderngl, "create_context", create)
    assert open_context() is context
    assert (calls[0]["libgl"], calls[0]["libegl"]) == ("libGL.so.1", "libEGL.so.1")
    assert "libegl" not in calls[1]


def test_without_any_library_the_error_has_each_reason_and_the_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def create(**settings: Any) -> Any:
        raise Exception("no library" if settings.get("backend") else "cannot open display")

    monkeypatch.setattr(moderngl, "create_context", create)
    with pytest.raises(MachineFailed) as caught:
        open_context()
    text = str(caught.value)
    assert "EGL: no library; the system's own: cannot open display" in text
    assert system_command("gl") in text
    assert "\n" not in text
