# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring structures on the open scene: all that are ticked, or as few as choosing one needs."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty

from ..core import auto, benchmark, catalogue, choice, costmap, native, report, results, specs
from ..core.background import Background
from ..core.choice import Comparison, Plan
from ..core.reference import affordable
from ..core.session import POLL_SECONDS
from ..core.settings import memory_limit
from ..core.workload import Workload
from . import presets, properties, trees, workloads

VIEW_WIDTH = 384
"""Pixels across the view whose rays are timed."""

REPEATS, PASS_SECONDS = 3, 0.5
"""Timed passes over each set of rays, and how long one may take."""

CHECKED = 2000
"""Rays per set compared with brute force, unless that takes longer than it may."""

TEXT = "Halfspace comparison"
"""Texts with results are called so, with the scene's name."""

STOP_SECONDS = 10.0
"""How long unregistering waits for the step that runs."""

log = logging.getLogger(__name__)


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
    return costmap.rounded((VIEW_WIDTH, round(VIEW_WIDTH * render.resolution_y / max(render.resolution_x, 1))))


class _Work:
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


def comparing(scene: Any) -> _Work:
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

    return _Work(scene, steps)


def choosing(scene: Any) -> _Work:
    """Begin to choose."""
    plan, threads, limit = plan_of(scene), _threads(scene), memory_limit(scene.halfspace.memory_limit)
    candidates = auto.candidates(catalogue.load())

    def steps(module: Any, workload: Workload, keep: Callable[[Found], None]) -> Iterator[tuple[float, str]]:
        chooser = auto.Chooser(module, workload, plan, candidates, threads, limit)
        for number, text in enumerate(chooser.steps()):
            yield min(number / (len(candidates) + 6), 1.0), text
        if chooser.result is not None:
            keep(Found(chooser.result.comparison, [*chooser.result.notes, *workload.notes]))

    return _Work(scene, steps)


class _Modal:
    """An operator that works while Blender goes on. Esc stops it."""

    _work: _Work | None = None
    _timer: Any = None
    _told = ""

    @classmethod
    def poll(cls, context: Any) -> bool:
        return native.problem() is None and context.scene is not None

    def _begin(self, scene: Any) -> _Work:
        raise NotImplementedError

    def _use(self, scene: Any, found: Found) -> None:
        """What else follows when the result is there."""

    def _done(self, work: _Work) -> set[str]:
        """Write the result into the file as a text of the scene that was measured, whichever is shown by now."""
        scene = trees.scene_of(work.scene_uid)
        if scene is None:
            self.report({"WARNING"}, "The scene that was measured is gone")  # type: ignore[attr-defined]
            return {"CANCELLED"}
        found = last(scene)
        if found is not None:
            keep_text(scene, found)
            self._use(scene, found)
        return {"FINISHED"}

    def execute(self, context: Any) -> set[str]:
        """Work and wait, for scripts."""
        try:
            work = self._begin(context.scene)
            while not work.step(POLL_SECONDS):
                pass
        except Exception as error:
            return self._failed(error)
        return self._done(work)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Work while Blender goes on."""
        try:
            self._work = self._begin(context.scene)
        except Exception as error:
            return self._failed(error)
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(2 * POLL_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Look at the work on each tick of a timer; all but Esc passes through."""
        assert self._work is not None
        if event.type == "ESC":
            self._work.cancel()
            self._end(context)
            self.report({"INFO"}, "Measuring was stopped")  # type: ignore[attr-defined]
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        now = progress()
        if now is None:  # stopped from outside: another file, or the add-on goes
            self._end(context)
            return {"CANCELLED"}
        try:
            ended = self._work.step(0.0)
        except Exception as error:
            self._end(context)
            return self._failed(error)
        if ended:
            self._end(context)
            return self._done(self._work)
        done, text = now
        context.window_manager.progress_update(100 * done)
        if text != self._told:
            self._told = text
            context.workspace.status_text_set(f"{done:.0%}  {text}   Esc: stop")
            trees.redraw_panels()
        return {"PASS_THROUGH"}  # an event does not tell whose timer it is of

    def cancel(self, context: Any) -> None:
        """Blender closes the window or the file."""
        if self._work is not None:
            self._work.cancel()

    def _end(self, context: Any) -> None:
        manager = context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        context.workspace.status_text_set(None)
        trees.redraw_panels()

    def _failed(self, error: Exception) -> set[str]:
        log.error("Halfspace could not measure", exc_info=error)
        self.report({"ERROR"}, " ".join(str(error).split()) or type(error).__name__)  # type: ignore[attr-defined]
        return {"CANCELLED"}


