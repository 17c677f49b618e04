# SPDX-License-Identifier: GPL-3.0-or-later
"""Accuracy of hits: ray-by-ray comparison of a structure's hits with those of a reference."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ..base.arrays import F32
    from ..base.interface import HitArrays, Structure
    from ..scene.rays import RaySet

Mask = NDArray[np.bool_]

BOUNDARY = 2.0**-20
"""Largest value of a hit's smallest barycentric coordinate that counts as on the boundary, for tracers that do not
compute `on_boundary`.
"""

TIE = 2.0**-20
"""Relative distance within which hits on different triangles are a tie, for a reference that is not exact."""


@dataclass(frozen=True, eq=False)
class Answers:
    """Hits of n rays as arrays. t: (n,) float32, inf = miss; triangle: (n,) int32, -1 = miss; u, v: (n,) float32.

    on_boundary: (n,) bool, hits on an edge or a vertex of their triangle; None if the tracer does not compute it.
    """

    t: NDArray[np.float32]
    triangle: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    on_boundary: Mask | None = None

    @classmethod
    def of(cls, hits: HitArrays) -> Answers:
        """The arrays of the native `Hits`, each copied once."""
        return cls(hits.t, hits.triangle, hits.u, hits.v, getattr(hits, "on_boundary", None))

    def take(self, indices: NDArray[np.int64]) -> Answers:
        """The answers to the rays with these indices."""
        boundary = None if self.on_boundary is None else self.on_boundary[indices]
        return Answers(self.t[indices], self.triangle[indices], self.u[indices], self.v[indices], boundary)

    @property
    def hit(self) -> Mask:
        """(n,) bool: rays that hit a triangle."""
        return self.triangle >= 0

    def boundary(self) -> Mask:
        """(n,) bool: hits on an edge or vertex, as computed by the tracer, else from their barycentric coordinates."""
        if self.on_boundary is not None:
            return self.on_boundary
        smallest = np.minimum(np.minimum(self.u, self.v), 1.0 - self.u.astype(np.float64) - self.v)
        return self.hit & (smallest <= BOUNDARY)


def traced(structure: Structure, some: RaySet, threads: int) -> tuple[Answers, Mask]:
    """Nearest hits of some rays, and which of them hit anything, (n,) bool. threads: 0 = one per core."""
    options = some.options(threads)
    hits = structure.closest(some.origins, some.directions, **options)
    return Answers.of(hits), structure.occluded(some.origins, some.directions, **options)


@dataclass(frozen=True, eq=False)
class Errors:
    """Error counts of a set of rays. `ulps`: distance between the two values of t, in units in the last place of
    float32, for rays that hit in both.

    wrong_values: same triangle, but different u or v. wrong_any_hit: `occluded` differs from the reference; these rays
    are also counted in false_miss or false_hit. wrong: rays with any difference, each counted once; t, u and v count
    bit for bit with an exact reference, and are ignored with an inexact one. last_bits: those of them on the right
    triangle that differ in t, u or v only.
    """

    rays: int = 0
    false_miss: int = 0
    false_hit: int = 0
    wrong_triangle: int = 0
    wrong_values: int = 0
    wrong_any_hit: int = 0
    wrong: int = 0
    last_bits: int = 0
    on_boundary: int = 0
    ulps: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    def agrees(self, *, bitwise: bool) -> bool:
        """Whether no answer differs; with `bitwise`, t, u and v must match bit for bit."""
        if self.false_miss or self.false_hit or self.wrong_triangle or self.wrong_any_hit:
            return False
        return not bitwise or not (self.wrong or self.wrong_values or self.ulps.any())

    def as_row(self, reference: str) -> dict[str, Any]:
        """The columns of a benchmark row."""
        return {
            "reference": reference,
            "rays": self.rays,
            "false_miss": self.false_miss,
            "false_hit": self.false_hit,
            "wrong_triangle": self.wrong_triangle,
            "wrong_values": self.wrong_values,
            "wrong_any_hit": self.wrong_any_hit,
            "wrong": self.wrong,
            "t_ulp_max": int(self.ulps.max()) if len(self.ulps) else 0,
            # method="higher" returns a measured distance, not an interpolated one.
            "t_ulp_p999": int(np.quantile(self.ulps, 0.999, method="higher")) if len(self.ulps) else 0,
            "on_boundary": self.on_boundary,
        }


def total(parts: Iterable[Errors]) -> Errors:
    """The sum of the errors of several ray sets."""
    found = list(parts)
    counts = [entry.name for entry in fields(Errors) if entry.name != "ulps"]
    ulps = np.concatenate([part.ulps for part in found]) if found else np.zeros(0, np.int64)
    return Errors(**{name: sum(getattr(part, name) for part in found) for name in counts}, ulps=ulps)


def differing(reference: Answers, answers: Answers | None, occluded: Mask | None) -> Mask:
    """(n,) bool: rays whose nearest hit differs from the reference's in any bit, or whose any-hit answer differs.

    `answers` and `occluded` are skipped when None.
    """
    differ: Mask = np.zeros(len(reference.hit), bool)
    if answers is not None:
        differ |= answers.triangle != reference.triangle
        for name in ("t", "u", "v"):
            bits, expected = (getattr(hits, name).view(np.uint32) for hits in (answers, reference))
            differ |= reference.hit & (bits != expected)
    if occluded is not None:
        differ |= occluded != reference.hit
    return differ


def compare(
    reference: Answers,
    answers: Answers | None,
    occluded: Mask | None,
    ulp_distance: Callable[[F32, F32], NDArray[np.int64]],
    *,
    bitwise: bool,
) -> Errors:
    """Count the errors of `answers` (nearest hits) and `occluded` (any-hit answers); either is skipped when None.

    ulp_distance: (n,) float32 twice to (n,) int64, distances in units in the last place. bitwise: every difference
    counts; otherwise equal distances on two triangles are a tie, not an error.
    """
    expected = reference.hit
    missed = np.zeros(len(expected), bool)
    invented, any_hit_wrong, other = missed.copy(), missed.copy(), missed.copy()
    wrong_values = 0
    ulps = np.zeros(0, np.int64)
    # Compare the nearest hits: misses, invented hits, triangles, then the bits of u and v on equal triangles.
    if answers is not None:
        missed |= expected & ~answers.hit
        invented |= ~expected & answers.hit
        both = expected & answers.hit
        other = both & (answers.triangle != reference.triangle)
        if not bitwise:
            near = np.abs(answers.t[both] - reference.t[both]) <= TIE * np.abs(reference.t[both])
            other[np.flatnonzero(both)[near]] = False
        same = both & ~other
        bits = [getattr(answers, name)[same].view(np.uint32) for name in "uv"]
        expected_bits = [getattr(reference, name)[same].view(np.uint32) for name in "uv"]
        wrong_values = int(((bits[0] != expected_bits[0]) | (bits[1] != expected_bits[1])).sum())
        ulps = np.asarray(ulp_distance(reference.t[both], answers.t[both]), np.int64)
    # Compare the any-hit answers; the reference's nearest hits give the expected ones.
    if occluded is not None:
        any_hit_wrong = occluded != expected
        missed |= expected & ~occluded
        invented |= ~expected & occluded
    far_off = missed | invented | other
    wrong = differing(reference, answers, occluded) if bitwise else far_off
    return Errors(
        rays=len(expected),
        false_miss=int(missed.sum()),
        false_hit=int(invented.sum()),
        wrong_triangle=int(other.sum()),
        wrong_values=wrong_values,
        wrong_any_hit=int(any_hit_wrong.sum()),
        wrong=int(wrong.sum()),
        last_bits=int((wrong & ~far_off).sum()),
        on_boundary=int(reference.boundary().sum()),
        ulps=ulps,
    )
