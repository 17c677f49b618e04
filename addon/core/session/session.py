# SPDX-License-Identifier: GPL-3.0-or-later
"""Building a structure and rendering with it: long native work, observed from Python and cancelled on demand."""

from __future__ import annotations

import re
import threading
import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from ..base.equality import same
from ..scene.instances import InstancedGeometry
from ..scene.scene import shallow
from ..structures.trees import TREES, Trees
from . import refits

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..base.arrays import F32, I32
    from ..base.interface import AnyStructure, BuildOptions, Native, RenderJob, RenderScene, Structure
    from ..scene.instances import AnyGeometry, Mesh
    from ..scene.scene import Camera, Geometry, Scene
    from ..structures.settings import RenderSettings
    from .refits import Followed

POLL_SECONDS = 0.05
"""Interval of progress checks in seconds; a cancel takes effect after at most this time."""

KeepGoing = Callable[[float], bool]
"""Called with the progress 0..1; returns False to stop the work."""


class Cancelled(Exception):
    """The user cancelled the work."""


class RenderError(RuntimeError):
    """The native renderer failed. The message is its own."""


class Session:
    """A structure that is built on its own thread, and the scene around it in the native renderer's form.

    For instances it is one structure per mesh, reused where known, and a tree over the instances. Deleting this object
    cancels the build, so every user of the structure keeps a reference.

    meshes: the structures of the meshes; keeping them lets the next build reuse them. meshes_built: number of those
    that were built anew. render_scene: made by `show`.
    """

    render_scene: RenderScene

    def __init__(
        self,
        native: Native,
        geometry: AnyGeometry,
        spec: str,
        *,
        trees: Trees = TREES,
        followed: Followed | None = None,
        structure: AnyStructure | None = None,
        **options: Unpack[BuildOptions],
    ) -> None:
        """Start to build `spec` over these triangles.

        trees: cache of the meshes' structures. followed: structures in use, which are fitted instead where only
        vertices moved; None = none are. structure: a finished one, which is used in place of a build.
        """
        self.native, self.geometry, self.spec = native, geometry, spec
        self.memory_limit = options.get("memory_limit")
        self.meshes: list[Structure] = []
        self.meshes_built = 0
        self._mesh_seconds = 0.0
        self._structure = structure
        self._error: BaseException | None = None
        self._cancelled = False
        self._monitor = native.Monitor()
        self._part = (0.0, 1.0)
        self._done: list[str] = []
        self._followed = followed
        self._options: BuildOptions = {"threads": options.get("threads", 0), "memory_limit": self.memory_limit}
        # Run on a proxy, which does not keep this object alive.
        work = (weakref.proxy(self), geometry, trees)
        self._thread = threading.Thread(target=Session._run, args=work, name="halfspace-build", daemon=True)
        if structure is None:
            self._thread.start()

    def __del__(self) -> None:
        if hasattr(self, "_thread"):  # the constructor failed before the thread began
            self._stop()

    @classmethod
    def start(
        cls,
        native: Native,
        scene: Scene,
        spec: str,
        *,
        trees: Trees = TREES,
        followed: Followed | None = None,
        keep_going: KeepGoing,
        first: Shown | None = None,
        **options: Unpack[BuildOptions],
    ) -> Session:
        """Build the structure to the end, calling `keep_going` meanwhile, and pass on materials, lights and world.
        first: as for `render_scene`.

        Raises Cancelled, or as `show` does.
        """
        session = cls(native, scene.geometry, spec, trees=trees, followed=followed, **options)
        try:
            while not session.wait(POLL_SECONDS):
                if not keep_going(session.progress):
                    raise Cancelled
        except BaseException:  # also KeyboardInterrupt
            session.cancel()
            raise
        session.show(scene, first)
        return session

    def show(self, scene: Scene, first: Shown | None = None) -> None:
        """Put a scene of the same triangles around the structure, after waiting for it. first: as for `render_scene`.
        Raises as `structure` and `render_scene` do.
        """
        self.render_scene = render_scene(self.native, self.structure, scene, first)

    @property
    def progress(self) -> float:
        """0 to 1."""
        before, share = self._part
        return before + share * float(self._monitor.progress)

    @property
    def done(self) -> str:
        """The reuse of structures of the same triangles at other positions: "refitted", or "rebuilt" with the reason;
        "" if there were none.
        """
        return ", ".join(dict.fromkeys(self._done))

    @property
    def usable(self) -> bool:
        """Whether the structure exists or is being built: neither failed nor cancelled."""
        return self._error is None and not self._cancelled

    @property
    def structure(self) -> AnyStructure:
        """The structure, after waiting for the end of its build. Raises the native module's exception."""
        self.wait()
        if self._error is not None:
            raise self._error
        assert self._structure is not None, "the build has ended without an error"
        return self._structure

    @property
    def statistics(self) -> dict[str, Any]:
        """Those of the structure; with the seconds of the meshes' structures that were built for it."""
        found: dict[str, Any] = dict(self.structure.statistics)
        return {**found, "build_seconds": found["build_seconds"] + self._mesh_seconds}

    @property
    def left_out(self) -> list[str]:
        """Features that are not computed because this scene lacks them, one reason per line."""
        return list(self.render_scene.left_out)

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for the end of the build, at most `seconds`. Returns whether it has ended."""
        if self._thread.is_alive():
            self._thread.join(seconds)
        return not self._thread.is_alive()

    def cancel(self) -> None:
        """Cancel the build and wait for its end, which the native module reaches within a tenth of a second."""
        self._stop()
        self.wait()

    def render(
        self,
        camera: Camera,
        settings: RenderSettings,
        times: Sequence[Session] = (),
        points: Mapping[str, Any] | None = None,
    ) -> RenderJob:
        """Start a native job for one picture and return it at once.

        times: sessions of the same scene at the times that samples take in turn, in place of this one; none: it does
        not move. points: of surfaces that the pixels show in place of what the camera sees, as the native module takes
        them.
        """
        scenes = [session.render_scene for session in times] or self.render_scene
        return render(self.native, scenes, camera, settings, points)

    def _stop(self) -> None:
        self._cancelled = True
        self._monitor.cancel()

    def _run(self, geometry: AnyGeometry, trees: Trees) -> None:
        """Build the structure, or those of all meshes and the tree over instances. Any exception is kept."""
        build = partial(Session._build, self)  # a method of the proxy would be one of the session
        try:
            if isinstance(geometry, InstancedGeometry):
                started = time.perf_counter()
                self.meshes, self.meshes_built = trees.of(geometry, self.spec, build)
                self._mesh_seconds = time.perf_counter() - started
                self._structure = self.native.build_instances(
                    self.meshes,
                    geometry.mesh,
                    geometry.matrices,
                    top=geometry.top,
                    monitor=self._monitor,
                    **self._options,
                )
            else:
                self._structure = build(geometry, 0.0, 1.0)
        except BaseException as error:
            with suppress(ReferenceError):  # the session was deleted meanwhile
                self._error = error

    def _build(self, triangles: Geometry | Mesh, before: float, share: float) -> Structure:
        """Build one structure. before, share: progress at its start, and its part of the whole, both 0 to 1."""
        if before > 0:
            self._monitor = self.native.Monitor()
        self._part = (before, share)
        if self._cancelled:  # cancelled before this build or between two meshes
            self._monitor.cancel()
        # Fit the structure of the same triangles at other places, where one is in use.
        shape = b"" if self._followed is None else refits.topology(triangles)
        old = None if self._followed is None else self._followed.find(shape, self.spec)
        structure = None
        if old is not None:
            structure, done = refits.fitted(self.native, old, triangles, self._options["threads"], self._monitor)
            self._done.append(done)
        if structure is None:
            structure = self.native.build(
                triangles.vertices, triangles.triangles, self.spec, monitor=self._monitor, **self._options
            )
        if self._followed is not None:
            self._followed.keep(shape, self.spec, structure)
        return structure


class SceneArguments(TypedDict, total=False):
    """The keyword arguments of the native `RenderScene`, documented in its stub."""

    material_index: I32 | None
    materials: list[dict[str, Any]]
    corner_normals: F32 | None
    surfaces: dict[str, Any]
    lights: list[dict[str, Any]]
    world: dict[str, Any]
    images: list[dict[str, Any]]
    layers: list[F32 | None]
    objects: list[dict[str, Any]]
    grids: list[dict[str, Any]]
    object_index: NDArray[np.uint32] | None
    origin: tuple[float, float, float]
    indices: dict[str, Any] | None
    like: RenderScene


Shown = tuple["Scene", "RenderScene"]
"""A scene in both forms."""


def arguments(scene: Scene) -> SceneArguments:
    """The arguments of the native `RenderScene` except the structure."""
    # Pass either instances with their surfaces, or flattened triangles with their attributes.
    geometry = scene.geometry
    carried: SceneArguments
    if isinstance(geometry, InstancedGeometry):
        carried = {"surfaces": geometry.surfaces()}
    else:
        carried = {
            "material_index": geometry.material_index,
            "corner_normals": geometry.corner_normals,
            "object_index": geometry.object_index,
        }
    if scene.grids:
        carried["grids"] = [shallow(grid) for grid in scene.grids]
    x, y, z = geometry.origin
    return {
        **carried,
        "layers": list(geometry.layers),
        "objects": [shallow(frame) for frame in geometry.objects],
        "materials": [material.as_dict() for material in scene.materials],
        "lights": [shallow(light) for light in scene.lights],
        "world": shallow(scene.world),
        "images": [image.as_dict() for image in scene.images],
        "indices": scene.for_passes(),
        "origin": (float(x), float(y), float(z)),
    }


LIGHT = re.compile(r"lights\[(\d+)\]")
"""Prefix of the native module's messages about a light."""


