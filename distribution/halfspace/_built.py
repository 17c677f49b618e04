# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures for callers of NumPy: lists, tensors and single rays as input, files, pickles, progress."""

from __future__ import annotations

import contextlib
import hashlib
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, TypedDict, Unpack, overload

import numpy as np
import numpy.typing as npt

from . import _arrays, _compiled
from .core.report import results
from .core.scene import workload
from .core.scene.workload import WorkloadError
from .lab.export import trees

if TYPE_CHECKING:
    import halfspace_native as native

    Bits = int | npt.ArrayLike | None
    Limit = npt.ArrayLike | None

F32 = npt.NDArray[np.float32]

INTERVAL = 0.1
"""Seconds between two calls of a progress function."""


class Monitor:
    """Progress of a build, and cancellation of builds and of traced rays: `with halfspace.Monitor(print) as monitor:`.

    progress: called within the block, from a thread of its own, with the share of the build that is done, 0 to 1,
    whenever it changed; it is not called for traced rays. An exception of it cancels the work and is raised at the end
    of the block. At that end, work that other threads still do with the monitor is cancelled.
    """

    def __init__(self, progress: Callable[[float], object] | None = None) -> None:
        self.native = _compiled.module().Monitor()
        self._call = progress
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._failed: BaseException | None = None
        self._last = -1.0

    @property
    def progress(self) -> float:
        """Share of the build that is done, 0 to 1."""
        return float(self.native.progress)

    @property
    def cancelled(self) -> bool:
        """Whether `cancel` was called."""
        return bool(self.native.cancelled)

    def cancel(self) -> None:
        """Request the work to stop; it raises Cancelled within a tenth of a second."""
        self.native.cancel()

    def __enter__(self) -> Monitor:
        if self._call is not None:
            self._thread = threading.Thread(target=self._report, name="halfspace-progress", daemon=True)
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
        self.cancel()
        if self._failed is not None:
            raise self._failed
        if self._call is not None and kind is None and self._last != 1.0:
            self._call(1.0)

    def _report(self) -> None:
        """Call the function until the block ends."""
        assert self._call is not None
        while not self._ended.wait(INTERVAL):
            if (now := self.progress) != self._last:
                self._last = now
                try:
                    self._call(now)
                except BaseException as error:
                    self._failed = error
                    self.cancel()
                    return


def _watched(monitor: Monitor | native.Monitor | None) -> native.Monitor | None:
    """The monitor of the compiled module."""
    return monitor.native if isinstance(monitor, Monitor) else monitor


class Options(TypedDict, total=False):
    """Options of rays, as of `halfspace_native.Structure.closest`."""

    order: Literal["none", "tile8"]
    threads: int
    counters: bool
    triangle_mask: Bits
    ray_mask: Bits
    monitor: Monitor | native.Monitor | None


def _passed(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of rays for the compiled module."""
    found = {name: _watched(value) if name == "monitor" else value for name, value in options.items()}
    masks = {name: _arrays.integers(name, found[name]) for name in ("triangle_mask", "ray_mask") if name in found}
    return found | masks


class Traced:
    """What answers rays: origins and directions as arrays, lists or tensors on the CPU, of any numbers.

    A single origin or direction, (3,) or (1, 3), serves all rays of the other. Results have one entry per ray, also for
    a single ray. Other arguments, results and errors are those of `halfspace_native.Structure`; integers are exact up
    to 2**53. native: the object of the compiled module, whose further attributes are those of this one too.
    """

    native: Any

    def __getattr__(self, name: str) -> Any:
        """An attribute of the compiled module's object."""
        if name == "native":  # before __init__, as while a pickle is read
            raise AttributeError(name)
        return getattr(self.native, name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *dir(self.native)})

    def __repr__(self) -> str:
        return repr(self.native)

    def closest(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: Limit = None,
        t_max: Limit = None,
        **options: Unpack[Options],
    ) -> native.Hits:
        """The nearest triangle that each ray hits."""
        hits: native.Hits = self.native.closest(
            *_arrays.rays(origins, directions),
            _arrays.single("t_min", t_min),
            _arrays.single("t_max", t_max),
            **_passed(options),
        )
        return hits

    @overload
    def occluded(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: Limit = None,
        t_max: Limit = None,
        *,
        order: Literal["none", "tile8"] = "none",
        threads: int = 0,
        counters: Literal[False] = False,
        triangle_mask: Bits = None,
        ray_mask: Bits = None,
        monitor: Monitor | native.Monitor | None = None,
    ) -> npt.NDArray[np.bool_]: ...
    @overload
    def occluded(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: Limit = None,
        t_max: Limit = None,
        *,
        order: Literal["none", "tile8"] = "none",
        threads: int = 0,
        counters: Literal[True],
        triangle_mask: Bits = None,
        ray_mask: Bits = None,
        monitor: Monitor | native.Monitor | None = None,
    ) -> tuple[npt.NDArray[np.bool_], dict[str, npt.NDArray[np.uint32]]]: ...
    def occluded(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: Limit = None,
        t_max: Limit = None,
        **options: Any,
    ) -> Any:
        """Whether each ray hits anything; with counters=True a pair of that and the counters."""
        return self.native.occluded(
            *_arrays.rays(origins, directions),
            _arrays.single("t_min", t_min),
            _arrays.single("t_max", t_max),
            **_passed(options),
        )

    def all_hits(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: Limit = None,
        t_max: Limit = None,
        *,
        max_hits: int | None = None,
        threads: int = 0,
        monitor: Monitor | native.Monitor | None = None,
    ) -> tuple[npt.NDArray[np.int64], native.Hits]:
        """Every triangle that each ray hits, nearest first: where the hits of each ray begin, and the hits."""
        found: tuple[npt.NDArray[np.int64], native.Hits] = self.native.all_hits(
            *_arrays.rays(origins, directions),
            _arrays.single("t_min", t_min),
            _arrays.single("t_max", t_max),
            max_hits=max_hits,
            threads=threads,
            monitor=_watched(monitor),
        )
        return found

    def count_hits(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: Limit = None,
        t_max: Limit = None,
        *,
        threads: int = 0,
        monitor: Monitor | native.Monitor | None = None,
    ) -> npt.NDArray[np.int64]:
        """The number of triangles that each ray hits."""
        found: npt.NDArray[np.int64] = self.native.count_hits(
            *_arrays.rays(origins, directions),
            _arrays.single("t_min", t_min),
            _arrays.single("t_max", t_max),
            threads=threads,
            monitor=_watched(monitor),
        )
        return found


