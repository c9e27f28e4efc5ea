"""Notebook displays of a home, cameras, frames and a report; and progress."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.views.views import Views
from tests.scene.homes import small_home

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def home() -> pf.Home:
    return small_home()


@pytest.fixture(scope="module")
def frames(home: pf.Home) -> Views:
    views = pf.render(home, home.cameras(n=2), modes=["opengl_dl"])
    assert isinstance(views, Views)
    return views


def titles(page: str) -> list[str]:
    (svg,) = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    return [e.text or "" for e in ET.fromstring(svg).iter(f"{SVG}title")]


def test_a_home_shows_its_plan_with_rooms_items_and_lamps(home: pf.Home) -> None:
    page = home._repr_html_()
    assert "Living room" in page
    assert "sofa" in titles(page)
    n_lights = sum(len(item.lights) for item in home.house.items)
    assert sum(title.startswith("lamp: ") for title in titles(page)) == n_lights > 0


def test_a_plan_shows_the_cameras_it_is_given(home: pf.Home) -> None:
    cameras = home.cameras(n=3)
    shown = titles(home.plan(cameras))
    assert all(
        any(title.startswith(f"{camera.id}: score") for title in shown) for camera in cameras
    )
    assert titles(home.plan([pf.Camera.look_at((2.5, 1.2, 2.4), (2, 0.9, 2))])) != titles(
        home.plan()
    )


def test_viewpoints_show_their_visible_items(home: pf.Home) -> None:
    cameras = home.cameras(n=2)
    page = cameras._repr_html_()
    assert page.count("<img") == 2
    assert cameras[0].id in page
    assert cameras[:1]._repr_html_().count("<img") == 1
    assert home.sketches([cameras[0]], 80)[0].shape == (60, 80, 3)
    assert len(home.cameras_around("sofa", n=1, min_visible=0.1)._repr_html_()) > 1000


def test_a_machine_without_opengl_sketches_diffuse_colours_by_rays(
    home: pf.Home, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pbrs_farm.run.house_cache import CachedHouse

    def fail(_self: object) -> None:
        raise MachineFailed("no OpenGL here")

    camera = home.cameras(n=1)[0]
    monkeypatch.setattr(CachedHouse, "rasterizer", property(fail))
    sketch = home.sketches([camera], 80)[0]
    frame = pf.render(home, camera, modes=[], layers=["albedo"], size=(80, 60))
    albedo = frame.layer("albedo").astype(float)
    assert (sketch <= albedo).all()
    assert (sketch >= albedo // 2).all()
    # Surfaces that face the camera keep their colour: there normal and ray are parallel.
    share = -frame.normal[..., 2]
    faces = (share > 0.99)[15:45, 20:60]
    assert np.abs(sketch - albedo)[15:45, 20:60][faces].max(initial=0) < 12


def test_viewpoints_are_drawn_without_opengl(
    home: pf.Home, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_words: object) -> None:
        raise MachineFailed("no OpenGL <here>")

    cameras = home.cameras(n=2)
    monkeypatch.setattr(home.renderer, "sketches", fail)
    page = cameras._repr_html_()
    assert "no OpenGL &lt;here&gt;" in page
    assert "Living room" in page


def test_views_show_at_most_24_small_pictures(home: pf.Home, frames: Views) -> None:
    assert frames._repr_html_().count("<img") == 2
    many = replace(frames, refs=frames.refs * 20)
    assert many._repr_html_().count("<img") == 24
    assert "24 of them shown" in many._repr_html_()
    assert len(repr(many)) < 100
    look = pf.Camera.look_at((2.5, 1.2, 2.4), (2, 0.9, 2), size=(64, 48))
    bare = pf.render(home, [look], modes=[])
    assert "no picture in any mode" in bare._repr_html_()
    assert "<img" not in frames[:0]._repr_html_()


def test_a_repair_report_is_shown_in_words(home: pf.Home) -> None:
    page = home.report._repr_html_()
    assert page.count("<li>") >= 3
    assert len(repr(home.report)) < 100


@pytest.mark.long
def test_without_a_terminal_progress_is_printed_in_lines(
    home: pf.Home, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cameras = home.cameras(n=2)
    heard: list[str] = []
    pf.render(home, cameras, modes=["opengl_dl"], progress=True, observe=heard.append)
    output = capsys.readouterr().out
    assert heard == [camera.id for camera in cameras]
    assert re.search(rf"{cameras[1].id}: [\d.]+ s; 2 of 2", output)
    pf.render_homes([home], tmp_path / "x", views=1, modes=["opengl_dl"], progress=True)
    assert "1 of 1" in capsys.readouterr().out
