# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled module with one structure that gives a wrong answer, which every check must notice."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import halfspace_native
import numpy as np

from addon.core.measure.accuracy import Answers


def altered(**changes: Any) -> Any:
    """The module with other functions in place of some."""
    return SimpleNamespace(**{**vars(halfspace_native), **changes})


LIES = ("false_miss", "false_hit", "wrong_triangle", "wrong_values", "wrong_any_hit", "late")
"""Kinds of wrong answers. late: the distance is one unit in the last place too large."""


class Lying:
    """A structure whose answer to one ray is wrong, in the way that `lie` (one of LIES) names."""

    def __init__(self, structure: Any, lie: str) -> None:
        self._structure = structure
        self._lie = lie

    def __getattr__(self, name: str) -> Any:
        return getattr(self._structure, name)

    def closest(self, *arguments: Any, **options: Any) -> Any:
        hits = self._structure.closest(*arguments, **options)
        if options.get("counters"):
            return hits
        answers = Answers.of(hits)
        t, triangle, u = answers.t.copy(), answers.triangle.copy(), answers.u.copy()
        first_hit = int(np.argmax(answers.hit)) if answers.hit.any() else None
        if self._lie == "false_miss" and first_hit is not None:
            t[first_hit], triangle[first_hit] = np.inf, -1
        elif self._lie == "false_hit" and not answers.hit.all():
            miss = int(np.argmin(answers.hit))
            t[miss], triangle[miss] = 1.0, 0
        elif self._lie == "wrong_triangle" and first_hit is not None:
            triangle[first_hit] ^= 1
        elif self._lie == "wrong_values" and first_hit is not None:
            u[first_hit] = np.nextafter(u[first_hit], np.float32(2))
        elif self._lie == "late" and first_hit is not None:
            t[first_hit] = np.nextafter(t[first_hit], np.float32(np.inf))
        return Answers(t, triangle, u, answers.v)

    def occluded(self, *arguments: Any, **options: Any) -> Any:
        found = self._structure.occluded(*arguments, **options)
        if self._lie == "wrong_any_hit" and not options.get("counters") and len(found):
            found = found.copy()
            found[0] = ~found[0]
        return found


class LyingNative:
    """The module, whose builds of `spec` on `threads` threads lie: those of the benchmark, not of the ray maker."""

    def __init__(self, lie: str, spec: str = "kd", threads: int = 1) -> None:
        self._lie = lie
        self._lying_build = spec, threads

    def __getattr__(self, name: str) -> Any:
        return getattr(halfspace_native, name)

    def build(self, vertices: Any, triangles: Any, spec: str, *, threads: int = 0, **options: Any) -> Any:
        structure = halfspace_native.build(vertices, triangles, spec, threads=threads, **options)
        return Lying(structure, self._lie) if (spec, threads) == self._lying_build else structure
