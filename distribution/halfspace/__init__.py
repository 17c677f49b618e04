# SPDX-License-Identifier: GPL-3.0-or-later
"""Acceleration structures for ray tracing: build them, trace rays, compare their answers and times.

`build` takes arrays, lists and tensors on the CPU, and what it returns traces single rays and batches, and can be
pickled and saved. The compiled module `halfspace_native`, whose structures trace arrays alone, is loaded when it is
needed; that raises ImportError, in one sentence, if it cannot be loaded. `load`, `measure` and `table` are what the
command `halfspace bench` does. No Blender is needed; `register` adds the render engine to one that is running.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _compiled
from ._built import Instances, Monitor, Structure, build, build_instances, load_structure
from .core.base import native
from .core.measure import benchmark
from .core.measure.preparation import Options
from .core.measure.rows import Row, agrees
from .core.report import tables
from .core.scene.workload import View, Workload, WorkloadError
from .core.structures import specs
from .lab.bench import mesh_files

if TYPE_CHECKING:
    from halfspace_native import (
        Cancelled,
        Hits,
        NonFiniteError,
        RefitError,
        ShapeError,
        SpecError,
        exact_closest,
        free_memory,
        level,
        structures,
    )

__all__ = [
    "Cancelled",
    "Hits",
    "Instances",
    "Monitor",
    "NonFiniteError",
    "Options",
    "RefitError",
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
    "load_structure",
    "measure",
    "register",
    "structures",
    "table",
    "unregister",
]

__version__ = native.VERSION

if not TYPE_CHECKING:  # a type checker would take every name for one of this function's

    def __getattr__(name: str) -> Any:
        """A name of the compiled module. Raises ImportError if the module cannot be loaded."""
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(_compiled.module(), name)


def __dir__() -> list[str]:
    """All names, those of the compiled module too, which need not be loaded for this."""
    return sorted({*globals(), *__all__})


def load(path: str | Path) -> Workload:
    """The triangles and the view of a file: .npz, .ply, .stl or .obj.

    Only .npz has a view of its own; the others are seen entirely. Raises WorkloadError, in one line, and ImportError
    if the compiled module cannot be loaded.
    """
    return mesh_files.bare(Path(path), _compiled.module().free_memory())


def expand(text: str) -> list[str]:
    """The configurations that a text stands for, such as `kd,bsp-wn:k=3..5` or `all`, each proved by a tiny build.

    Raises ValueError, which names what is not understood, and ImportError as `load`.
    """
    module = _compiled.module()
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
    configuration that is not understood, and ImportError as `load`.
    """
    chosen = expand(configurations if isinstance(configurations, str) else ",".join(configurations))
    return list(benchmark.measure(_compiled.module(), scene, chosen, options or Options(), say))


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
