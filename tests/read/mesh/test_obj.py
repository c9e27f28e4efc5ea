"""OBJ and MTL: every form of index, and the quirks of published models."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb
from pbrs_farm.read.mesh.mtl import builtin_materials, laid, parse_mtl
from pbrs_farm.read.mesh.obj import Mesh, parse_obj
from pbrs_farm.read.mesh.triangulate import triangulated_corners

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.mark.parametrize("first", ["mtllib m.mtl\n", "v 9 9 9\n", "# a remark\n"])
def test_a_byte_order_mark_hides_no_line(first: str) -> None:
    text = f"{first}{QUAD}usemtl a\nf -4 -3 -2\n"
    plain, marked = (parse_obj(text.encode(e), "m.obj") for e in ("utf-8", "utf-8-sig"))
    assert marked.mtllibs == plain.mtllibs
    np.testing.assert_array_equal(marked.meshes[0].positions, plain.meshes[0].positions)
    (material,) = parse_mtl("newmtl a\nKd 1 0 0\n".encode("utf-8-sig"))
    assert (material.name, material.kd) == ("a", (1.0, 0.0, 0.0))


def single_mesh(text: str) -> Mesh:
    (mesh,) = parse_obj(text.encode(), "m.obj").meshes
    return mesh


def area(mesh: Mesh) -> float:
    return float(trimesh.Trimesh(mesh.positions, mesh.faces, process=False).area)


@pytest.mark.parametrize(
    "face",
    ["1 2 3 4", "1/1 2/2 3/3 4/4", "1//1 2//1 3//1 4//1", "1/1/1 2/2/1 3/3/1 4/4/1",
     "-4 -3 -2 -1", "-4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1", "1/1 2//1 3 4/4/1"],
)  # fmt: skip
def test_every_index_form_gives_the_same_triangles(face: str) -> None:
    mesh = single_mesh(QUAD + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n" + f"f {face}\n")
    assert area(mesh) == pytest.approx(1.0)
    assert np.allclose(mesh.normals, [0, 0, 1])


def test_texture_coordinates_stay_with_their_corners() -> None:
    mesh = single_mesh(QUAD + "vt 0 0\nvt 2 0\nvt 2 2\nvt 0 2\nf 1/1 2/2 3/3 4/4\n")
    assert mesh.uvs is not None
    assert np.allclose(mesh.uvs, 2 * mesh.positions[:, :2])


def test_a_vertex_with_two_texture_coordinates_is_split() -> None:
    mesh = single_mesh(QUAD + "vt 0 0\nvt 1 1\nf 1/1 2/1 3/1\nf 1/2 3/1 4/1\n")
    assert len(mesh.positions) == 5


def test_a_concave_polygon_is_ear_cut_not_fanned() -> None:
    arrow = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\n"
    mesh = single_mesh(arrow + "f 1 2 3 4 5\n")
    assert area(mesh) == pytest.approx(10.0)
    mesh = single_mesh("v 0 0 0\nv 2 1 0\nv 0 2 0\nv 1 1 0\nf 1 2 3 4\n")
    assert area(mesh) == pytest.approx(1.0)


def test_polygons_of_any_size_keep_their_order_and_winding() -> None:
    angles = 2 * np.pi * np.arange(7) / 7
    ring = np.stack([np.cos(angles), np.sin(angles), 0 * angles], -1)
    positions = np.concatenate([ring[:3], ring[:5], ring, ring[:4]])
    corners = triangulated_corners(positions, np.array([3, 5, 7, 4]))
    assert corners[:, 0].tolist() == [0, 3, 3, 3, 8, 8, 8, 8, 8, 15, 15]
    a, b, c = (positions[corners[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_without_normals_a_box_is_sharp_and_a_fine_cylinder_smooth() -> None:
    box = trimesh.creation.box()
    cylinder = trimesh.creation.cylinder(1, 1, sections=32)
    for mesh, smooth in ((box, False), (cylinder, True)):
        text = "".join(f"v {x} {y} {z}\n" for x, y, z in mesh.vertices)
        text += "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in mesh.faces)
        read = single_mesh(text)
        flat = trimesh.Trimesh(read.positions, read.faces, process=False).face_normals
        dots = (read.normals[read.faces] * flat[:, None]).sum(-1)
        assert dots.min() > math.cos(math.pi / 32) - 1e-6
        assert bool(dots.min() < 1 - 1e-6) is smooth


def test_flat_shading_of_the_file_is_kept() -> None:
    cylinder = trimesh.creation.cylinder(1, 1, sections=32)
    text = "s off\n" + "".join(f"v {x} {y} {z}\n" for x, y, z in cylinder.vertices)
    text += "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in cylinder.faces)
    read = single_mesh(text)
    flat = trimesh.Trimesh(read.positions, read.faces, process=False).face_normals
    assert np.allclose((read.normals[read.faces] * flat[:, None]).sum(-1), 1)


def test_groups_and_materials_part_the_meshes() -> None:
    text = (
        QUAD
        + "g a\nusemtl red\nf 1 2 3\ng b\nf 1 3 4\nusemtl blue\nf 1 2 4\ng a\nusemtl red\nf 2 3 4\n"
    )
    meshes = parse_obj(text.encode(), "m.obj").meshes
    assert [(m.group, m.material, len(m.faces)) for m in meshes] == [
        ("a", "red", 2),
        ("b", "red", 1),
        ("b", "blue", 1),
    ]


def test_lines_points_curves_tabs_and_continuations_are_taken() -> None:
    text = "v\t0 0 0\r\nv 1 0 0 0.5 0.5 0.5\r\nv 1 1 \\\r\n0\nl 1 2\np 1\ncurv 0 1 1 2\nf\t1 2 3\n"
    assert area(single_mesh(text)) == pytest.approx(0.5)


def test_faces_without_area_are_dropped_and_counted() -> None:
    model = parse_obj((QUAD + "f 1 2 2\nf 1 2\nf 1 2 3\n").encode(), "m.obj")
    assert model.n_dropped == 1
    assert len(model.meshes[0].faces) == 1


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (QUAD + "f 1 2 9\n", "vertex 9 of 4"),
        (QUAD + "f 0 1 2\n", "vertex 0"),
        (QUAD + "f -9 1 2\n", "does not exist"),
        (QUAD + "f 1 2 x\n", "not an index"),
        ("v 0 nan 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite"),
        ("v 0 1e999 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite"),
        ("v 0 a 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not a number"),
    ],
)
def test_a_bad_obj_is_refused_with_its_place(text: str, what: str) -> None:
    with pytest.raises(BadHouse, match=what):
        parse_obj(text.encode(), "m.obj")


def test_faces_without_texture_coordinates_leave_those_of_the_others() -> None:
    mesh = single_mesh(QUAD + "vt 0.5 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 1 3 4\n")
    assert mesh.uvs is not None
    assert sorted(map(tuple, mesh.uvs[mesh.faces[0]].tolist())) == [(0.5, 0), (1, 0), (1, 1)]
    assert not mesh.uvs[mesh.faces[1]].any()


def test_a_texture_index_out_of_range_costs_only_the_texture() -> None:
    mesh = single_mesh(QUAD + "vt 0 0\nf 1/1 2/7 3/1\n")
    assert mesh.uvs is None


def test_more_triangles_than_allowed_are_refused_before_they_are_built() -> None:
    with pytest.raises(BadHouse, match="5 triangles or more, at most 4"):
        parse_obj((QUAD + "f 1 2 3\n" * 5).encode(), "m.obj", max_triangles=4)


def test_mtl_lines_are_read_and_nonsense_is_passed_over() -> None:
    red, blue = parse_mtl(
        b"# c\nnewmtl red one\nKd 1 0 0\nKs 0.5 0.5 0.5\nNs 30\nTr 0.25\nmap_Kd -s 2 2 2 a b.jpg\n"
        b"illum 2\nnewmtl blue\nKd spectral x.rfl\nNs nan\nd 2\nmap_d mask.png\n"
    )
    assert red.name == "red one"
    assert (red.kd, red.ks, red.ns, red.d) == ((1, 0, 0), (0.5, 0.5, 0.5), 30, 0.75)
    assert red.map_kd == "a b.jpg"
    assert (blue.kd, blue.ns, blue.d, blue.map_d) == ((0.8, 0.8, 0.8), 0, 1, "mask.png")


def test_an_mtl_places_its_pictures_and_unread_options_are_noted() -> None:
    wood, plain = parse_mtl(
        b"newmtl wood\nmap_Kd -o 0.25 -s 2 3 1 -clamp on a.png\nKe 1 1 1\nmap_Bump -bm 2 b.png\n"
        b"newmtl plain\nmap_Kd -clamp off a.png\nKe 0 0 0\nNi 1.4\nillum 2\n"
    )
    assert (wood.map_kd, wood.uv_offset, wood.uv_scale) == ("a.png", (0.25, 0), (2, 3))
    assert wood.unread == ("map_kd -clamp on", "ke", "map_bump")
    assert (plain.map_kd, plain.unread) == ("a.png", ())
    (mesh,) = parse_obj((QUAD + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n").encode(), "q.obj").meshes
    uvs = laid(mesh, wood).uvs
    assert uvs is not None
    assert uvs.tolist() == [[0.25, 0], [2.25, 0], [2.25, 3]]
    assert laid(mesh, plain) is mesh


def test_the_built_in_materials_carry_their_notice() -> None:
    table = builtin_materials()
    assert len(table) == 134
    assert "_notice" not in table


def test_built_in_colours_are_linear_and_those_of_an_mtl_are_not() -> None:
    table = builtin_materials()
    for name, linear in (("ltgrey", 0.3837), ("grey", 0.1837), ("dkgrey", 0.049)):
        assert linear_from_srgb(np.array(table[name].kd)) == pytest.approx([linear] * 3, abs=1e-6)
    (same,) = parse_mtl(b"newmtl grey\nKd 0.1837 0.1837 0.1837\n")
    assert same.kd == (0.1837,) * 3


def test_no_built_in_material_is_read_as_a_metal() -> None:
    # A metal reflects more than a fifth, and four times its colour (transport/scene_tables).
    for material in builtin_materials().values():
        assert linear_from_srgb(np.array(material.ks)) @ LUMINANCE < 0.2, material.name


def test_a_face_repeated_a_hundred_thousand_times_is_read_once() -> None:
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 4\n" + b"f 1 2 3\n" * 100_000
    model = parse_obj(text, "many.obj")
    assert sum(len(m.faces) for m in model.meshes) == 2
    assert model.n_dropped == 99_999
