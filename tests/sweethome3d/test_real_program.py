"""The real Sweet Home 3D opens generated homes and saves them again: `make test-sweethome3d`.

Needs Debian's sweethome3d, a JDK and Xvfb. The screenshots are in out/sweethome3d/, for inspection.
"""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageGrab

from pbrs_farm.core.house import House
from pbrs_farm.core.made_home import MadeHome
from pbrs_farm.generate.generated_home import generate_home
from pbrs_farm.prepare.dress_catalogue import catalogue_of_words, has_furniture
from pbrs_farm.read.sweethome3d.home import read_home

pytestmark = pytest.mark.sweethome3d
HOMES = {f"made-{seed}": MadeHome(seed) for seed in range(1, 9)} | {
    f"house-{seed}": MadeHome(seed, storeys=2) for seed in (1, 2)
}
SHOTS = Path("out/sweethome3d")
JARS = [
    "/usr/share/sweethome3d/sweethome3d.jar",
    *(f"/usr/share/java/{name}.jar" for name in ("j3dcore", "j3dutils", "vecmath")),
]
DISPLAY, SIZE = ":97", (1600, 1000)
OPEN_S = 150.0


@pytest.fixture(scope="session")
def homes(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    assert has_furniture(), "pbrs-farm homes --furniture"
    folder = tmp_path_factory.mktemp("homes")
    paths = []
    for name, home in HOMES.items():
        path = folder / f"{name}.sh3d"
        path.write_bytes(generate_home(home, catalogue_of_words("")).data)
        paths.append(path)
    return paths


def test_saved_again_a_home_reads_back_equal(homes: list[Path], tmp_path: Path) -> None:
    words = [str(p) for path in homes for p in (path, tmp_path / path.name)]
    command = ["java", "-Djava.awt.headless=true", "-cp", ":".join(JARS)]
    source = str(Path(__file__).with_name("SaveAgain.java"))
    subprocess.run([*command, source, *words], check=True, timeout=300)
    for path in homes:
        ours, theirs = read(path), read(tmp_path / path.name)
        assert len(theirs.rooms) == len(ours.rooms)
        assert [r.floor_y for r in theirs.rooms] == [r.floor_y for r in ours.rooms]
        assert len(theirs.openings) == len(ours.openings)
        assert [i.name for i in theirs.items] == [i.name for i in ours.items]
        for a, b in zip(ours.rooms, theirs.rooms, strict=True):
            np.testing.assert_allclose(a.polygon, b.polygon, atol=1e-4)
        for item, saved_item in zip(ours.items, theirs.items, strict=True):
            np.testing.assert_allclose(item.bounds, saved_item.bounds, atol=2e-3, err_msg=item.name)


def read(path: Path) -> House:
    return read_home(path.read_bytes(), path.name)


@pytest.fixture(scope="session")
def screen() -> Iterator[str]:
    words = ["Xvfb", DISPLAY, "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x24", "+extension", "GLX"]
    server = subprocess.Popen(words, stderr=subprocess.DEVNULL)
    time.sleep(2)
    yield DISPLAY
    server.terminate()
    server.wait(10)


@pytest.mark.parametrize("name", HOMES)
def test_a_home_opens_with_its_rooms_and_furniture(
    homes: list[Path], screen: str, tmp_path: Path, name: str
) -> None:
    path = next(p for p in homes if p.stem == name)
    environment = os.environ | {"DISPLAY": screen, "HOME": str(tmp_path)}
    log = (tmp_path / "log").open("wb")
    program = subprocess.Popen(
        ["sweethome3d", str(path)], env=environment, stdout=log, stderr=log,
        start_new_session=True,
    )  # fmt: skip
    try:
        picture = opened(screen)
    finally:
        os.killpg(program.pid, 15)
        program.wait(20)
        log.close()
    SHOTS.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(SHOTS / f"{name}.png")
    # An empty home shows some hundred colours; floors and furniture thousands.
    assert n_colours(picture) > 2000


def opened(screen: str) -> np.ndarray:
    """The screen once it has many colours and is still, or after the time limit."""
    last, until = np.zeros((*SIZE[::-1], 3), np.uint8), time.monotonic() + OPEN_S
    while time.monotonic() < until:
        time.sleep(6)
        picture = np.asarray(ImageGrab.grab(xdisplay=screen).convert("RGB"))
        if n_colours(picture) > 2000 and (picture == last).mean() > 0.999:
            return picture
        last = picture
    return last


def n_colours(picture: np.ndarray) -> int:
    return len(np.unique(picture.astype(np.uint32) @ np.array([65536, 256, 1], np.uint32)))
