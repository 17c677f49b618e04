# SPDX-License-Identifier: GPL-3.0-or-later
"""Embree, through the package embreex, with the interface of a native structure: yardstick and second opinion.

It uses Embree's robust mode unless `robust` is False, and runs on the calling thread whatever `threads` is.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base import native
from .accuracy import Answers

if TYPE_CHECKING:
    from .two_level import AnyLayout

SPEC = "embree"

MODES = {SPEC: True, "embree:robust=none": False}
"""Whether each configuration uses Embree's robust mode; Embree's own default is False."""

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


class EmbreeStructure:
    """A committed Embree scene."""

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

    def closest_ids(self, origins: Any, directions: Any, t_max: Any = np.inf) -> Any:
        """The ids of the nearest triangles only: the fastest query of the package."""
        return self._run(origins, directions, t_max, "INTERSECT")

    def occluded(self, origins: Any, directions: Any, *, t_max: Any = np.inf, **_: Any) -> NDArray[np.bool_]:
        """(n,) bool: rays that hit anything."""
        ids = self._run(origins, directions, t_max, "OCCLUDED")
        return np.asarray(ids) >= 0

    def _run(self, origins: Any, directions: Any, t_max: Any, query: str, **options: Any) -> Any:
        # Embree writes into the distances, so always pass a copy.
        ends = np.minimum(np.broadcast_to(np.asarray(t_max, np.float32), len(origins)), FAR)
        return self._scene.run(origins, directions, dists=ends, query=query, **options)


if TYPE_CHECKING:
    Traced = AnyLayout | EmbreeStructure
    """A measured structure: native, or the yardstick."""
