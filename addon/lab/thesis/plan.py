# SPDX-License-Identifier: GPL-3.0-or-later
"""Plan of measurements: the trees of the thesis, in its scalar form, and the amount of a quick and of a full run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..bench.bench_presets import as_published
from ..claims.thesis import BVHS
from ..report.thesis import TABLES

AXES = 3
"""Number of directions with which trees that try the axes first try only these."""

RBSP_K = 13
"""Directions of the thesis's RBSP."""

SCENES = ("killeroo-feet", "sponza-dabrovic", "conference")
SETS = ("primary", "shadow", "diffuse")
ALL_TRIED = "tried=1000000"
"""More triangles than any node has."""

HIERARCHIES = ("bvh-scalar", "bvh-embree")
"""Names of the hierarchies of boxes that the trees are compared with beside the kd-tree."""

CHEAP = "-plus-kd"
"""End of the names of trees with the axes as cheap nodes."""


@dataclass(frozen=True)
class Effort:
    """How much is measured. k: of trees with cheap axis nodes, of other swept trees. size: of the view in pixels.

    repeats: timed passes, in turn with the kd-tree's, after one to warm up. checked: rays per set compared with brute
    force. all_tried: whether Ize's trees try the planes of all triangles of a node, else those of 128.
    """

    k: tuple[tuple[int, ...], tuple[int, ...]]
    seeds: tuple[int, ...]
    size: tuple[int, int]
    repeats: int
    checked: int
    all_tried: bool = False

    @property
    def of_row(self) -> tuple[int, ...]:
        """The options that a row depends on; more seeds add rows and change none."""
        return (*self.size, self.repeats, self.checked)


FULL = Effort((tuple(range(3, 11)), tuple(range(2, 11))), tuple(range(1, 8)), (512, 512), 5, 20_000, all_tried=True)
QUICK = Effort(((4, 6), (6,)), (1,), (128, 128), 3, 2_000)


@dataclass(frozen=True)
class Tree:
    """A tree to measure. structure: its name. k: number of directions, 0 where the tables have none. spec: in full."""

    structure: str
    k: int
    seed: int
    spec: str

    @property
    def table(self) -> str:
        """The table of the thesis that it belongs to."""
        return TABLES.get(self.structure, "comparison")


def trees(effort: Effort) -> Iterator[Tree]:
    """All trees, those of most interest first: with cheap axis nodes, of other authors, the others."""
    cheap = [name for name in TABLES if name.endswith(CHEAP)]
    for seed in effort.seeds:
        first = seed == effort.seeds[0]
        for name in cheap:
            yield from (_swept(name, k, seed) for k in effort.k[0] if first or k != AXES)
        if first:
            for name in ("rbsp-kd", "rbsp"):
                yield Tree(name, 0, 0, as_published(f"{name}:k={RBSP_K}"))
            for name in ("bsp-ize-kd", "bsp-ize"):
                yield Tree(name, 0, 0, as_published(f"{name}:{ALL_TRIED}" if effort.all_tried else name))
            yield from (Tree(name, 0, 0, spec) for name, spec in zip(HIERARCHIES, BVHS.values(), strict=True))
        for name in (name for name in TABLES if name not in cheap):
            least = AXES if name.endswith("-plus") else 1
            # Trees of the axes alone draw nothing, and are the same for all seeds.
            same = name.endswith("-plus")
            yield from (_swept(name, k, seed) for k in effort.k[1] if k >= least and (first or not same or k != AXES))


def _swept(name: str, k: int, seed: int) -> Tree:
    """A tree along drawn directions; with the axes alone nothing is drawn."""
    if k == AXES and name.endswith(CHEAP):
        # Values that have no effect are refused.
        kept = [
            part for part in as_published(name).partition(":")[2].split(",") if part.split("=")[0] not in NOT_OF_AXES
        ]
        return Tree(name, k, seed, f"{name}:k={k},{','.join(kept)}")
    if k == AXES and name.endswith("-plus"):
        kept = [part for part in as_published(name).partition(":")[2].split(",") if part.split("=")[0] not in DRAWN]
        return Tree(name, k, seed, f"{name}:k={k},{','.join(kept)}")
    return Tree(name, k, seed, as_published(f"{name}:k={k},seed={seed}"))


DRAWN = ("draw", "rule", "empty_clusters", "seed")
"""Parameters that have no effect on the axes alone."""

NOT_OF_AXES = (*DRAWN, "slab")
"""The same where the axes are cheap nodes."""
