"""The floor plan with candidates, refusals and winners."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np

from pbrs_farm.sample.camera_map import COLOURS, camera_map, camera_map_rgb, camera_map_svg
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.sample.house_sampler import sample_cameras
from tests.sample.sampled_rooms import QUICK, counter_of, furnished, room_house, shell

SVG = "{http://www.w3.org/2000/svg}"


def rgb_of(colour: str) -> list[int]:
    return [int(colour[k : k + 2], 16) for k in (1, 3, 5)]


def test_the_map_shows_every_candidate_and_every_winner_in_its_colour() -> None:
    house = furnished()
    sampling = sample_cameras(house, QUICK, 0, counter_of(house))
    tree = ET.fromstring(camera_map_svg(house, sampling))
    dots = [e.get("fill") for e in tree.iter(f"{SVG}circle")]
    tally = np.bincount(sampling.traces[0].verdict, minlength=len(Verdict))
    for verdict in Verdict:
        assert dots.count(COLOURS[verdict]) == tally[verdict] + 1  # plus one in the legend
    titles = [e.text or "" for e in tree.iter(f"{SVG}title")]
    for view in sampling.views:
        assert any(title.startswith(f"{view.id}: score") for title in titles)
    assert "wardrobe" in titles


def test_the_picture_has_the_drawings_size_and_the_winners_colour() -> None:
    house = furnished()
    sampling = sample_cameras(house, QUICK, 0, counter_of(house))
    image, drawing = camera_map_rgb(house, sampling), camera_map(house, sampling)
    assert image.shape == (drawing.height, drawing.width, 3)
    assert image.dtype == np.uint8
    blue = (image == rgb_of(COLOURS[Verdict.WINNER])).all(2)
    assert blue.sum() > 30 * len(sampling.views)


def test_each_empty_sector_and_each_room_left_out_has_its_reason_in_words() -> None:
    house = room_house(shell(3, 3), 3, 3)
    house = replace(house, rooms=(*house.rooms, replace(house.rooms[0], id="0_1", lit_by=())))
    sampling = sample_cameras(house, QUICK, 0, counter_of(house))
    svg = camera_map_svg(house, sampling)
    for sector in range(6):
        assert f"sector {sector}: every candidate was refused" in svg
    assert "0_1 room: no camera: nothing lights it" in svg


def test_names_cannot_break_the_svg() -> None:
    house = furnished()
    house = replace(house, rooms=(replace(house.rooms[0], name='<b>&"'),))
    sampling = sample_cameras(house, QUICK, 0, counter_of(house))
    assert ET.fromstring(camera_map_svg(house, sampling)).tag == f"{SVG}svg"


def test_a_house_without_rooms_gives_an_empty_map() -> None:
    house = replace(furnished(), rooms=())
    sampling = sample_cameras(house, QUICK, 0, counter_of(house))
    assert camera_map_rgb(house, sampling).size > 0
    assert sampling.report.n_views == 0
