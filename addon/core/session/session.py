# SPDX-License-Identifier: GPL-3.0-or-later
"""Building a structure and rendering with it: long native work, observed from Python and cancelled on demand."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from ..scene.instances import InstancedGeometry
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


class _Work:
    """The work of a build's thread and its results. It holds no reference to its waiter, which may thus be freed."""

    def __init__(
        self, native: Native, spec: str, threads: int, memory_limit: int | None, followed: Followed | None
    ) -> None:
        self.structure: AnyStructure | None = None
        self.error: BaseException | None = None
        self.meshes: list[Structure] = []
        self.meshes_built = 0
        self.cancelled = False
        self.monitor = native.Monitor()
        self.part = (0.0, 1.0)
        self.done: list[str] = []
        self._followed = followed
        self._native, self._spec = native, spec
        self._options: BuildOptions = {"threads": threads, "memory_limit": memory_limit}

    def run(self, geometry: AnyGeometry, trees: Trees) -> None:
        """Build the structure, or those of all meshes and the tree over instances. Any exception is kept in `error`."""
        try:
            if isinstance(geometry, InstancedGeometry):
                self.meshes, self.meshes_built = trees.of(geometry, self._spec, self._build)
                self.structure = self._native.build_instances(
                    self.meshes, geometry.mesh, geometry.matrices, monitor=self.monitor, **self._options
                )
            else:
                self.structure = self._build(geometry, 0.0, 1.0)
        except BaseException as error:
            self.error = error

    def cancel(self) -> None:
        """Request the end of the work without waiting for it."""
        self.cancelled = True
        self.monitor.cancel()

    def _build(self, triangles: Geometry | Mesh, before: float, share: float) -> Structure:
        """Build one structure. before, share: progress at its start, and its part of the whole, both 0 to 1."""
        if before > 0:
            self.monitor = self._native.Monitor()
        self.part = (before, share)
        if self.cancelled:  # cancelled before this build or between two meshes
            self.monitor.cancel()
        # Fit the structure of the same triangles at other places, where one is in use.
        shape = b"" if self._followed is None else refits.topology(triangles)
        old = None if self._followed is None else self._followed.find(shape, self._spec)
        structure = None
        if old is not None:
            structure, done = refits.fitted(self._native, old, triangles, self._options["threads"], self.monitor)
            self.done.append(done)
        if structure is None:
            structure = self._native.build(
                triangles.vertices, triangles.triangles, self._spec, monitor=self.monitor, **self._options
            )
        if self._followed is not None:
            self._followed.keep(shape, self._spec, structure)
        return structure


class Building:
    """A structure that is being built on its own thread.

    For instances it is one structure per mesh, reused where known, and a tree over the instances. Deleting this object
    cancels the work, so every user of the structure keeps a reference.
    """

    def __init__(
        self,
        native: Native,
        geometry: AnyGeometry,
        spec: str,
        *,
        threads: int = 0,
        memory_limit: int | None = None,
        trees: Trees = TREES,
        followed: Followed | None = None,
    ) -> None:
        """Start to build `spec` over these triangles; 0 threads means one per core.

        memory_limit: bytes that the build may use; None for the native module's limit. trees: cache of the meshes'
        structures. followed: structures in use, which are fitted instead where only vertices moved; None = none are.
        """
        self.geometry = geometry
        self.spec = spec
        self.memory_limit = memory_limit
        self._work = work = _Work(native, spec, threads, memory_limit, followed)
        # Not a method of this class: the thread must not keep this object alive.
        self._thread = threading.Thread(target=work.run, args=(geometry, trees), name="halfspace-build", daemon=True)
        self._thread.start()

    def __del__(self) -> None:
        if hasattr(self, "_thread"):  # the constructor failed before the thread began
            self._work.cancel()

    @property
    def progress(self) -> float:
        """0 to 1."""
        before, share = self._work.part
        return before + share * float(self._work.monitor.progress)

    @property
    def meshes(self) -> list[Structure]:
        """The structures of the meshes of instances; keeping them lets the next build reuse them."""
        return self._work.meshes

    @property
    def meshes_built(self) -> int:
        """The number of those structures that were built anew."""
        return self._work.meshes_built

    @property
    def done(self) -> str:
        """What became of structures of the same triangles at other places: "refitted", or "rebuilt" with the reason; ""
        if there were none.
        """
        return ", ".join(dict.fromkeys(self._work.done))

    @property
    def usable(self) -> bool:
        """Whether the structure exists or is being built: neither failed nor cancelled."""
        return self._work.error is None and not self._work.cancelled

    def wait(self, seconds: float) -> bool:
        """Wait at most `seconds` for the end. Returns whether the work has ended."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def cancel(self) -> None:
        """Cancel the work and wait for its end, which the native module reaches within a tenth of a second."""
        self._work.cancel()
        self._thread.join()

    def result(self) -> AnyStructure:
        """The structure, after waiting for the end. Raises the native module's exception."""
        self._thread.join()
        if self._work.error is not None:
            raise self._work.error
        assert self._work.structure is not None, "the thread has ended without an error"
        return self._work.structure


