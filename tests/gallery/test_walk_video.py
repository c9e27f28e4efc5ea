"""Films of a sequence: all its frames, at its pace, and reproducible."""

import io
import json
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.formats.film_mp4 import film
from pbrs_farm.formats.output_folder import OutputHouse, ViewEntry
from pbrs_farm.gallery.walk_video import films_of, sequences_of
from pbrs_farm.images import png_from_array


def frames(folder: Path, n: int = 4, *, with_picture: bool = True) -> list[ViewEntry]:
    """Frames of a moving square, 10 a second, the last one first."""
    house = OutputHouse("home-1", "Home", "")
    entries = []
    for k in reversed(range(n)):
        view = folder / f"frame_{k:05d}"
        view.mkdir(parents=True)
        picture = np.full((48, 64, 3), 30, np.uint8)
        picture[10:30, 4 * k : 4 * k + 20] = 220
        if with_picture:
            (view / "opengl_il.png").write_bytes(png_from_array(picture))
        (view / "depth.png").write_bytes(png_from_array(np.full((48, 64), 2000, np.uint16)))
        facts = {"frame": k, "time_s": k / 10}
        (view / "view.json").write_text(json.dumps(facts))
        entries.append(ViewEntry(house, view.name, "0_0", "Room", view, facts))
    return entries


def decoded(data: bytes) -> tuple[list[np.ndarray], Fraction]:
    with av.open(io.BytesIO(data)) as container:
        stream = container.streams.video[0]
        return [f.to_ndarray(format="rgb24") for f in container.decode(stream)], stream.average_rate


def test_a_film_has_every_frame_in_time_at_its_pace(tmp_path: Path) -> None:
    (sequence,) = sequences_of(frames(tmp_path)).values()
    pictures, rate = decoded(films_of(sequence)["picture"])
    assert (len(pictures), rate) == (4, 10)
    assert pictures[0].shape == (48, 64, 3)
    # The square moves 4 px a frame.
    middles = [np.nonzero(p[20, :, 0] > 128)[0].mean() for p in pictures]
    np.testing.assert_allclose(np.diff(middles), 4, atol=0.6)


def test_labels_are_beside_the_picture_in_two_rows_of_three(tmp_path: Path) -> None:
    (sequence,) = sequences_of(frames(tmp_path)).values()
    pictures, _rate = decoded(films_of(sequence)["labels"])
    assert pictures[0].shape == (96, 192, 3)


def test_the_same_frames_give_the_same_film() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (3, 33, 47, 3), np.uint8)
    first, second = (film(iter(noise), Fraction(30)) for _ in range(2))
    assert first == second
    assert decoded(first)[0][0].shape == (32, 46, 3)


def test_frames_without_a_picture_are_reported(tmp_path: Path) -> None:
    (sequence,) = sequences_of(frames(tmp_path, with_picture=False)).values()
    with pytest.raises(BadInput, match="no picture to film"):
        films_of(sequence)


def test_single_views_are_no_sequence(tmp_path: Path) -> None:
    alone = ViewEntry(OutputHouse("h", "H", ""), "0_0_1", "0_0", "Room", tmp_path, {})
    assert sequences_of([alone]) == {}
