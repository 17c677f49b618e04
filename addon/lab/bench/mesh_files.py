# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of .ply, .stl and .obj files, read without Blender.

Polygons are cut into triangles within their outline. As in Blender's importers, the coordinates of .ply and .stl are
kept, and those of .obj, whose y axis points up, are rotated so that z does.

Blender's importers read the same, but the package also serves without Blender. trimesh 5.2 cuts concave polygons beyond
their outline and reads no triangle strips; meshio 5.3 cuts no polygons, and reads neither strips nor negative indices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.base.arrays import F32, I32
from ...core.base.native import first_line
from ...core.scene import workload
from ...core.scene.workload import Workload, WorkloadError, framing_view
from . import polygons

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices, (n, 3), and triangles, (m, 3)."""

SCALARS = {
    name: kind
    for kind, names in {
        "i1": "char int8",
        "u1": "uchar uint8",
        "i2": "short int16",
        "u2": "ushort uint16",
        "i4": "int int32",
        "u4": "uint uint32",
        "f4": "float float32",
        "f8": "double float64",
    }.items()
    for name in names.split()
}
"""NumPy's types by PLY's names of scalar types."""

ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
"""NumPy's sign of the byte order by PLY's format."""


STL_HEAD = 1024
"""Bytes within which an ASCII STL names its first facet. Binary ones may begin with the word solid, too."""


class MeshError(ValueError):
    """The content of a file is not of its format. The message states why, without the file's name."""


def load(path: Path) -> Workload:
    """The triangles of a file, seen entirely. Raises WorkloadError."""
    try:
        with np.errstate(over="ignore"):  # values beyond float32 become infinite and are dropped
            vertices, triangles = READERS[path.suffix.lower()](path.read_bytes())
            corners: F32 = np.ascontiguousarray(vertices, np.float32)
    except (OSError, ValueError, MemoryError) as error:
        raise WorkloadError(f"{path}: cannot be read as {path.suffix.lower()}: {first_line(error)}") from error
    if not len(triangles):
        raise WorkloadError(f"{path}: there are no triangles in it")
    if not 0 <= triangles.min() <= triangles.max() < len(corners):
        raise WorkloadError(f"{path}: a triangle has a vertex that is not among the {len(corners):,} of the file")
    indices: I32 = np.ascontiguousarray(triangles, np.int32)
    if not np.isfinite(corners[indices.ravel()]).all(axis=1).any():
        raise WorkloadError(f"{path}: none of its vertices is finite")
    return Workload(path.stem, corners, indices, framing_view(corners, indices))


def bare(path: Path, memory_limit: int) -> Workload:
    """The geometry of an .npz, or of a file as for `load`. memory_limit: bytes for the arrays of an .npz.

    Raises WorkloadError.
    """
    if path.suffix.lower() in READERS:
        return load(path)
    return workload.load_npz(path, memory_limit=memory_limit)


@dataclass(frozen=True)
class Property:
    """A property of a PLY element. kind: NumPy's type of it, or of the list's items. length: that of a list's length,
    None for a scalar.
    """

    name: str
    kind: str
    length: str | None = None


@dataclass(frozen=True)
class Element:
    """A table of a PLY file, with its number of rows."""

    name: str
    count: int
    properties: list[Property]


Columns = dict[str, NDArray[np.float64]]
"""The columns of a PLY element by name. A list becomes two columns: the items of all rows, end to end, and `NAME#`, the
number of items of each row.
"""


def read_ply(data: bytes) -> Mesh:
    """The triangles of a PLY file, ASCII or binary. Raises MeshError and ValueError."""
    head, end, body = data.partition(b"end_header")
    if not data.startswith(b"ply") or not end:
        raise MeshError("it has no PLY header")
    _, _, body = body.partition(b"\n")
    order, elements = _ply_header(head.decode("ascii", "replace").splitlines()[1:])
    # The rows of each element follow those of the one before.
    tables: dict[str, Columns] = {}
    rows = _ascii_rows(body) if not order else _binary_rows(body, order)
    for element in elements:
        tables[element.name] = rows(element)
    vertex = tables.get("vertex")
    if vertex is None or not {"x", "y", "z"} <= vertex.keys():
        raise MeshError("its element vertex has no x, y and z")
    corners = np.stack([vertex[axis] for axis in "xyz"], axis=1)
    found = []
    for name in ("face", "tristrips"):
        table = tables.get(name, {})
        items = next((key for key in ("vertex_indices", "vertex_index") if f"{key}#" in table), None)
        if items is None:
            continue
        numbers, counts = table[items].astype(np.int64), table[f"{items}#"].astype(np.int64)
        found.append(_strips(numbers, counts) if name == "tristrips" else _polygons(corners, numbers, counts))
    if not found:
        raise MeshError("its element face has no list vertex_indices, and there are no tristrips")
    return corners, np.concatenate(found)


