from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.read.catalogue import model_folder as folders
from pbrs_farm.read.catalogue.read_catalogue import catalogue_from
from tests.read.catalogue.small_library import WEDGE_MTL, WEDGE_OBJ
from tests.read.gltf.gltf_scenes import Scene


def write(path: Path, data: bytes = WEDGE_OBJ) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    (path.parent / "wedge.mtl").write_bytes(WEDGE_MTL)


def test_the_folder_of_a_model_gives_its_class(tmp_path: Path) -> None:
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


def test_a_folder_without_usable_models_reports_why(tmp_path: Path) -> None:
    (tmp_path / "sofa.glb").write_bytes(b"junk")
    with pytest.raises(BadInput, match="no usable piece or picture") as caught:
        catalogue_from([], given=[tmp_path])
    assert "sofa.glb" in str(caught.value)


def test_the_digest_follows_every_file_of_the_folder(tmp_path: Path) -> None:
    write(tmp_path / "sofa" / "a.obj")
    first = catalogue_from([], given=[tmp_path]).digest
    (tmp_path / "sofa" / "wedge.mtl").write_bytes(WEDGE_MTL + b"\n")
    assert catalogue_from([], given=[tmp_path]).digest != first


def box_glb(width: float, height: float, depth: float) -> bytes:
    """A box with one corner at the origin."""
    scene = Scene()
    scene.materials.append({"name": "wood"})
    return scene.glb([scene.node("thing", mesh=scene.box([0, 0, 0], [width, height, depth], 0))])


