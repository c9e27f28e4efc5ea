from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.house_bundle import bundle_from_house, house_from_bundle
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_root import HOUSE, item, material_of


def test_every_valid_node_becomes_its_items_in_order(house: House) -> None:
    assert [i.id for i in house.items] == [
        "0_0f", "0_0c", "0_0w0", "0_0w2", "0_0w3", "0_0w4",
        "0_1f", "0_1w0", "0_1w2", "0_1w3", "0_1w4",
        "0_2", "0_3", "0_4", "0_5", "0_6", "0_7", "0_8", "0_9", "0_11", "0_12", "0_15", "0_16",
        "1_0",
    ]  # fmt: skip


def test_pretty_and_compact_json_give_the_same_house(root: Path, tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path, pretty=True)
    compact, pretty = (read_suncg(r, HOUSE, ReadFields()) for r in (root, tmp_path))
    assert (
        bundle_from_house(compact)[0].replace(
            compact.source.sha256.encode(), pretty.source.sha256.encode()
        )
        == (bundle_from_house(pretty)[0])
    )


def test_reading_twice_gives_the_same_bytes(root: Path, house: House) -> None:
    assert bundle_from_house(read_suncg(root, HOUSE, ReadFields())) == bundle_from_house(house)


def test_the_house_survives_the_bundle(house: House) -> None:
    bundle = bundle_from_house(house)
    assert bundle_from_house(house_from_bundle(*bundle)) == bundle


def test_missing_files_are_notes_and_the_rest_is_read(house: House) -> None:
    notes = {(n.kind, n.text.split()[0].rstrip(":")) for n in house.notes}
    assert notes == {
        ("missing-texture", "texture/gone.jpg"),
        ("unreadable-texture", "texture/broken.jpg"),
        ("unknown-type", "a"),
        ("missing-model", "object/nobody_has_this"),
        ("room-in-room", "lists"),
    }
    assert material_of(house, "0_5", "material_0").diffuse == (0.2, 0.3, 0.4)


def test_strict_makes_the_first_note_an_error(root: Path) -> None:
    with pytest.raises(BadHouse, match="Room 0_1"):
        read_suncg(root, HOUSE, ReadFields(strict=True))


def test_scale_and_axes_of_the_house_are_applied_to_rooms_too(tmp_path: Path, house: House) -> None:
    suncg_root.write_root(tmp_path)
    plain = suncg_root.house_json() | {"up": [0, 0, 1], "front": [1, 0, 0], "scaleToMeters": 0.5}
    (tmp_path / f"house/{HOUSE}/house.json").write_text(json.dumps(plain))
    turned = read_suncg(tmp_path, HOUSE, ReadFields())
    for original, turned_item in zip(house.items[:6], turned.items[:6], strict=True):
        expected = (
            0.5 * original.bounds[:, [1, 2, 0]]
        )  # x = up x front = y, y = up = z, z = front = x
        assert np.allclose(turned_item.bounds, expected, atol=1e-5)


def test_without_tables_everything_is_otherprop_with_a_note(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    for table in (tmp_path / "metadata").iterdir():
        table.unlink()
    house = read_suncg(tmp_path, HOUSE, ReadFields())
    assert item(house, "0_2").nyu40 == 40
    assert sum(n.kind == "missing-table" for n in house.notes) == 3
    assert item(house, "0_4").lights == ()


def test_the_digest_covers_every_file_that_was_read(
    root: Path, tmp_path: Path, house: House
) -> None:
    suncg_root.write_root(tmp_path)
    assert read_suncg(tmp_path, HOUSE, ReadFields()).source.sha256 == house.source.sha256
    (tmp_path / "texture/wood.jpg").write_bytes(suncg_root.picture((1, 2, 3), "JPEG"))
    assert read_suncg(tmp_path, HOUSE, ReadFields()).source.sha256 != house.source.sha256
