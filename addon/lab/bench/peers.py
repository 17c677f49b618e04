# SPDX-License-Identifier: GPL-3.0-or-later
"""Other ray tracers as rows of the benchmark: those of the crate native/peers, which is built on demand, and Python
files.

A Python file has `build(vertices, triangles)`, which takes (n, 3) float32 and (m, 3) int32 and returns an object with
`closest(origins, directions, t_max)` and `occluded(origins, directions, t_max)` over (n, 3), (n, 3) and (n,) float32.
The first returns distances in lengths of the directions (inf for a miss), triangles (-1 for a miss), and the weights of
the second and third vertices, all (n,); the second an (n,) bool.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.native import first_line
from ...core.measure import yardstick
from ...core.measure.accuracy import Answers
from ..base.usage import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...core.scene.rays import RaySet

ROOT = Path(__file__).resolve().parents[3]

CRATE, TARGET = ROOT / "native" / "peers", ROOT / "build" / "peers"
"""The crate of the tracers and the folder in which cargo builds it."""

GROUPS = ("tinybvh", "obvhs", "bvh", "parry", "embree")
"""Beginnings of the names of the crate's tracers."""

MODULE = "halfspace_peers"

UNSAFE = {"tinybvh-bvh8": "tinybvh 1.6.8 reads outside of its nodes there"}
"""Beginnings of the names of tracers that crash on the grid of touching boxes, and how."""


class PeerError(ValueError):
    """A tracer refuses a scene, or what it returns is not an answer. The message gives the reason."""