def build(
    native: Native,
    geometry: AnyGeometry,
    spec: str,
    *,
    trees: Trees = TREES,
    followed: Followed | None = None,
    keep_going: KeepGoing,
    **options: Unpack[BuildOptions],
) -> Building:
    """Build the native structure `spec` over these triangles to the end, calling `keep_going` meanwhile.

    Raises Cancelled, or the native module's exceptions.
    """
    building = Building(native, geometry, spec, trees=trees, followed=followed, **options)
    try:
        while not building.wait(POLL_SECONDS):
            if not keep_going(building.progress):
                raise Cancelled
    except BaseException:  # also KeyboardInterrupt
        building.cancel()
        raise
    building.result()
    return building


def asdict_shallow(item: Any) -> dict[str, Any]:
    """The fields of a dataclass; unlike `asdict` it copies no array, so a million lights take seconds, not minutes."""
    return {entry.name: getattr(item, entry.name) for entry in fields(item)}


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
            "layers": list(geometry.layers),
            "objects": [asdict(frame) for frame in geometry.objects],
            "object_index": geometry.object_index,
        }
    if scene.grids:
        carried["grids"] = [asdict_shallow(grid) for grid in scene.grids]
    x, y, z = geometry.origin
    return {
        **carried,
        "materials": [material.as_dict() for material in scene.materials],
        "lights": [asdict_shallow(light) for light in scene.lights],
        "world": asdict_shallow(scene.world),
        "images": [image.as_dict() for image in scene.images],
        "indices": scene.for_passes(),
        "origin": (float(x), float(y), float(z)),
    }


LIGHT = re.compile(r"lights\[(\d+)\]")
"""Prefix of the native module's messages about a light."""


def render_scene(native: Native, structure: AnyStructure, scene: Scene) -> RenderScene:
    """The native `RenderScene` over this structure. Raises its exceptions, with the light's name where one is
    concerned.
    """
    try:
        return native.RenderScene(structure, **arguments(scene))
    except ValueError as error:
        about = LIGHT.match(str(error))
        name = scene.lights[int(about[1])].name if about is not None else ""
        if not name:
            raise
        raise type(error)(f"{name}: {error}") from error


@dataclass(frozen=True)
class Session:
    """A structure, and the scene around it in the native renderer's form."""

    native: Native
    structure: AnyStructure
    render_scene: RenderScene
    building: Building | None = None
    """The structure's build, if the session made it."""

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
        **options: Unpack[BuildOptions],
    ) -> Session:
        """Build the structure and pass on materials, lights and world. Raises as `build` does."""
        building = build(native, scene.geometry, spec, trees=trees, followed=followed, keep_going=keep_going, **options)
        return replace(cls.over(native, scene, building.result()), building=building)

    @classmethod
    def over(cls, native: Native, scene: Scene, structure: AnyStructure) -> Session:
        """A session over a finished structure of this scene."""
        return cls(native, structure, render_scene(native, structure, scene))

    @property
    def left_out(self) -> list[str]:
        """Features that are not computed because this scene lacks them, one reason per line."""
        return list(self.render_scene.left_out)

    def render(
        self,
        camera: Camera,
        settings: RenderSettings,
        times: Sequence[Session] = (),
        points: Mapping[str, Any] | None = None,
    ) -> RenderJob:
        """Start a native job for one picture and return it at once.

        times: sessions of the same scene at the times that samples take in turn, in place of this one; none: it stands
        still. points: of surfaces that the pixels show in place of what the camera sees, as the native module takes
        them.
        """
        scenes = [session.render_scene for session in times] or self.render_scene
        return self.native.render(scenes, camera.as_dict(), settings.as_dict(), threads=settings.threads, points=points)


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
