# SPDX-License-Identifier: GPL-3.0-or-later
"""Acceleration structures for ray tracing: build them, trace rays, compare their answers and times.

`build` and all that traces come from the compiled module `halfspace_native`. `load`, `measure` and `table` are what the
command `halfspace bench` does. No Blender is needed; `register` adds the render engine to one that is running.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from halfspace_native import (
    Hits,
    Instances,
    NonFiniteError,
    ShapeError,
    SpecError,
    Structure,
    build,
    build_instances,
    exact_closest,
    free_memory,
    level,
    structures,
)

from .core.base import native
from .core.measure import benchmark
from .core.measure.preparation import Options
from .core.measure.rows import Row, agrees
from .core.report import tables
from .core.scene.workload import View, Workload, WorkloadError
from .core.structures import specs
from .lab.bench import mesh_files

__all__ = [
    "Hits",
    "Instances",
    "NonFiniteError",
    "Options",
    "Row",
    "ShapeError",
    "SpecError",
    "Structure",
    "View",
    "Workload",
    "WorkloadError",
    "agrees",
    "build",
    "build_instances",
    "exact_closest",
    "expand",
    "free_memory",
    "level",
    "load",
    "measure",
    "register",
    "structures",
    "table",
    "unregister",
]

__version__ = native.VERSION


def load(path: str | Path) -> Workload:
    """The triangles and the view of a file: .npz, .ply, .stl or .obj.

    Only .npz has a view of its own; the others are seen entirely. Raises WorkloadError, in one line.
    """
    return mesh_files.bare(Path(path), free_memory())


def expand(text: str) -> list[str]:
    """The configurations that a text stands for, such as `kd,bsp-wn:k=3..5` or `all`, each proved by a tiny build.

    Raises ValueError, which names what is not understood.
    """
    module = native.load()
    return specs.prove(module, specs.expand(text, module.structures(), {}))


def measure(
    scene: Workload,
    configurations: str | Sequence[str],
    options: Options | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> list[Row]:
    """Compare the answers of configurations with brute force, then time them in alternation; one row for each.

    configurations: a text as for `expand`, or their list. options: those of `Options` if None. say: called with the
    text of each step before it runs. `agrees` returns whether a row's answers equal brute force's, `errors` of the row
    holds what differs; a configuration that cannot be built has the reason in `error`. Raises ValueError for a
    configuration that is not understood.
    """
    chosen = expand(configurations if isinstance(configurations, str) else ",".join(configurations))
    return list(benchmark.measure(native.load(), scene, chosen, options or Options(), say))


def table(rows: Sequence[Row]) -> str:
    """Rows as text tables, one table for each way of tracing, with what their marks mean."""
    return tables.text(rows)


def register() -> None:
    """Add the render engine, its settings and its panels to the Blender that is running."""
    from . import blender

    blender.register()


def unregister() -> None:
    """Take away everything that `register` added."""
    from . import blender

    blender.unregister()
