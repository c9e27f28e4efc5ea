"""The board at 100,000 views, and relighting in a browser against `relight`. Effects: files, processes.

`python -m benchmarks.board.board_pages --views 10000` measures a smaller root. The browser is Debian's
chromium, drawing in software unless the machine has a GPU for it: relight_fps says which.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import httpx
import numpy as np

from benchmarks.board.farm_pages import UNITS as FARM_UNITS
from benchmarks.board.farm_pages import farm_cost
from benchmarks.board.many_views import write_many_views
from benchmarks.figures import write_report
from pbrs_farm.images import array_from_png

UNITS: Final = {
    "board.views": "views of the root",
    "board.index_s": "s to read all of them, once",
    "board.page_ms": "ms, 95th percentile of gallery pages with and without filters",
    "board.page_median_ms": "ms",
    "board.thumb_ms": "ms, median of a thumbnail made the first time",
    "board.memory_mb": "MB, peak of the board's process after all of this",
    "board.first_kb": "kB that a browser loads for the first page, pictures included",
    "board.relight_error": "of 255, largest difference from the file that relight writes",
    "board.relight_fps": "pictures a second while a slider moves, 640x480",
    "board.relight_gpu": "what drew them",
}
_FILTERS: Final = (
    "", "room=Kitchen", "has=chair", "warned=1", "mode=mlt_il_ol", "verdict=unjudged",
    "has=sofa&room=Hall", "words=home-0042", "words=Bath", "warned=0&has=bed",
)  # fmt: skip
_SETTINGS: Final = (
    "",
    "?outdoor=14,ffffff",
    "?outdoor=60,a0c0ff&indoor=150,ffd0a0",
    "?outdoor=0,ffffff&lamp1=30,ff8040&lamp2=180,40a0ff",
    "?denoise=0&indoor=0,ffffff",
)
_FPS: Final = """async () => {
  const slider = document.querySelector("input[data-light=outdoor]");
  const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
  let n = 0;
  const began = performance.now();
  while (performance.now() - began < 4000) {
    slider.value = 20 + (n++ % 100);
    slider.dispatchEvent(new Event("input"));
    await frame();
  }
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const gpu = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : gl.getParameter(gl.RENDERER);
  return [n / ((performance.now() - began) / 1000), gpu];
}"""


def main(argv: list[str] | None = None) -> None:
    """Measure and write out/bench/board.json."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--views", type=int, default=100_000)
    args = parser.parse_args(argv or [])
    with tempfile.TemporaryDirectory(prefix="board-bench-") as folder:
        figures = pages(Path(folder), args.views) | relighting(Path(folder))
    figures |= farm_cost()
    write_report("board", figures, UNITS | FARM_UNITS)


@contextmanager
def board_of(root: Path, cache: Path) -> Iterator[tuple[httpx.Client, int]]:
    """A client of a board in a process of its own, and the process' id."""
    command = [sys.executable, "-m", "pbrs_farm.cli", "board", str(root)]
    command += ["--port", "0", "--cache", str(cache)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        url = process.stdout.readline().strip()
        with httpx.Client(base_url=url, timeout=60) as client:
            yield client, process.pid
    finally:
        process.terminate()
        process.wait(20)


def pages(folder: Path, n_views: int) -> dict[str, Any]:
    """What gallery pages cost at n_views."""
    root = folder / "root"
    write_many_views(root, n_views)
    with board_of(root, folder / "cache") as (client, pid):
        # Wait until the index has read everything.
        began = time.monotonic()
        while f"<h1>{n_views:,} views" not in client.get("/views").text:
            time.sleep(0.5)
        index_s = time.monotonic() - began
        times = [_page_ms(client, k) for k in range(200)]
        thumbs = _thumb_ms(client)
        first_kb = _first_kb(str(client.base_url))
        status = Path(f"/proc/{pid}/status").read_text()
    peak = re.search(r"VmHWM:\s+(\d+) kB", status)
    assert peak is not None
    return {
        "board.views": n_views,
        "board.index_s": round(index_s, 1),
        "board.page_ms": round(float(np.percentile(times, 95)), 1),
        "board.page_median_ms": round(float(np.median(times)), 1),
        "board.thumb_ms": round(thumbs, 1),
        "board.memory_mb": round(int(peak[1]) / 1024, 1),
        "board.first_kb": round(first_kb, 1),
    }


def _page_ms(client: httpx.Client, k: int) -> float:
    """Milliseconds of a page: each filter in turn, any of its pages."""
    rng = random.Random(k)
    query = _FILTERS[k % len(_FILTERS)]
    number = rng.randint(1, 2083 if not query else 20)
    began = time.perf_counter()
    answer = client.get(f"/views?{query}&page={number}")
    seconds = time.perf_counter() - began
    assert answer.status_code == 200
    return 1000 * seconds


def _thumb_ms(client: httpx.Client) -> float:
    found = re.findall(r'src="([^"]+/thumb/[^"]+)"', client.get("/views?page=9").text)
    times = []
    for url in found[:20]:
        began = time.perf_counter()
        assert client.get(url.replace("&amp;", "&")).status_code == 200
        times.append(1000 * (time.perf_counter() - began))
    return float(np.median(times))


@contextmanager
def browser_tab(**options: Any) -> Iterator[Any]:
    """A tab of Debian's chromium, drawing in software where there is no GPU."""
    from playwright.sync_api import sync_playwright

    from tests.board.web.browser import ARGUMENTS

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=list(ARGUMENTS)
        )
        yield browser.new_page(**options)
        browser.close()


def _first_kb(url: str) -> float:
    from tests.board.web.counted_bytes import loaded_kb

    with browser_tab() as tab, loaded_kb(tab) as loaded:
        tab.goto(url, wait_until="networkidle")
        return loaded()


def relighting(folder: Path) -> dict[str, Any]:
    """How far the browser's pictures are from relight's, and how fast they come."""
    root = folder / "lit"
    command = [sys.executable, "-m", "pbrs_farm.cli", "run", "builtin", "--out", str(root)]
    command += ["--recipe", "preview", "--size", "640x480", "--views", "1", "--groups", "lamps"]
    subprocess.run([*command, "--modes", "mlt_il_ol"], check=True, stdout=subprocess.DEVNULL)
    view = next(root.glob("houses/*/views/*"))
    path = f"homes/{view.parents[1].name}/views/{view.name}/relight"
    with board_of(root, folder / "lit-cache") as (client, _pid):
        while "views/" not in client.get(f"/homes/{view.parents[1].name}").text:
            time.sleep(0.2)
        with browser_tab(viewport={"width": 1280, "height": 900}) as tab:
            errors = [_relight_error(tab, f"{client.base_url}{path}{s}", folder) for s in _SETTINGS]
            fps, gpu = tab.evaluate(_FPS)
    return {
        "board.relight_error": max(errors),
        "board.relight_fps": round(fps, 1),
        "board.relight_gpu": json.dumps(gpu),
    }


def _relight_error(tab: Any, url: str, folder: Path) -> int:
    tab.goto(url)
    tab.wait_for_selector("#stage[data-settled=yes]", timeout=180_000)
    with tab.expect_download() as download:
        tab.click("#save")
    words = shlex.split(tab.inner_text("#command"))[1:]
    out = folder / "relit.png"
    command = [sys.executable, "-m", "pbrs_farm.cli", *words, "--out", str(out)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=os.environ)
    wanted = array_from_png(out.read_bytes()).astype(int)
    got = array_from_png(Path(download.value.path()).read_bytes())[..., :3].astype(int)
    return int(np.abs(got - wanted).max())


if __name__ == "__main__":
    main(sys.argv[1:])
