# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine that Blender calls."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ...core.base import denoise, native, room
from ...core.base.background import Background
from ...core.base.command import INTERRUPTED
from ...core.base.notes import Notes
from ...core.base.resident import Growth
from ...core.choose import auto, choice
from ...core.session import coarse
from ...core.session.refits import FOLLOWED, Followed
from ...core.session.session import POLL_SECONDS, Cancelled, Session, Shown, watch
from ...core.structures import catalogue
from ...core.structures.settings import RenderSettings, memory_limit
from ..measure import comparing, workloads
from ..read import extract, passes, remarks
from ..read.standing import Standing
from ..session import reports, trees
from ..settings import properties, quality
from . import cameras, denoising, motion, moving, running, stages
from .baking import Bake
from .previews import Preview
from .requested import removes_noise, render_settings
from .result import Result, copy, summary
from .viewport import Viewport

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...core.base.arrays import F32, F64
    from ...core.scene.scene import Camera, Scene

ENGINE = "HALFSPACE"
UPDATE_MILLISECONDS = 400
"""Interval at which a converging picture is shown."""

BUILD_SHARE = 0.1
"""Share of the progress bar that the build takes."""

log = logging.getLogger(__name__)

_kept: list[Any] = []
"""Structures of the last picture and its meshes, kept while Blender's persistent data is enabled."""


class HalfspaceEngine(bpy.types.RenderEngine):
    """The engine's instance for one final render or one 3D view in rendered mode."""

    bl_idname = ENGINE
    bl_label = "Halfspace"
    bl_use_preview = True
    bl_use_postprocess = True
    bl_use_shading_nodes_custom = False
    bl_use_eevee_viewport = True
    bl_use_spherical_stereo = False
    bl_use_stereo_viewport = False
    bl_use_custom_freestyle = False

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._viewport: Viewport | None = None
        self._noted: dict[tuple[str, str], Notes] = {}
        self._frame = math.nan

    def noted(self, depsgraph: Any, notes: Notes) -> Notes:
        """The notes of all layers and views of this frame so far, including `notes` of the current one."""
        key, frame = (depsgraph.view_layer.name, self.active_view_get()), depsgraph.scene.frame_float
        if self._frame != frame or key in self._noted:  # an engine may persist over several pictures
            self._noted, self._frame = {}, frame
        self._noted[key] = notes
        found = Notes()
        for one in self._noted.values():
            found.join(one)
        return found

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        passes.register_passes(self, scene, renderlayer)

    def render(self, depsgraph: Any) -> None:
        """Render one view layer of one frame. An error is reported once, and no incomplete result is kept."""
        self._render(lambda: Preview(self, depsgraph) if self.is_preview else _Picture(self, depsgraph))

    def bake(self, depsgraph: Any, item: Any, pass_type: str, pass_filter: int, width: int, height: int) -> None:
        """Bake one object into one image. An error is reported once, and no incomplete result is kept."""
        self._render(lambda: Bake(self, depsgraph, item, pass_type, pass_filter, (width, height)))

    def _render(self, begin: Callable[[], _Picture | Preview | Bake]) -> None:
        if running.closing():
            return
        with running.picture(self):
            picture = None
            try:
                picture = begin()
                picture.render()
            except BaseException as error:
                # An exception that leaves this function is lost: Blender overwrites the last picture with an empty one.
                try:
                    self._failed(error)
                finally:
                    if picture is not None:
                        picture.discard()

    def _failed(self, error: BaseException) -> None:
        """Report what ended a render, unless the user cancelled it."""
        if isinstance(error, Cancelled):
            return
        if isinstance(error, KeyboardInterrupt):
            self._refuse(INTERRUPTED)
            return
        # With Blender as a module, the calling program reports the failure itself.
        level = logging.DEBUG if bpy.app.module else logging.ERROR
        log.log(level, "Halfspace could not render", exc_info=error)
        self._refuse(native.reason(error))

    def _refuse(self, message: str) -> None:
        """Report an error to Blender, so that it writes no picture."""
        self.error_set(message)
        self.report({"ERROR"}, message)

    def view_update(self, context: Any, depsgraph: Any) -> None:
        if self._viewport is None:
            self._viewport = Viewport()
        self._viewport.update(self, context, depsgraph)

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        if self._viewport is not None:
            self._viewport.draw(self, context, depsgraph)


