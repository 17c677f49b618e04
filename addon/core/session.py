# SPDX-License-Identifier: GPL-3.0-or-later
"""Building a structure and rendering with it: long native work, watched from Python and stopped on demand."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .scene import Camera, Geometry, Scene
    from .settings import RenderSettings

POLL_SECONDS = 0.05
"""How often long work is looked at; a cancel is noticed after at most this time."""

KeepGoing = Callable[[float], bool]
"""Called with the progress 0..1; returns False to stop the work."""


class Cancelled(Exception):
    """The user stopped the work."""


class RenderError(RuntimeError):
    """The native renderer failed. The message is its own."""


class _Outcome:
    """What the thread of a build leaves behind."""

    structure: Any = None
    error: BaseException | None = None


class Building:
    """A structure that is being built on a thread of its own, so that the caller's thread stays free.

    Forgetting it stops the work, so whoever needs the structure keeps it; several may.
    """

    def __init__(
        self, native: Any, geometry: Geometry, spec: str, *, threads: int = 0, memory_limit: int | None = None
    ) -> None:
        """Begin to build `spec` over these triangles; 0 threads means one per core.

        memory_limit: bytes that the build may take; None leaves it to the native module.
        """
        self.geometry = geometry
        self.spec = spec
        self.memory_limit = memory_limit
        self._monitor = monitor = native.Monitor()
        self._outcome = outcome = _Outcome()

        # Not a method: the thread must not keep this object alive.
        def work() -> None:
            try:
                outcome.structure = native.build(
                    geometry.vertices,
                    geometry.triangles,
                    spec,
                    threads=threads,
                    monitor=monitor,
                    memory_limit=memory_limit,
                )
            except BaseException as error:
                outcome.error = error

        self._thread = threading.Thread(target=work, name="halfspace-build", daemon=True)
        self._thread.start()

    def __del__(self) -> None:
        if hasattr(self, "_thread"):  # else it never began
            self._monitor.cancel()

    @property
    def progress(self) -> float:
        """0 to 1."""
        return float(self._monitor.progress)

    @property
    def usable(self) -> bool:
        """Whether the structure is there or still to come: neither failed nor stopped."""
        return self._outcome.error is None and not self._monitor.cancelled

    def wait(self, seconds: float) -> bool:
        """Wait at most so long for the end, whichever it is. Returns whether it has come."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def cancel(self) -> None:
        """Stop the work, and wait for that: at most the native module's tenth of a second."""
        self._monitor.cancel()
        self._thread.join()

    def result(self) -> Any:
        """The structure, after the end. Raises whatever the native module raised."""
        self._thread.join()
        if self._outcome.error is not None:
            raise self._outcome.error
        return self._outcome.structure


def build(
    native: Any,
    geometry: Geometry,
    spec: str,
    *,
    threads: int = 0,
    memory_limit: int | None = None,
    keep_going: KeepGoing,
) -> Any:
    """The native structure `spec` over these triangles, built while `keep_going` is asked.

    Raises Cancelled, or whatever the native module raises.
    """
    building = Building(native, geometry, spec, threads=threads, memory_limit=memory_limit)
    while not building.wait(POLL_SECONDS):
        if not keep_going(building.progress):
            building.cancel()
            raise Cancelled
    return building.result()


@dataclass(frozen=True)
class Session:
    """A structure, and the scene around it in the form that the native renderer walks."""

    native: Any
    structure: Any
    render_scene: Any

    @classmethod
    def start(
        cls,
        native: Any,
        scene: Scene,
        spec: str,
        *,
        threads: int = 0,
        memory_limit: int | None = None,
        keep_going: KeepGoing,
    ) -> Session:
        """Build the structure and hand over materials, lights and world. Raises as `build` does."""
        structure = build(
            native, scene.geometry, spec, threads=threads, memory_limit=memory_limit, keep_going=keep_going
        )
        return cls.over(native, scene, structure)

    @classmethod
    def over(cls, native: Any, scene: Scene, structure: Any) -> Session:
        """The same over a structure of this scene that is built already."""
        geometry = scene.geometry
        render_scene = native.RenderScene(
            structure,
            material_index=geometry.material_index,
            materials=[asdict(material) for material in scene.materials],
            corner_normals=geometry.corner_normals,
            lights=[asdict(light) for light in scene.lights],
            world=asdict(scene.world),
        )
        return cls(native, structure, render_scene)

    @property
    def left_out(self) -> list[str]:
        """What this scene lacks and therefore does not pay for, one reason per line."""
        return list(self.render_scene.left_out)

    def render(self, camera: Camera, settings: RenderSettings) -> Any:
        """The running native job for one picture. Returns at once."""
        return self.native.render(self.render_scene, asdict(camera), settings.as_dict(), threads=settings.threads)


def watch(job: Any, *, milliseconds: int, keep_going: KeepGoing, show: Callable[[], None]) -> None:
    """Wait for a job, calling `show` about every `milliseconds` while it works.

    `keep_going` is asked more often, so that a cancel never waits for a picture. Raises Cancelled or RenderError.
    """
    step = max(1, round(POLL_SECONDS * 1000))
    elapsed = 0
    while not job.wait(step):
        if not keep_going(job.progress):
            job.cancel()
            job.wait(1000)
            raise Cancelled
        elapsed += step
        if elapsed >= milliseconds:
            elapsed = 0
            show()
    if job.error is not None:
        raise RenderError(job.error)
    if job.cancelled:
        raise Cancelled
