"""A mutable house's materials: painted in parallel, once each, numbered in the order of requests."""

from threading import Event

import pytest

from pbrs_farm.core.house import Material, Texture
from pbrs_farm.dress.painted_materials import Painted, PaintedMaterials

PLAIN = Material("plain")


def _texture(name: str) -> Texture:
    return Texture(name, f"{name}.jpg", "image/jpeg", b"")


def _painted(name: str) -> Painted:
    return Painted(Material(name, texture_id=name), (_texture(name),), (0.5, 0.5, 0.5))


def test_a_reader_paints_a_material_itself_while_the_thread_is_busy() -> None:
    materials, begun, go_on = PaintedMaterials([PLAIN], {}), Event(), Event()

    def waiting() -> Painted:
        begun.set()
        go_on.wait(60)
        return _painted("held")

    slow, _ = materials.paint(waiting)
    fast, painting = materials.paint(lambda: _painted("fast"))
    assert begun.wait(60)  # the thread is painting, and waits for a signal to end
    assert materials[fast].name == "fast"
    assert painting.painted().mean_rgb == (0.5, 0.5, 0.5)
    go_on.set()
    assert materials[slow].name == "held"
    assert materials[0] == PLAIN


def test_a_thread_paints_materials_before_they_are_read() -> None:
    materials, done = PaintedMaterials([], {}), Event()

    def paint() -> Painted:
        done.set()
        return _painted("a")

    materials.paint(paint)
    assert done.wait(60)


def test_a_material_read_repeatedly_is_painted_once() -> None:
    materials, calls = PaintedMaterials([], {}), list[int]()

    def paint() -> Painted:
        calls.append(1)
        return _painted("a")

    number, painting = materials.paint(paint)
    assert {materials[number].name, painting.painted().material.name} == {"a"}
    assert list(materials.textures()) == ["a"]
    assert len(calls) == 1


def test_textures_are_in_the_order_of_requests_rather_than_of_painting() -> None:
    materials, go_on = PaintedMaterials([], {"old": _texture("old")}), Event()

    def waiting() -> Painted:
        go_on.wait(60)
        return _painted("held")

    materials.paint(waiting)
    second, _ = materials.paint(lambda: _painted("second"))
    materials.add(Material("named", texture_id="named"), [_texture("named")])
    assert materials[second].texture_id == "second"
    go_on.set()
    assert list(materials.textures()) == ["old", "held", "second", "named"]


def test_a_painters_error_reaches_the_reader_of_the_material() -> None:
    materials = PaintedMaterials([PLAIN], {})

    def fail() -> Painted:
        raise KeyError("no such family")

    number, _ = materials.paint(fail)
    assert materials[0] == PLAIN
    with pytest.raises(KeyError, match="no such family"):
        _ = materials[number]


def test_equal_materials_share_a_number() -> None:
    materials = PaintedMaterials([PLAIN], {})
    number, _ = materials.paint(lambda: _painted("a"))
    assert materials.add(PLAIN, ()) == 0
    assert materials.add(Material("new"), ()) == materials.add(Material("new"), ()) == 2
    assert (number, len(materials)) == (1, 3)
    assert [m.name for m in materials[:2]] == ["plain", "a"]


def test_a_painted_material_that_was_read_keeps_its_number_when_it_is_added() -> None:
    materials = PaintedMaterials([PLAIN], {})
    number, _ = materials.paint(lambda: _painted("a"))
    assert materials.add(materials[number], ()) == number
    assert len(materials) == 2


def test_a_closed_draft_stops_painting() -> None:
    materials, begun, go_on, painted = PaintedMaterials([], {}), Event(), Event(), list[str]()

    def waiting() -> Painted:
        begun.set()
        go_on.wait(60)
        return _painted("held")

    def later() -> Painted:
        painted.append("later")
        return _painted("later")

    materials.paint(waiting)
    materials.paint(later)
    assert begun.wait(60)
    materials.close()
    go_on.set()
    materials.painter.shutdown(wait=True)
    assert not painted
