# SPDX-License-Identifier: GPL-3.0-or-later
"""Brute force's answers to a sample of rays: found once, and then compared with as many structures as one likes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..scene import rays
from ..scene.workload import Workload
from .accuracy import Answers, differing, traced

if TYPE_CHECKING:
    from ..base.interface import Native, Structure

BRUTE_TESTS = 1_000_000_000
"""So many triangle tests brute force may do before someone who waits: about two seconds on two cores."""


def affordable(workload: Workload, sets: int = 1, tests: float = BRUTE_TESTS) -> int:
    """How many rays of each of some sets brute force may answer over these triangles."""
    return int(tests / max(len(workload.triangles) * sets, 1))


class Reference:
    """A sample of some ray sets, and what is right."""

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
        """Ask brute force. wanted: about how many rays of all sets together; of each at least a block of 64."""
        brute = native.build(workload.vertices, workload.triangles, "brute", threads=threads)
        self._threads = threads
        self._parts: list[tuple[rays.RaySet, Answers]] = []
        for whole in sets:
            some = whole.take(rays.blocks(len(whole), wanted // len(sets), seed))
            found = brute.closest(some.origins, some.directions, t_max=some.t_max, threads=threads)
            self._parts.append((some, Answers.of(found)))

    def __len__(self) -> int:
        """How many rays are compared."""
        return sum(len(some) for some, _ in self._parts)

    def wrong(self, structure: Structure) -> int:
        """How many of the rays a structure over the same triangles answers otherwise, be it in the last bit."""
        found = 0
        for some, right in self._parts:
            found += int(differing(right, *traced(structure, some, self._threads)).sum())
        return found