def put(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def kinds(folder: Path) -> list[str]:
    return sorted(note.kind for note in catalogue_from([], given=[folder]).notes)


def test_3d_future_is_recognised_by_its_table_and_by_its_raw_models(tmp_path: Path) -> None:
    rows = [
        {"model_id": "a1", "super-category": "Sofa", "category": "Loveseat Sofa"},
        {"model_id": "b2", "super-category": "Cabinet/Shelf/Desk", "category": "Nightstand"},
        {"model_id": "c3", "super-category": "Bed", "category": "King-size Bed"},
    ]
    (tmp_path / "model_info.json").write_text(json.dumps(rows))
    for key in ("a1", "b2"):
        write(tmp_path / key / "raw_model.obj")
        write(tmp_path / key / "normalized_model.obj")
    catalogue = catalogue_from([], given=[tmp_path])
    # The nightstand is 2 m high and loses its class; the bed has no model file.
    assert [(p.id, p.group) for p in catalogue.pieces] == [
        (f"{tmp_path.name}#a1/raw_model", "sofa")
    ]
    assert sorted(n.kind for n in catalogue.notes) == ["missing-models", "wrong-size"]
    assert "1 of its 3 models are missing" in next(
        n.text for n in catalogue.notes if n.kind == "missing-models"
    )


def test_hssd_models_are_turned_to_the_front_of_their_configuration(tmp_path: Path) -> None:
    (tmp_path / "objects.csv").write_text("id,name,main_category\nab12,x,bookcase\n")
    put(tmp_path / "objects/a/ab12.glb", box_glb(0.3, 1.8, 0.9))
    put(tmp_path / "objects/a/ab12.collider.glb", box_glb(9, 9, 9))
    put(tmp_path / "objects/a/ab12.object_config.json", b'{"up": [0, 1, 0], "front": [1, 0, 0]}')
    catalogue = catalogue_from([], given=[tmp_path])
    (piece,) = catalogue.pieces
    assert piece.group == "bookcase"
    assert piece.size == pytest.approx((0.9, 0.3, 1.8))
    shape = catalogue.shape(piece)
    assert shape is not None
    np.testing.assert_allclose(shape.bounds, [[-0.45, 0, -0.15], [0.45, 1.8, 0.15]], atol=1e-6)


def test_a_front_to_the_right_comes_to_the_front_and_the_back_to_the_back(tmp_path: Path) -> None:
    write(tmp_path / "a.obj")  # 2 x 1, its tall side at -z
    (tmp_path / "list.csv").write_text("file,class,size,front\na.obj,sofa,100 x 200 x 100,+x\n")
    catalogue = catalogue_from([], given=[tmp_path])
    (piece,) = catalogue.pieces
    assert piece.size == (2.0, 1.0, 1.0)
    shape = catalogue.shape(piece)
    assert shape is not None
    points = np.concatenate([s.positions for s in shape.surfaces])
    # The model's -z becomes +x when +x is declared as its front: the tall side is at +x.
    assert np.allclose(points[points[:, 1] > 0.5][:, 0], 1.0)


def test_objathor_is_read_from_glb_and_its_pickles_are_refused(tmp_path: Path) -> None:
    rows = {"a1": {"category": "armchair"}, "b2": {"category": "vase"}}
    (tmp_path / "annotations.json.gz").write_bytes(gzip.compress(json.dumps(rows).encode()))
    put(tmp_path / "assets/a1/a1.glb", box_glb(0.8, 0.9, 0.8))
    put(tmp_path / "assets/b2/b2.pkl.gz", b"no")
    catalogue = catalogue_from([], given=[tmp_path])
    assert [p.group for p in catalogue.pieces] == ["armchair"]
    assert sorted(n.kind for n in catalogue.notes) == ["missing-models", "refused-pickles"]


@pytest.mark.parametrize(
    ("size", "found"),
    [((80, 90, 80), "centimetres"), ((800, 900, 800), "millimetres"), ((7, 9, 7), "wrong-size")],
)
def test_a_model_of_another_unit_is_scaled_and_one_of_no_size_is_refused(
    tmp_path: Path, size: tuple[float, float, float], found: str
) -> None:
    put(tmp_path / "armchair" / "a.glb", box_glb(*size))
    if found == "wrong-size":
        with pytest.raises(BadInput, match="7 x 7 x 9 m is the wrong size for armchair"):
            catalogue_from([], given=[tmp_path])
        return
    catalogue = catalogue_from([], given=[tmp_path])
    (piece,) = catalogue.pieces
    assert piece.size == pytest.approx((0.8, 0.8, 0.9))
    shape = catalogue.shape(piece)
    assert shape is not None
    np.testing.assert_allclose(shape.bounds, [[-0.4, 0, -0.4], [0.4, 0.9, 0.4]], atol=1e-6)
    assert [n.text for n in catalogue.notes] == [f"is in {found}"]


def test_a_folder_is_indexed_once_and_again_if_a_file_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, store = tmp_path / "own", tmp_path / "store"
    put(folder / "armchair" / "a.glb", box_glb(0.8, 0.9, 0.8))
    put(folder / "armchair" / "b.glb", b"junk")
    first = catalogue_from([], given=[folder], store=store)
    with monkeypatch.context() as patch:
        patch.setattr(folders, "index_models", lambda *_: pytest.fail("indexed again"))
        patch.setattr(folders, "digest_of_regular", lambda _: pytest.fail("digested again"))
        again = catalogue_from([], given=[folder], store=store)
    assert (again.pieces, again.digest, again.notes) == (first.pieces, first.digest, first.notes)
    (index,) = store.glob("index-*.json")
    index.write_bytes(b"[1")
    assert catalogue_from([], given=[folder], store=store).pieces == first.pieces
    put(folder / "armchair" / "c.glb", box_glb(0.7, 0.9, 0.8))
    assert len(catalogue_from([], given=[folder], store=store).pieces) == 2


def test_a_glb_is_measured_by_its_declared_bounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(tmp_path / "armchair" / "a.glb", box_glb(0.8, 0.9, 0.7))
    monkeypatch.setattr(folders, "read_object", lambda *_: pytest.fail("its meshes were read"))
    (piece,) = catalogue_from([], given=[tmp_path]).pieces
    assert piece.size == pytest.approx((0.8, 0.7, 0.9))


def test_a_glb_with_a_cycle_of_nodes_is_refused(tmp_path: Path) -> None:
    scene = Scene()
    scene.nodes += [{"children": [1]}, {"children": [0]}]
    put(tmp_path / "armchair" / "round.glb", scene.glb([0]))
    put(tmp_path / "armchair" / "a.glb", box_glb(0.8, 0.9, 0.8))
    assert kinds(tmp_path) == ["unusable-model"]


def test_the_verb_lists_usable_models_and_writes_refused_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "cache"))
    put(tmp_path / "own" / "armchair" / "a.glb", box_glb(0.8, 0.9, 0.8))
    put(tmp_path / "own" / "armchair" / "huge.glb", box_glb(7, 9, 7))
    refused = tmp_path / "out/refused.csv"
    assert main(["catalogue", str(tmp_path / "own"), "--refused", str(refused)]) == 0
    assert capsys.readouterr().out == (
        "1 piece, 0 pictures\n       1 armchair\n"
        "1 wrong-size: own#armchair/huge: 7 x 7 x 9 m is the wrong size for armchair: left out\n"
    )
    assert refused.read_text().splitlines()[1].startswith("wrong-size,own#armchair/huge,")


def test_the_verb_writes_refused_models_if_none_is_usable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "cache"))
    put(tmp_path / "own" / "armchair" / "huge.glb", box_glb(7, 9, 7))
    refused = tmp_path / "refused.csv"
    assert main(["catalogue", str(tmp_path / "own"), "--refused", str(refused)]) == 1
    said = capsys.readouterr()
    assert said.out.startswith("0 pieces, 0 pictures\n1 wrong-size: own#armchair/huge")
    assert "no usable piece or picture" in said.err
    assert refused.read_text().splitlines()[1].startswith("wrong-size,own#armchair/huge,")
    with pytest.raises(BadInput, match="no usable piece or picture"):
        catalogue_from([], given=[tmp_path / "own"])
