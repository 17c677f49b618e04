# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether structures answer like brute force on whole scenes: camera rays, shadow rays and bounces, bit for bit.

Where brute force would take too long it answers a sample, which proves a kd-tree, and that answers the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from addon.core.measure import accuracy
from addon.core.measure.accuracy import Answers, Errors
from addon.core.scene import rays
from addon.core.scene.rays import RaySet
from addon.core.scene.workload import Workload

from . import stability
from .stability import Row

if TYPE_CHECKING:
    from addon.core.base.interface import Native, Structure

BRUTE_PAIRS = 20_000_000_000
"""Pairs of a ray and a triangle that brute force may test per set of rays: half a minute of one core."""

REFERENCE = "kd"
"""What answers where brute force takes too long."""


class ReferenceDiffersError(RuntimeError):
    """The reference itself differs from brute force. The message says where."""


@dataclass(frozen=True)
class Question:
    """A set of rays and what brute force answers, or the kd-tree that equals it on `proven` of them.

    fresh: how many different rays it has that no set before it has; some sets are others in another order.
    """

    rays: RaySet
    answers: Answers
    proven: int
    fresh: int


def questions(native: Native, workload: Workload, count: int, seed: int, *, threads: int = 0) -> list[Question]:
    """About `count` rays of each set of a scene, with their answers. Raises ReferenceDiffersError."""
    reference, brute = (
        native.build(workload.vertices, workload.triangles, spec, threads=threads) for spec in (REFERENCE, "brute")
    )
    side = max(rays.TILE, int(np.ceil(count**0.5 / rays.TILE)) * rays.TILE)
    made: list[Question] = []
    for whole in rays.make(workload, reference, size=(side, side), seed=seed, names=rays.NAMES):
        some = whole.take(rays.blocks(len(whole), count, seed))
        asked = (some.origins, some.directions, np.zeros(len(some), np.float32), some.t_max)
        answers = stability.nearest(reference, asked, threads=threads)
        proven = min(len(some), BRUTE_PAIRS // max(1, len(workload.triangles)))
        sample = rays.blocks(len(some), proven, seed + 1)
        right = Answers.of(brute.closest(*(part[sample] for part in asked), threads=threads))
        errors = accuracy.compare(right, answers.take(sample), None, native.ulp_distance, bitwise=True)
        if not errors.agrees(bitwise=True):
            raise ReferenceDiffersError(f"{workload.name}, {some.name}: {REFERENCE} differs from brute force")
        sets = [question.rays for question in made]
        fresh = _different([*sets, some]) - sum(question.fresh for question in made)
        made.append(Question(some, answers, len(sample), fresh))
    return made


def _different(sets: list[RaySet]) -> int:
    """How many different rays these sets have together."""
    parts = ([getattr(some, name) for some in sets] for name in ("origins", "directions", "t_max"))
    return stability.different(*map(np.concatenate, parts))


def compare(native: Native, structure: Structure, asked: list[Question], *, threads: int = 0) -> Errors:
    """The errors of a structure over all sets: nearest hits and any hits of every ray."""
    found = []
    for question in asked:
        some = question.rays
        arrays = (some.origins, some.directions, np.zeros(len(some), np.float32), some.t_max)
        answers = stability.nearest(structure, arrays, threads=threads)
        occluded = structure.occluded(*arrays, threads=threads)
        found.append(accuracy.compare(question.answers, answers, occluded, native.ulp_distance, bitwise=True))
    return accuracy.total(found)


def row(native: Native, workload: Workload, spec: str, asked: list[Question], *, threads: int = 0) -> Row:
    """One row of the table of `stability`, with its nodes, links and bytes, and what is broken in it.

    Raises MemoryError, which names the scene and the structure, when the build needs more than there is.
    """
    try:
        structure = native.build(workload.vertices, workload.triangles, spec, threads=threads)
    except MemoryError as error:
        raise MemoryError(f"{workload.name}, {spec}: {error}") from error
    statistics = structure.statistics
    return {
        "case": workload.name,
        "spec": spec,
        "triangles": len(workload.triangles),
        "different_rays": sum(question.fresh for question in asked),
        **stability.columns(compare(native, structure, asked, threads=threads), Errors()),
        "statistics": {name: value for name, value in statistics.items() if isinstance(value, (int, float))},
        "broken": structure.validate(),
    }
