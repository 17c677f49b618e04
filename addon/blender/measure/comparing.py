# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring structures on the open scene: all ticked ones, or those that an automatic choice needs."""

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
from ...core.structures import catalogue, specs, ways
from ...core.structures.settings import memory_limit
from .. import state
from ..session import trees
from ..settings import properties, quality
from ..state import SceneState, Slot
from . import workloads

VIEW_WIDTH = 384
"""Width of the view whose rays are timed, in pixels."""

REPEATS, PASS_SECONDS = 3, 0.5
"""Number of timed passes over each ray set, and limit on one pass in seconds."""

CHECKED = 2000
"""Largest number of rays per set compared with brute force; fewer if that would take too long."""


COMPARE, CHOOSE = "Compare", "Choose for Me"
"""Names of the two commands."""


@dataclass
class Found:
    """Result for a scene. notes: reasons and omissions, as lines; the first is the answer. rest: lines on what an
    automatic choice left out, for panels. rows, options: of the benchmark, for the report. name: of the command. state,
    read: of the scene, and its `moment` when it was read.
    """

    comparison: Comparison
    notes: list[str]
    name: str
    rest: list[str] = field(default_factory=list)
    rows: list[Any] = field(default_factory=list)
    options: dict[str, Any] = field(default_factory=dict)
    state: SceneState | None = None
    read: int = 0

    @property
    def stale(self) -> bool:
        """Whether the scene's triangles may have changed since they were read."""
        return self.state is not None and self.read != self.state.moment

    def relate(self, earlier: Found | None) -> None:
        """Add to the answer whether the last result of the other command agrees."""
        if earlier is not None and earlier.name != self.name and not earlier.stale:
            agreement = self.comparison.beside(earlier.comparison, earlier.name)
            self.notes[0] = f"{self.notes[0]} {agreement}".strip()


@dataclass
class _State:
    """The running work, at most one, and its progress for the panel."""

    work: Background | None = None
    text: str = ""
    done: float = 0.0


_state = _State()

FOUND: Slot[Found] = Slot()

last = FOUND.of
"""The result of the last comparison or choice in a scene, or None."""


def progress() -> tuple[float, str] | None:
    """Progress of the running work, 0 to 1, and its current step; None if nothing runs."""
    return None if _state.work is None else (_state.done, _state.text)


def stop(seconds: float = 0.0) -> None:
    """Stop the running work, and wait for it at most `seconds`."""
    work, _state.work = _state.work, None
    if work is not None:
        work.join(seconds) if seconds else work.stop()


def ticked(group: Any) -> list[str]:
    """The configurations to compare: the chosen structure with its settings, and all other ticked ones."""
    own = properties.spec(group)
    others = [s.id for s in catalogue.load().structures if getattr(group.compared, properties.tick(s.id))]
    return [own, *(spec for spec in others if spec != specs.structure_of(own))]


def tried(group: Any) -> list[str]:
    """The configurations to measure: the chosen one as it is set, and the fastest traversals of its tree and of all
    ticked ones.
    """
    own, *others = ticked(group)
    known = catalogue.load()
    pairs = ((known.get(specs.structure_of(spec)), spec) for spec in (ways.tree_of(own), *others))
    fastest = [spec for structure, tree in pairs if structure is not None for spec in ways.fastest(structure, tree)]
    return list(dict.fromkeys([own, *fastest]))


def name(spec: str) -> str:
    """A configuration's name for the user interface."""
    structure = catalogue.load().get(specs.structure_of(spec))
    parameters = specs.parameters(spec)
    label = structure.label if structure is not None else spec
    return f"{label}, {parameters}" if parameters else label


def rest(found: auto.Choice) -> list[str]:
    """What a choice cost, and the candidates that it left out, by the reason, as lines with names for readers."""
    left_out = (f"{len(some)} {why}: {'; '.join(map(name, some))}" for why, some in found.left_out.items())
    return [f"Choosing took {found.own:.2f} s in addition to that build", *found.dropped, *left_out]


def plan_of(scene: Any) -> Plan:
    """The picture that the scene's settings describe."""
    render, group = scene.render, scene.halfspace
    share = render.resolution_percentage / 100
    pixels = max(int(render.resolution_x * share), 1) * max(int(render.resolution_y * share), 1)
    return Plan(pixels, group.samples, group.max_bounces)


def _threads(scene: Any) -> int:
    return scene.render.threads if scene.render.threads_mode == "FIXED" else os.cpu_count() or 1


def _view(scene: Any) -> tuple[int, int]:
    """Width and height in pixels of the view whose rays are timed, in the shape of the scene's picture."""
    render = scene.render
    return costmap.shaped(VIEW_WIDTH, (render.resolution_x, render.resolution_y))


