# SPDX-License-Identifier: GPL-3.0-or-later
"""Brute force's answers to a sample of rays, computed once and compared with any number of structures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..scene import rays
from ..scene.workload import Workload
from .accuracy import Answers, differing, traced

if TYPE_CHECKING:
    from ..base.interface import Native, Structure

BRUTE_TESTS = 1_000_000_000
"""Triangle tests that brute force may spend in an interactive task: about two seconds on two cores."""


def affordable(workload: Workload, sets: int = 1, tests: float = BRUTE_TESTS) -> int:
    """Number of rays per set that brute force can trace over these triangles within `tests` triangle tests."""
    return int(tests / max(len(workload.triangles) * sets, 1))


class Reference:
    """A sample of several ray sets, and its correct answers."""

    def __init__(
        self,
        native: Native,
        workload: Workload,
        sets: Sequence[rays.RaySet],
        wanted: int,
        *,
        seed: int,
        threads: int = 0,
    ) -> None:
        """Trace the sample with brute force. wanted: approximate number of rays of all sets together; each set gets at
        least a block of 64.
        """
        # Trace the sample of each set with brute force.
        brute = native.build(workload.vertices, workload.triangles, "brute", threads=threads)
        self._threads = threads
        self._parts: list[tuple[rays.RaySet, Answers]] = []
        for whole in sets:
            some = whole.take(rays.blocks(len(whole), wanted // len(sets), seed))
            found = brute.closest(some.origins, some.directions, t_max=some.t_max, threads=threads)
            self._parts.append((some, Answers.of(found)))

    def __len__(self) -> int:
        """Number of compared rays."""
        return sum(len(some) for some, _ in self._parts)

    def wrong(self, structure: Structure) -> int:
        """Number of rays whose answer from a structure over the same triangles differs in any bit."""
        found = 0
        for some, right in self._parts:
            found += int(differing(right, *traced(structure, some, self._threads)).sum())
        return found
