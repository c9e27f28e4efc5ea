from pathlib import Path

import numpy as np
import pytest

import pbrs_farm
from pbrs_farm.core.errors import BadInput
from pbrs_farm.formats.class_map import class_map
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.views.packing.pack_shards import pack
from pbrs_farm.views.packing.packing_plan import Packing
from tests.check.roots import make_root
from tests.views.small_roots import fill

ARMCHAIR = {"id": 1, "name": "Armchair", "class": "sofa", "kind": "object", "source_class": "x#12"}
LAMP = {"id": 2, "name": "Floor lamp", "class": "lamp", "kind": "lamp", "source_class": ""}
PLANT = {"id": 3, "name": "Fern", "class": "otherprop", "kind": "plant", "source_class": "fern"}


def table(folder: Path, *rows: str) -> Path:
    file = folder / "map.csv"
    file.write_text("\n".join(["from,id,name", *rows]) + "\n")
    return file


@pytest.mark.parametrize(
    ("rows", "ids"),
    [
        (["sofa,1,seat", "lamp,2,light"], [1, 2, 0]),
        (["arm*,7,arms", "sofa,1,seat"], [7, 0, 0]),
        (["sofa,1,seat", "arm*,7,arms"], [1, 0, 0]),  # the first matching row
        (["X#12,4,chair twelve"], [4, 0, 0]),  # a source's class, ignoring case
        (["plant,5,green", "FLOOR LAMP,6,tall"], [0, 6, 5]),  # a kind, a whole name
        (["fern,0,", "*,9,thing"], [9, 9, 0]),  # 0 excludes items that a later row would match
    ],
)
def test_the_first_row_that_fits_an_instance_wins(tmp_path, rows, ids):
    classes = class_map(table(tmp_path, *rows))
    assert [classes.id_of(row) for row in (ARMCHAIR, LAMP, PLANT)] == ids


def test_a_label_is_the_class_of_each_instance(tmp_path):
    classes = class_map(table(tmp_path, "# mine", "", "sofa,40000,seat", "lamp,2,light"))
    label = classes.label(np.array([[0, 1, 2], [3, 9, 1]], np.uint16), [ARMCHAIR, LAMP, PLANT])
    assert label.dtype == np.uint16
    assert label.tolist() == [[0, 40000, 2], [0, 0, 40000]]
    assert classes.names == {2: "light", 40000: "seat"}
    empty = classes.label(np.zeros((2, 2), np.uint16), [])
    assert not empty.any()


def test_columns_may_have_any_order_and_a_byte_order_mark_may_come_first(tmp_path):
    file = tmp_path / "map.csv"
    file.write_bytes(b'\xef\xbb\xbfid,Name,from\r\n1,"a, b",chair\r\n')
    assert class_map(file).names == {1: "a, b"}


def test_a_class_of_only_building_parts_is_structure(tmp_path):
    rows = ["wall,1,shell", "floor,1,shell", "door,2,mixed", "chair,2,mixed"]
    assert class_map(table(tmp_path, *rows)).structure == {1}


@pytest.mark.parametrize(
    ("rows", "match"),
    [
        (["chair,1,a", "chiar,2,b"], "line 3: 'chiar' is not a class of NYU40.*did you mean chair"),
        (["night_stand,1,a"], "line 2: .*did you mean night stand"),
        (["chair,1"], "line 2: 2 cells, not 3"),
        ([",1,a"], "line 2: from is empty"),
        (["chair,one,a"], "line 2: id 'one' is not a whole number"),
        (["chair,65536,a"], r"line 2: id '65536' is not a whole number of 0\.\.65535"),
        (["chair,-1,a"], "line 2: id '-1'"),
        (["chair,1,"], "line 2: class 1 has no name"),
        (["chair,1,a\x1bb"], "line 2: name .* cannot be printed"),
        (["", "# x", "chair,1,a", "Chair,1,a"], "line 5: 'chair' is already in line 4"),
        (["chair,1,a", "sofa,1,b"], "line 3: class 1 is 'b', but 'a' above"),
        (["chair,1,a", "sofa,2,a"], "line 3: 'a' is class 2, but 1 above"),
        (['chair,1,"a'], "line 2: is not valid CSV"),
        ([], "names no class"),
        (["chair,0,"], "names no class"),
    ],
)
def test_faults_of_a_table_are_reported_with_their_line(tmp_path, rows, match):
    with pytest.raises(BadInput, match=rf"map\.csv.*{match}"):
        class_map(table(tmp_path, *rows))


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "is empty"),
        ("from,id\nchair,1\n", "line 1: has no column name"),
        ("from,ids,name\n", "line 1: 'ids' is not a column.*did you mean id"),
        ("from,id,name,id\n", "line 1: has the column id twice"),
    ],
)
def test_a_header_without_a_column_is_refused(tmp_path, text, match):
    (tmp_path / "map.csv").write_text(text)
    with pytest.raises(BadInput, match=match):
        class_map(tmp_path / "map.csv")
    with pytest.raises(BadInput, match="no such file"):
        class_map(tmp_path / "none.csv")


def test_a_frame_gives_its_classes_by_a_table(tmp_path):
    make_root(tmp_path / "root")
    frame = next(f for f in pbrs_farm.open(tmp_path / "root") if f.ref.view == "v0")
    label = frame.classes_by(table(tmp_path, "wall,300,shell", "ceiling,300,shell", "bed,7,rest"))
    assert label.shape == frame.instance.shape
    assert label.dtype == np.uint16
    expected = np.select([np.isin(frame.classes, [1, 22]), frame.classes == 4], [300, 7], 0)
    assert (label == expected).all()
    assert set(np.unique(label)) >= {0, 300}


def test_a_frame_of_shards_has_no_classes_by_a_table(tmp_path):
    fill(FolderStore(tmp_path / "root"), {"one-00000001": 1})
    packing = Packing(layers=("instance",), modes=())
    pack(pbrs_farm.open(tmp_path / "root"), tmp_path / "shards", packing)
    with pytest.raises(BadInput, match="has no table of instances"):
        pbrs_farm.open(tmp_path / "shards")[0].classes_by(table(tmp_path, "wall,1,shell"))
