from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.read.catalogue.read_catalogue import catalogue_from
from tests.read.catalogue.small_library import WEDGE_MTL, WEDGE_OBJ


def write(path: Path, data: bytes = WEDGE_OBJ) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    (path.parent / "wedge.mtl").write_bytes(WEDGE_MTL)


def test_the_folder_of_a_model_says_what_it_is(tmp_path: Path) -> None:
    write(tmp_path / "sofa" / "kivik.obj")
    catalogue = catalogue_from([], given=[tmp_path])
    (piece,) = catalogue.of("sofa")
    assert piece.size == pytest.approx((2, 1, 1))
    shape = catalogue.shape(piece)
    assert shape is not None
    np.testing.assert_allclose(shape.bounds, [[-1, 0, -0.5], [1, 1, 0.5]], atol=1e-6)


def test_a_table_beside_the_models_names_and_sizes_them(tmp_path: Path) -> None:
    write(tmp_path / "things" / "x1.obj")
    table = "file,name,group,width,depth,height,creator,licence\nthings/x1.obj,Lack,coffee_table,90,55,45,Me,CC0\n"
    (tmp_path / "catalogue.csv").write_text(table)
    catalogue = catalogue_from([], given=[tmp_path])
    (piece,) = catalogue.pieces
    assert (piece.name, piece.group, piece.creator, piece.licence) == (
        "Lack", "coffee_table", "Me", "CC0",
    )  # fmt: skip
    shape = catalogue.shape(piece)
    assert shape is not None
    np.testing.assert_allclose(np.ptp(shape.bounds, axis=0), [0.9, 0.45, 0.55], atol=1e-6)


def test_a_model_of_no_known_kind_becomes_a_note(tmp_path: Path) -> None:
    write(tmp_path / "zzz" / "zzz.obj")
    write(tmp_path / "sofa" / "a.obj")
    write(tmp_path / "sofa" / "damaged.obj", b"v 1 x 2\nf 1 1 1\n")
    catalogue = catalogue_from([], given=[tmp_path])
    assert [p.name for p in catalogue.pieces] == ["a"]
    assert sorted(n.kind for n in catalogue.notes) == ["unmapped-class", "unusable-model"]


@pytest.mark.parametrize("table", [b"\xff\xfe\0", b"name,group\na,b\n"])
def test_a_damaged_table_becomes_a_note(tmp_path: Path, table: bytes) -> None:
    write(tmp_path / "sofa" / "a.obj")
    (tmp_path / "catalogue.csv").write_bytes(table)
    catalogue = catalogue_from([], given=[tmp_path])
    assert [n.kind for n in catalogue.notes] == ["damaged-table"]
    assert len(catalogue.pieces) == 1


def test_an_empty_folder_is_no_catalogue(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no model found"):
        catalogue_from([], given=[tmp_path])


def test_a_folder_of_which_nothing_can_be_used_says_why(tmp_path: Path) -> None:
    (tmp_path / "sofa.glb").write_bytes(b"junk")
    with pytest.raises(BadInput, match="holds nothing that can be used") as caught:
        catalogue_from([], given=[tmp_path])
    assert "sofa.glb" in str(caught.value)


def test_the_digest_follows_every_file_of_the_folder(tmp_path: Path) -> None:
    write(tmp_path / "sofa" / "a.obj")
    first = catalogue_from([], given=[tmp_path]).digest
    (tmp_path / "sofa" / "wedge.mtl").write_bytes(WEDGE_MTL + b"\n")
    assert catalogue_from([], given=[tmp_path]).digest != first
