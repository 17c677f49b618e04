# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring structures on the open scene: all that are ticked, or as few as choosing one needs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import bpy

from ...core.base import native
from ...core.base.background import Background
from ...core.choose import auto, choice
from ...core.choose.choice import Comparison, Plan
from ...core.measure import benchmark, costmap
from ...core.measure.reference import affordable
from ...core.scene.workload import Workload
from ...core.structures import catalogue, specs
from ...core.structures.settings import memory_limit
from ..session import trees
from ..settings import properties
from . import workloads

VIEW_WIDTH = 384
"""Pixels across the view whose rays are timed."""

REPEATS, PASS_SECONDS = 3, 0.5
"""Timed passes over each set of rays, and how long one may take."""

CHECKED = 2000
"""Rays per set compared with brute force, unless that takes longer than it may."""


@dataclass
class Found:
    """What is known of a scene. notes: why, in lines, and what was left out. rows, options: of the benchmark, for the
    report. scene_uid, read: the scene, and its `trees.moment` when it was read.
    """

    comparison: Comparison
    notes: list[str]
    rows: list[Any] = field(default_factory=list)
    options: dict[str, Any] = field(default_factory=dict)
    scene_uid: int = 0
    read: int = 0

    @property
    def stale(self) -> bool:
        """Whether triangles of the scene may have moved since they were read."""
        return trees.moved(self.scene_uid, self.read)


@dataclass
class _State:
    """The work that runs, at most one, and what the panel may say of it."""

    work: Background | None = None
    text: str = ""
    done: float = 0.0


_state = _State()
_found: dict[int, Found] = {}


def last(scene: Any) -> Found | None:
    """What the last comparison or choice in this scene found."""
    return _found.get(scene.original.session_uid)


def progress() -> tuple[float, str] | None:
    """How far the work is, 0 to 1, and what is done; None when nothing runs."""
    return None if _state.work is None else (_state.done, _state.text)


def stop(seconds: float = 0.0) -> None:
    """End what runs, and wait for it at most so long."""
    work, _state.work = _state.work, None
    if work is not None:
        work.join(seconds) if seconds else work.stop()


def clear() -> None:
    """Forget all."""
    _found.clear()


def ticked(group: Any) -> list[str]:
    """The configurations to compare: the chosen structure as it is set, and all others that are ticked."""
    own = properties.spec(group)
    others = [s.id for s in catalogue.load().structures if getattr(group.compared, properties.tick(s.id))]
    return [own, *(spec for spec in others if spec != specs.structure_of(own))]


def name(spec: str) -> str:
    """A configuration as people read it."""
    structure = catalogue.load().get(specs.structure_of(spec))
    parameters = specs.parameters(spec)
    label = structure.label if structure is not None else spec
    return f"{label}, {parameters}" if parameters else label


def plan_of(scene: Any) -> Plan:
    """The picture that the scene's settings ask for."""
    render, group = scene.render, scene.halfspace
    share = render.resolution_percentage / 100
    pixels = max(int(render.resolution_x * share), 1) * max(int(render.resolution_y * share), 1)
    return Plan(pixels, group.samples, group.max_bounces)


def _threads(scene: Any) -> int:
    return scene.render.threads if scene.render.threads_mode == "FIXED" else os.cpu_count() or 1


def _view(scene: Any) -> tuple[int, int]:
    render = scene.render
    return costmap.shaped(VIEW_WIDTH, (render.resolution_x, render.resolution_y))


class Work:
    """One comparison or choice: read the scene, begin, and keep what comes out."""

    def __init__(self, scene: Any, steps: Callable[[Any, Workload, Any], Iterator[tuple[float, str]]]) -> None:
        """Raises what extraction raises, and native.NativeError."""
        stop()
        self.scene_uid = scene.original.session_uid
        module = native.load()
        bpy.context.view_layer.update()  # first, since it tells what has moved
        self.read = trees.moment(scene)
        workload = workloads.current(scene.name, _view(scene))
        self.result: list[Found] = []
        _state.done, _state.text = 0.0, "reading the scene"
        self.background = Background(steps(module, workload, self.result.append), self._see)
        _state.work = self.background

    def _see(self, item: tuple[float, str]) -> None:
        _state.done, _state.text = item

    def step(self, seconds: float) -> bool:
        """Wait at most so long. True when the work has ended; then its result is kept. Raises what a step raised."""
        try:
            ended = self.background.wait(seconds)
        except BaseException:
            self._forget()
            raise
        if ended:
            self._forget()
            for found in self.result if trees.scene_of(self.scene_uid) is not None else ():
                found.scene_uid, found.read = self.scene_uid, self.read
                _found[self.scene_uid] = found
            trees.redraw_panels()
        return ended

    def cancel(self) -> None:
        """Stop and keep nothing."""
        self.background.stop()
        self._forget()

    def _forget(self) -> None:
        if _state.work is self.background:
            _state.work = None


def comparing(scene: Any) -> Work:
    """Begin to compare what is ticked."""
    chosen, plan, threads, size = ticked(scene.halfspace), plan_of(scene), _threads(scene), _view(scene)
    limit = memory_limit(scene.halfspace.memory_limit)

    def steps(module: Any, workload: Workload, keep: Callable[[Found], None]) -> Iterator[tuple[float, str]]:
        options = benchmark.Options(
            size=size,
            sets=choice.SETS,
            repeats=REPEATS,
            threads=threads,
            check_rays=max(min(affordable(workload, len(choice.SETS)), CHECKED), 64),
            pass_seconds=PASS_SECONDS,
            memory_limit=limit,
        )
        rows = []
        for event in benchmark.events(module, workload, chosen, options):
            if isinstance(event, benchmark.Finished):
                rows.append(event.row)
            else:
                yield event.done, event.text
        yield 1.0, "counting the rays of a small picture"
        failed = {row["spec"] for row in rows if row["error"] is not None}
        spec = next((spec for spec in chosen if spec not in failed), chosen[0])
        structure = module.build(workload.vertices, workload.triangles, spec, threads=threads, memory_limit=limit)
        counted = choice.mix(module, structure, workload, size, plan.max_bounces)
        comparison = choice.compare(rows, counted, plan)
        keep(Found(comparison, [comparison.reason(), *workload.notes], rows, options.as_dict()))

    return Work(scene, steps)


def choosing(scene: Any) -> Work:
    """Begin to choose."""
    plan, threads, limit = plan_of(scene), _threads(scene), memory_limit(scene.halfspace.memory_limit)
    known = catalogue.load()
    candidates, dropped = auto.candidates(known), auto.dropped(known)

    def steps(module: Any, workload: Workload, keep: Callable[[Found], None]) -> Iterator[tuple[float, str]]:
        chooser = auto.Chooser(module, workload, plan, candidates, threads, limit, dropped)
        for number, text in enumerate(chooser.steps()):
            yield min(number / (len(candidates) + 6), 1.0), text
        if chooser.result is not None:
            keep(Found(chooser.result.comparison, [*chooser.result.notes, *workload.notes]))

    return Work(scene, steps)
