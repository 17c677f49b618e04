# SPDX-License-Identifier: GPL-3.0-or-later
"""The input of a benchmark: triangles and a view of them, from a file or built in."""

from __future__ import annotations

import contextlib
import hashlib
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..base.arrays import F32, F64, I32
from ..base.native import first_line
from . import rays
from .rays import RaySet

if TYPE_CHECKING:
    from .scene import Camera, Scene


SCENES = Path(__file__).resolve().parents[4] / "shared" / "scenes"
"""Folder of scenes outside the project, which are named without a path if they exist."""

NAMED = f"a name in {SCENES}, " if SCENES.is_dir() else ""
"""That choice for the help of a command."""


class WorkloadError(ValueError):
    """A scene cannot be used. The message names the file and the problem, in one line."""


FARTHEST = 1e37
"""Largest coordinate of a view: rays must be able to start there and to cross it in f32."""


@dataclass(frozen=True, eq=False)
class View:
    """A pinhole view. eye, target, up: (3,) float64, scene frame; vertical_fov: degrees, 0 to 180 exclusive.

    crop: the visible part of a square film, as left, right, top, bottom from 0 to 1, from its top left corner; the
    angle is that of the whole film. None: all of a film with the picture's aspect ratio. Raises WorkloadError.
    """

    eye: F64
    target: F64
    up: F64
    vertical_fov: float
    crop: tuple[float, float, float, float] | None = None

    def __post_init__(self) -> None:
        for name in ("eye", "target", "up"):
            value = getattr(self, name)
            if value.shape != (3,) or not (np.abs(value) <= FARTHEST).all():
                raise WorkloadError(
                    f"camera_{name}: expected three finite numbers of at most {FARTHEST:g}, got {value.tolist()}"
                )
        if not 0 < self.vertical_fov < 180:
            raise WorkloadError(f"camera_vfov_deg: expected an angle between 0 and 180, got {self.vertical_fov}")
        if not np.cross(self.target - self.eye, self.up).any():
            raise WorkloadError("camera: it looks along its own up direction, or at its own place")
        if self.crop is not None:
            left, right, top, bottom = self.crop
            if not (0 <= left < right <= 1 and 0 <= top < bottom <= 1):
                raise WorkloadError(f"camera_crop: expected parts of the film from 0 to 1, got {self.crop}")

    def axes(self) -> tuple[F64, F64, F64]:
        """Unit vectors to the right, upwards and forwards: three (3,) float64."""
        forward = (self.target - self.eye) / np.linalg.norm(self.target - self.eye)
        right = np.cross(forward, self.up)
        right /= np.linalg.norm(right)
        return right, np.cross(right, forward), forward

    def window(self, aspect: float) -> tuple[float, float, float, float]:
        """Left, right, bottom, top of the visible part, at distance 1 ahead. aspect: width by height of the picture."""
        tangent = float(np.tan(np.radians(self.vertical_fov) / 2))
        if self.crop is None:
            return -tangent * aspect, tangent * aspect, -tangent, tangent
        left, right, top, bottom = self.crop
        return tangent * (2 * left - 1), tangent * (2 * right - 1), tangent * (1 - 2 * bottom), tangent * (1 - 2 * top)


class Peer(Protocol):
    """Another renderer that can render a workload's scene through its camera."""

    name: str

    def render(
        self,
        size: tuple[int, int],
        samples: int,
        seed: int,
        max_bounces: int,
        limits: Mapping[str, float],
        threads: int,
    ) -> tuple[F32, float]:
        """(height, width, 3) float32 linear RGB, rows from the bottom, and the seconds of the whole render: reading the
        scene, building and tracing; processor time on one thread. limits: `clamp_direct` and `clamp_indirect`, as in
        Cycles. Raises RuntimeError, OSError.
        """
        ...


