"""The nine example homes, if they were fetched; and how they are fetched."""

from __future__ import annotations

import io
import lzma
import subprocess
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh

from pbrs_farm.assets import homes_package
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.house import House, ItemKind, MaterialKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.sweethome3d.home import read_home
from tests.example_homes import example_homes

NAMES = [h.name for h in homes_package.example_homes()]


def example(name: str, fields: ReadFields | None = None) -> House:
    package = example_homes()
    data, file = package.home(name)
    return read_home(
        data, file, resources=package.resources(), fields=fields, package=package.label
    )


@pytest.mark.quick(3)
@pytest.mark.homes
@pytest.mark.parametrize("name", NAMES)
def test_an_example_home_is_read_whole(name: str) -> None:
    house = example(name, ReadFields(hidden_levels=True))
    drawn = next(h for h in homes_package.example_homes() if h.name == name)
    assert len(house.rooms) == drawn.n_rooms
    assert len(house.levels) == drawn.n_levels
    assert house.source.attribution.startswith("home and models: E. and V. Puybaret / eTeks, CC-BY")
    assert house.source.package.startswith("sweethome3d ")
    assert not [n for n in house.notes if n.kind.startswith(("missing", "unreadable", "unmapped"))]
    assert any(i.lights for i in house.items)
    assert any(m.kind is MaterialKind.PANE for m in house.materials)
    assert len({i.id for i in house.items}) == len(house.items)


@pytest.mark.homes
def test_hidden_parts_no_longer_name_a_piece() -> None:
    # Studio hides the television of its TV unit and places a flat one on the bench.
    classes = {i.name: NYU40_NAMES[i.nyu40] for i in example("Studio").items}
    assert (classes["TV unit"], classes["Flat TV"]) == ("cabinet", "television")


@pytest.mark.homes
@pytest.mark.parametrize("name", ["Studio", "1BedroomApartmentWithRoundWall"])
def test_the_walls_and_cutters_of_a_real_home_are_closed_solids(name: str) -> None:
    house = example(name)
    solids = [i.surfaces for i in house.items if i.kind is ItemKind.WALL]
    solids += [(o.cutter,) for o in house.openings]
    for surfaces in solids:
        mesh = trimesh.util.concatenate(
            [trimesh.Trimesh(s.positions, s.faces, process=False) for s in surfaces]
        )
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        assert mesh.is_watertight
        assert mesh.volume > 0


@pytest.mark.homes
def test_the_authors_cameras_are_in_rooms_and_see_something() -> None:
    house = example("2BedroomApartment")
    assert len(house.cameras) == 6
    for camera in house.cameras:
        standpoint = shapely.Point(camera.eye[[0, 2]])
        assert any(shapely.Polygon(r.polygon).contains(standpoint) for r in house.rooms)
        assert 0.9 < camera.eye[1] < 2.4
        assert np.linalg.norm(camera.towards) == pytest.approx(1.0)


def deb(folder: Path, version: str = homes_package.TESTED_VERSION) -> Path:
    """A package of that version with a jar of one home."""
    jar = io.BytesIO()
    with zipfile.ZipFile(jar, "w") as archive:
        archive.writestr(f"{homes_package.EXAMPLES}/Studio.xml", "<home/>")
        archive.writestr("model.obj", "v 0 0 0")
    tar = io.BytesIO()
    with tarfile.open(fileobj=tar, mode="w") as archive:
        entry = tarfile.TarInfo("./" + homes_package.JAR)
        entry.size = len(jar.getvalue())
        archive.addfile(entry, io.BytesIO(jar.getvalue()))
    data = b"!<arch>\n"
    for name, content in (
        (b"debian-binary", b"2.0\n"),
        (b"data.tar.xz", lzma.compress(tar.getvalue())),
    ):
        data += name.ljust(16) + b"0".ljust(32) + str(len(content)).encode().ljust(10) + b"`\n"
        data += content + b"\n" * (len(content) % 2)
    path = folder / f"sweethome3d_{version}_all.deb"
    path.write_bytes(data)
    return path


def test_a_package_in_the_cache_is_used_without_a_network(tmp_path: Path) -> None:
    deb(tmp_path)
    package = homes_package.fetch(tmp_path)
    assert package.version == homes_package.TESTED_VERSION
    assert package.note == ""
    assert package.home("studio") == (b"<home/>", "Studio.xml")
    assert package.resources().read("model.obj") == b"v 0 0 0"
    assert package.resources().read("absent") is None
    assert homes_package.cached(tmp_path) == package


def test_the_cache_keeps_a_package_once(tmp_path: Path) -> None:
    path = deb(tmp_path)
    package = homes_package.fetch(tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {package.jar.name, f"{path.name}.sha256"}
    # Without its contents the package counts as absent.
    package.jar.unlink()
    assert homes_package.cached(tmp_path) is None
    deb(tmp_path)
    assert homes_package.fetch(tmp_path) == package


def test_another_version_is_used_with_a_note(tmp_path: Path) -> None:
    deb(tmp_path, "7.5-1")
    assert "7.5-1 is not the tested version" in homes_package.fetch(tmp_path).note


def test_the_tested_version_is_taken_before_another(tmp_path: Path) -> None:
    deb(tmp_path, "9.0-1")
    deb(tmp_path)
    assert homes_package.fetch(tmp_path).version == homes_package.TESTED_VERSION


def test_an_unknown_home_is_refused_with_the_names(tmp_path: Path) -> None:
    deb(tmp_path)
    with pytest.raises(BadInput, match=r"no example home of that name.*Studio"):
        homes_package.fetch(tmp_path).home("Castle")


def test_a_damaged_package_advises_to_fetch_it_again(tmp_path: Path) -> None:
    path = deb(tmp_path)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(MachineFailed, match="fetch it again"):
        homes_package.fetch(tmp_path)


def test_without_apt_lists_the_command_to_type_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess([], 100, "", "E: Unable to locate package sweethome3d\n")

    monkeypatch.setattr("shutil.which", lambda _: "/usr/bin/apt-get")
    monkeypatch.setattr("subprocess.run", refuse)
    monkeypatch.setenv("PBRS_DEBIAN_MIRROR", "http://127.0.0.1:1")
    with pytest.raises(MachineFailed, match=r"Unable to locate.*apt-get update"):
        homes_package.fetch(tmp_path)


def test_a_cache_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(MachineFailed, match=r"file/cache.*PBRS_CACHE"):
        homes_package.fetch(tmp_path / "file" / "cache")


def test_without_apt_the_file_to_get_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.which", lambda _: None)
    monkeypatch.setenv("PBRS_DEBIAN_MIRROR", "http://127.0.0.1:1")
    with pytest.raises(MachineFailed, match="sweethome3d_7"):
        homes_package.fetch(tmp_path)
