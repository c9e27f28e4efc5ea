from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.catalogue import Catalogue, Shape
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import MaterialKind
from pbrs_farm.read.catalogue.read_catalogue import catalogue_from
from tests.read.catalogue.small_library import WEDGE_OBJ, entry, library, library_bytes


def _shape(catalogue: Catalogue, name: str) -> Shape:
    piece = next(p for p in catalogue.pieces if p.name == name)
    shape = catalogue.shape(piece)
    assert shape is not None
    return shape


def test_a_piece_stands_on_its_base_in_metres_with_its_back_behind(tmp_path: Path) -> None:
    shape = _shape(catalogue_from([library(tmp_path, [entry("Dresser")])]), "Dresser")
    low, high = shape.bounds
    np.testing.assert_allclose(low, [-0.4, 0, -0.2], atol=1e-6)
    np.testing.assert_allclose(high, [0.4, 0.9, 0.2], atol=1e-6)
    top = np.concatenate([s.positions[s.positions[:, 1] > 0.8] for s in shape.surfaces])
    assert (top[:, 2] < -0.19).all()


def test_the_back_of_a_wall_piece_is_on_the_wall(tmp_path: Path) -> None:
    shape = _shape(catalogue_from([library(tmp_path, [entry("Mirror", (60, 4, 90))])]), "Mirror")
    np.testing.assert_allclose(shape.bounds[:, 2], [0, 0.04], atol=1e-6)


def test_a_model_is_turned_as_its_library_says(tmp_path: Path) -> None:
    turned = entry("Dresser", modelRotation="-1 0 0 0 1 0 0 0 -1")
    shape = _shape(catalogue_from([library(tmp_path, [turned])]), "Dresser")
    top = np.concatenate([s.positions[s.positions[:, 1] > 0.8] for s in shape.surfaces])
    assert (top[:, 2] > 0.19).all()


def test_a_lamp_keeps_its_light_sources(tmp_path: Path) -> None:
    lamp = entry(
        "Lamp", (30, 30, 50), category="Lights", lightSourceX="15", lightSourceY="15",
        lightSourceZ="40", lightSourceColor="#FF8000", lightSourceDiameter="6",
    )  # fmt: skip
    shape = _shape(catalogue_from([library(tmp_path, [lamp])]), "Lamp")
    (light,) = shape.lights
    np.testing.assert_allclose(light.position, [0, 0.4, 0], atol=1e-6)
    assert light.radius_m == pytest.approx(0.03)
    assert light.rgb_linear[0] == 1.0
    assert light.rgb_linear[2] == 0.0


def test_group_names_mark_panes_mirrors_and_lights(tmp_path: Path) -> None:
    model = WEDGE_OBJ.replace(b"f 2 3 6", b"g sweethome3d_window_mirror\nf 2 3 6")
    path = library(tmp_path, [entry("Dresser")], contents={"wedge/wedge.obj": model})
    kinds = {m.kind for m in _shape(catalogue_from([path]), "Dresser").materials}
    assert MaterialKind.MIRROR in kinds


def test_a_piece_names_its_author_and_licence(tmp_path: Path) -> None:
    (piece,) = catalogue_from([library(tmp_path, [entry("Dresser")])]).pieces
    assert (piece.library, piece.creator, piece.licence) == ("Small", "Someone", "CC-BY 3.0")
    assert piece.size == (0.8, 0.4, 0.9)


def test_the_digest_changes_with_a_library_and_with_nothing_else(tmp_path: Path) -> None:
    path = library(tmp_path, [entry("Dresser")])
    first = catalogue_from([path]).digest
    assert catalogue_from([path]).digest == first
    library(tmp_path, [entry("Dresser", (81, 40, 90))])
    assert catalogue_from([path]).digest != first


def test_the_users_own_libraries_are_distinguished_from_packages(tmp_path: Path) -> None:
    package, own_library = tmp_path / "package.sh3f", tmp_path / "own.sh3f"
    package.write_bytes(library_bytes([entry("Chest one"), entry("Chest two")]))
    own_library.write_bytes(library_bytes([entry("Chest two"), entry("Chest three")]))
    assert catalogue_from([package]).own == frozenset()
    libraries = catalogue_from([package], given=[own_library])
    assert {piece.split("#")[1] for piece in libraries.own} == {"chest-two", "chest-three"}
    assert libraries.own < {piece.id for piece in libraries.pieces}


def test_a_wrong_entry_becomes_a_note_and_the_others_are_read(tmp_path: Path) -> None:
    rows = [
        entry("Dresser"),
        entry("Bed", model="/gone.obj"),
        entry("Sofa", width="wide"),
        entry("Chair", modelRotation="1 0 0"),
        entry("Lamp", lightSourceX="1", lightSourceY="1", lightSourceZ="1", lightSourceColor="red"),
    ]
    catalogue = catalogue_from([library(tmp_path, rows)])
    assert [p.name for p in catalogue.pieces] == ["Dresser"]
    kinds = [n.kind for n in catalogue.notes]
    assert kinds == ["missing-model", "unreadable-entry", "unreadable-entry", "unreadable-entry"]


@pytest.mark.parametrize("model", [b"f 1 2 3", b"v 0 0 0\n", b"v 0 0 x\nf 1 1 1\n", b"glTF\0"])
def test_a_model_that_cannot_be_used_is_no_shape(tmp_path: Path, model: bytes) -> None:
    path = library(tmp_path, [entry("Dresser")], contents={"wedge/wedge.obj": model})
    catalogue = catalogue_from([path])
    assert catalogue.shape(catalogue.pieces[0]) is None


@pytest.mark.parametrize("data", [b"", b"PK\3\4 damaged", b"no zip at all"])
def test_a_damaged_library_of_the_packages_becomes_a_note(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "bad.sh3f"
    path.write_bytes(data)
    catalogue = catalogue_from([path])
    assert not catalogue.pieces
    assert [n.kind for n in catalogue.notes] == ["damaged-library"]
    # Of the user's own nothing passes in silence.
    with pytest.raises(BadInput, match="no usable piece or picture"):
        catalogue_from([], given=[path])


def test_a_users_library_without_a_known_class_is_refused(tmp_path: Path) -> None:
    path = library(tmp_path, [entry("Zzz")])
    assert [n.kind for n in catalogue_from([path]).notes] == ["no-classes"]
    with pytest.raises(BadInput, match=r"no usable piece or picture \(no piece"):
        catalogue_from([], given=[path])


def test_a_missing_catalogue_is_reported_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such file or folder"):
        catalogue_from([], given=[tmp_path / "none.sh3f"])


def test_a_file_of_another_kind_is_no_catalogue(tmp_path: Path) -> None:
    (tmp_path / "x.txt").write_text("hello")
    with pytest.raises(BadInput, match="is not a catalogue"):
        catalogue_from([], given=[tmp_path / "x.txt"])