def _later(scene: Scene, first: Shown) -> SceneArguments:
    """The arguments of the native `RenderScene` for a scene at another time: without what it shares with the first."""
    given, (before, shown) = arguments(scene), first
    images = same(scene.images, before.images)
    shared = {
        "materials": same(scene.materials, before.materials),
        "images": images,
        "layers": same(scene.geometry.layers, before.geometry.layers),
        "world": images and same(scene.world, before.world),
        "indices": same(_of_passes(scene), _of_passes(before)),
    }
    for name, alike in shared.items():
        if alike:
            given.pop(name)  # type: ignore[misc]
    if not shared["indices"] and given["indices"] is None:
        given["indices"] = scene.numbers.arrays(scene.geometry.runs())
    if isinstance(scene.geometry, InstancedGeometry) and isinstance(before.geometry, InstancedGeometry):
        pairs = zip(scene.geometry.meshes, before.geometry.meshes, strict=False)
        alike = len(scene.geometry.meshes) == len(before.geometry.meshes)
        if alike and all(same((a.slots, a.corner_normals), (b.slots, b.corner_normals)) for a, b in pairs):
            given["surfaces"].pop("meshes")
    return {**given, "like": shown}


def _of_passes(scene: Scene) -> tuple[Any, ...]:
    """What `Scene.for_passes` depends on."""
    geometry = scene.geometry
    return geometry.runs(), scene.numbers, geometry.uvs, scene.mattes, scene.motion


