# SPDX-License-Identifier: GPL-3.0-or-later
"""Answers of other tracers and of all structures on the scenes of the reports, and their numbers of wrong ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.base import interrupt
from ...core.base.arrays import F32
from ...core.measure import yardstick
from . import judge
from .reports import Scene

if TYPE_CHECKING:
    from ...core.base.interface import Native

TOLERANCE = 1e-3
"""Error of a distance, relative to itself and to the length of the direction, above which an answer of another tracer
is wrong: far more than single precision needs in these scenes, so that only faults are counted."""

Tracer = Callable[[Scene], F32]
"""Returns the distances (n,) of the nearest hits in units of the directions, inf for a miss."""


def embree(*, robust: bool) -> Tracer:
    """Embree through embreex."""

    def trace(scene: Scene) -> F32:
        built = yardstick.EmbreeStructure(scene.vertices, scene.triangles, robust=robust)
        return built.closest(scene.origins, scene.directions).t

    return trace


def bvh_tree(scene: Scene) -> F32:
    """Class BVHTree of Blender's mathutils, without its tolerance around triangles."""
    from mathutils.bvhtree import BVHTree

    tree = BVHTree.FromPolygons(scene.vertices.tolist(), scene.triangles.tolist(), all_triangles=True, epsilon=0.0)
    lengths = np.linalg.norm(scene.directions.astype(np.float64), axis=1)
    rays = zip(scene.origins.tolist(), scene.directions.tolist(), strict=True)
    found = [tree.ray_cast(origin, direction)[3] for origin, direction in rays]
    # Convert distances in units of length to units of the directions.
    return np.array([np.inf if t is None else t / length for t, length in zip(found, lengths, strict=True)], np.float32)


def others() -> tuple[dict[str, Tracer], list[str]]:
    """The other tracers that are installed, by name, and a sentence for each that is not."""
    tracers: dict[str, Tracer] = {}
    missing = []
    if (reason := yardstick.problem()) is None:
        tracers = {"Embree robust": embree(robust=True), "Embree default": embree(robust=False)}
    else:
        missing.append(reason)
    try:
        with interrupt.guarded():
            import bpy  # noqa: F401
    except ImportError as error:
        missing.append(f"BVHTree needs Blender as a module ({error})")
    else:
        tracers["BVHTree"] = bvh_tree
    return tracers, missing


def wrong_distances(t: F32, exact: Sequence[judge.Exact | None]) -> int:
    """Number of rays with a false miss or a false hit, or with a distance that is off by more than TOLERANCE.

    t: (n,) float32, inf for a miss. exact: the exact answers, None for a miss.
    """
    truth = np.array([np.inf if one is None else one.t for one in exact], np.float64)
    hit = np.isfinite(truth)
    error = np.abs(np.where(hit, t - np.where(hit, truth, 0), 0))
    right = np.where(hit, error <= TOLERANCE * np.maximum(1, np.abs(truth)), np.isinf(t))
    return int(np.count_nonzero(~right))


def wrong_bits(hits: Any, exact: Sequence[judge.Exact | None]) -> int:
    """Number of rays whose distance or triangle differs from the exact answer."""
    truth = [(np.inf, -1) if one is None else (float(one.t), one.triangle) for one in exact]
    pairs: NDArray[np.float64] = np.array(truth)
    return int(np.count_nonzero((hits.t != pairs[:, 0]) | (hits.triangle != pairs[:, 1])))


def ours(native: Native, scene: Scene, exact: Sequence[judge.Exact | None]) -> dict[str, int]:
    """Number of wrong answers of each structure of the registry: not exactly right, or any-hit unlike nearest hit."""
    wrong = {}
    for row in native.structures():
        built = native.build(scene.vertices, scene.triangles, row["id"], threads=1)
        hits = built.closest(scene.origins, scene.directions, threads=1)
        occluded = built.occluded(scene.origins, scene.directions, threads=1)
        unlike = np.count_nonzero(occluded != (hits.triangle >= 0))
        wrong[row["id"]] = wrong_bits(hits, exact) + int(unlike)
    return wrong