class _Picture:
    """One call of `render`, with its open render result."""

    def __init__(self, engine: HalfspaceEngine, depsgraph: Any) -> None:
        self.engine = engine
        self.depsgraph = depsgraph
        self.notes = Notes()
        self.result: Result | None = None
        self.followed: Followed | None = None
        self._fetch()

    def _fetch(self) -> None:
        """Take what another evaluation of the depsgraph replaces."""
        self.scene = self.depsgraph.scene_eval
        self.group = self.scene.halfspace

    def render(self) -> None:
        """Extract, build, render, report."""
        module = native.load()
        settings = render_settings(self.engine, self.depsgraph)
        width, height = settings.size
        if not self.group.overlay.show:
            trees.clear()  # free the last tree first: it may not fit into memory together with this picture's
        room.check(module, f"a picture of {width} × {height} pixels", passes.bytes_needed(settings))

        self._show_status("Reading the scene")
        memory = Growth()
        read = self._read(settings)
        memory.look()
        # The structures of times are fitted to each other, those of an animation's frames on request.
        if self.scene.render.use_persistent_data:
            self.followed = FOLLOWED
        elif read.times:
            self.followed = Followed()
        built = self._build(module, read, settings)
        memory.look()
        tree = self._keep(read, built)

        first = read.scene, built.session.render_scene
        later = [self._build_set(module, scene, settings, built.spec, first).session for scene in read.times]
        # The next frame's structure is fitted to the last one of its triangles.
        if later and self.scene.render.use_persistent_data:
            _kept.extend(_structures(later[-1]))
        job = self._trace(settings, read, built, later)
        if settings.record_rays:
            reports.RECORDED.keep(self.scene, reports.Recorded(job.recorded(), read.scene.geometry.origin))
        self._report(job, read, built, tree, memory.bytes)
        self._warn()

    def _read(self, settings: RenderSettings) -> stages.Read:
        """The scene and its camera. Raises the exceptions of extraction."""
        start, moment = time.perf_counter(), trees.moment(self.scene)
        quality.remark_unknown(self.group, self.notes)
        uvs = "UV" in settings.passes
        standing = Standing()
        vectors = self._motion() if "Vector" in settings.passes else None
        found = self._find(uvs, self.notes, standing)
        # Look at what moves, which the choice of the layout needs.
        read_cameras = partial(cameras.by_view, self.engine, self.depsgraph, np.zeros(3), Notes())
        times = moving.Times(self.engine, self.depsgraph, read_cameras, self._reading)
        later = partial(self._find, uvs, Notes(), standing)
        moves = times.look(found, later, self.notes)
        self._fetch()
        layout = found.layout(
            quality.instancing(self.group),
            integrator=quality.integrator(self.group),
            times=moves.times if moves.keys else 1,
        )

        def placed(found: extract.Found, origin: F64 | None = None) -> Scene:
            place = partial(found.instanced, top=quality.top(self.group)) if layout.two_level else found.flattened
            scene = place(uvs=uvs, origin=origin)
            return scene if vectors is None else replace(scene, motion=vectors.of(scene.geometry))

        scene = placed(found)
        origin = scene.geometry.origin
        views = cameras.by_view(self.engine, self.depsgraph, origin, self.notes)
        views = times.posed(moves, views, origin)

        def placed_later(other: extract.Found) -> Scene:
            return other.moved(scene) if layout.two_level and moves.keys else placed(other, origin)

        scenes = times.scenes(moves, placed_later, later)
        self._fetch()
        return stages.Read(scene, views, layout, moment, time.perf_counter() - start, found.made, vectors, scenes)

    def _find(self, uvs: bool, notes: Notes, standing: Standing) -> extract.Found:
        """The objects that the scene shows at the depsgraph's time."""
        wanted = replace(passes.wanted_data(self.depsgraph.view_layer_eval), standing=standing)
        return extract.find(self.depsgraph, notes, uvs=uvs, keep_going=self._reading, wanted=wanted)

    def _motion(self) -> motion.Motion:
        """The frames before and after. Evaluates the scene three times, the last time for this frame."""
        engine, depsgraph = self.engine, self.depsgraph
        found = motion.read(engine, depsgraph, lambda origin: cameras.by_view(engine, depsgraph, origin, Notes()))
        self._fetch()
        return found

    def _build(self, module: Any, read: stages.Read, settings: RenderSettings) -> stages.Built:
        """The structure of the settings, or the automatically chosen one, with the scene around it."""
        two_level = read.layout.two_level
        if self.group.automatic and read.scene.geometry.count and not two_level:
            built = self._build_chosen(module, read, settings)
        else:
            built = self._build_set(module, read.scene, settings)
            if self.group.automatic and two_level:
                built.reasons.append("as set: Choose for Me needs flattened instances, see Instances")
        session = built.session
        _kept[:] = _structures(session) if self.scene.render.use_persistent_data else []
        self._note_dropped(read.scene.geometry, session.statistics)
        return built

    def _build_set(
        self,
        module: Any,
        scene: Scene,
        settings: RenderSettings,
        spec: str | None = None,
        first: Shown | None = None,
    ) -> stages.Built:
        """Build the structure of the settings, or of this specification. first: the scene at another time."""
        spec = properties.spec(self.group) if spec is None else spec
        label = properties.structure(self.group).label
        properties.remark_unknown(self.group, self.notes)
        self._show_status(f"{label}: building over {scene.geometry.count:,} triangles")
        session = Session.start(
            module,
            scene,
            spec,
            threads=settings.threads,
            memory_limit=memory_limit(self.group.memory_limit),
            followed=self.followed,
            keep_going=self._building,
            first=first,
        )
        kept = session.done and self.followed is FOLLOWED
        reasons = [f"Persistent data: the structure was {session.done}"] if kept else []
        return stages.Built(session, spec, label, reasons)

    def _build_chosen(self, module: Any, read: stages.Read, settings: RenderSettings) -> stages.Built:
        """Choose the structure with the least predicted time, with the reasons and the number of compared answers."""
        seen = Notes()
        chosen = self._choose(module, read.scene, read.view, settings, seen)
        session = Session(module, read.scene.geometry, chosen.spec, structure=chosen.structure)
        session.show(read.scene)
        answers = chosen.comparison.lines[0].answers
        reasons = [*chosen.comparison.answer(comparing.name), *comparing.rest(chosen), *seen.lines()]
        return stages.Built(session, chosen.spec, comparing.name(chosen.spec), reasons, answers)

    def _keep(self, read: stages.Read, built: stages.Built) -> trees.Tree | None:
        """Keep the tree for the overlay, which can only show flattened geometry; None with instances."""
        if read.layout.two_level:
            trees.clear()
            return None
        structure, geometry = built.session.structure, read.scene.geometry
        return trees.keep(self.scene, structure, geometry, spec=built.spec, label=built.label, read=read.moment)

    def _trace(self, settings: RenderSettings, read: stages.Read, built: stages.Built, later: list[Session]) -> Any:
        """Render all views into a result that is shown coarse at once, then while it converges. Returns the last job,
        finished.

        later: sessions of the times that samples take in turn, if the scene moves.
        """
        self.result = Result(self.engine, self.depsgraph, settings.size)
        job = None
        for number, name in enumerate(self.result.views):
            self.engine.active_view_set(name)
            view = read.views.get(name, read.view)
            if read.motion is not None:
                view = replace(view, motion=read.motion.cameras(name, read.scene.geometry.origin))
            job = self._trace_view(settings, view, read, built, later, number)
        self.result.describe(read.scene)
        self.result.end()
        self.result = None
        return job

    def _trace_view(
        self,
        settings: RenderSettings,
        view: Camera,
        read: stages.Read,
        built: stages.Built,
        later: list[Session],
        number: int,
    ) -> Any:
        """Render one view of the open result. Returns the finished job."""
        assert self.result is not None
        result, (width, height), origin = self.result, settings.size, read.scene.geometry.origin
        first = self._show_coarse(settings, view, built, number) if is_displayed() else None
        job = built.session.render(view, settings, later)
        buffers = {name: np.empty(width * height * channels, np.float32) for name, channels in job.passes.items()}
        if first is not None:
            buffers["Combined"] = first

        def show() -> None:
            if is_displayed():
                copy(job, buffers, origin, keep=first is not None)
                result.fill(buffers, number)
                result.show()
            self._show_status(summary(built.label, built.session.statistics, job, built.answers))

        watch(job, milliseconds=UPDATE_MILLISECONDS, keep_going=self._tracing, show=show)
        copy(job, buffers, origin)
        if removes_noise(self.depsgraph):
            self._denoise(buffers, settings, read.scene)
        result.fill(buffers, number)
        return job

    def _show_coarse(self, settings: RenderSettings, view: Camera, built: stages.Built, number: int) -> F32 | None:
        """Show a view in large pixels. Returns the last such picture, flat; None if there was none."""
        assert self.result is not None
        last = None
        for last in coarse.pictures(built.session, view, settings, self._reading):
            self.result.fill({"Combined": last}, number)
            self.result.show()
        return last

    def _report(
        self, job: Any, read: stages.Read, built: stages.Built, tree: trees.Tree | None, peak: int | None
    ) -> None:
        """Report on the finished picture: in the status line, as Blender's memory use, and in the panel of the last
        render. peak: bytes that reading, build and render took together, where known.
        """
        session, count = built.session, read.scene.geometry.count
        # Update Blender's status and memory display.
        statistics = {**session.statistics, **job.statistics}
        self._show_status(summary(built.label, statistics, job, built.answers))
        if peak is not None:
            statistics["peak_bytes"] = peak
        used, most = (statistics.get(key, statistics["bytes"]) / 2**20 for key in ("bytes", "peak_bytes"))
        self.engine.update_memory_stats(memory_used=used, memory_peak=most)
        # Keep the report for the panels.
        left_out = [*session.statistics["left_out"], *session.left_out]
        remarks.remark(self.scene, self.depsgraph.view_layer_eval, count, self.notes)
        report = reports.Report(
            built.label,
            count,
            read.seconds,
            statistics,
            left_out,
            self.engine.noted(self.depsgraph, self.notes).lines(),
            built.reasons,
            built.answers,
            None if tree is None else tree.number,
            read.layout.reason,
            read.made,
        )
        reports.keep(self.scene, report)
        reports.KEPT.keep(self.scene, read.layout.two_level)

    def discard(self) -> None:
        """Close an open result without keeping its pixels."""
        if self.result is not None:
            self.result.end(cancel=True)
            self.result = None

    def _choose(self, module: Any, scene: Scene, view: Camera, settings: RenderSettings, seen: Notes) -> auto.Choice:
        """Choose a structure by the scene and the number of samples.

        seen: collects notes on the measured view.
        """
        width, height = settings.size
        plan = choice.Plan(width * height, settings.samples, settings.max_bounces)
        workload = workloads.of_scene(self.scene.name, scene, view, seen)
        limit = memory_limit(self.group.memory_limit)
        known = catalogue.load()
        specs, dropped = auto.candidates(known), auto.dropped(known)
        chooser = auto.Chooser(module, workload, plan, specs, settings.threads, limit, dropped)
        work = Background(chooser.steps(), lambda text: self._show_status(f"Choosing a structure: {text}"))
        try:
            while not work.wait(POLL_SECONDS):
                if not self._building(0.0):
                    raise Cancelled
        except BaseException:
            work.stop()
            raise
        assert chooser.result is not None, "the last step decides"
        return chooser.result

    def _reading(self) -> bool:
        """Whether to continue: neither the user nor the end of the extension stops the render."""
        return not running.closing() and not self.engine.test_break()

    def _building(self, progress: float) -> bool:
        """Show the progress of a build, 0 to 1. Returns whether to continue."""
        return self._going_on(BUILD_SHARE * progress)

    def _tracing(self, progress: float) -> bool:
        """Show the progress of the native render, 0 to 1. Returns whether to continue."""
        return self._going_on(BUILD_SHARE + (1 - BUILD_SHARE) * progress)

    def _going_on(self, done: float) -> bool:
        """Show the share of the picture that is done. Returns whether to continue."""
        self.engine.update_progress(done)
        for watcher in running.watchers:
            watcher(done)
        return self._reading()

    def _denoise(self, buffers: dict[str, F32], settings: RenderSettings, scene: Scene) -> None:
        """Remove the picture's noise. Without the library the noise stays, and a note gives the reason."""
        self._show_status("Removing the noise")
        try:
            shadows = any(material.catcher for material in scene.materials)
            denoising.apply(buffers, settings, self._reading, shadows=shadows)
        except denoise.DenoiseError as error:
            self.notes.add(f"The noise could not be removed: {error}", self.scene.name)

    def _note_dropped(self, geometry: Any, statistics: dict[str, Any]) -> None:
        """Note the instances and triangles that the native module dropped, by object."""
        for index in statistics.get("dropped_instances", ()):
            self.notes.add("Dropped, the transform is out of range", geometry.names[index])
        if statistics["dropped_triangles"]:
            for name, count in geometry.faulty_triangles().items():
                self.notes.add("Dropped triangles without area or with coordinates that are not finite", name, count)

    def _show_status(self, text: str) -> None:
        """Show a text in the status line of the render."""
        self.engine.update_stats("", text)

    def _warn(self) -> None:
        for line in self.notes.lines():
            log.warning(line)
            self.engine.report({"WARNING"}, line)


def _structures(session: Session) -> list[Any]:
    """The structure of a session and those of its meshes."""
    return [session.structure, *session.meshes]


def is_displayed() -> bool:
    """Whether somebody can watch the picture converge: not in the background."""
    return not bpy.app.background