def render_scene(native: Native, structure: AnyStructure, scene: Scene, first: Shown | None = None) -> RenderScene:
    """The native `RenderScene` over this structure. first: the same scene at another time, with which it shares what
    does not differ. Raises its exceptions, with the light's name where one is concerned.
    """
    try:
        return native.RenderScene(structure, **(arguments(scene) if first is None else _later(scene, first)))
    except ValueError as error:
        about = LIGHT.match(str(error))
        name = scene.lights[int(about[1])].name if about is not None else ""
        if not name:
            raise
        raise type(error)(f"{name}: {error}") from error


def render(
    native: Native,
    scenes: RenderScene | list[RenderScene],
    camera: Camera,
    settings: RenderSettings,
    points: Mapping[str, Any] | None = None,
) -> RenderJob:
    """Start a native job for one picture, see `Session.render`."""
    return native.render(scenes, camera.as_dict(), settings.as_dict(), threads=settings.threads, points=points)


def watch(job: RenderJob, *, milliseconds: int, keep_going: KeepGoing, show: Callable[[], None]) -> None:
    """Wait for a job, calling `show` about every `milliseconds` while it works.

    `keep_going` is called more often, so that a cancel never waits for a picture. Raises Cancelled or RenderError.
    """
    step = max(1, round(POLL_SECONDS * 1000))
    elapsed = 0
    try:
        while not job.wait(step):
            if not keep_going(job.progress):
                raise Cancelled
            elapsed += step
            if elapsed >= milliseconds:
                elapsed = 0
                show()
    except BaseException:  # also KeyboardInterrupt
        job.cancel()
        job.wait(1000)
        raise
    if job.error is not None:
        raise RenderError(job.error)
    if job.cancelled:
        raise Cancelled