def _polygons(
    vertices: NDArray[np.float64], corners: NDArray[np.int64], counts: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The triangles of polygons, (m, 3), by the vertices as they are traced, in float32. Raises MeshError."""
    with np.errstate(over="ignore"):
        traced = vertices.astype(np.float32).astype(np.float64)
    return polygons.triangles(traced, _checked(corners, len(vertices)), counts)


def _ply_header(lines: list[str]) -> tuple[str, list[Element]]:
    """NumPy's sign of the byte order, empty for ASCII, and the elements. Raises MeshError."""
    order, elements = None, []
    for line in lines:
        match line.split():
            case ["format", name, "1.0"] if name in ORDERS:
                order = ORDERS[name]
            case ["element", name, count] if count.isdigit():
                elements.append(Element(name, int(count), []))
            case ["property", kind, name] if kind in SCALARS and elements:
                elements[-1].properties.append(Property(name, SCALARS[kind]))
            case ["property", "list", length, kind, name] if {length, kind} <= SCALARS.keys() and elements:
                elements[-1].properties.append(Property(name, SCALARS[kind], SCALARS[length]))
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise MeshError(f"its header has the unknown line {line[:40]!r}")
    if order is None:
        raise MeshError("its header names no format")
    return order, elements


def _binary_rows(body: bytes, order: str) -> Callable[[Element], Columns]:
    """A function that reads the next element of a binary file."""
    place = 0

    def rows(element: Element) -> Columns:
        nonlocal place
        found, place = _binary_element(body, place, order, element)
        return found

    return rows


def _binary_element(body: bytes, place: int, order: str, element: Element) -> tuple[Columns, int]:
    """The columns of an element that begins at a byte, and the byte after it. Raises ValueError."""
    if not element.count or not element.properties:
        return _empty(element), place
    # Read all rows at once if every list has the length that it has in the first row.
    fields: list[tuple[str, str] | tuple[str, str, int]] = []
    width = place
    for one in element.properties:
        if one.length is not None:
            number = int(np.frombuffer(body, order + one.length, 1, width)[0])
            fields += [(f"{one.name}#", order + one.length), (one.name, order + one.kind, max(number, 0))]
            width += np.dtype(one.length).itemsize + number * np.dtype(one.kind).itemsize
        else:
            fields.append((one.name, order + one.kind))
            width += np.dtype(one.kind).itemsize
    kind = np.dtype(fields)
    if place + kind.itemsize * element.count <= len(body):
        table = np.frombuffer(body, kind, element.count, place)
        lists = [one.name for one in element.properties if one.length is not None]
        if all((table[f"{name}#"] == table[name].shape[1]).all() for name in lists):
            return {name: table[name].astype(np.float64).ravel() for name in kind.names or ()}, place + table.nbytes
    # Read row by row otherwise.
    columns: dict[str, list[NDArray[np.float64]]] = {name: [] for name in _empty(element)}
    for _ in range(element.count):
        for one in element.properties:
            number = 1
            if one.length is not None:
                number = int(np.frombuffer(body, order + one.length, 1, place)[0])
                columns[f"{one.name}#"].append(np.array([number], np.float64))
                place += np.dtype(one.length).itemsize
            items = np.frombuffer(body, order + one.kind, number, place) if number else np.zeros(0)
            columns[one.name].append(items.astype(np.float64))
            place += number * np.dtype(one.kind).itemsize
    return {name: np.concatenate(parts) for name, parts in columns.items()}, place


def _ascii_rows(body: bytes) -> Callable[[Element], Columns]:
    """A function that reads the next element of an ASCII file."""
    words = iter(body.split())

    def rows(element: Element) -> Columns:
        columns: dict[str, list[float]] = {name: [] for name in _empty(element)}
        try:
            for _ in range(element.count):
                for one in element.properties:
                    number = 1
                    if one.length is not None:
                        number = int(next(words))
                        columns[f"{one.name}#"].append(number)
                    columns[one.name].extend(float(next(words)) for _ in range(number))
        except (StopIteration, RuntimeError) as error:
            raise MeshError(f"it ends within the element {element.name}") from error
        return {name: np.array(values, np.float64) for name, values in columns.items()}

    return rows


def _empty(element: Element) -> Columns:
    """The columns of an element without rows."""
    names = [name for one in element.properties for name in (one.name, *([f"{one.name}#"] if one.length else []))]
    return {name: np.zeros(0) for name in names}


def _strips(items: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangles of strips, (m, 3).

    items: the vertices of all lists, end to end, -1 between strips. counts: number of items of each list.
    """
    # A list ends its last strip, too.
    ends = np.cumsum(counts)
    items = np.insert(items, ends, -1)
    whole = np.stack([items[:-2], items[1:-1], items[2:]], axis=1) if len(items) > 2 else np.zeros((0, 3), np.int64)
    # Every second triangle of a strip is turned, counted from its beginning.
    begin = np.maximum.accumulate(np.where(np.r_[-1, items[:-1]] < 0, np.arange(len(items)), 0))[: len(whole)]
    is_odd = (np.arange(len(whole)) - begin) % 2 == 1
    whole[is_odd] = whole[is_odd][:, [1, 0, 2]]
    a, b, c = whole.T
    # Strips turn by triangles with a corner twice.
    found: NDArray[np.int64] = whole[(whole >= 0).all(axis=1) & (a != b) & (b != c) & (c != a)]
    return found


def _checked(corners: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Indices of vertices. Raises MeshError if one is not among `count`."""
    if len(corners) and not 0 <= corners.min() <= corners.max() < count:
        raise MeshError(f"a triangle has a vertex that is not among the {count:,} of the file")
    return corners


def read_stl(data: bytes) -> Mesh:
    """The triangles of an STL file, binary or ASCII. Raises MeshError and ValueError."""
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:
        facets = np.frombuffer(
            data, np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("rest", "<u2")]), count, 84
        )
        corners = facets["corners"].astype(np.float64).reshape(-1, 3)
    elif data.lstrip().startswith(b"solid") and b"facet" in data[:STL_HEAD]:
        words = data.split()
        numbers = [float(word) for i, name in enumerate(words) if name == b"vertex" for word in words[i + 1 : i + 4]]
        if len(numbers) % 9:
            raise MeshError("a facet has not three vertices of three coordinates")
        corners = np.array(numbers, np.float64).reshape(-1, 3)
    else:
        raise MeshError(f"expected {84 + 50 * count:,} bytes for {count:,} triangles, got {len(data):,}")
    return corners, np.arange(len(corners), dtype=np.int64).reshape(-1, 3)


