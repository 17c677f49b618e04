# SPDX-License-Identifier: GPL-3.0-or-later
"""The native module as types: the module itself, and anything that traces rays as its structures do.

Classes and dictionaries of the module are declared in its stub, `native/python/halfspace_native/__init__.pyi`, alone.
Other modules import them from here under TYPE_CHECKING. The last line lets a type checker compare `Native` with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypedDict

if TYPE_CHECKING:
    import halfspace_native
    import numpy as np
    from halfspace_native import (
        BeamPath,
        Case,
        Hits,
        Instances,
        LeafCells,
        Monitor,
        Parameter,
        RayPath,
        Recording,
        RenderJob,
        RenderScene,
        SplitPolygons,
        Statistics,
        Structure,
        StructureRow,
        Visits,
    )
    from numpy.typing import NDArray

    AnyStructure = Structure | Instances

    __all__ = [
        "AnyStructure",
        "BeamPath",
        "BuildOptions",
        "Case",
        "HitArrays",
        "Hits",
        "Instances",
        "LeafCells",
        "Monitor",
        "Native",
        "Order",
        "Parameter",
        "RayOptions",
        "RayPath",
        "Recording",
        "RenderJob",
        "RenderScene",
        "SplitPolygons",
        "Statistics",
        "Structure",
        "StructureRow",
        "Tracer",
        "Visits",
    ]

Order = Literal["none", "tile8"]
"""The promised order of rays: none, or that every 64 consecutive rays are a tile of 8×8 pixels."""


class RayOptions(TypedDict):
    """Options of `closest` and `occluded` that all measurements set. t_max: (n,) float32. threads: 0 = one per core."""

    t_max: NDArray[np.float32]
    order: Order
    threads: int


class BuildOptions(TypedDict, total=False):
    """Options of `build` and `build_instances`. threads: 0 = one per core. memory_limit: bytes, None = the module's."""

    threads: int
    memory_limit: int | None


class HitArrays(Protocol):
    """Nearest hits. t: (n,) float32, inf = miss. triangle: (n,) int32, -1 = miss. u, v: (n,) float32."""

    @property
    def t(self) -> NDArray[np.float32]: ...
    @property
    def triangle(self) -> NDArray[np.int32]: ...
    @property
    def u(self) -> NDArray[np.float32]: ...
    @property
    def v(self) -> NDArray[np.float32]: ...


class Tracer(Protocol):
    """A structure over triangles that traces rays: native, or the yardstick. Arguments as in the stub."""

    def closest(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        *,
        t_max: NDArray[np.float32] = ...,
        order: Order = ...,
        threads: int = ...,
    ) -> HitArrays: ...

    def occluded(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        *,
        t_max: NDArray[np.float32] = ...,
        order: Order = ...,
        threads: int = ...,
    ) -> NDArray[np.bool_]: ...


class Native(Protocol):
    """The module `halfspace_native`; functions, arguments and errors as in its stub."""

    __version__: str

    def __hash__(self) -> int: ...
    @property
    def __file__(self) -> str | None: ...
    @property
    def Monitor(self) -> type[Monitor]: ...  # noqa: N802 (the name in the module)
    @property
    def RefitError(self) -> type[ValueError]: ...  # noqa: N802 (the name in the module)
    @property
    def SpecError(self) -> type[ValueError]: ...  # noqa: N802 (the name in the module)
    @property
    def RenderScene(self) -> type[RenderScene]: ...  # noqa: N802 (the name in the module)

    def level(self) -> str: ...
    def use_level(self, level: str) -> None: ...
    def free_memory(self) -> int: ...
    def structures(self) -> list[StructureRow]: ...
    def count_events(self, function: Callable[[], object], names: Sequence[str]) -> dict[str, float]: ...
    def effective(self, spec: str) -> dict[str, int | float | str | None]: ...
    def options(self, spec: str) -> dict[str, list[str]]: ...
    def idle(self, spec: str) -> list[tuple[str, str]]: ...
    def cases(self, size: Literal["small", "large"] = "small", *, seed: int = 7) -> list[Case]: ...
    def ulp_distance(self, a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.int64]: ...

    def build(
        self,
        vertices: NDArray[np.float32],
        triangles: NDArray[np.int32],
        spec: str = "kd",
        *,
        threads: int = 0,
        monitor: halfspace_native.Monitor | None = None,
        memory_limit: int | None = None,
    ) -> Structure: ...

    def build_instances(
        self,
        structures: Sequence[Structure],
        mesh: NDArray[np.int32],
        matrices: NDArray[np.float64],
        *,
        top: str = "sah",
        threads: int = 0,
        monitor: halfspace_native.Monitor | None = None,
        memory_limit: int | None = None,
    ) -> Instances: ...

    def exact_closest(
        self,
        vertices: NDArray[np.float32],
        triangles: NDArray[np.int32],
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        *,
        t_min: NDArray[np.float32] | None = None,
        t_max: NDArray[np.float32] | None = None,
        threads: int = 0,
    ) -> Hits: ...

    def evaluate_program(self, request: Mapping[str, Any]) -> NDArray[np.float32]: ...

    def render(
        self,
        scene: halfspace_native.RenderScene | Sequence[halfspace_native.RenderScene],
        camera: Mapping[str, Any],
        settings: Mapping[str, Any],
        *,
        threads: int = 0,
        points: Mapping[str, Any] | None = None,
    ) -> RenderJob: ...


if TYPE_CHECKING:
    _stub: Native = halfspace_native