@dataclass(frozen=True, eq=False)
class Workload:
    """A scene for measuring.

    vertices: (n, 3) float32. triangles: (m, 3) int32. extra: the scene's own ray sets, in addition to those of the
    view. render_scene: the scene with materials and lights (`core.scene.Scene`) and its camera, if the file has them.
    kept: the same scene with its instances, whose triangles have the same numbers, if they were read.
    peer: another renderer whose pictures are compared, too. up_axis: x, y or z, as the file names it.
    Raises WorkloadError.
    """

    name: str
    vertices: F32
    triangles: I32
    view: View
    extra: tuple[RaySet, ...] = ()
    render_scene: Scene | None = None
    render_camera: Camera | None = None
    kept: Scene | None = None
    notes: tuple[str, ...] = field(default=())
    peer: Peer | None = None
    up_axis: str = "z"

    def __post_init__(self) -> None:
        vertices, triangles = self.vertices, self.triangles
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise WorkloadError(f"{self.name}: vertices: expected shape (n, 3), got {vertices.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3:
            raise WorkloadError(f"{self.name}: triangles: expected shape (m, 3), got {triangles.shape}")
        if not len(triangles):
            raise WorkloadError(f"{self.name}: the scene has no triangles")
        if not 0 <= int(triangles.min()) <= int(triangles.max()) < len(vertices):
            raise WorkloadError(f"{self.name}: triangles: an index is out of range for {len(vertices)} vertices")
        if not np.isfinite(vertices[triangles.ravel()]).all(axis=1).any():
            raise WorkloadError(f"{self.name}: vertices: none is finite")
        taken = {*rays.ALL}
        for one in self.extra:
            if one.name in taken:
                raise WorkloadError(f"{self.name}: two of its ray sets are called {one.name!r}")
            taken.add(one.name)

    def upright(self, up_axis: str) -> Workload:
        """The triangles and the view, rotated so that this axis points along z, as Blender's importers do."""
        order, signs = _ROTATIONS[up_axis]
        vertices: F32 = self.vertices[:, order] * np.array(signs, np.float32)
        eye, target, up = (one[order] * np.array(signs) for one in (self.view.eye, self.view.target, self.view.up))
        return Workload(self.name, vertices, self.triangles, replace(self.view, eye=eye, target=target, up=up))

    def origin(self) -> F64:
        """The point of the file at which the coordinates of vertices are 0: (3,) float64."""
        return np.zeros(3) if self.render_scene is None else self.render_scene.geometry.origin

    def fingerprint(self) -> str:
        """A hash of everything that is measured: equal for equal triangles, view and extra rays."""
        digest = hashlib.sha256()
        view = self.view
        arrays = [self.vertices, self.triangles, view.eye, view.target, view.up, np.float64(view.vertical_fov)]
        if view.crop is not None:
            arrays.append(np.array(view.crop))
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
            digest.update(b"|")
        digest.update(rays.fingerprint(self.extra).encode())
        return digest.hexdigest()

    def bounds(self) -> tuple[F64, F64]:
        """The box around all finite vertices that a triangle uses: two (3,) float64."""
        return bounds(self.vertices, self.triangles)

    def diagonal(self) -> float:
        """Length of the diagonal of `bounds`."""
        low, high = self.bounds()
        return float(np.linalg.norm(high - low))


def bounds(vertices: F32, triangles: I32) -> tuple[F64, F64]:
    """The box around all finite vertices that a triangle uses: two (3,) float64."""
    used = vertices[triangles.ravel()].astype(np.float64)
    used = used[np.isfinite(used).all(axis=1)]
    return used.min(axis=0), used.max(axis=0)


def left_out(workload: Workload, dropped: int) -> list[str]:
    """A line, or none, on the number of triangles that a structure omits and why. dropped: from its statistics."""
    if not dropped:
        return []
    finite = np.isfinite(workload.vertices).all(axis=1)
    outside = int(np.count_nonzero(~finite[workload.triangles].all(axis=1)))
    reasons = {"with coordinates that are not finite": outside, "without area": dropped - outside}
    told = " and ".join(f"{count:,} {reason}" for reason, count in reasons.items() if count)
    return [f"{dropped:,} of {len(workload.triangles):,} triangles are left out: {told}"]


def framing_view(vertices: F32, triangles: I32) -> View:
    """A view of the whole scene from the front, right and above, for files without a camera."""
    low, high = bounds(vertices, triangles)
    centre, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-6)
    direction = np.array([0.6, -1.0, 0.5])
    distance = radius / np.sin(np.radians(40.0) / 2)
    eye = centre + direction / np.linalg.norm(direction) * distance
    return View(eye, centre, np.array([0.0, 0.0, 1.0]), 40.0)