class Structure(Traced):
    """A structure over triangles, from `build`, `load_structure` or a pickle. Immutable: copies are itself.

    vertices, triangles: (n, 3) float32 and (m, 3) int32 or int64, read-only, over which it was built.
    """

    def __init__(self, built: native.Structure, vertices: F32, triangles: npt.NDArray[Any]) -> None:
        self.native = built
        self.vertices, self.triangles = vertices, triangles
        for array in (vertices, triangles):
            array.flags.writeable = False

    @property
    def spec(self) -> str:
        """The configuration, with only what differs from the defaults."""
        return str(self.native.spec)

    @property
    def statistics(self) -> native.Statistics:
        """Statistics of the build."""
        found: native.Statistics = self.native.statistics
        return found

    def __copy__(self) -> Structure:
        return self

    def __deepcopy__(self, _: dict[int, Any]) -> Structure:
        return self

    def __reduce__(self) -> tuple[Callable[..., Structure], tuple[Any, ...]]:
        """Triangles and configuration, from which an equal tree is built again; a refitted one is built anew."""
        return _rebuilt, (self.vertices, self.triangles, self.spec, _hash(self.vertices, self.triangles))

    def save(self, path: str | Path) -> None:
        """Write the archive that docs/trees.md describes: triangles, configuration and the whole tree.

        `load_structure` reads it, and every other program that reads NumPy archives. Raises FolderError, an OSError.
        """
        path = Path(path)
        found = trees.arrays(self.native, path.stem, self.vertices, self.triangles.astype(np.int32))
        results.write_all({path: trees.packed(found)})

    def closest_points(
        self,
        points: npt.ArrayLike,
        max_distance: Limit = None,
        *,
        threads: int = 0,
        monitor: Monitor | native.Monitor | None = None,
    ) -> native.NearestPoints:
        """The point of the triangles that is closest to each point; a single point may be (3,)."""
        found: native.NearestPoints = self.native.closest_points(
            _arrays.points("points", points),
            _arrays.single("max_distance", max_distance),
            threads=threads,
            monitor=_watched(monitor),
        )
        return found

    def points_within(
        self,
        points: npt.ArrayLike,
        radius: npt.ArrayLike,
        *,
        threads: int = 0,
        monitor: Monitor | native.Monitor | None = None,
    ) -> tuple[npt.NDArray[np.int64], native.NearestPoints]:
        """Every triangle at most `radius` away from each point, nearest first."""
        found: tuple[npt.NDArray[np.int64], native.NearestPoints] = self.native.points_within(
            _arrays.points("points", points),
            _arrays.single("radius", radius),
            threads=threads,
            monitor=_watched(monitor),
        )
        return found

    def overlaps(
        self, other: Structure, *, threads: int = 0, monitor: Monitor | native.Monitor | None = None
    ) -> npt.NDArray[np.int32]:
        """Every pair of a triangle of this structure and one of the other that have a point in common."""
        found: npt.NDArray[np.int32] = self.native.overlaps(_of(other), threads=threads, monitor=_watched(monitor))
        return found

    def refit(
        self, vertices: npt.ArrayLike, *, threads: int = 0, monitor: Monitor | native.Monitor | None = None
    ) -> Structure:
        """A new structure, fitted to moved vertices."""
        moved = _arrays.points("vertices", vertices)
        fitted = self.native.refit(moved, threads=threads, monitor=_watched(monitor))
        return Structure(fitted, _float32(moved), self.triangles)


