"""Filters, sliders and buttons of each page work in a real browser."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.recipe_fields import ReadFields
from pbrs_farm.formats.house_bundle import bundle_from_house
from pbrs_farm.images import array_from_png
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.board.roots import HEIGHT, WIDTH, write_root, write_view
from tests.board.served import served
from tests.board.web.browser import until
from tests.board.web.counted_bytes import loaded_kb

pytestmark = pytest.mark.web

VIEW = "/homes/a-1/views/0_0_1"
EVIL = "<script>document.title='evil'</script>"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("web")
    root = write_root(folder, {"a-1": ("0_0_1", "0_0_2", "0_1_0"), "b-2": ("0_0_4",)})
    house = read_house(resolve("builtin"), ReadFields())
    (root / "houses/a-1/house.glb").write_bytes(bundle_from_house(house)[0])
    pose = [[1, 0, 0, 2], [0, 1, 0, 1.5], [0, 0, 1, 2], [0, 0, 0, 1]]
    size = {"width_px": 640, "height_px": 480, "fx": 500, "fy": 500}
    views = [{"id": "0_0_1", "room": "0_0", "intrinsics": size, "world_from_camera_opengl": pose}]
    cameras = {"views": views, "report": {"refused": {"near_obstacle": 3}}}
    (root / "houses/a-1/cameras.json").write_text(json.dumps(cameras))
    return root


@pytest.fixture(scope="module")
def base(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with served(str(root), tmp_path_factory.mktemp("cache")) as client:
        yield str(client.base_url).rstrip("/")


def test_the_first_page_shows_pictures_and_is_light(tab: Any, base: str) -> None:
    with loaded_kb(tab) as loaded:
        tab.goto(base, wait_until="networkidle")
    assert tab.locator(".card").count() == 2
    until(tab, "[...document.images].every((i) => i.naturalWidth > 0)")
    assert loaded() < 300


def test_a_filter_changes_the_list_and_the_address_and_goes_back(tab: Any, base: str) -> None:
    tab.goto(f"{base}/views")
    tab.select_option("select[name=room]", "Bath")
    until(tab, "document.querySelectorAll('.card').length === 1")
    assert tab.url == f"{base}/views?room=Bath"
    tab.reload()
    assert tab.locator(".card").count() == 1
    assert tab.input_value("select[name=room]") == "Bath"
    tab.go_back()
    until(tab, "document.querySelectorAll('.card').length === 4")
    tab.fill("#words", "0_0_4")
    until(tab, "document.querySelectorAll('.card').length === 1")


def test_two_layers_are_wiped_and_the_address_keeps_them(tab: Any, base: str) -> None:
    tab.goto(base + VIEW)
    tab.select_option("#right-layer", "semantic")
    tab.wait_for_selector(".seam:not([hidden])")
    stage = tab.locator("#stage").bounding_box()
    tab.mouse.move(stage["x"] + stage["width"] / 2, stage["y"] + 40)
    tab.mouse.down()
    tab.mouse.move(stage["x"] + stage["width"] / 4, stage["y"] + 40)
    tab.mouse.up()
    until(tab, "location.search.includes('wipe=0.25')")
    assert tab.evaluate("document.querySelectorAll('#stage img')[1].style.clipPath").startswith(
        "inset(0px 0px 0px 25"
    )
    tab.reload()
    assert tab.input_value("#right-layer") == "semantic"
    tab.wait_for_selector(".seam:not([hidden])")


def test_overlays_boxes_and_opacity_show(tab: Any, base: str) -> None:
    tab.goto(base + VIEW, wait_until="networkidle")
    tab.select_option("#over-layer", "instance")
    tab.fill("#opacity", "80")
    over = "document.querySelectorAll('#stage img')[2]"
    until(tab, f"{over}.naturalWidth > 0 && {over}.style.opacity === '0.8'")
    tab.check("#boxes")
    assert tab.locator("#stage rect:visible").count() == 2
    tab.uncheck("#boxes")
    tab.hover("tr[data-instance='300']")
    assert tab.locator("#stage rect:visible").count() == 1


def test_the_probe_shows_class_instance_metres_and_normal(tab: Any, base: str) -> None:
    tab.goto(base + VIEW, wait_until="networkidle")
    stage = tab.locator("#stage").bounding_box()
    # The pixel in the middle of row 30 is the chair, 1.3 m away.
    x = stage["x"] + stage["width"] / 2
    tab.mouse.move(x, stage["y"] + stage["height"] * (30.5 / HEIGHT))
    until(tab, "document.getElementById('probe').textContent.includes('chair')")
    text = tab.inner_text("#probe")
    for line in (f"{WIDTH // 2}, 30", "Chair, 300", "1.300 m", "-1.00 forward"):
        assert line in text


def test_the_probe_is_moved_by_the_keyboard(tab: Any, base: str) -> None:
    tab.goto(base + VIEW, wait_until="networkidle")
    for _ in range(40):
        tab.keyboard.press("Tab")
        if tab.evaluate("document.activeElement.id") == "stage":
            break
    until(
        tab, f"document.getElementById('probe').textContent.includes('{WIDTH // 2}, {HEIGHT // 2}')"
    )
    # Ten to the right, far past the edge, and one up: the chair's upper row is HEIGHT / 2.
    for key in ["Shift+ArrowRight"] * 3 + ["ArrowUp"]:
        tab.keyboard.press(key)
    text = tab.inner_text("#probe")
    assert f"{WIDTH - 1}, {HEIGHT // 2 - 1}" in text
    assert "Wall, 7" in text
    tab.keyboard.press("ArrowDown")
    assert "Chair, 300" in tab.inner_text("#probe")
    # The mark is on the pixel, also where the picture is zoomed.
    for _ in range(3):
        tab.keyboard.press("+")
    place = tab.evaluate(
        """() => {
          const [mark, plane] = [".pixel-mark", ".plane"].map((s) => document.querySelector(s).getBoundingClientRect());
          return [(mark.x + mark.width / 2 - plane.x) / plane.width, (mark.y + mark.height / 2 - plane.y) / plane.height];
        }"""
    )
    assert place == pytest.approx([(WIDTH - 0.5) / WIDTH, (HEIGHT // 2 + 0.5) / HEIGHT], abs=0.004)
    assert tab.url.endswith(VIEW)
    tab.keyboard.press("Escape")
    assert not tab.is_visible(".pixel-mark")


def test_relighting_reports_its_progress(tab: Any, base: str) -> None:
    tab.route("**/light?*", lambda route: (tab.wait_for_timeout(1500), route.continue_()))
    tab.goto(base + VIEW + "/relight")
    until(
        tab, "/layers of light.*: [1-9]\\d* s/.test(document.getElementById('status').textContent)"
    )
    tab.wait_for_selector("#stage[data-settled=yes]")
    assert tab.inner_text("#status") == ""


def test_a_page_of_a_root_being_read_updates_without_a_reload(tab: Any, base: str) -> None:
    texts = ["Reading homes: 3 of 9."]
    page = httpx.get(base + "/").text
    strip = '<p class="strip" id="reading" role="status">Looking for homes</p></header>'
    script = '<script type="module" src="/static/reading.js"></script></head>'
    reading = page.replace("</header>", strip, 1).replace("</head>", script, 1)

    def progress(route: Any) -> None:
        route.fulfill(json={"text": texts[0], "fault": False})

    def first(route: Any) -> None:
        route.fulfill(body=reading if texts[0] else page, content_type="text/html")

    tab.route("**/progress", progress)
    tab.route(base + "/", first)
    tab.goto(base + "/")
    tab.wait_for_selector("#reading:has-text('3 of 9')")
    texts[0] = ""
    tab.wait_for_selector("#reading", state="detached")


def test_a_wheel_zooms_to_the_pixel_and_fit_comes_back(tab: Any, base: str) -> None:
    tab.goto(base + VIEW, wait_until="networkidle")
    tab.hover("#stage")
    for _ in range(12):
        tab.mouse.wheel(0, -600)
    tab.wait_for_selector(".plane.sharp")
    scale = tab.evaluate(
        "new DOMMatrix(getComputedStyle(document.querySelector('.plane')).transform).a"
    )
    width = tab.evaluate("document.getElementById('stage').clientWidth")
    assert scale * width / WIDTH == pytest.approx(64, rel=0.01)
    tab.click("#fit")
    assert "scale(1)" in tab.evaluate("document.querySelector('.plane').style.transform")


def test_arrow_keys_go_to_the_neighbours(tab: Any, base: str) -> None:
    tab.goto(base + VIEW)
    tab.keyboard.press("ArrowRight")
    tab.wait_for_url("**/0_0_2")
    tab.keyboard.press("ArrowLeft")
    tab.wait_for_url("**/0_0_1")


@pytest.mark.parametrize(
    "query",
    [
        "?denoise=0",
        "?denoise=0&outdoor=20,ffffff&lamp1=150,ff8040",
        "?denoise=0&outdoor=0,ffffff&indoor=60,80c0ff&lamp2=0,ffffff",
    ],
)
def test_the_relit_picture_is_that_of_the_command_shown(
    query: str, tab: Any, base: str, tmp_path: Path
) -> None:
    tab.goto(f"{base}{VIEW}/relight{query}")
    tab.wait_for_selector("#stage[data-settled=yes]")
    with tab.expect_download() as download:
        tab.click("#save")
    words = shlex.split(tab.inner_text("#command"))
    assert main([*words[1:], "--out", str(tmp_path / "relit.png")]) == 0
    expected = array_from_png((tmp_path / "relit.png").read_bytes()).astype(int)
    got = array_from_png(Path(download.value.path()).read_bytes())[..., :3].astype(int)
    assert np.abs(got - expected).max() <= 2


def test_sliders_colours_and_presets_change_picture_command_and_address(
    tab: Any, base: str
) -> None:
    tab.goto(f"{base}{VIEW}/relight?denoise=0")
    tab.wait_for_selector("#stage[data-settled=yes]")
    tab.fill("input[type=range][data-light=lamp1]", "50")
    tab.fill("input[type=color][data-light=lamp2]", "#ff0000")
    for words in ("--lamp 1=0.25", "--lamp 2=1,0,0"):
        until(tab, f"document.getElementById('command').textContent.includes('{words}')")
    until(tab, "location.search.includes('lamp1=50')")
    tab.click("[data-preset=lamps]")
    assert "--outdoor 0" in tab.inner_text("#command")
    assert "--lamp" not in tab.inner_text("#command")


def test_a_home_turns_hides_rooms_and_shows_a_cameras_picture(tab: Any, base: str) -> None:
    tab.goto(f"{base}/homes/a-1")
    tab.wait_for_selector("#scene[data-ready=yes]", timeout=30_000)
    before = tab.locator("#scene canvas").screenshot()
    tab.uncheck("#rooms label:has-text('Walls') input")
    tab.wait_for_timeout(300)
    assert tab.locator("#scene canvas").screenshot() != before
    assert "near obstacle" in tab.inner_text("#refused")


def test_a_home_called_script_is_text(tab: Any, tmp_path: Path) -> None:
    root = write_root(tmp_path / "root", {"a-1": ()}, name=EVIL)
    rows = [{"id": 7, "name": EVIL, "class": EVIL, "nyu40": 1, "fraction": 0.5,
             "visible_fraction": 1.0, "box2d": [0, 0, WIDTH, HEIGHT]}]  # fmt: skip
    write_view(root / "houses/a-1/views/0_0_1", instances=rows, warnings=[EVIL])
    with served(str(root), tmp_path / "cache") as client:
        base = str(client.base_url).rstrip("/")
        for path in ("/", "/views", VIEW):
            tab.goto(base + path, wait_until="networkidle")
            assert tab.title() != "evil"
            assert EVIL in tab.inner_text("body")
        stage = tab.locator("#stage").bounding_box()
        tab.mouse.move(stage["x"] + 20, stage["y"] + 20)
        until(tab, "document.getElementById('probe').textContent.includes('<script>')")


@pytest.mark.parametrize(
    "path", ["/", "/views", VIEW, f"{VIEW}/relight?denoise=0", "/homes/a-1", "/contents"]
)
@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1600, "light")])
def test_no_page_is_wider_than_its_screen(
    path: str, width: int, scheme: str, browser: Any, base: str
) -> None:
    page = browser.new_page(viewport={"width": width, "height": 844}, color_scheme=scheme)
    page.goto(base + path, wait_until="networkidle")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(16, 18, 23)"
    assert dark == (scheme == "dark")
    page.close()


def test_a_session_with_the_token_may_log_out(tab: Any, root: Path, tmp_path: Path) -> None:
    with served(str(root), tmp_path, host="0.0.0.0") as client:
        base = str(client.base_url).rstrip("/")
        tab.goto(base)
        assert tab.url == f"{base}/login"
        tab.fill("input[name=token]", "a token that nobody guesses")
        tab.click("button.main")
        tab.wait_for_selector(".card")
        tab.click("text=Log out")
        tab.wait_for_url("**/login")


def test_the_client_of_these_tests_sees_the_same_board(base: str) -> None:
    assert httpx.get(f"{base}/health").text == "ok\n"
