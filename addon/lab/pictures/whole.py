# SPDX-License-Identifier: GPL-3.0-or-later
"""Time and memory of whole renders, from the operator behind F12 to the picture, with Halfspace and with Cycles."""

from __future__ import annotations

import ctypes
import gc
import statistics
import time
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from ...blender.measure import workloads
from ...blender.session import reports, trees
from ...core.base import native, resident
from ...core.measure import check
from ...core.measure.check import Check

LIGHTS = ("point",)
"""Lights of a bare geometry: each visible point needs one shadow ray, and no path can hit the light by chance."""

ENGINES = ("HALFSPACE", "CYCLES")

PARTS = {"extract": "reading the scene", "build": "building", "trace": "tracing and shading"}


@dataclass(frozen=True)
class Times:
    """clock, processor: seconds of each run, by engine; memory: MiB by which it grew at most, on Linux only. parts:
    wall-clock seconds of Halfspace's runs, by part.
    """

    clock: dict[str, list[float]] = field(default_factory=lambda: {engine: [] for engine in ENGINES})
    processor: dict[str, list[float]] = field(default_factory=lambda: {engine: [] for engine in ENGINES})
    memory: dict[str, list[float]] = field(default_factory=lambda: {engine: [] for engine in ENGINES})
    parts: dict[str, list[float]] = field(default_factory=lambda: {part: [] for part in PARTS})

    def ratio(self, of: str) -> float:
        """Ratio of Halfspace's median to Cycles's. of: "clock" or "processor"."""
        seconds: dict[str, list[float]] = getattr(self, of)
        return statistics.median(seconds["HALFSPACE"]) / statistics.median(seconds["CYCLES"])

    def lines(self) -> list[str]:
        """The numbers as lines of text."""
        found = []
        for engine in ENGINES:
            clock, worked = self.clock[engine], self.processor[engine]
            found.append(
                f"{engine}: {statistics.median(clock):.3f} s by the clock ({min(clock):.3f} to {max(clock):.3f}), "
                f"{statistics.median(worked):.3f} s of the processor, {len(clock)} runs"
                + (f", {statistics.median(grown):,.0f} MiB" if (grown := self.memory[engine]) else "")
            )
        parts = ", ".join(f"{words} {statistics.median(self.parts[part]):.3f} s" for part, words in PARTS.items())
        return [*found, f"of HALFSPACE: {parts}"]


def measure(scene: Any, runs: int) -> Times:
    """Render the scene with both engines in turn, `runs` times each after a warm-up round.

    Nothing is written to disk: the time ends when Blender has the picture. Raises RuntimeError with the engine's
    message.
    """
    times = Times()
    for seed in range(runs + 1):
        for engine in ENGINES:
            scene.render.engine = engine
            scene.halfspace.render_seed = scene.cycles.seed = seed
            # Time one render by both clocks, and note the growth of the process.
            before = _reset_peak()
            worked, begun = time.process_time(), time.perf_counter()
            bpy.ops.render.render(scene=scene.name)
            taken, work = time.perf_counter() - begun, time.process_time() - worked
            if seed == 0:
                continue
            times.clock[engine].append(taken)
            times.processor[engine].append(work)
            if before is not None:
                times.memory[engine].append((resident.sizes()[1] - before) / 2**20)
            # Take the parts of the time from the engine's own report.
            if engine == "HALFSPACE":
                report = reports.last(scene)
                if report is None:
                    raise RuntimeError("nothing was rendered")
                times.parts["extract"].append(report.extract_seconds)
                times.parts["build"].append(report.statistics["build_seconds"])
                times.parts["trace"].append(report.statistics["seconds"])
    return times


def _reset_peak() -> int | None:
    """Free what earlier renders left, and begin the measurement of the largest memory of this process. Returns its
    bytes now; None where the system does not measure it.
    """
    trees.clear()
    gc.collect()
    try:
        # Return freed memory to the system, where the C library can.
        ctypes.CDLL(None).malloc_trim(0)
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except (AttributeError, OSError, TypeError):
        return None
    return resident.sizes()[0] or None


def check_rays(scene: Any) -> Check | None:
    """Compare a sample of the answers of the last render's structure with brute force, bit for bit; None if it was one
    of instances. Raises RuntimeError.
    """
    tree = trees.last(scene)
    if tree is None:
        return None
    render = scene.render
    workload = workloads.of_tree(tree, scene.name, (render.resolution_x, render.resolution_y))
    last = deque(check.steps(native.load(), tree.structure, workload), maxlen=1)
    if not last:
        raise RuntimeError("the camera sees nothing")
    return last[0]