class Instances(Traced):
    """Instances of structures, from `build_instances`."""

    def __init__(self, built: native.Instances) -> None:
        self.native = built

    @property
    def statistics(self) -> native.InstanceStatistics:
        """Statistics of the build and of the meshes."""
        found: native.InstanceStatistics = self.native.statistics
        return found

    def __len__(self) -> int:
        return len(self.native)


def build(
    vertices: npt.ArrayLike,
    triangles: npt.ArrayLike,
    spec: str = "kd",
    *,
    threads: int = 0,
    monitor: Monitor | native.Monitor | None = None,
    progress: Callable[[float], object] | None = None,
    memory_limit: int | None = None,
) -> Structure:
    """Build a structure over triangles: arrays, lists or tensors on the CPU, (n, 3) numbers and (m, 3) indices.

    progress: called with the share that is done, as by a `Monitor`, whose place it takes. Other arguments and errors
    are those of `halfspace_native.build`. Raises ImportError if the compiled module cannot be loaded, and ValueError
    for both a monitor and progress.
    """
    module = _compiled.module()
    if monitor is not None and progress is not None:
        raise ValueError("progress: expected no monitor with it, which has a function of its own")
    corners, faces = _arrays.points("vertices", vertices), _arrays.integers("triangles", triangles, wide=True)
    with Monitor(progress) if progress is not None else contextlib.nullcontext(monitor) as watched:
        built = module.build(
            corners, faces, spec, threads=threads, monitor=_watched(watched), memory_limit=memory_limit
        )
    return Structure(built, _float32(corners), np.array(faces))


def build_instances(
    structures: Sequence[Structure | Instances | native.Structure | native.Instances],
    mesh: npt.ArrayLike,
    matrices: npt.ArrayLike,
    *,
    top: str = "sah",
    threads: int = 0,
    monitor: Monitor | native.Monitor | None = None,
    memory_limit: int | None = None,
) -> Instances:
    """Build a tree over instances. Arguments and errors as for `halfspace_native.build_instances`."""
    made = _compiled.module().build_instances(
        [_of(one) for one in structures],
        np.ascontiguousarray(mesh, np.int32),
        np.ascontiguousarray(matrices, np.float64),
        top=top,
        threads=threads,
        monitor=_watched(monitor),
        memory_limit=memory_limit,
    )
    return Instances(made)


def load_structure(path: str | Path, *, threads: int = 0) -> Structure:
    """The structure in an archive of `Structure.save` or `halfspace export`.

    The tree is built again from triangles and configuration, of which it is a function, and compared with the archive's
    nodes; parts that `lazy=1` has not built are not compared. Raises WorkloadError, in one line, for a file that is no
    such archive, is of another format, or holds another tree; and ImportError as `build`.
    """
    path, module = Path(path), _compiled.module()
    kept = workload.read_archive(path, _chosen(path), module.free_memory())
    if int(kept["format"]) != trees.FORMAT:
        raise WorkloadError(f"{path}: its format is {int(kept['format'])}, and this version reads {trees.FORMAT}")
    with workload.naming(path):
        found = build(kept["scene_vertices"], kept["scene_triangles"], str(kept["spec"]), threads=threads)
    if "lazy=1" not in found.spec:
        nodes = found.native.export()
        for name in COMPARED:
            if not np.array_equal(kept[name], nodes[name]):
                raise WorkloadError(f"{path}: {name} is not that of {found.spec} over its triangles: it was changed")
    return found


COMPARED = ("node_kind", "children", "planes", "triangle_offsets", "triangles")
"""The arrays of a tree that are compared after it was built again."""

NEEDED = ("format", "spec", "scene_vertices", "scene_triangles", *COMPARED)


def _chosen(path: Path) -> Callable[[Sequence[str]], list[str]]:
    """A function that names the arrays to read, or raises WorkloadError if one is missing."""

    def choose(there: Sequence[str]) -> list[str]:
        missing = [name for name in NEEDED if name not in there]
        if missing:
            raise WorkloadError(f"{path}: the key {missing[0]!r} is missing: it is no archive of a tree")
        return list(NEEDED)

    return choose


def _rebuilt(vertices: F32, triangles: npt.NDArray[Any], spec: str, digest: str) -> Structure:
    """The structure of a pickle. Raises ValueError for arrays that are not those that were pickled."""
    if _hash(vertices, triangles) != digest:
        raise ValueError("the pickle of a structure holds other triangles than were pickled")
    return build(vertices, triangles, spec)


def _hash(*arrays: npt.NDArray[Any]) -> str:
    """A hash of the content of arrays."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.shape} {array.dtype}".encode() + np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _of(one: Any) -> Any:
    """The object of the compiled module."""
    return one.native if isinstance(one, Traced) else one


def _float32(array: npt.NDArray[Any]) -> F32:
    """A copy in the numbers that the structure stores."""
    with np.errstate(over="ignore"):
        return np.array(array, np.float32)
