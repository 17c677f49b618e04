# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of an animation, measured: time to bring a structure up to date, time of the rays, cost drift, answers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypedDict

import numpy as np

from ...core.base.arrays import F32, I32
from ...core.measure import accuracy
from ...core.scene import rays
from ...core.scene.workload import Workload
from ...core.structures import specs
from .animations import Animation, Mesh

if TYPE_CHECKING:
    from ...core.base.interface import Native, Structure

SPECS = ("bvh-sah", "bih-sah", "bih", "kd", "bsp-wn-plus-kd")
"""Structures that are measured if none are named: boxes, intervals by area and by a grid, planes along the axes, and
planes along normals.
"""

COMPARED = 512
"""Camera rays per frame and method whose answers are compared with brute force, whole tiles."""

SEED = 1

Way = Literal["refit", "rebuild", "lazy"]


class Moved(TypedDict):
    """One frame and method. way: how the structure is kept up to date. done: "built" in the first frame, then
    "refitted" or "rebuilt"; why: the reason for a rebuild by the way *refit*, or "".

    update_s, trace_s: seconds of the update, without the check of the arrays, and of all camera rays; lazy trees are
    built within the latter. sah_cost: expected cost of a ray in this frame; drift: the same divided by that of the last
    build. None where rays built the tree. nodes: number of nodes and leaves, as far as built. rays: number of rays
    traced; compared, wrong: answers compared with those of brute force over this frame's triangles, and those of them
    that differ; wrong_triangle, last_bits: of these, those on another triangle, and those that differ in bits of t, u
    or v only.
    """

    animation: str
    frame: int
    spec: str
    way: Way
    done: str
    why: str
    triangles: int
    update_s: float
    trace_s: float
    sah_cost: float | None
    drift: float | None
    nodes: int
    rays: int
    compared: int
    wrong: int
    wrong_triangle: int
    last_bits: int


@dataclass(frozen=True)
class Method:
    """A structure and the way in which it follows the triangles."""

    spec: str
    way: Way

    @property
    def name(self) -> str:
        """As shown in tables and plots."""
        return f"{self.spec}, {self.way}"


def methods(native: Native, listed: Sequence[str]) -> list[Method]:
    """All ways of these structures: refit where it exists, rebuild, and a lazy build where the structure has one."""
    lazy = {row["id"] for row in native.structures() if any(one["name"] == "lazy" for one in row["parameters"])}
    triangle = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)
    found = []
    for spec in listed:
        if can_refit(native, native.build(*triangle, spec), triangle[0]):
            found.append(Method(spec, "refit"))
        if "lazy=1" not in spec:
            found.append(Method(spec, "rebuild"))
        if spec.partition(":")[0] in lazy:
            own = spec if "lazy=1" in spec else specs.joined(spec, "lazy=1")
            # Other nodes than planes cannot be built lazily.
            if not is_refused(native, own, triangle):
                found.append(Method(own, "lazy"))
    return list(dict.fromkeys(found))


def is_refused(native: Native, spec: str, triangle: tuple[F32, I32]) -> bool:
    """Whether a configuration excludes itself."""
    try:
        native.build(*triangle, spec)
    except native.SpecError:
        return True
    return False


def can_refit(native: Native, structure: Structure, vertices: np.ndarray) -> bool:
    """Whether the structure can be fitted to moved vertices."""
    try:
        structure.refit(vertices)
    except native.RefitError:
        return False
    return True


@dataclass
class _Kept:
    """The structure of a method, and the triangles that it was made of."""

    structure: Structure
    mesh: Mesh


def update(native: Native, method: Method, kept: _Kept | None, mesh: Mesh, threads: int) -> tuple[_Kept, str, str]:
    """The structure of the next frame, what was done for it, and why a structure was not refitted."""
    why = ""
    if method.way == "refit" and kept is not None:
        if kept.mesh.vertices.shape != mesh.vertices.shape or not np.array_equal(kept.mesh.triangles, mesh.triangles):
            why = "other triangles"
        else:
            try:
                return _Kept(kept.structure.refit(mesh.vertices, threads=threads), mesh), "refitted", ""
            except native.RefitError:
                why = "a triangle appeared"
    structure = native.build(mesh.vertices, mesh.triangles, method.spec, threads=threads)
    return _Kept(structure, mesh), "built" if kept is None else "rebuilt", why


def measure(
    native: Native,
    animation: Animation,
    numbers: range,
    chosen: Sequence[Method],
    *,
    size: tuple[int, int],
    threads: int = 1,
    say: Callable[[str], None] = lambda _: None,
) -> Iterator[Moved]:
    """One row per frame and method. size: pixels of the view, multiples of 8."""
    kept: dict[Method, _Kept] = {}
    for number in numbers:
        mesh = animation.frame(number)
        workload = Workload(animation.name, mesh.vertices, mesh.triangles, animation.view)
        brute = native.build(mesh.vertices, mesh.triangles, "brute", threads=threads)
        (camera,) = rays.make(workload, brute, size=size, seed=SEED, names=("primary",))
        sample = camera.take(rays.blocks(len(camera), COMPARED, SEED + number))
        expected, _ = accuracy.traced(brute, sample, threads)
        for method in chosen:
            kept[method], done, why = update(native, method, kept.get(method), mesh, threads)
            structure = kept[method].structure
            statistics = structure.statistics
            # Trace all rays for the time, and the sample for the answers.
            begin = time.perf_counter()
            structure.closest(camera.origins, camera.directions, **camera.options(threads))
            traced = time.perf_counter() - begin
            found, occluded = accuracy.traced(structure, sample, threads)
            errors = accuracy.compare(expected, found, occluded, native.ulp_distance, bitwise=True)
            lazy = method.way == "lazy"
            if errors.wrong:
                say(f"{animation.name}, frame {number}, {method.name}: {errors.wrong} wrong answers")
            yield {
                "animation": animation.name,
                "frame": number,
                "spec": method.spec,
                "way": method.way,
                "done": done,
                "why": why,
                "triangles": len(mesh.triangles),
                "update_s": statistics["refit_seconds" if done == "refitted" else "build_seconds"],
                "trace_s": traced,
                "sah_cost": None if lazy else statistics["sah_cost"],
                "drift": None if lazy else statistics["sah_cost"] / max(statistics["sah_cost_built"], 1e-30),
                "nodes": sum(statistics[kind] for kind in ("nodes_axis", "nodes_oblique", "leaves")),
                "rays": len(camera),
                "compared": len(sample),
                "wrong": errors.wrong,
                "wrong_triangle": errors.wrong_triangle,
                "last_bits": errors.last_bits,
            }
        say(f"{animation.name}: frame {number}")
