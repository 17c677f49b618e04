# SPDX-License-Identifier: GPL-3.0-or-later
"""Building a structure and rendering with it: long native work, watched from Python and stopped on demand."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from ..scene.instances import InstancedGeometry
from ..structures.trees import TREES, Trees

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..base.arrays import F32, I32
    from ..base.interface import AnyStructure, BuildOptions, Native, RenderJob, RenderScene, Structure
    from ..scene.instances import AnyGeometry, Mesh
    from ..scene.scene import Camera, Geometry, Scene
    from ..structures.settings import RenderSettings

POLL_SECONDS = 0.05
"""How often long work is looked at; a cancel is noticed after at most this time."""

KeepGoing = Callable[[float], bool]
"""Called with the progress 0..1; returns False to stop the work."""


class Cancelled(Exception):
    """The user stopped the work."""


class RenderError(RuntimeError):
    """The native renderer failed. The message is its own."""


class _Work:
    """What the thread of a build does, and what it leaves behind. It knows nobody who waits for it."""

    def __init__(self, native: Native, spec: str, threads: int, memory_limit: int | None) -> None:
        self.structure: AnyStructure | None = None
        self.error: BaseException | None = None
        self.meshes: list[Structure] = []
        self.meshes_built = 0
        self.cancelled = False
        self.monitor = native.Monitor()
        self.part = (0.0, 1.0)
        self._native, self._spec = native, spec
        self._options: BuildOptions = {"threads": threads, "memory_limit": memory_limit}

    def run(self, geometry: AnyGeometry, trees: Trees) -> None:
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
        self.cancelled = True
        self.monitor.cancel()

    def _build(self, triangles: Geometry | Mesh, before: float, share: float) -> Structure:
        if before > 0:
            self.monitor = self._native.Monitor()
        self.part = (before, share)
        if self.cancelled:  # now, or between two meshes
            self.monitor.cancel()
        return self._native.build(
            triangles.vertices, triangles.triangles, self._spec, monitor=self.monitor, **self._options
        )


class Building:
    """A structure that is being built on a thread of its own, so that the caller's thread stays free.

    Over instances it is a structure of each mesh, those that are known already taken as they are, and a tree over the
    places. Forgetting it stops the work, so whoever needs the structure keeps it; several may.
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
    ) -> None:
        """Begin to build `spec` over these triangles; 0 threads means one per core.

        memory_limit: bytes that the build may take; None leaves it to the native module. trees: of meshes.
        """
        self.geometry = geometry
        self.spec = spec
        self.memory_limit = memory_limit
        self._work = work = _Work(native, spec, threads, memory_limit)
        # Not a method of this class: the thread must not keep this object alive.
        self._thread = threading.Thread(target=work.run, args=(geometry, trees), name="halfspace-build", daemon=True)
        self._thread.start()

    def __del__(self) -> None:
        if hasattr(self, "_thread"):  # else it never began
            self._work.cancel()

    @property
    def progress(self) -> float:
        """0 to 1."""
        before, share = self._work.part
        return before + share * float(self._work.monitor.progress)

    @property
    def meshes(self) -> list[Structure]:
        """The structures of the meshes, of instances: whoever holds on to them spares the next build theirs."""
        return self._work.meshes

    @property
    def meshes_built(self) -> int:
        """How many of them were not known."""
        return self._work.meshes_built

    @property
    def usable(self) -> bool:
        """Whether the structure is there or still to come: neither failed nor stopped."""
        return self._work.error is None and not self._work.cancelled

    def wait(self, seconds: float) -> bool:
        """Wait at most so long for the end, whichever it is. Returns whether it has come."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def cancel(self) -> None:
        """Stop the work, and wait for that: at most the native module's tenth of a second."""
        self._work.cancel()
        self._thread.join()

    def result(self) -> AnyStructure:
        """The structure, after the end. Raises whatever the native module raised."""
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
    keep_going: KeepGoing,
    **options: Unpack[BuildOptions],
) -> Building:
    """The finished build of the native structure `spec` over these triangles; `keep_going` is asked meanwhile.

    Raises Cancelled, or whatever the native module raises.
    """
    building = Building(native, geometry, spec, trees=trees, **options)
    try:
        while not building.wait(POLL_SECONDS):
            if not keep_going(building.progress):
                raise Cancelled
    except BaseException:  # an interrupt from the keyboard too
        building.cancel()
        raise
    building.result()
    return building


