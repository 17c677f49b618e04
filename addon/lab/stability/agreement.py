# SPDX-License-Identifier: GPL-3.0-or-later
"""Agreement of structures with brute force on whole scenes, bit for bit, for camera, shadow and bounce rays.

Where brute force would take too long it traces a sample; the sample verifies a kd-tree, which then traces the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.measure import accuracy
from ...core.measure.accuracy import Answers, Errors
from ...core.scene import rays
from ...core.scene.rays import RaySet
from ...core.scene.workload import Workload
from . import stability
from .stability import Row

if TYPE_CHECKING:
    from ...core.base.interface import Native, Structure

BRUTE_PAIRS = 20_000_000_000
"""Ray-triangle tests that brute force may spend per ray set; derived from half a minute on one core."""

REFERENCE = "kd"
"""Structure that replaces brute force where that takes too long."""


class ReferenceDiffersError(RuntimeError):
    """The kd-tree reference differs from brute force. The message names the scene and the ray set."""


@dataclass(frozen=True)
class Question:
    """A set of rays with the reference answers of the kd-tree, which brute force verified on `proven` of them.

    fresh: number of distinct rays that no earlier set contains; some sets are permutations of others.
    """

    rays: RaySet
    answers: Answers
    proven: int
    fresh: int


def questions(native: Native, workload: Workload, count: int, seed: int, *, threads: int = 0) -> list[Question]:
    """About `count` rays of each set of a scene, with their reference answers. Raises ReferenceDiffersError."""
    reference, brute = (
        native.build(workload.vertices, workload.triangles, spec, threads=threads) for spec in (REFERENCE, "brute")
    )
    side = max(rays.TILE, int(np.ceil(count**0.5 / rays.TILE)) * rays.TILE)
    made: list[Question] = []
    # Answer blocks of each ray set with the kd-tree, and verify a sample of the answers with brute force.
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
    """Number of distinct rays in all sets together."""
    parts = ([getattr(some, name) for some in sets] for name in ("origins", "directions", "t_max"))
    return stability.different(*map(np.concatenate, parts))


def compare(native: Native, structure: Structure, asked: list[Question], *, threads: int = 0) -> Errors:
    """The errors of a structure over all sets: nearest hit and any-hit of every ray."""
    found = []
    for question in asked:
        some = question.rays
        arrays = (some.origins, some.directions, np.zeros(len(some), np.float32), some.t_max)
        answers = stability.nearest(structure, arrays, threads=threads)
        occluded = structure.occluded(*arrays, threads=threads)
        found.append(accuracy.compare(question.answers, answers, occluded, native.ulp_distance, bitwise=True))
    return accuracy.total(found)


def row(native: Native, workload: Workload, spec: str, asked: list[Question], *, threads: int = 0) -> Row:
    """One row of the table of `stability`, with the structure's statistics and its broken invariants.

    Raises MemoryError with the names of the scene and the structure if the build needs more memory than is free.
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
