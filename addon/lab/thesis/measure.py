# SPDX-License-Identifier: GPL-3.0-or-later
"""One row of the tables: a tree against the kd-tree of the same scene, traced in turn, with counters and a check."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.measure import accuracy, counting
from ...core.measure.accuracy import Answers
from ...core.measure.check import timed_build
from ...core.scene import rays
from ...core.scene.rays import RaySet, blocks
from ...core.scene.workload import Workload
from ..bench.bench_presets import BASE
from .plan import SETS, Effort, Tree

if TYPE_CHECKING:
    from ...core.base.interface import Native, Structure

RAY_SEED = 1


@dataclass(frozen=True)
class Model:
    """A scene with its kd-tree, its rays and the right answers of those that are checked."""

    workload: Workload
    base: Structure
    base_seconds: float
    sets: Sequence[RaySet]
    right: Sequence[Answers]
    counted: dict[str, float]


def prepare(native: Native, workload: Workload, effort: Effort) -> Model:
    """The kd-tree, the rays and the answers of brute force. Raises the build's exceptions."""
    base, seconds = timed_build(native, workload, BASE, 1)
    made = rays.make(workload, base, size=effort.size, seed=RAY_SEED, names=SETS)
    sets = [some for some in made if len(some)]
    brute = native.build(workload.vertices, workload.triangles, "brute", threads=0)
    chosen = [_checked(some, effort) for some in sets]
    right = [Answers.of(brute.closest(some.origins, some.directions, t_max=some.t_max, threads=0)) for some in chosen]
    return Model(workload, base, seconds, sets, right, counts(base, sets))


def _checked(some: RaySet, effort: Effort) -> RaySet:
    return some.take(blocks(len(some), effort.checked, seed=RAY_SEED))


def counts(structure: Structure, sets: Sequence[RaySet]) -> dict[str, float]:
    """Sums over all rays: tests of nearest-hit and of any-hit rays, steps of nearest-hit rays."""
    found = dict.fromkeys(("nearest", "any", "steps", "steps_axis", "leaves"), 0.0)
    for some in sets:
        own = counting.counters(structure, some, 1)
        found["any" if some.any_hit else "nearest"] += float(own["tests"].sum())
        if not some.any_hit:
            found["steps"] += float(own["steps"].sum())
            found["steps_axis"] += float(own["steps_axis"].sum())
            found["leaves"] += float(own["leaves"].sum() + own["leaves_empty"].sum())
    return found


def row(native: Native, model: Model, tree: Tree, effort: Effort) -> dict[str, Any]:
    """Measure one tree. Times, tests and steps: percent of the kd-tree's. Raises the build's exceptions."""
    structure, seconds = timed_build(native, model.workload, tree.spec, 1)
    statistics = structure.statistics
    own = counts(structure, model.sets)
    shares = {name: 100 * own[name] / max(model.counted[name], 1.0) for name in ("nearest", "any", "steps")}
    return {
        "model": model.workload.name,
        "structure": tree.structure,
        "k": tree.k,
        "seed": tree.seed,
        "spec": tree.spec,
        "time": 100 * _ratio(structure, model, effort.repeats),
        **shares,
        "axis_steps": 100 * own["steps_axis"] / max(own["steps"], 1.0),
        "nodes_axis": statistics["nodes_axis"],
        "nodes_oblique": statistics["nodes_oblique"],
        "nodes": statistics["nodes_axis"] + statistics["nodes_oblique"] + statistics["leaves"],
        "references": statistics["references"] / max(len(model.workload.triangles), 1),
        "leaf_max": statistics["leaf_max"],
        "build": 100 * seconds / max(model.base_seconds, 1e-9),
        "build_seconds": seconds,
        "checked": sum(len(answers.hit) for answers in model.right),
        "wrong": _wrong(native, structure, model, effort),
    }


def _ratio(structure: Structure, model: Model, repeats: int) -> float:
    """Median over passes of the tree's time as a share of the kd-tree's, over all rays; both traced in turn."""
    found = []
    for _ in range(repeats + 1):
        own, base = (sum(_seconds(one, some) for some in model.sets) for one in (structure, model.base))
        found.append(own / max(base, 1e-9))
    return float(np.median(found[1:]))


def _seconds(structure: Structure, some: RaySet) -> float:
    trace = structure.occluded if some.any_hit else structure.closest
    start = time.thread_time()
    trace(some.origins, some.directions, **some.options(1))
    return time.thread_time() - start


def _wrong(native: Native, structure: Structure, model: Model, effort: Effort) -> int:
    """Number of checked rays whose answer differs from brute force in any bit."""
    wrong = 0
    for some, right in zip(model.sets, model.right, strict=True):
        answers = accuracy.traced(structure, _checked(some, effort), 1)
        wrong += accuracy.compare(right, *answers, native.ulp_distance, bitwise=True).wrong
    return wrong
