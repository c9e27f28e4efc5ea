"""The house step notices changes of every file its source read: each test changes each file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pbrs_farm.assets import homes_package
from pbrs_farm.core.errors import BadHouse, MachineFailed
from pbrs_farm.core.recipe import ReadFields, Recipe
from pbrs_farm.formats.glb import GlbWriter
from pbrs_farm.prepare.home_kinds import object_source
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.objects.model_folders import find_models
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.step_cache import StepOutput, Work, run_unless_done
from pbrs_farm.store.memory_store import MemoryStore
from tests.inputs.suncg_files import arch_json, write_v2
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_root import picture
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, home_xml, piece, sh3d
from tests.read.textured_sources import FORMATS, MTL, QUAD_OBJ
from workers.house_files import entries_from_arguments, is_left_in_place

PNG = picture((10, 20, 30), "PNG")


class HouseStep:
    """The house step of one source over one store: reads the house if its digest changed."""

    def __init__(self, named: Callable[[], SourceRef]) -> None:
        self._named = named
        self._store = MemoryStore()
        self.n_read = 0

    def was_kept(self) -> bool:
        source = self._named()
        work = Work(self._store, Recipe(), source.house_id, HouseCache(), source)
        return run_unless_done("house", work, self._read).was_done

    def _read(self, work: Work) -> StepOutput:
        assert work.source is not None
        read_house(work.source, ReadFields())
        self.n_read += 1
        return StepOutput({})


def assert_notices(named: Callable[[], SourceRef], companions: list[Path]) -> None:
    """The step runs again after each companion changed, and only then."""
    step = HouseStep(named)
    assert not step.was_kept()
    for path in companions:
        assert step.was_kept()
        path.write_bytes(path.read_bytes() + b"\n")
        assert not step.was_kept(), f"{path.name} changed"
        fingerprint, data = named().fingerprint, path.read_bytes()
        path.unlink()
        assert named().fingerprint != fingerprint, f"{path.name} is gone"
        path.write_bytes(data)
    assert step.was_kept()


def files_below(folder: Path, *own: Path) -> list[Path]:
    return sorted(p for p in folder.rglob("*") if p.is_file() and p not in own)


def test_a_gltf_notices_its_rooms_classes_buffers_and_pictures(tmp_path: Path) -> None:
    scene = FORMATS["gltf"](tmp_path, PNG)
    glb = Path(scene.location)
    rooms = [{"name": "A", "polygon": [[0, 0], [4, 0], [4, 3], [0, 3]]}]
    (tmp_path / "scene.rooms.json").write_text(json.dumps({"rooms": rooms}))
    (tmp_path / "scene.classes.json").write_text('{"nodes": {"Sofa": "sofa"}}')
    assert_notices(lambda: resolve(str(glb)), files_below(tmp_path, glb))


def test_a_gltf_in_text_notices_its_buffer_in_a_folder(tmp_path: Path) -> None:
    writer = GlbWriter()
    corners = [[0, 0, 3], [6, 0, 3], [6, 0, 0]]
    document: dict[str, Any] = one_floor(writer, corners)
    binary = writer.glb(document)
    # The binary chunk follows the header (12 bytes), the JSON chunk and its own head (8 bytes).
    n_json = int.from_bytes(binary[12:16], "little")
    data = binary[12 + 8 + n_json + 8 :]
    head = json.loads(binary[20 : 20 + n_json])
    head["buffers"][0]["uri"] = "more%20data/floor.bin"
    (tmp_path / "more data").mkdir()
    (tmp_path / "more data/floor.bin").write_bytes(data)
    path = tmp_path / "scene.gltf"
    path.write_text(json.dumps(head))
    assert_notices(lambda: resolve(str(path)), files_below(tmp_path, path))


def one_floor(writer: GlbWriter, corners: list[list[float]]) -> dict[str, Any]:
    import numpy as np

    points = np.array(corners, np.float32)
    position = writer.add_vertices(points, with_bounds=True)
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "Floor", "mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": position}}]}],
    }


@pytest.mark.slow
def test_a_suncg_house_notices_its_rooms_models_textures_and_tables(tmp_path: Path) -> None:
    house_id = suncg_root.write_root(tmp_path)
    folder = tmp_path / "house" / house_id
    companions = files_below(tmp_path, folder / "house.json")
    assert len(companions) > 20
    assert_notices(lambda: resolve(str(folder)), companions)


def test_a_suncg_house_notices_its_architecture_file(tmp_path: Path) -> None:
    house_id = suncg_root.write_root(tmp_path)
    write_v2(tmp_path, arch_json())
    folder = tmp_path / "house" / house_id
    assert_notices(lambda: resolve(str(folder)), files_below(tmp_path / "wall"))


def test_other_houses_and_models_do_not_change_a_suncg_house(tmp_path: Path) -> None:
    house_id = suncg_root.write_root(tmp_path)
    step = HouseStep(lambda: resolve(str(tmp_path / "house" / house_id)))
    step.was_kept()
    suncg_root.write(tmp_path / "object/other/other.obj", "v 0 0 0")
    suncg_root.write(tmp_path / "room/other/fr_0rm_0f.obj", "v 0 0 0")
    suncg_root.write(tmp_path / "texture/other.png", PNG)
    assert step.was_kept()


def test_an_object_notices_its_materials_and_picture(tmp_path: Path) -> None:
    (tmp_path / "thing.obj").write_text(QUAD_OBJ)
    (tmp_path / "thing.mtl").write_text(MTL)
    (tmp_path / "picture.any").write_bytes(PNG)
    companions = files_below(tmp_path, tmp_path / "thing.obj")
    assert_notices(lambda: object_source(find_models([tmp_path])[0]), companions)


def test_a_home_that_needs_the_programs_models_notices_another_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    needing, whole = tmp_path / "needing.sh3d", tmp_path / "whole.sh3d"
    body = home_xml(piece("") + piece("model='com/eteks/chair.obj'"))
    needing.write_bytes(sh3d(body, {"1": BOX_OBJ}))
    whole.write_bytes(sh3d(home_xml(piece("")), {"1": BOX_OBJ}))

    def use(package: homes_package.Package | None) -> None:
        monkeypatch.setattr(homes_package, "cached", lambda: package)

    package_names = []
    for version in (homes_package.TESTED_VERSION, "9.9", None):
        note = "" if version == homes_package.TESTED_VERSION else "another version"
        use(
            None
            if version is None
            else homes_package.Package(version, "0" * 64, tmp_path / "jar", note)
        )
        package_names.append(resolve(str(needing)).fingerprint)
        assert resolve(str(whole)).companions == ""
    assert len(set(package_names)) == 3
    source = resolve(str(needing))
    assert package_names[0] == source.sha256, "the tested package leaves digests as they were"
    use(homes_package.Package("9.9", "0" * 64, tmp_path / "jar", "another version"))
    with pytest.raises(MachineFailed, match="package"):
        read_house(source, ReadFields())


def test_a_companion_changed_since_submission_is_reported(tmp_path: Path) -> None:
    for kind, write in FORMATS.items():
        if kind in ("sweethome3d", "scenestate"):
            continue  # formats of a single file
        folder = tmp_path / kind
        folder.mkdir()
        source = write(folder, PNG)
        (picture_file,) = [
            *folder.glob("picture.any"),
            *folder.glob("stages/picture.any"),
            *folder.glob("texture/wood.jpg"),
            *folder.glob("3D-FRONT-texture/*/texture.png"),
        ]
        picture_file.write_bytes(PNG + b"\n")
        with pytest.raises(BadHouse, match="changed since the run began"):
            read_house(source, ReadFields())


def test_a_source_of_one_file_has_the_digest_of_its_file(tmp_path: Path) -> None:
    path = tmp_path / "home.sh3d"
    path.write_bytes(sh3d(home_xml(piece("")), {"1": BOX_OBJ}))
    source = resolve(str(path))
    assert source.fingerprint == source.sha256


def test_files_that_houses_share_are_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    house_id = suncg_root.write_root(tmp_path)
    files = SourceFiles()
    first = resolve(str(tmp_path / "house" / house_id), files)
    read: list[str] = []
    plain_read = RootFolder.read

    def recorded(self: RootFolder, name: str, *, max_bytes: int, limit: str = "") -> bytes | None:
        read.append(name)
        return plain_read(self, name, max_bytes=max_bytes, limit=limit)

    monkeypatch.setattr(RootFolder, "read", recorded)
    assert resolve(str(tmp_path / "house" / house_id), files) == first
    assert {name.split("/")[0] for name in read} == {"house", "wall"}, "no model is opened again"


def test_a_scene_with_side_files_is_not_copied(tmp_path: Path) -> None:
    source = FORMATS["gltf"](tmp_path, PNG)
    ((entry, ref),) = entries_from_arguments([source.location])
    assert is_left_in_place(ref)
    assert entry.sha256 == source.fingerprint != source.sha256
    (tmp_path / "picture.any").unlink()
    ((_, alone),) = entries_from_arguments([source.location])
    assert not is_left_in_place(alone)
