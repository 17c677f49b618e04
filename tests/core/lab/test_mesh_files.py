# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files read without Blender: every variant gives the same triangles, and a broken file raises one line."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from addon.core.scene.workload import Workload, WorkloadError
from addon.lab.bench import mesh_files, scenes

CORNERS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.5, 0.5, 1.0)]
FACES = [(0, 1, 2, 3), (0, 1, 4), (3, 2, 1, 0, 4)]
"""A square, a triangle and a pentagon."""

TRIANGLES = [[0, 1, 2], [0, 2, 3], [0, 1, 4], [3, 2, 1], [3, 1, 0], [3, 0, 4]]


def ply(form: str, faces: list[tuple[int, ...]] = FACES, real: str = "float", extra: bool = False) -> bytes:
    """A PLY file. form: its format. real: type of the coordinates. extra: add an element and properties to skip."""
    head = ["ply", f"format {form} 1.0", "comment made by a test", "obj_info none"]
    head += [f"element vertex {len(CORNERS)}", *(f"property {real} {axis}" for axis in "xyz")]
    head += ["property uchar red"] * extra + [f"element face {len(faces)}"] + ["property uchar flags"] * extra
    head += ["property list uchar int vertex_indices"]
    head += ["element edge 1", "property int vertex1", "property list ushort short pair"] * extra + ["end_header", ""]
    data = "\n".join(head).encode()
    if form == "ascii":
        lines = [" ".join(map(str, [*corner, *[7] * extra])) for corner in CORNERS]
        lines += [" ".join(map(str, [*[7] * extra, len(face), *face])) for face in faces]
        return data + "\n".join(lines + ["0 2 1 2"] * extra).encode()
    order = "<" if "little" in form else ">"
    for corner in CORNERS:
        data += struct.pack(f"{order}3{'d' if real == 'double' else 'f'}", *corner) + b"\7" * extra
    for face in faces:
        data += b"\7" * extra + struct.pack(f"{order}B{len(face)}i", len(face), *face)
    return data + struct.pack(f"{order}iHhh", 0, 2, 1, 2) * extra


def stl(text: bool) -> bytes:
    """The triangles as an STL file."""
    if text:
        facets = [
            "facet normal 0 0 0\nouter loop\n"
            + "".join("vertex {} {} {}\n".format(*CORNERS[corner]) for corner in triangle)
            + "endloop\nendfacet\n"
            for triangle in TRIANGLES
        ]
        return ("solid thing\n" + "".join(facets) + "endsolid thing\n").encode()
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *(value for corner in triangle for value in CORNERS[corner]), 0)
        for triangle in TRIANGLES
    )
    return b"solid by the way".ljust(80) + struct.pack("<I", len(TRIANGLES)) + body


def obj() -> bytes:
    """The faces as an OBJ file with indices of all kinds. Its y axis points up."""
    lines = ["# a comment", *(f"v {x} {z} {-y} 1.0" for x, y, z in CORNERS), "vt 0 0", "vn 0 0 1"]
    lines += ["f 1/1/1 2/1/1 \\", "3/1/1 4/1/1", "f 1 2//1 -1", "f -2 -3 -4 -5 -1"]
    return "\n".join(lines).encode()


def load(path: Path, data: bytes) -> Workload:
    path.write_bytes(data)
    return mesh_files.load(path)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("real", ["float", "double"])
@pytest.mark.parametrize("extra", [False, True])
def test_every_ply_gives_the_same_triangles(tmp_path: Path, form: str, real: str, extra: bool) -> None:
    found = load(tmp_path / "mesh.ply", ply(form, real=real, extra=extra))
    assert found.vertices.tolist() == [list(corner) for corner in CORNERS]
    assert found.triangles.tolist() == TRIANGLES
    assert (found.vertices.dtype, found.triangles.dtype, found.name) == (np.float32, np.int32, "mesh")


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_faces_of_equal_size_give_the_same_triangles(tmp_path: Path, form: str) -> None:
    faces = [tuple(triangle) for triangle in TRIANGLES]
    found = load(tmp_path / "mesh.ply", ply(form, faces, extra=True))
    assert found.triangles.tolist() == TRIANGLES


@pytest.mark.parametrize(("name", "data"), [("a.stl", stl(True)), ("b.STL", stl(False)), ("c.obj", obj())])
def test_other_formats_give_the_same_triangles(tmp_path: Path, name: str, data: bytes) -> None:
    found = load(tmp_path / name, data)
    assert found.vertices[found.triangles].tolist() == np.array(CORNERS)[np.array(TRIANGLES)].tolist()


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.ply", b"", "it has no PLY header"),
        ("a.ply", b"solid\nend_header\n", "it has no PLY header"),
        ("a.ply", b"ply\nend_header\n", "its header names no format"),
        ("a.ply", b"ply\nformat ascii 2.0\nend_header\n", "unknown line 'format ascii 2.0'"),
        ("a.ply", b"ply\nformat ascii 1.0\nend_header\n", "its element vertex has no x, y and z"),
        ("a.ply", ply("ascii").replace(b"vertex_indices", b"corners"), "its element face has no list"),
        ("a.ply", ply("ascii", [(0, 1, 9)]), "a triangle has a vertex that is not among the 5"),
        ("a.ply", ply("ascii", [(0, 1, -1)]), "a triangle has a vertex that is not among the 5"),
        ("a.ply", ply("ascii", [(0, 1)]), "there are no triangles in it"),
        ("a.ply", ply("ascii").replace(b"vertex 5", b"vertex 99999999999"), "cannot be read as .ply"),
        ("a.ply", ply("binary_little_endian").replace(b"face 3", b"face 9999999"), "cannot be read as .ply"),
        ("a.stl", b"", "expected 84 bytes for 0 triangles, got 0"),
        ("a.stl", stl(False)[:-1], "expected 384 bytes for 6 triangles, got 383"),
        ("a.stl", b"solid x facet vertex 1 2 3", "a facet has not three vertices"),
        ("a.obj", b"", "there are no triangles in it"),
        ("a.obj", b"v 1 2\n", "vertex 1 has fewer than three coordinates"),
        ("a.obj", b"v 1 2 3\nf 1 x 3\n", "cannot be read as .obj"),
        ("a.obj", obj() + b"\nf 1 2 99\n", "a triangle has a vertex that is not among the 5"),
        ("a.obj", b"v nan 2 3\nf 1 1 1\n", "none of its vertices is finite"),
    ],
)
def test_a_broken_file_raises_one_line_with_its_name(tmp_path: Path, name: str, data: bytes, words: str) -> None:
    with pytest.raises(WorkloadError) as error:
        load(tmp_path / name, data)
    assert words in str(error.value)
    assert str(error.value).startswith(str(tmp_path / name))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize("extra", [False, True])
