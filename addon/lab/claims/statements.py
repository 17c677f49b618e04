# SPDX-License-Identifier: GPL-3.0-or-later
"""Every statement of the four sources that can be true or false, with the claims that measure it.

`table` sets them beside the verdicts of a run; docs/papers.md has that table.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from .claims import VERDICTS

HAVRAN = "Havran, Kopal, Bittner and Žára 1997"
KELLER = "Bounding interval hierarchies (Wächter and Keller 2006)"
GONZALEZ = "González López and Gisbert Cantó"
HOOBERGS = "Hoobergs 2019"

LABELS = {"faithful": "as published", "best": "ours"}
"""Configurations as they are called in documents."""

UNMEASURED = "not measured"


@dataclass(frozen=True)
class Statement:
    """A statement of a source. says: its words in short. claims: ids of the claims about it. untested: why there is
    none.
    """

    source: str
    says: str
    claims: tuple[str, ...] = ()
    untested: str = ""


def _of(source: str, *pairs: tuple[str, str]) -> Iterator[Statement]:
    """The statements of a source, each with the ids of its claims, or `-` and the reason why it has none."""
    for says, where in pairs:
        if where.startswith("-"):
            yield Statement(source, says, untested=where[1:].strip())
        else:
            yield Statement(source, says, tuple(where.split()))


STATEMENTS: tuple[Statement, ...] = (
    *_of(
        HAVRAN,
        ("The tree is built in relatively little time", "ta-b-construction"),
        ("Planes across the axes lessen the computations of ray and plane", "rbsp-projected"),
        ("All cases of ray and plane are covered; exactly two comparisons find one", "ta-b-comparisons"),
        ("The crossing point is the costly part; it is reused", "ta-b-reuse"),
        ("All singularities are handled correctly", "ta-b-singularities"),
        ("Saves 30 to 50 % of the traversal time of Sung and of Arvo", "ta-b-walks"),
        ("Ray tracing is about twice as fast", "ta-b-rays"),
        ("Subdivision means fewer tests and more traversal", "- true of any tree"),
    ),
    *_of(
        KELLER,
        ("For high performance, above all for dynamic scenes", "moving-intervals"),
        ("First presented as SKD trees and as box trees", "- history; these names are aliases"),
        ("Build and memory are comparable to those of boxes", "intervals-and-boxes"),
        ("A fraction of the build time and memory of a kd-tree", "intervals-small-and-quick"),
        ("Traversal resembles that of kd-trees, in about the same time", "intervals-walks"),
        ("The first picture is there sooner", "intervals-first-picture intervals-sorted-boxes"),
        ("Oblique planes: less desirable, traversal more complex", "intervals-oblique"),
        ("Oblique planes: less numerical stability", "intervals-stability"),
        ("Two planes a node; children overlap and have an order", "- a definition"),
        ("Traversed as boxes: faster for large bundles of rays", "intervals-groups"),
        ("Traversed as boxes: low use of memory and cache", "intervals-boxes-memory"),
        ("The global heuristic suits quick builds", "intervals-candidates"),
        ("Four cases of ray and node; subtrees behind a hit are skipped", "- a definition, tested against rays"),
        ("A fifth case cuts empty space off on both sides", "intervals-fifth-case"),
        ("No clipping, so no hit goes undetected as in kd-trees", "intervals-holes"),
        ("One, four or n planes a node separate objects better", "intervals-planes"),
    ),
    *_of(
        GONZALEZ,
        ("The time hardly depends on the number of rays", "beams-flat-line beams-resolution beams-further-ray"),
        ("Supersamples fill the same beams", "beams-further-ray"),
        ("Looking for neighbours takes up to 40 % of the time", "neighbour-search"),
        ("Links cost little time and more memory, and pay with the rays", "links-gain"),
        ("All kinds of objects, not polygons only", "- scenes here are triangles"),
        ("Fewer levels let beams hold more rays", "beams-levels"),
        ("Rays go on singly below a threshold", "beams-threshold"),
        ("Scene 1: all methods on octrees beat the boxes", "octrees-beat-boxes"),
        ("Scene 2: boxes beat single rays through the octree", "boxes-beat-octrees"),
        ("A small object in a large scene makes the octree deep; boxes win", "teapot-in-the-stadium"),
        ("Beams are the fastest method in both scenes as the resolution rises", "beams-fastest"),
        ("In empty zones rays stay in beams to the end", "beams-empty-zones"),
        ("Beams are independent and can be traced in parallel", "beams-independent"),
        ("The process extends to shadow rays", "shadow-polygons shadow-beams"),
        ("A shadow cache saves shadow rays (quoted from Wilt)", "shadow-cache"),
        ("Mirrored rays keep beams, refracted ones nearly (quoted)", "mirrored-beams refracted-beams"),
    ),
    *_of(
        HOOBERGS,
        ("The heuristic is linear between ends, so the best plane lies at one", "sweep-trees-linear"),
        ("An axis step is cheaper than an oblique one", "rbsp-projected"),
        ("Belief 1 of 3, wrong: BSP trees are never faster than kd-trees", "sweep-trees-time other-trees-time"),
        ("Belief 2 of 3, wrong: BSP trees are numerically unstable", "sweep-trees-stability sweep-trees-singular"),
        ("Belief 3 of 3, wrong: BSP trees are much harder to build", "long-builds"),
        ("RBSP: fewer tests and steps, but slower", "fixed-directions rbsp-fewer-steps"),
        ("RBSP: products with all directions can be computed beforehand", "rbsp-projected"),
        ("RBSP: incremental areas make up for costly cells", "rbsp-incremental"),
        ("Convex cells make builds 25 times slower", "rbsp-convex-cells"),
        ("A constant cost of a step makes mostly oblique nodes", "sweep-trees-constant-cost"),
        ("IZE^Kd is as fast as the kd-tree or faster in many scenes", "other-trees-time"),
        ("IZE^Kd: less variance per pixel, no hot spots", "sweep-trees-hot-spots"),
        ("6n, 2kn and 10n planes a level; all others repeat theirs", "- tables of the command `thesis`"),
        ("Random directions: O(log n) planes a triangle", "- tables of the command `thesis`"),
        ("Dividing pays down to one triangle a leaf (equations 3.2 to 3.6)", "medians-one-triangle"),
        ("The criterion by β as a rule for leaves", "sweep-trees-beta"),
        ("Axes are often better than random directions", "without-axes"),
        ("K = 3 with cheap axis nodes is the kd-tree", "three-directions-are-kd"),
        ("wn+^Kd, cn+^Kd and random+^Kd take 67 to 87 % of the time", "sweep-trees-time"),
        ("40 % fewer tests and 20 % less time in all scenes", "sweep-trees-tests"),
        ("One normal beside the axes gives most of the gain", "one-normal"),
        ("Random directions gain with K, normals are flat from 5", "sweep-trees-directions"),
        ("Clustering gains nothing over picking", "sweep-trees-clusters"),
        ("80 to 90 % axis steps at 30 to 45 % axis nodes", "sweep-trees-axis-steps"),
        ("Upper levels axis nodes, lower ones oblique", "sweep-trees-levels"),
        ("The expected cost drops by 40 %", "sweep-trees-cost"),
        ("Builds take a hundred times as long as a kd-tree's", "long-builds"),
        ("Numbers of nodes of the leg's trees", "sweep-trees-nodes"),
        ("Times of the museum", "- the model was not published"),
    ),
)


def table(rows: Iterable[Mapping[str, Any]]) -> str:
    """The statements as a Markdown table, one row each, by source. rows: of claims.json."""
    found: dict[str, dict[str, Counter[str]]] = {}
    for row in rows:
        found.setdefault(row["claim"], {}).setdefault(row["configuration"], Counter())[row["verdict"]] += 1
    lines = []
    for source in dict.fromkeys(one.source for one in STATEMENTS):
        lines += [f"| {source} | claims | verdict |", "| --- | --- | --- |"]
        for one in (one for one in STATEMENTS if one.source == source):
            verdicts = "; ".join(verdict(found.get(claim, {})) for claim in one.claims)
            lines.append(f"| {one.says} | {', '.join(f'`{c}`' for c in one.claims)} | {verdicts or one.untested} |")
        lines.append("")
    return "\n".join(lines)


def verdict(counts: Mapping[str, Counter[str]]) -> str:
    """The verdicts of a claim's outcomes by configuration, as text."""
    parts = []
    for configuration, label in LABELS.items():
        own = counts.get(configuration, Counter())
        kinds = [kind for kind in VERDICTS if own[kind]]
        if len(kinds) == 1:
            parts.append(f"{label} {kinds[0]}")
        elif kinds:
            parts.append(f"{label} " + ", ".join(f"{kind} ({own[kind]} of {own.total()})" for kind in kinds))
    return ", ".join(parts) or UNMEASURED
