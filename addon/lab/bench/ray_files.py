# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray sets in archives of NumPy: the user's own, and those recorded from a render.

A set has the keys `origins` and `directions`, (n, 3), and, where wanted, `t_min` and `t_max`, (n,) or one number for
all (0 and infinity without), and `any`, whether any hit answers its rays. With several sets in one file each key begins
with a set's name, as in `diffuse 1/origins`. The point `origin` (3,), zero without, is added to the origins of all
sets: rays of a render are in the frame of its scene, and rounded there.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base.arrays import F32, F64
from ...core.scene.rays import RaySet
from ...core.scene.workload import Workload, WorkloadError, naming, numbers, read_archive, real

if TYPE_CHECKING:
    from numpy.typing import NDArray

SUFFIX = ".npz"

KEYS = ("origins", "directions")
"""Keys that each set needs."""

KNOWN = (*KEYS, "t_min", "t_max", "any", "traced")
"""All keys of a set. `traced` is the number of rays among which those of a recorded set were chosen."""

ORIGIN = "origin"
"""The key of a file's own point."""

COPIES = 4
"""Number of copies in f32 and f64 that exist while a file is read."""


@dataclass(frozen=True, eq=False)
class Given:
    """A ray set of a file, and the (3,) point to which its origins are relative."""

    rays: RaySet
    origin: F64

    def seen_from(self, origin: F64) -> RaySet:
        """The rays relative to another point."""
        offset = self.origin - origin
        if not offset.any():
            return self.rays
        return replace(self.rays, origins=(self.rays.origins + offset).astype(np.float32))


def load(files: Mapping[Path, Sequence[str]], memory_limit: int) -> tuple[Given, ...]:
    """The named ray sets of each file, or all where none is named. Each is called as in its file, one without a name as
    its file; with several files the file's name precedes it.

    memory_limit: bytes that reading may use. Raises WorkloadError.
    """
    found = []
    for path, wanted in files.items():
        origin, sets = _sets(path, memory_limit)
        if unknown := [name for name in wanted if name not in sets]:
            raise WorkloadError(f"{path}: there is no ray set {unknown[0]!r}; there are {', '.join(sets)}")
        for name in wanted or sets:
            one = sets[name]
            label = f"{path.stem} {name}" if name and len(files) > 1 else name or path.stem
            # Names are shown in reports, where they are a part of pages and of file names.
            found.append(Given(replace(one, name=re.sub(r"[^\w .-]", "_", label)[:40]), origin))
    names = [one.rays.name for one in found]
    if twice := [name for name in names if names.count(name) > 1]:
        raise WorkloadError(f"{path}: two ray sets are called {twice[0]!r}")
    return tuple(found)


def added(workload: Workload, given: Sequence[Given]) -> Workload:
    """The scene with these rays as further ray sets. Raises WorkloadError."""
    own = (one.seen_from(workload.origin()) for one in given)
    return replace(workload, extra=(*workload.extra, *own))


def packed(sets: Mapping[str, Mapping[str, Any]], origin: F64) -> bytes:
    """An archive of recorded sets by name, each as `RenderJob.recorded` returns it. origin: of the scene frame."""
    written = io.BytesIO()
    arrays: dict[str, Any] = {f"{name}/{key}": value for name, one in sets.items() for key, value in one.items()}
    arrays[ORIGIN] = origin
    np.savez_compressed(written, **arrays)
    return written.getvalue()