def test_a_file_cut_anywhere_raises_one_line(tmp_path: Path, form: str, extra: bool) -> None:
    whole = ply(form, extra=extra)
    for end in range(0, len(whole) - 8, 5):
        with pytest.raises(WorkloadError, match=r"cut\.ply: "):
            load(tmp_path / "cut.ply", whole[:end])


def test_a_benchmark_reads_meshes_where_blender_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "mesh.ply"
    path.write_bytes(ply("ascii"))
    monkeypatch.setitem(__import__("sys").modules, "addon.blender.measure", None)
    assert scenes.loader(str(path), (8, 8))().triangles.tolist() == TRIANGLES
    (tmp_path / "a.glb").touch()
    with pytest.raises(ValueError, match="needs Blender"):
        scenes.loader(str(tmp_path / "a.glb"), (8, 8))


ARROW = [(2, 2, 0), (0, 1, 0), (-2, 2, 0), (0, 0, 0)]
"""A concave square of area 2, whose reflex corner is not the first."""


def area(loaded: Workload) -> float:
    """The area of all triangles."""
    a, b, c = loaded.vertices[loaded.triangles].astype(float).transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("shift", range(4))
@pytest.mark.parametrize("name", ["a.obj", "a.ply"])
def test_concave_polygons_have_their_area(tmp_path: Path, name: str, shift: int) -> None:
    corners = ARROW[shift:] + ARROW[:shift]
    if name == "a.obj":
        data = "".join("v {} {} {}\n".format(*corner) for corner in corners) + "f 1 2 3 4\n"
    else:
        axes = "".join(f"property float {axis}\n" for axis in "xyz")
        data = f"ply\nformat ascii 1.0\nelement vertex 4\n{axes}element face 1\nproperty list uchar int vertex_index\n"
        data += "end_header\n" + "".join("{} {} {}\n".format(*corner) for corner in corners) + "4 0 1 2 3\n"
    assert area(load(tmp_path / name, data.encode())) == pytest.approx(2)


def strips(lists: list[list[int]], form: str) -> bytes:
    """A PLY file of strips over a row of vertices at the heights 0 and 1."""
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat {form} 1.0\nelement vertex 8\n{axes}element tristrips {len(lists)}\n"
    data = (head + "property list int int vertex_indices\nend_header\n").encode()
    corners = [(i // 2, i % 2, 0) for i in range(8)]
    if form == "ascii":
        rows = [*corners, *([len(one), *one] for one in lists)]
        return data + "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()
    data += b"".join(struct.pack("<3f", *corner) for corner in corners)
    return data + b"".join(struct.pack(f"<{len(one) + 1}i", len(one), *one) for one in lists)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize(
    ("lists", "expected"),
    [
        ([[0, 2, 1, 3]], [[0, 2, 1], [1, 2, 3]]),
        ([[0, 2, 1, 3, -1, 4, 6, 5, 7, -1]], [[0, 2, 1], [1, 2, 3], [4, 6, 5], [5, 6, 7]]),
        ([[0, 2, 1], [2, 4, 3, 5, 5, 6]], [[0, 2, 1], [2, 4, 3], [3, 4, 5]]),
        ([[0, 2, 1, -1, -1, 3, 4, 5, 6]], [[0, 2, 1], [3, 4, 5], [5, 4, 6]]),
        ([[], [0, 1], [0, 2, 1]], [[0, 2, 1]]),
    ],
)
def test_strips_turn_every_second_triangle(
    tmp_path: Path, form: str, lists: list[list[int]], expected: list[list[int]]
) -> None:
    found = load(tmp_path / "a.ply", strips(lists, form)).triangles.tolist()
    # A triangle may begin at any of its corners.
    assert [one[one.index(min(one)) :] + one[: one.index(min(one))] for one in found] == [
        one[one.index(min(one)) :] + one[: one.index(min(one))] for one in expected
    ]


def test_strips_have_no_vertex_of_another_file(tmp_path: Path) -> None:
    with pytest.raises(WorkloadError, match="a vertex that is not among the 8"):
        load(tmp_path / "a.ply", strips([[0, 1, 99]], "ascii"))


def test_the_index_0_of_an_obj_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WorkloadError, match="face 1 has the index 0"):
        load(tmp_path / "a.obj", b"v 0 0 0\nv 1 0 0\nf 0 1 2\nv 0 1 0\n")