def asdict_shallow(item: Any) -> dict[str, Any]:
    """The fields of a dataclass; unlike `asdict` it copies no array, so a million lights take seconds, not minutes."""
    return {entry.name: getattr(item, entry.name) for entry in fields(item)}


class SceneArguments(TypedDict, total=False):
    """The keyword arguments of the native `RenderScene`, as its text in the stub describes them."""

    material_index: I32 | None
    materials: list[dict[str, Any]]
    corner_normals: F32 | None
    surfaces: dict[str, Any]
    lights: list[dict[str, Any]]
    world: dict[str, Any]
    images: list[dict[str, Any]]
    layers: list[F32 | None]
    objects: list[dict[str, Any]]
    object_index: NDArray[np.uint32] | None
    origin: tuple[float, float, float]
    indices: dict[str, Any] | None


def arguments(scene: Scene) -> SceneArguments:
    """What the native `RenderScene` takes beside the structure."""
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
    x, y, z = geometry.origin
    return {
        **carried,
        "materials": [material.as_dict() for material in scene.materials],
        "lights": [asdict_shallow(light) for light in scene.lights],
        "world": asdict_shallow(scene.world),
        "images": [asdict_shallow(image) for image in scene.images],
        "indices": scene.for_passes(),
        "origin": (float(x), float(y), float(z)),
    }


LIGHT = re.compile(r"lights\[(\d+)\]")
"""How messages of the native module begin that are about a light."""


def render_scene(native: Native, structure: AnyStructure, scene: Scene) -> RenderScene:
    """The native `RenderScene` over this structure. Raises what it raises; an error about a light tells its name."""
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
    """A structure, and the scene around it in the form that the native renderer walks."""

    native: Native
    structure: AnyStructure
    render_scene: RenderScene
    building: Building | None = None
    """What the structure came from, where the session built it itself."""

    @classmethod
    def start(
        cls,
        native: Native,
        scene: Scene,
        spec: str,
        *,
        trees: Trees = TREES,
        keep_going: KeepGoing,
        **options: Unpack[BuildOptions],
    ) -> Session:
        """Build the structure and hand over materials, lights and world. Raises as `build` does."""
        building = build(native, scene.geometry, spec, trees=trees, keep_going=keep_going, **options)
        return replace(cls.over(native, scene, building.result()), building=building)

    @classmethod
    def over(cls, native: Native, scene: Scene, structure: AnyStructure) -> Session:
        """The same over a structure of this scene that is built already."""
        return cls(native, structure, render_scene(native, structure, scene))

    @property
    def left_out(self) -> list[str]:
        """What this scene lacks and therefore does not pay for, one reason per line."""
        return list(self.render_scene.left_out)

    def render(self, camera: Camera, settings: RenderSettings) -> RenderJob:
        """The running native job for one picture. Returns at once."""
        return self.native.render(self.render_scene, asdict(camera), settings.as_dict(), threads=settings.threads)


def watch(job: RenderJob, *, milliseconds: int, keep_going: KeepGoing, show: Callable[[], None]) -> None:
    """Wait for a job, calling `show` about every `milliseconds` while it works.

    `keep_going` is asked more often, so that a cancel never waits for a picture. Raises Cancelled or RenderError.
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
    except BaseException:  # an interrupt from the keyboard too
        job.cancel()
        job.wait(1000)
        raise
    if job.error is not None:
        raise RenderError(job.error)
    if job.cancelled:
        raise Cancelled