class HALFSPACE_OT_compare(_Modal, bpy.types.Operator):
    """Compares what is ticked."""

    bl_idname = "halfspace.compare"
    bl_label = "Compare"
    bl_description = (
        "Build the chosen structure and all ticked ones over this scene, prove their answers and time their rays. "
        "Blender can be used meanwhile; Esc stops"
    )
    bl_options = {"REGISTER", "UNDO"}

    def _begin(self, scene: Any) -> _Work:
        return comparing(scene)


class HALFSPACE_OT_choose(_Modal, bpy.types.Operator):
    """Chooses a structure."""

    bl_idname = "halfspace.choose"
    bl_label = "Choose for Me"
    bl_description = (
        "Try structures on a part of the scene, the promising ones on all of it, and use what makes the picture "
        "soonest, build included. Esc stops"
    )
    bl_options = {"REGISTER", "UNDO"}

    def _begin(self, scene: Any) -> _Work:
        return choosing(scene)

    def _use(self, scene: Any, found: Found) -> None:
        if found.comparison.best is not None:
            presets.apply(scene.halfspace, found.comparison.best.spec)
            self.report({"INFO"}, " ".join(found.notes[:2]))


class HALFSPACE_OT_write_report(bpy.types.Operator):
    """Writes the report."""

    bl_idname = "halfspace.write_report"
    bl_label = "Write Report"
    bl_description = "Write the last comparison into a folder: report.html, bench.json and bench.csv"

    directory: StringProperty(name="Folder", subtype="DIR_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: Any) -> bool:
        found = last(context.scene) if context.scene is not None else None
        return found is not None and bool(found.rows)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the folder."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        found = last(context.scene)
        assert found is not None
        folder = Path(bpy.path.abspath(self.directory))
        try:
            save(folder, found)
        except (*native.FAILURES, OSError) as error:
            self.report({"ERROR"}, " ".join(str(error).split()))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {folder / 'report.html'}")
        return {"FINISHED"}


def keep_text(scene: Any, found: Found) -> None:
    """Keep a result in the .blend, as a text with the scene's name, in place of the last one."""
    title = f"{TEXT}, {scene.name}"
    text = bpy.data.texts.get(title) or bpy.data.texts.new(title)
    text.from_string("\n".join(words(found)))


def words(found: Found) -> Iterator[str]:
    """A result in lines: what each configuration takes for the picture, why, and what was measured."""
    plan = found.comparison.plan
    yield f"{plan.pixels:,} pixels, {plan.samples:,} samples each, up to {plan.max_bounces} bounces"
    yield ""
    for line in found.comparison.lines:
        marks = " (best)" * (line is found.comparison.best) + " (fastest rays)" * (line is found.comparison.fastest)
        if line.problem:
            yield f"{line.spec}: {line.problem}"
        else:
            yield (
                f"{line.spec}: build {line.build:.2f} s + render {line.trace:.2f} s = {line.total:.2f} s; "
                f"{line.answers}{marks}"
            )
    yield ""
    yield from found.notes
    if found.rows:
        yield ""
        yield from report.table(found.rows).splitlines()
        yield ""
        yield from report.findings(found.rows)


def save(folder: Path, found: Found) -> None:
    """Write the files of a report. Raises results.FolderError."""
    from ..core import page

    document = results.document(native.load(), found.rows, found.options)
    results.prepare_folder(folder)
    with results.writing(folder):
        results.write_all(
            {
                folder / "bench.json": json.dumps(document, indent=1, allow_nan=False) + "\n",
                folder / "bench.csv": report.as_csv(document["rows"]),
                folder / "report.html": page.as_html(document),
            }
        )


CLASSES = (HALFSPACE_OT_compare, HALFSPACE_OT_choose, HALFSPACE_OT_write_report)


def register() -> None:
    """Register the operators."""
    for operator in CLASSES:
        bpy.utils.register_class(operator)


def unregister() -> None:
    """Stop what runs, and the reverse of `register`."""
    stop(STOP_SECONDS)
    for operator in reversed(CLASSES):
        bpy.utils.unregister_class(operator)
    clear()