def _sets(path: Path, memory_limit: int) -> tuple[F64, dict[str, RaySet]]:
    """The origin of a file, and its sets by their names in it, "" for one without a name. Raises WorkloadError."""

    def choose(there: Sequence[str]) -> Sequence[str]:
        of_sets = [key for key in there if key != ORIGIN]
        unknown = [key for key in of_sets if key.rpartition("/")[2] not in KNOWN]
        if unknown:
            known = ", ".join((*KNOWN, ORIGIN))
            raise WorkloadError(f"{path}: the key {unknown[0]!r} is unknown; there are {known}")
        prefixes = dict.fromkeys("".join(key.rpartition("/")[:2]) for key in of_sets) or {"": None}
        missing = [prefix + key for prefix in prefixes for key in KEYS if prefix + key not in there]
        if missing:
            raise WorkloadError(f"{path}: the key {missing[0]!r} is missing")
        return there

    arrays = read_archive(path, choose, memory_limit // COPIES)
    origin = arrays.pop(ORIGIN, np.zeros(3))
    sets: dict[str, dict[str, Any]] = {}
    for key, array in arrays.items():
        prefix, _, name = key.rpartition("/")
        sets.setdefault(prefix, {})[name] = array
    with naming(path):
        checked = {name: _checked(f"{name}/" if name else "", one) for name, one in sets.items()}
        return numbers(origin, ORIGIN, 3), checked


def _checked(prefix: str, arrays: Mapping[str, Any]) -> RaySet:
    """The rays in these arrays, from their `t_min` on: other tracers have no such limit. Raises WorkloadError."""
    # Check shapes and values, in the precision of all tracers.
    origins, directions = (_numbers(arrays[key], prefix + key) for key in KEYS)
    for key, one in zip(KEYS, (origins, directions), strict=True):
        if one.ndim != 2 or one.shape[1] != 3:
            raise WorkloadError(f"{prefix}{key}: expected shape (n, 3), got {one.shape}")
        if not np.isfinite(one).all():
            raise WorkloadError(f"{prefix}{key}: ray {_first(~np.isfinite(one).all(axis=1)):,} is not finite in f32")
    if len(origins) != len(directions) or not len(origins):
        raise WorkloadError(
            f"{prefix}directions: expected one for each of the {len(origins):,} origins, got {len(directions):,}"
            if len(origins) or len(directions)
            else f"{prefix}origins: there are no rays"
        )
    if not (moving := directions.any(axis=1)).all():
        raise WorkloadError(f"{prefix}directions: ray {_first(~moving):,} has none")
    starts = _limits(arrays.get("t_min", 0.0), prefix + "t_min", len(origins))
    ends = _limits(arrays.get("t_max", np.inf), prefix + "t_max", len(origins))
    if not (valid := np.isfinite(starts) & (starts <= ends)).all():
        row = _first(~valid)
        raise WorkloadError(
            f"{prefix}t_min: expected a finite number of at most t_max, got {starts[row]:g} and {ends[row]:g} "
            f"for ray {row:,}"
        )
    any_hit = np.asarray(arrays.get("any", False))
    if any_hit.shape != () or any_hit.dtype.kind not in "biu" or any_hit not in (0, 1):
        raise WorkloadError(f"{prefix}any: expected one truth value for all rays, got {any_hit.dtype} {any_hit.shape}")
    # Move the origins to t_min.
    if starts.any():
        moved = origins.astype(np.float64) + starts.astype(np.float64)[:, None] * directions
        with np.errstate(over="ignore"):
            origins, ends = moved.astype(np.float32), (ends.astype(np.float64) - starts).astype(np.float32)
        if not (inside := np.isfinite(origins).all(axis=1)).all():
            raise WorkloadError(f"{prefix}t_min: ray {_first(~inside):,} begins beyond the numbers of f32")
    return RaySet("", origins, directions, ends, any_hit=bool(any_hit))


def _numbers(array: Any, key: str) -> F32:
    """The array as f32. Raises WorkloadError."""
    with np.errstate(over="ignore"):  # values beyond f32 become infinite
        return np.ascontiguousarray(real(array, key), np.float32)


def _limits(array: Any, key: str, count: int) -> F32:
    """One limit for each ray. Raises WorkloadError."""
    found = real(np.asarray(array), key)
    if found.shape not in ((), (count,)):
        raise WorkloadError(f"{key}: expected one number for each of {count:,} rays, got shape {found.shape}")
    if (missing := np.isnan(found)).any():
        raise WorkloadError(f"{key}: ray {_first(np.atleast_1d(missing)):,} has no number")
    return _numbers(np.broadcast_to(found, count), key)


def _first(mask: NDArray[np.bool_]) -> int:
    """The first row where it is true."""
    return int(np.flatnonzero(mask)[0])