def find(name: str, suffixes: Sequence[str] = (".npz",), built_in: Sequence[str] = ()) -> str | Path:
    """Resolve a scene of a command line: one of `built_in`, a readable file, or a name in SCENES.

    Returns a built-in name unchanged, else the path. Raises WorkloadError, which lists all choices.
    """
    # Try a built-in name, then a file, then a shared scene.
    if name in built_in:
        return name
    path, problem = Path(name), "there is no such scene"
    if path.suffix.lower() in suffixes:
        try:
            with path.open("rb"):
                return path
        except OSError as error:
            problem = f"cannot be read: {error.strerror or error}"
    shared = SCENES / f"{name.removesuffix('.npz')}.npz"
    if path.name == name and shared.is_file():
        return shared
    names = ", ".join(sorted(one.stem for one in SCENES.glob("*.npz")))
    choices = " or ".join(filter(None, [", ".join(built_in), f"a file ending in {' '.join(suffixes)}"]))
    raise WorkloadError(f"{name}: {problem}; expected {choices}{f', or one of {SCENES}: {names}' if names else ''}")


def distinct(found: Mapping[str, str | Path]) -> list[str]:
    """The scenes of a command line, each once. Raises WorkloadError if two files have one name, because reports would
    merge their rows.

    found: results of `find`, by the names on the command line.
    """
    known: dict[str, tuple[str, str | Path]] = {}
    for scene, one in found.items():
        name, place = (one, one) if isinstance(one, str) else (one.stem, one.resolve())
        # Distinguish files by their resolved path.
        other, taken = known.setdefault(name, (scene, place))
        if taken != place:
            raise WorkloadError(
                f"{scene}: has the name of {other}; expected different names, which identify them in reports"
            )
    return [scene for scene, _ in known.values()]


def load_npz(path: Path, *, memory_limit: int | None = None, published: bool = False) -> Workload:
    """A scene in NumPy's format; docs/manual.md lists the keys. Raises WorkloadError.

    memory_limit: bytes that its arrays may use; they are compressed, and may be a thousand times larger than the file.
    published: as it was measured in a publication, where the file records it: without the triangles that
    replace quadrics, and only the rendered part of the film.
    """
    arrays = _scene_arrays(path, (*_KEYS, *_OPTIONAL, *(_PUBLISHED if published else ())), memory_limit)
    with naming(path):
        whole = _whole(path.stem, arrays)
        return _as_published(whole, arrays) if published else whole


def load_both(path: Path) -> tuple[Workload, Workload]:
    """A scene and its published part, from one reading, as by `load_npz`. Raises WorkloadError."""
    arrays = _scene_arrays(path, (*_KEYS, *_OPTIONAL, *_PUBLISHED), None)
    with naming(path):
        whole = _whole(path.stem, arrays)
        return whole, _as_published(whole, arrays)


def _scene_arrays(path: Path, wanted: Sequence[str], memory_limit: int | None) -> dict[str, Any]:
    """Those of the wanted arrays that the file has. Raises WorkloadError."""

    def choose(there: Sequence[str]) -> list[str]:
        missing = [key for key in _KEYS if key not in there]
        if missing:
            raise WorkloadError(f"{path}: the key {missing[0]!r} is missing")
        return [key for key in wanted if key in there]

    return read_archive(path, choose, memory_limit)


def read_archive(
    path: Path, choose: Callable[[Sequence[str]], Iterable[str]], memory_limit: int | None
) -> dict[str, Any]:
    """Arrays of an archive by their keys. Raises WorkloadError.

    choose: from the keys of all arrays, those to read; may raise WorkloadError. memory_limit: bytes for all arrays.
    """
    try:
        # Open it here, because NumPy leaves a damaged file open.
        with path.open("rb") as raw, _archive(raw) as file:
            unpacked = sum(member.file_size for member in file.zip.infolist())
            if memory_limit is not None and unpacked > memory_limit:
                raise WorkloadError(f"{path}: needs {unpacked:,} bytes of memory, of {memory_limit:,} that are free")
            return {key: _array(file, key) for key in choose(file.files)}
    except WorkloadError:
        raise
    except Exception as error:
        # A damaged archive makes its readers raise anything, from struct.error to NotImplementedError.
        raise WorkloadError(f"{path}: cannot be read as .npz: {first_line(error)}") from error


def _archive(raw: Any) -> Any:
    """The arrays of an open file. Raises ValueError if it is none: NumPy's own message advises to run what is in it."""
    if not zipfile.is_zipfile(raw):
        raise ValueError("it is no NumPy archive")
    raw.seek(0)
    return np.load(raw, allow_pickle=False)


def _array(file: Any, key: str) -> Any:
    """An array of an archive. Raises ValueError if it holds objects of Python, without NumPy's advice."""
    try:
        return file[key]
    except ValueError as error:
        if "pickle" in str(error):
            raise ValueError(f"{key}: expected numbers, got objects of Python") from error
        raise


