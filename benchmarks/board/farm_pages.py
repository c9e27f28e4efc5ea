"""What ten open pages cost a farm: tasks a second with and without them. Effects: files, processes.

Tasks that make no pictures keep Redis, coordinator and slots as busy as they can be; the board and
those who look share the machine with them.
"""

from __future__ import annotations

import statistics
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import httpx

from benchmarks.farm.farm_cost import Bench, bench_farm, opened_house
from pbrs_farm.core.recipe import recipe_from_name
from workers.client.farm_client import Farm, completed, new_spec
from workers.job import HouseEntry

UNITS: Final = {
    "board.farm_cost": "share of the farm's tasks a second lost with ten pages open",
    "board.farm_tasks_per_s": "tasks a second without them, two slots",
    "board.farm_noise": "share by which two windows without pages differ, median",
}
N_PAGES: Final = 10
_N_HOUSES: Final = 5000  # of 9 tasks each: more than is run
_WINDOW_S: Final = 6.0
_ROUNDS: Final = 3


def farm_cost() -> dict[str, float]:
    """The figures above: windows without, with, with, without pages, and again."""
    with bench_farm() as bench:
        farm = bench.farm()
        job = _running_job(bench, farm)
        without: list[list[float]] = []
        shares: list[float] = []
        for _ in range(_ROUNDS):
            # Neighbours are compared, so that drift of the machine cancels.
            before = _rate(farm, job)
            with open_pages(bench):
                during = [_rate(farm, job), _rate(farm, job)]
            after = _rate(farm, job)
            without.append([before, after])
            shares.append(1 - statistics.mean(during) / statistics.mean([before, after]))
            print(f"   {before:.0f}/s, with pages {during[0]:.0f}, {during[1]:.0f}, {after:.0f}")
        farm.ledger.client.close()
    pairs = [abs(a - b) / ((a + b) / 2) for a, b in without]
    return {
        "board.farm_cost": round(max(0.0, statistics.median(shares)), 3),
        "board.farm_tasks_per_s": round(statistics.mean(x for pair in without for x in pair), 1),
        "board.farm_noise": round(statistics.median(pairs), 3),
    }


def _running_job(bench: Bench, farm: Farm) -> str:
    """A job of houses whose geometry is done, that a coordinator and a worker of two slots run."""
    houses = [HouseEntry(house_id=f"h{k:05d}") for k in range(_N_HOUSES)]
    _houses, spec = completed(houses, new_spec(recipe_from_name("fast")))
    farm.ledger.create(spec)
    farm.ledger.load_houses(spec.job_id, map(opened_house, range(_N_HOUSES)))
    farm.ledger.open(spec.job_id, 5)
    bench.python("coordinator", "workers.coordinator.leader")
    bench.python("worker", "workers.node.supervisor", PBRS_FARM_SLOTS="2")
    # Let both renderers start.
    while _done(farm, spec.job_id) < 300:
        time.sleep(0.1)
    return spec.job_id


def _rate(farm: Farm, job: str) -> float:
    """Tasks a second in one window."""
    first, began = _done(farm, job), time.monotonic()
    time.sleep(_WINDOW_S)
    return (_done(farm, job) - first) / (time.monotonic() - began)


def _done(farm: Farm, job: str) -> int:
    counts = farm.view(job).counts
    return int(sum(counts.get(f"done:{stage}", 0) for stage in ("gl", "light", "reduce")))


@contextmanager
def open_pages(bench: Bench) -> Iterator[None]:
    """Inside, a board over the farm and its store has ten pages that listen to it."""
    words = [sys.executable, "-m", "pbrs_farm.cli", "board", bench.env["PBRS_STORE"]]
    words += ["--port", "0", "--readonly", "--cache", str(bench.folder / "cache")]
    bench.start("board", words, PYTHONUNBUFFERED="1")
    log = bench.folder / "board.log"
    try:
        while "http://" not in log.read_text().rpartition("\n")[0]:
            time.sleep(0.05)
        url = [line for line in log.read_text().splitlines() if line.startswith("http://")][-1]
        stop = threading.Event()
        heard = [threading.Event() for _ in range(N_PAGES)]
        pages = [threading.Thread(target=_listen, args=(url, stop, h)) for h in heard]
        for page in pages:
            page.start()
        for event in heard:
            assert event.wait(30), "a page heard nothing"
        yield
        stop.set()
    finally:
        bench.end("board")
        log.unlink()
    for page in pages:
        page.join()


def _listen(url: str, stop: threading.Event, heard: threading.Event) -> None:
    """Take a page and its events until told to stop or the board has gone."""
    try:
        with httpx.Client(base_url=url, timeout=30) as client:
            client.get("/farm").raise_for_status()
            with client.stream("GET", "/farm/events") as answer:
                for line in answer.iter_lines():
                    if line.startswith("data:"):
                        heard.set()
                    if stop.is_set():
                        return
    except httpx.HTTPError:
        return


if __name__ == "__main__":
    print(farm_cost())