class Work:
    """One comparison or choice: reads the scene, starts the steps on a thread, and keeps the result."""

    def __init__(
        self, scene: Any, steps: Callable[[Any, Workload, Any], Iterator[tuple[float, str]]], layout: str = "flatten"
    ) -> None:
        """layout: as for `workloads.current`. Raises the exceptions of extraction, and native.NativeError."""
        # Stop earlier work, read the scene on this thread, and start the steps on another.
        stop()
        self.state = state.of(scene)
        module = native.load()
        bpy.context.view_layer.update()  # first, because evaluation reports changes
        self.read = trees.moment(scene)
        workload = workloads.current(scene.name, _view(scene), layout)
        self.result: list[Found] = []
        _state.done, _state.text = 0.0, "reading the scene"
        self.background = Background(steps(module, workload, self.result.append), self._see)
        _state.work = self.background

    def _see(self, item: tuple[float, str]) -> None:
        _state.done, _state.text = item

    def step(self, seconds: float) -> bool:
        """Wait at most `seconds`. Returns True once the work has ended and its result is kept. Raises a step's
        exception.
        """
        try:
            ended = self.background.wait(seconds)
        except BaseException:
            self._forget()
            raise
        if ended:
            self._forget()
            scene = self.state.scene
            for found in self.result if scene is not None else ():
                found.state, found.read = state.of(scene), self.read
                found.relate(last(scene))
                FOUND.keep(scene, found)
            trees.redraw_panels()
        return ended

    def cancel(self) -> None:
        """Stop and drop the result."""
        self.background.stop()
        self._forget()

    def _forget(self) -> None:
        if _state.work is self.background:
            _state.work = None


def comparing(scene: Any) -> Work:
    """Start a comparison of the chosen configuration with the fastest traversals of the ticked structures."""
    plan, threads, size = plan_of(scene), _threads(scene), _view(scene)
    flat, kept = tried(scene.halfspace), ticked(scene.halfspace)
    limit, top = memory_limit(scene.halfspace.memory_limit), quality.top(scene.halfspace)

    def steps(module: Any, workload: Workload, keep: Callable[[Found], None]) -> Iterator[tuple[float, str]]:
        # Rays go one by one through instances, so other traversals of a tree are no faster.
        chosen = flat if workload.kept is None else kept
        options = benchmark.Options(
            size=size,
            sets=choice.SETS,
            repeats=REPEATS,
            threads=threads,
            check_rays=max(min(affordable(workload, len(choice.SETS)), CHECKED), 64),
            pass_seconds=PASS_SECONDS,
            memory_limit=limit,
            layout="flatten" if workload.kept is None else "two-level",
            top=top,
        )
        rows = []
        for event in benchmark.events(module, workload, chosen, options):
            if isinstance(event, benchmark.Finished):
                rows.append(event.row)
            else:
                yield event.done, event.text
        # Predict the picture's time from the rows: count its rays with the first structure that could be built.
        # Its rays do not depend on the structure.
        yield 1.0, "counting the rays of a small picture"
        failed = {row["spec"] for row in rows if row["error"] is not None}
        spec = next((spec for spec in chosen if spec not in failed), chosen[0])
        structure = module.build(workload.vertices, workload.triangles, spec, threads=threads, memory_limit=limit)
        counted = choice.mix(module, structure, workload, size, plan.max_bounces)
        comparison = choice.compare(rows, counted, plan).of_trees(chosen[0])
        told = [f"Measured in two levels, as Instances is set; top: {top}"] if workload.kept is not None else []
        notes = [comparison.reason(), *told, *workload.notes]
        keep(Found(comparison, notes, COMPARE, rows=rows, options=options.as_dict()))

    return Work(scene, steps, quality.instancing(scene.halfspace))


def choosing(scene: Any) -> Work:
    """Start an automatic choice."""
    plan, threads, limit = plan_of(scene), _threads(scene), memory_limit(scene.halfspace.memory_limit)
    known = catalogue.load()
    candidates, dropped = auto.candidates(known), auto.dropped(known)

    def steps(module: Any, workload: Workload, keep: Callable[[Found], None]) -> Iterator[tuple[float, str]]:
        chooser = auto.Chooser(module, workload, plan, candidates, threads, limit, dropped)
        for number, text in enumerate(chooser.steps()):
            yield min(number / (len(candidates) + 6), 1.0), text
        if chooser.result is not None:
            chosen = chooser.result
            keep(Found(chosen.comparison, [*chosen.notes, *workload.notes], CHOOSE, [*rest(chosen), *workload.notes]))

    return Work(scene, steps)