class Peer(yardstick.Foreign):
    """A structure of the crate, whose rays are converted by a call of their own, outside of the timing."""

    def __init__(self, module: Any, name: str, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
        start = time.perf_counter()
        self._built = module.build(name, np.ascontiguousarray(vertices), np.ascontiguousarray(triangles))
        self.statistics = {"build_seconds": time.perf_counter() - start}

    def closest(self, origins: Any, directions: Any, *, t_max: Any = np.inf, **_: Any) -> Answers:
        """Nearest hits."""
        return Answers(*self._built.closest(self._rays(origins, directions, t_max)))

    def occluded(self, origins: Any, directions: Any, *, t_max: Any = np.inf, **_: Any) -> NDArray[np.bool_]:
        """(n,) bool: rays that hit anything."""
        found: NDArray[np.bool_] = self._built.occluded(self._rays(origins, directions, t_max))
        return found

    def timed(self, some: RaySet) -> Callable[[], Any]:
        """One call over the converted rays."""
        rays = self._rays(some.origins, some.directions, some.t_max)
        trace = self._built.occluded if some.any_hit else self._built.trace_closest
        return lambda: trace(rays)

    def _rays(self, origins: Any, directions: Any, t_max: Any) -> Any:
        ends = np.broadcast_to(np.asarray(t_max, np.float32), len(origins))
        return self._built.rays(*(np.ascontiguousarray(one, np.float32) for one in (origins, directions, ends)))


class OwnPeer(yardstick.Foreign):
    """A structure of a Python file. What it returns is checked for shape; its values are compared like all answers."""

    def __init__(self, module: Any, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
        start = time.perf_counter()
        self._built = module.build(vertices, triangles)
        self.statistics = {"build_seconds": time.perf_counter() - start}

    def closest(self, origins: Any, directions: Any, *, t_max: Any = np.inf, **_: Any) -> Answers:
        """Nearest hits. Raises PeerError for arrays of other shapes."""
        found = self._built.closest(origins, directions, _ends(origins, t_max))
        if not isinstance(found, tuple) or len(found) != 4:
            raise PeerError("closest returned no four arrays")
        kinds = (np.float32, np.int32, np.float32, np.float32)
        return Answers(*(_column(one, kind, len(origins)) for one, kind in zip(found, kinds, strict=True)))

    def occluded(self, origins: Any, directions: Any, *, t_max: Any = np.inf, **_: Any) -> NDArray[np.bool_]:
        """(n,) bool: rays that hit anything. Raises PeerError for an array of another shape."""
        found = self._built.occluded(origins, directions, _ends(origins, t_max))
        return _column(found, np.bool_, len(origins))

    def timed(self, some: RaySet) -> Callable[[], Any]:
        """One call of the file's function."""
        trace = self._built.occluded if some.any_hit else self._built.closest
        ends = _ends(some.origins, some.t_max)
        return lambda: trace(some.origins, some.directions, ends)


def _ends(origins: Any, t_max: Any) -> NDArray[np.float32]:
    return np.ascontiguousarray(np.broadcast_to(np.asarray(t_max, np.float32), len(origins)))


def _column(found: Any, kind: Any, count: int) -> NDArray[Any]:
    column = np.asarray(found)
    if column.shape != (count,) or not np.can_cast(column.dtype, kind, "same_kind"):
        raise PeerError(f"an array of shape {column.shape} and type {column.dtype} is no answer to {count} rays")
    return column.astype(kind)


def register(names: str, say: Callable[[str], None]) -> dict[str, str]:
    """Make the named tracers measurable. Returns the configuration and a description of each. Raises UsageError.

    names: of GROUPS or of single tracers, separated by commas, all, or paths of Python files.
    """
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    files = [name for name in wanted if name.endswith(".py")]
    found: dict[str, str] = {}
    if len(wanted) > len(files):
        module = _built(say)
        known = dict(module.names())
        if (reason := _use_embree(module)) is not None:
            say(f"Embree's packets are left out: {reason}")
            known = {name: told for name, told in known.items() if not name.startswith("embree")}
        for name in (one for one in wanted if one not in files):
            chosen = [one for one in known if name in ("all", one) or (name in GROUPS and one.split("-")[0] == name)]
            if not chosen:
                raise UsageError(f"--peers: no tracer is called {name}; there are {', '.join(known)}")
            found |= {yardstick.PEER + one: known[one] for one in chosen}
        for spec in found:
            name = spec.removeprefix(yardstick.PEER)
            yardstick.MAKERS[spec] = lambda v, t, name=name: Peer(module, name, v, t)  # type: ignore[misc]
            for start in filter(name.startswith, UNSAFE):
                yardstick.UNSAFE[spec] = UNSAFE[start]
    for name in files:
        own, spec = _own(Path(name)), yardstick.PEER + Path(name).stem.replace(":", "-")
        if spec in found:
            raise UsageError(f"--peers: two tracers are called {Path(name).stem}")
        yardstick.MAKERS[spec] = lambda v, t, own=own: OwnPeer(own, v, t)  # type: ignore[misc]
        found[spec] = name
    return found


def _own(path: Path) -> ModuleType:
    """The module of a Python file. Raises UsageError where it cannot be imported or has no `build`."""
    described = importlib.util.spec_from_file_location(f"peer_{path.stem}", path)
    assert described is not None, "the name ends with .py"
    assert described.loader is not None, "it is a file"
    module = importlib.util.module_from_spec(described)
    try:
        described.loader.exec_module(module)
    except Exception as error:
        raise UsageError(f"--peers: {path}: {first_line(error)}") from error
    if not callable(getattr(module, "build", None)):
        raise UsageError(f"--peers: {path}: has no function build(vertices, triangles)")
    return module


def _built(say: Callable[[str], None]) -> Any:
    """The module of the crate, built for this processor where it is not yet. Raises UsageError."""
    if not CRATE.is_dir() or shutil.which("cargo") is None:
        raise UsageError("--peers: needs a clone of the project and cargo, to build native/peers")
    say("building native/peers, where it has changed")
    # The crates choose their instructions when they are compiled: give them all of this processor.
    variables = {
        **os.environ,
        "RUSTFLAGS": "-Ctarget-cpu=native",
        "CARGO_TARGET_DIR": str(TARGET),
        "PYO3_PYTHON": sys.executable,
    }
    words = ["cargo", "build", "--release", "--locked"]
    if subprocess.run(words, cwd=CRATE, env=variables, check=False).returncode != 0:
        raise UsageError("--peers: native/peers cannot be built; cargo says why above")
    names = (f"lib{MODULE}.so", f"lib{MODULE}.dylib", f"{MODULE}.dll")
    library = next(path for path in (TARGET / "release" / name for name in names) if path.is_file())
    loader = importlib.machinery.ExtensionFileLoader(MODULE, str(library))
    described = importlib.util.spec_from_loader(MODULE, loader)
    assert described is not None, "a loader was given"
    module = importlib.util.module_from_spec(described)
    loader.exec_module(module)
    return module


def _use_embree(module: Any) -> str | None:
    """Give the crate the library of Embree that embreex brings. Returns the reason where there is none."""
    described = importlib.util.find_spec("embreex")
    if described is None or described.origin is None:
        return "embreex is not installed"
    folder = Path(described.origin).parent
    places = [path for place in ("../embreex.libs", ".", ".dylibs") for path in (folder / place).glob("*embree4*")]
    if not places:
        return "embreex brings no library of Embree"
    try:
        module.use_embree(str(places[0]))
    except RuntimeError as error:
        return first_line(error)
    return None
