# SPDX-License-Identifier: GPL-3.0-or-later
"""Other people's ray tracers with the interface of a native structure: Embree as yardstick and second opinion, and
peers as further rows.

They run on the calling thread whatever `threads` is.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base import native
from .accuracy import Answers

if TYPE_CHECKING:
    from ..scene.rays import RaySet
    from .two_level import AnyLayout

SPEC = "embree"

PEER = "peer-"
"""Prefix of the configurations of all other foreign tracers."""

MODES = {SPEC: True, "embree:robust=none": False}
"""Whether each configuration uses Embree's robust mode; Embree's own default is False."""

UNSAFE: dict[str, str] = {}
"""Foreign tracers that end the program on the grid of touching boxes, and how."""

FAR = np.float32(1e30)
"""Substitute for infinite t_max, which Embree does not accept."""


ROOM = 512_000_000
"""Bytes of free memory that Embree needs to start. Measured: with about 350 MB below a limit of the address space it
starts, with less it ends the process.
"""


def problem() -> str | None:
    """The reason why Embree cannot be used here, or None."""
    try:
        import embreex.mesh_construction
        import embreex.rtcore_scene  # noqa: F401
    except ImportError as error:
        return f"embreex cannot be imported ({error})"
    free = native.load().free_memory()
    if free < ROOM:
        return f"it needs {ROOM // 1_000_000} MB of memory to start, of {free // 1_000_000} MB that are free"
    return None


def is_foreign(spec: str) -> bool:
    """Whether a configuration is not one of the native module: its arithmetic differs, and it counts nothing."""
    return spec == SPEC or spec.startswith(PEER)


class Foreign(ABC):
    """A built structure of another ray tracer. statistics: build_seconds, and what else it reports."""

    statistics: dict[str, Any]

    @abstractmethod
    def closest(self, origins: Any, directions: Any, *, t_max: Any = np.inf, **_: Any) -> Answers:
        """Nearest hits, with distances and barycentric coordinates."""

    @abstractmethod
    def occluded(self, origins: Any, directions: Any, *, t_max: Any = np.inf, **_: Any) -> NDArray[np.bool_]:
        """(n,) bool: rays that hit anything."""

    @abstractmethod
    def timed(self, some: RaySet) -> Callable[[], Any]:
        """What is timed for these rays: their nearest hits, or whether they hit, as its users call it."""


Maker = Callable[[NDArray[np.float32], NDArray[np.int32]], Foreign]
"""Builds a structure over (n, 3) vertices and (m, 3) triangles."""


class EmbreeStructure(Foreign):
    """A committed Embree scene, in Embree's robust mode unless `robust` is False."""

    def __init__(self, vertices: NDArray[np.float32], triangles: NDArray[np.int32], *, robust: bool = True) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        start = time.perf_counter()
        self._scene = EmbreeScene(robust=robust)
        TriangleMesh(self._scene, vertices, triangles)
        # The first query runs the build.
        self._scene.run(np.zeros((1, 3), np.float32), np.array([[0, 0, 1]], np.float32))
        self.statistics: dict[str, Any] = {"build_seconds": time.perf_counter() - start}

    def closest(self, origins: Any, directions: Any, *, t_max: Any = np.inf, **_: Any) -> Answers:
        """Nearest hits, with distances and barycentric coordinates."""
        found = self._run(origins, directions, t_max, "INTERSECT", output=1)
        triangle = np.asarray(found["primID"], np.int32)
        hit = triangle >= 0
        t = np.where(hit, found["tfar"], np.float32(np.inf)).astype(np.float32)
        return Answers(t, triangle, found["u"].astype(np.float32), found["v"].astype(np.float32))

    def timed(self, some: RaySet) -> Callable[[], Any]:
        """The ids of the triangles only: the fastest query of the package."""
        query = "OCCLUDED" if some.any_hit else "INTERSECT"
        return lambda: self._run(some.origins, some.directions, some.t_max, query)

    def occluded(self, origins: Any, directions: Any, *, t_max: Any = np.inf, **_: Any) -> NDArray[np.bool_]:
        """(n,) bool: rays that hit anything."""
        ids = self._run(origins, directions, t_max, "OCCLUDED")
        return np.asarray(ids) >= 0

    def _run(self, origins: Any, directions: Any, t_max: Any, query: str, **options: Any) -> Any:
        # Embree writes into the distances, so always pass a copy.
        ends = np.minimum(np.broadcast_to(np.asarray(t_max, np.float32), len(origins)), FAR)
        return self._scene.run(origins, directions, dists=ends, query=query, **options)


MAKERS: dict[str, Maker] = {SPEC: EmbreeStructure}
"""The foreign tracers that can be measured, by their configuration; others are added to it."""

if TYPE_CHECKING:
    Traced = AnyLayout | Foreign
    """A measured structure: native, or foreign."""