@contextlib.contextmanager
def naming(path: Path) -> Iterator[None]:
    """Add the file's name to errors about its arrays."""
    try:
        yield
    except ValueError as error:
        raise WorkloadError(f"{path}: {first_line(error)}") from error


def _whole(name: str, arrays: Mapping[str, Any]) -> Workload:
    """The scene in these arrays. Raises ValueError."""
    camera = {key: real(arrays[key], key).astype(np.float64) for key in _KEYS if key.startswith("camera_")}
    eye, target, up = (camera[f"camera_{k}"].reshape(-1) for k in ("eye", "target", "up"))
    view = View(eye, target, up, float(camera["camera_vfov_deg"].reshape(())))
    with np.errstate(over="ignore"):  # values beyond float32 become infinite and are dropped
        vertices = np.ascontiguousarray(real(arrays["vertices"], "vertices"), np.float32)
    if arrays["triangles"].dtype.kind not in "iu":
        raise WorkloadError(f"triangles: expected whole numbers, got {arrays['triangles'].dtype}")
    if arrays["triangles"].size:  # check before the conversion to int32, which may wrap large values into the range
        least, most = int(arrays["triangles"].min()), int(arrays["triangles"].max())
        if not 0 <= least <= most < len(vertices):
            raise WorkloadError(f"triangles: an index is out of range for {len(vertices)} vertices")
    up_axis = "z"
    if "up_axis" in arrays:
        found = arrays["up_axis"]
        up_axis = str(found.reshape(-1)[0]).lower() if found.size == 1 and found.dtype.kind == "U" else ""
        if up_axis not in ("x", "y", "z"):
            raise WorkloadError(f"up_axis: expected x, y or z, got {found.tolist()!r}")
    triangles = np.ascontiguousarray(arrays["triangles"], np.int32)
    return Workload(name, vertices, triangles, view, up_axis=up_axis)


def _as_published(whole: Workload, arrays: Mapping[str, Any]) -> Workload:
    """The part of a scene that was measured in a publication, where its file records it."""
    triangles, view, notes = whole.triangles, whole.view, []
    if "triangle_from_quadric" in arrays:
        stand_in = arrays["triangle_from_quadric"]
        if stand_in.shape != (len(triangles),) or stand_in.dtype.kind not in "bui":
            raise WorkloadError(
                f"triangle_from_quadric: expected {len(triangles)} whole numbers, got {stand_in.dtype} {stand_in.shape}"
            )
        triangles = np.ascontiguousarray(triangles[stand_in == 0])
        notes.append(f"triangles that replace quadrics are left out: {len(whole.triangles) - len(triangles):,}")
    if "camera_crop" in arrays:
        left, right, top, bottom = map(float, numbers(arrays["camera_crop"], "camera_crop", 4))
        if "camera_right" in arrays and numbers(arrays["camera_right"], "camera_right", 3) @ view.axes()[0] < 0:
            # A mirrored image has the same rays on the other side.
            left, right = 1 - right, 1 - left
        view = replace(view, crop=(left, right, top, bottom))
        notes.append(f"only {right - left:.0%} by {bottom - top:.0%} of the film is visible, as published")
    return replace(whole, triangles=triangles, view=view, notes=tuple(notes))


_KEYS = ("vertices", "triangles", "camera_eye", "camera_target", "camera_up", "camera_vfov_deg")
_OPTIONAL = ("up_axis",)
_ROTATIONS = {"x": ([2, 1, 0], (-1, 1, 1)), "y": ([0, 2, 1], (1, -1, 1)), "z": ([0, 1, 2], (1, 1, 1))}
"""Order of the old axes and their signs, by the axis that becomes z."""

_PUBLISHED = ("triangle_from_quadric", "camera_crop", "camera_right")


def real(array: Any, key: str) -> Any:
    """The array, if it holds real numbers. Raises WorkloadError."""
    if array.dtype.kind not in "fiu":
        raise WorkloadError(f"{key}: expected numbers, got {array.dtype}")
    return array


def numbers(array: Any, key: str, count: int) -> F64:
    """The array as `count` finite numbers. Raises WorkloadError."""
    numbers = real(array, key).astype(np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise WorkloadError(f"{key}: expected {count} finite numbers, got {numbers.tolist()}")
    found: F64 = numbers
    return found