def read_obj(data: bytes) -> Mesh:
    """The triangles of a Wavefront OBJ file, without curves and surfaces. Raises ValueError."""
    vertices: list[list[float]] = []
    corners: list[int] = []
    counts: list[int] = []
    for words in _obj_lines(data):
        if words[0] == b"v":
            vertices.append([float(word) for word in words[1:4]])
            if len(words) < 4:
                raise MeshError(f"vertex {len(vertices):,} has fewer than three coordinates")
        elif words[0] == b"f":
            # An index counts from 1; a negative one counts back from the newest vertex.
            indices = [int(word.partition(b"/")[0]) for word in words[1:]]
            if 0 in indices:
                raise MeshError(f"face {len(counts) + 1:,} has the index 0, and indices count from 1")
            corners += [index - 1 if index > 0 else index + len(vertices) for index in indices]
            counts.append(len(indices))
    x, y, z = np.array(vertices, np.float64).reshape(-1, 3).T
    turned = np.stack([x, -z, y], axis=1)
    return turned, _polygons(turned, np.array(corners, np.int64), np.array(counts, np.int64))


def _obj_lines(data: bytes) -> Iterator[list[bytes]]:
    """The words of each line that is not empty; a backslash continues a line."""
    for line in data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        words = line.split()
        if words:
            yield words


READERS: Mapping[str, Callable[[bytes], Mesh]] = {".ply": read_ply, ".stl": read_stl, ".obj": read_obj}
"""Readers by suffix."""

BARE = (".npz", *READERS)
"""Suffixes of files that are read without Blender: geometry without materials and lights."""
