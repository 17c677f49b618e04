# SPDX-License-Identifier: GPL-3.0-or-later
"""Hoobergs 2019, the trees themselves: which planes they have and where, what they are expected to cost, how they grow
with the number of directions, how evenly their pixels cost, and whether they answer rightly without error bounds.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...core.base.arrays import F64
from ...core.measure import counting
from ...core.scene.workload import Workload
from ...core.structures.specs import joined
from . import kd, thesis
from .claims import HOLDS, UNTESTED, Checked, Claim, Lab, Outcome, Share, verdict
from .thesis import BASES, CHOSEN, MODELS, NOISE, PAPER, label, spec

AXIS_STEPS, AXIS_NODES = 0.8, (0.3, 0.45)
"""Published: least share of axis steps, and the range of the share of axis nodes."""

COST = 0.6
"""Published: largest share of the kd-tree's expected cost."""

GROWING = (("bsp-random-plus-kd", (5, 10)), ("bsp-wn-plus-kd", (5, 8)), ("bsp-cn-plus-kd", (5, 8)))
"""Trees and two numbers of directions: the first gains between them, the others do not."""

HOT = (CHOSEN[0], ("bsp-ize-kd", 0))
"""Trees whose cost per pixel is compared with the kd-tree's."""

COSTS = {"tests": 80.0, "steps_axis": 1.0, "steps_oblique": 5.0}
"""Costs of the thesis."""

TAIL = 99.9
"""Percentile of the pixels' costs that stands for hot spots."""

ROUNDED = (("bsp-wn-plus-kd", 6), ("bsp-random-plus-kd", 10), ("rbsp-kd", 13))
"""Trees whose answers without error bounds are compared with the kd-tree's."""

CONVEX, PUBLISHED = ("rbsp", 7), 25.0
"""A tree of convex cells, and how many times as long as with boxes the thesis's builds of equal trees take."""

LEAVES = (1, 2, 4, 8)
"""Largest numbers of triangles of a leaf."""

KD_NODES = 963_379
NODES = {
    ("rbsp", 13): 1_557_929,
    ("rbsp-kd", 13): 1_749_785,
    ("bsp-random", 5): 1_568_391,
    ("bsp-wn", 5): 783_783,
    ("bsp-cn", 5): 769_525,
    ("bsp-random-plus-kd", 5): 1_483_459,
    ("bsp-wn-plus-kd", 5): 1_381_761,
    ("bsp-cn-plus-kd", 5): 1_397_627,
}
"""Published numbers of nodes of the kd-tree and of other trees of the leg, leaves included."""

EQUAL = 0.01
"""Largest difference of a number of nodes that counts as equal, as a share (chosen)."""

BETAS = {"computed": "stop=beta", "given, 0.5": "stop=beta,beta=0.5"}
"""Leaf rules by beta: the share of visits to one child alone, of each plane and the same everywhere."""

SWEPT, GAPS = 24, 8
"""Triangles whose ends are swept over, and planes tried between two ends."""

STRAIGHT = 1e-9
"""Largest distance of the cost from a line between two ends, as a share of the cost, that counts as rounding."""


def some(lab: Lab) -> list[tuple[str, Workload]]:
    """The scenes of the thesis that exist, the first alone in a quick run."""
    return list(thesis.scenes(lab))[: 1 if lab.quick else None]


def share_of_axes(lab: Lab) -> Iterator[Outcome]:
    """The share of axis nodes among all inner nodes, and among those that rays visit."""
    yield from thesis.nowhere(lab)
    for name, workload in thesis.scenes(lab):
        for configuration in BASES:
            specs = {label(tree): spec(configuration, tree) for tree in CHOSEN}
            steps = axis_steps(kd.counts(lab, workload, list(specs.values())))
            steps = {k: steps[one] for k, one in specs.items()}
            nodes = {k: axis_nodes(lab.statistics(workload, s)) for k, s in specs.items()}
            yield Outcome(
                configuration,
                verdict(
                    holds=all(steps[k] >= AXIS_STEPS and AXIS_NODES[0] <= nodes[k] <= AXIS_NODES[1] for k in specs),
                ),
                f"{name}: "
                + "; ".join(f"{k}: {steps[k]:.0%} of the steps at {nodes[k]:.0%} of the nodes" for k in specs)
                + f" (published: at least {AXIS_STEPS:.0%} at {AXIS_NODES[0]:.0%} to {AXIS_NODES[1]:.0%})",
                "the upper levels, which all rays visit, have axis nodes; see sweep-trees-levels",
                lab.error(workload, specs.values()),
                {f"steps {k}": v for k, v in steps.items()} | {f"nodes {k}": v for k, v in nodes.items()},
            )


def axis_steps(counted: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """The share of steps through nodes with a plane along an axis, by configuration."""
    return {spec: own["steps_axis"] / max(own["steps"], 1e-9) for spec, own in counted.items()}


def axis_nodes(statistics: Mapping[str, float]) -> float:
    """The share of nodes with a plane along an axis among all inner nodes."""
    return statistics["nodes_axis"] / max(statistics["nodes_axis"] + statistics["nodes_oblique"], 1)


def by_level(lab: Lab) -> Iterator[Outcome]:
    """The share of axis planes in the upper half of the levels of a tree, and in the lower half of its nodes."""
    yield from thesis.nowhere(lab)
    for name, workload in thesis.scenes(lab):
        for configuration in BASES:
            own = spec(configuration, CHOSEN[0])
            found = lab.build(workload, own).analysis(SAMPLED)
            axis, oblique = (found[f"level_planes_{kind}"].astype(np.float64) for kind in ("axis", "oblique"))
            both = axis + oblique
            # Cut the levels where they hold half of the nodes.
            half = int(np.searchsorted(np.cumsum(both), both.sum() / 2))
            upper, lower = (
                float(axis[part].sum() / max(both[part].sum(), 1)) for part in (slice(half), slice(half, None))
            )
            kd.counts(lab, workload, [own])
            yield Outcome(
                configuration,
                verdict(holds=upper > 0.5 > lower),
                f"{name}: {label(CHOSEN[0])}: {upper:.0%} of the nodes above level {half} are axis nodes, {lower:.0%} "
                "of the others, which are half of all",
                "axis nodes by level: "
                + ", ".join(f"{level}: {axis[level] / max(both[level], 1):.0%}" for level in range(0, len(both), 4)),
                lab.error(workload, [own]),
                {"upper": upper, "lower": lower},
            )


SAMPLED = 1000
"""Nodes above which the parts of the analysis that are not used here are estimated."""


def constant_cost(lab: Lab) -> Iterator[Outcome]:
    """The share of oblique nodes with a constant cost of a step through one, and with one linear in the triangles."""
    yield from thesis.nowhere(lab)
    name_of_tree, k = CHOSEN[0]
    for name, workload in thesis.scenes(lab):
        for configuration in BASES:
            linear = spec(configuration, (name_of_tree, k))
            constant = joined(linear.replace(",rule=code", ""), "alpha=0")
            oblique = {one: 1 - axis_nodes(lab.statistics(workload, one)) for one in (constant, linear)}
            axis = axis_steps(kd.counts(lab, workload, list(oblique)))
            yield Outcome(
                configuration,
                verdict(holds=oblique[constant] > 0.5 > oblique[linear]),
                f"{name}: {label(CHOSEN[0])}: with a constant cost {oblique[constant]:.0%} of the nodes are oblique, "
                f"with a linear one {oblique[linear]:.0%}; axis steps: {axis[constant]:.0%} and {axis[linear]:.0%}",
                "the tests that a plane saves grow with the triangles, the constant cost does not: near the root any "
                "better division pays",
                lab.error(workload, [constant, linear]),
                {"constant": oblique[constant], "linear": oblique[linear]},
            )


def expected_cost(lab: Lab) -> Iterator[Outcome]:
    """The expected cost of a ray relative to the kd-tree's."""
    yield from thesis.nowhere(lab)
    for name, workload in thesis.scenes(lab):
        for configuration, base in BASES.items():
            specs = {label(tree): spec(configuration, tree) for tree in CHOSEN}
            whole = lab.statistics(workload, base)["sah_cost"]
            costs = {k: lab.statistics(workload, s)["sah_cost"] / whole for k, s in specs.items()}
            kd.counts(lab, workload, [base, *specs.values()])
            yield Outcome(
                configuration,
                verdict(holds=max(costs.values()) <= COST),
                f"{name}: of the expected cost of {base}, {whole:.1f}: "
                + ", ".join(f"{k} {share:.2f}" for k, share in costs.items())
                + f" (limit: {COST:g})",
                "80 a test, 1 an axis step, 5 an oblique step, by the surface of convex cells",
                lab.error(workload, [base, *specs.values()]),
                costs,
            )


def clusters(lab: Lab) -> Iterator[Outcome]:
    """The time of clustered normals against that of normals of arbitrary triangles."""
    yield from thesis.nowhere(lab)
    for name, workload in thesis.scenes(lab):
        for configuration in BASES:
            picked, clustered = (spec(configuration, tree) for tree in CHOSEN)
            found = thesis.measured(lab, workload, [picked, clustered])
            share = found[clustered].share(found[picked])
            builds = (lab.statistics(workload, one)["build_seconds"] for one in (picked, clustered))
            yield Outcome(
                configuration,
                verdict(holds=share.below() != HOLDS),
                f"{name}: {label(CHOSEN[1])} takes {share.value:.2f} of the time of {label(CHOSEN[0])}; builds: "
                + " and ".join(f"{seconds:.1f} s" for seconds in builds),
                thesis.counters(lab, workload, configuration, CHOSEN),
                lab.error(workload, [picked, clustered]),
                {"ratio": share.value},
            )


def directions(lab: Lab) -> Iterator[Outcome]:
    """The time with many directions against that with five, for random ones and for those along normals."""
    yield from thesis.nowhere(lab)
    for name, workload in some(lab):
        for configuration in BASES:
            shares, specs = {}, []
            for tree, (few, many) in GROWING:
                own = [spec(configuration, (tree, k)) for k in (few, many)]
                found = thesis.measured(lab, workload, own)
                shares[f"{tree} K={many}"] = found[own[1]].share(found[own[0]])
                specs += own
            growing, *flat = shares.values()
            yield Outcome(
                configuration,
                verdict(growing.below(), holds=all(abs(share.value - 1) <= NOISE for share in flat)),
                f"{name}: of the time with K={GROWING[0][1][0]}: "
                + ", ".join(f"{k} {share.value:.2f}" for k, share in shares.items()),
                "nodes: " + ", ".join(f"{one} {lab.statistics(workload, one)['leaves']:,} leaves" for one in specs),
                lab.error(workload, specs),
                {k: share.value for k, share in shares.items()},
            )


def hot_spots(lab: Lab) -> Iterator[Outcome]:
    """Spread and tail of the cost per pixel, in the thesis's units, against the kd-tree's."""
    yield from thesis.nowhere(lab)
    for name, workload in some(lab):
        for configuration, base in BASES.items():
            specs = {base: base} | {label(tree): spec(configuration, tree) for tree in HOT}
            view = kd.ray_sets(lab, workload)[0]
            spread, tail = {}, {}
            for k, one in specs.items():
                found = counting.alone(lab.build(workload, one), view)
                cost = sum(weight * found[what].astype(np.float64) for what, weight in COSTS.items())
                spread[k], tail[k] = float(np.std(cost)), float(np.percentile(cost, TAIL))
            for one in specs.values():
                lab.check(workload, one, view)
            shares = {k: (spread[k] / spread[base], tail[k] / tail[base]) for k in specs if k != base}
            yield Outcome(
                configuration,
                verdict(holds=max(max(pair) for pair in shares.values()) < 1),
                f"{name}: standard deviation and {TAIL:g} % percentile of the cost of a pixel, relative to {base}: "
                + ", ".join(f"{k} {a:.2f} and {b:.2f}" for k, (a, b) in shares.items()),
                f"{len(view):,} camera rays; 80 a test, 1 an axis step, 5 an oblique step",
                lab.error(workload, specs.values()),
                {f"deviation {k}": a for k, (a, _) in shares.items()}
                | {f"tail {k}": b for k, (_, b) in shares.items()},
            )


def stable(lab: Lab) -> Iterator[Outcome]:
    """Wrong triangles, false hits and misses without error bounds, of the kd-tree and of trees with oblique planes."""
    yield from thesis.nowhere(lab)
    base = joined(BASES["faithful"], "robust=none")
    specs = {label(tree): joined(spec("faithful", tree), "robust=none") for tree in ROUNDED}
    for name, workload in thesis.scenes(lab):
        rays = sum(len(some) for some in kd.ray_sets(lab, workload))
        for one in (base, *specs.values()):
            for some in kd.ray_sets(lab, workload):
                lab.check(workload, one, some)
        errors = {k: lab.error(workload, [one]) for k, one in ({base: base} | specs).items()}
        wrong = {k: own.wrong_triangle + own.false_hits for k, own in errors.items()}
        yield Outcome(
            "faithful",
            verdict(holds=max(wrong[k] for k in specs) <= wrong[base]),
            f"{name}: on another triangle, hit falsely or missed, of {errors[base].count:,} answers each: "
            + ", ".join(f"{k} {count:,}" for k, count in wrong.items()),
            f"of {rays:,} rays a sample is compared; a plane along a normal holds its triangle on one side only, and "
            "two such planes may bound a cell of one rounding error",
            lab.error(workload, [base, *specs.values()]),
            {k: float(count) for k, count in wrong.items()},
        )


def singular(lab: Lab) -> Iterator[Outcome]:
    """The same on rays in walls, along edges and through corners, with the exact test of triangles."""
    base = "kd:robust=none,traversal=dir"
    own = [joined(spec("best", tree), "traversal=dir,robust=none") for tree in ROUNDED]
    found = kd.singular_errors(lab, [base, *own])
    wrong = {one: errors.wrong for one, errors in found.items()}
    yield Outcome(
        "best",
        verdict(holds=max(wrong[one] for one in own) <= (1 + NOISE) * wrong[base]),
        f"of {found[base].rays:,} rays in walls, along edges and through corners, wrong: "
        + ", ".join(f"{one} {count:,}" for one, count in wrong.items()),
        "these rays lie in planes along the axes, which all of the trees have",
        Checked.of(found, found.values()),
        {one: float(count) for one, count in wrong.items()},
    )


def convex(lab: Lab) -> Iterator[Outcome]:
    """Build time a direction and inner node, of convex cells against boxes."""
    yield from thesis.nowhere(lab)
    _, k = CONVEX
    for name, workload in some(lab):
        for configuration, base in BASES.items():
            own = spec(configuration, CONVEX)
            made = lab.build_seconds(workload, [base, own])
            inner = {one: lab.statistics(workload, one)["leaves"] - 1 for one in (base, own)}
            whole = made.share(own, base)
            each = Share.of(whole.value * inner[base] / max(inner[own], 1) * thesis.AXES / k)
            kd.counts(lab, workload, [base, own])
            yield Outcome(
                configuration,
                each.above(PUBLISHED),
                f"{name}: {label(CONVEX)} is built in {whole.value:.1f} times the time of {base} ({made.method}); a "
                f"direction of a node takes {each.value:.1f} times as long (published: {PUBLISHED:g} and more)",
                f"areas of both sides follow from sums kept along the sweep (Budge et al. 2008); {inner[base]:,} and "
                f"{inner[own]:,} inner nodes",
                lab.error(workload, [base, own]),
                {"whole": whole.value, "each": each.value},
            )


def incremental(lab: Lab) -> Iterator[Outcome]:
    """The same as a verdict on sums kept along the sweep: convex cells cost less than where each is cut anew."""
    for one in convex(lab):
        if one.values:
            each = Share.of(one.values["each"])
            yield Outcome(
                one.configuration, each.below(PUBLISHED), one.measured, one.why, one.checked, {"each": each.value}
            )
        else:
            yield one


def one_triangle(lab: Lab) -> Iterator[Outcome]:
    """The time of rays by the largest number of triangles of a leaf, in trees of the same rule."""
    for workload in kd.scenes(lab):
        if not kd.ray_sets(lab, workload):
            continue
        for configuration, tree in {"faithful": "kd-object:traversal=dir,leaves=scalar", "best": "kd-object"}.items():
            specs = {most: joined(tree, f"leaf_size={most}") for most in LEAVES}
            found = kd.times(lab, workload, list(specs.values()), alone=False)
            shares = {most: found[specs[1]].share(found[one]) for most, one in specs.items() if most > 1}
            yield Outcome(
                configuration,
                verdict(*(share.below() for share in shares.values())),
                f"{workload.name}: ns a ray with leaves of at most "
                + ", ".join(f"{most}: {found[one].nanoseconds:.0f}" for most, one in specs.items()),
                "nodes and tests a ray: "
                + ", ".join(
                    f"{most}: {found[one].counters['steps']:.1f} and {found[one].counters['tests']:.1f}"
                    for most, one in specs.items()
                ),
                lab.error(workload, specs.values()),
                {f"{most} triangles": found[one].nanoseconds for most, one in specs.items()},
            )


def node_counts(lab: Lab) -> Iterator[Outcome]:
    """The published number of nodes of each tree of the leg, ours, and the difference."""
    leg = lab.shared(thesis.SCENES["leg"], published=True)
    if leg is None:
        yield Outcome("faithful", UNTESTED, "the leg is missing")
        return
    base = BASES["faithful"]
    specs = {base: base} | {label(tree): spec("faithful", tree) for tree in NODES}
    published = {base: KD_NODES} | {label(tree): count for tree, count in NODES.items()}
    ours = {k: 2 * int(lab.statistics(leg, own)["leaves"]) - 1 for k, own in specs.items()}
    off = {k: ours[k] / count - 1 for k, count in published.items()}
    kd.counts(lab, leg, list(specs.values()))
    yield Outcome(
        "faithful",
        verdict(holds=max(map(abs, off.values())) <= EQUAL),
        "leg, published nodes, ours and the difference: "
        + ", ".join(f"{k} {count:,}, {ours[k]:,}, {off[k] * 100:+.1f} %" for k, count in published.items()),
        "planes that meet a cell only in a corner count as inside or outside by the last bits of a height; see "
        "docs/papers.md. One seed: those of the thesis were not published",
        lab.error(leg, specs.values()),
        off,
    )


def by_beta(lab: Lab) -> Iterator[Outcome]:
    """The time of rays where leaves end by the criterion of beta, against the rule by cost."""
    yield from thesis.nowhere(lab)
    for name, workload in thesis.scenes(lab):
        for configuration, base in BASES.items():
            for tree in (base, spec(configuration, CHOSEN[0])):
                specs = {"by cost": tree} | {f"beta {k}": joined(tree, rule) for k, rule in BETAS.items()}
                found = thesis.measured(lab, workload, list(specs.values()))
                shares = {k: found[one].share(found[tree]) for k, one in specs.items() if one != tree}
                yield Outcome(
                    configuration,
                    verdict(*(share.below() for share in shares.values())),
                    f"{name}: of the time of {tree}: " + ", ".join(f"{k} {one.value:.2f}" for k, one in shares.items()),
                    "inner nodes, nodes a ray, tests a ray: "
                    + "; ".join(
                        f"{k} {lab.statistics(workload, one)['leaves'] - 1:,}, {found[one].counters['steps']:.1f}, "
                        f"{found[one].counters['tests']:.1f}"
                        for k, one in specs.items()
                    ),
                    lab.error(workload, specs.values()),
                    {k: one.value for k, one in shares.items()},
                )


def below(direction: F64, height: float) -> tuple[float, float]:
    """Surface area of the parts of the unit cube below and above a plane.

    direction: (3,) unit normal. Both parts have the section as a face.
    """
    section: list[F64] = []
    area = 0.0
    for axis in range(3):
        for side in (0.0, 1.0):
            corners = np.insert(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float64), axis, side, axis=1)
            part = _cut(corners, direction, height, section)
            area += _area(part)
    # Order the section's corners by angle around its middle.
    points = np.unique(np.round(section, 12), axis=0) if section else np.zeros((0, 3))
    if len(points) < 3:
        return area, 6.0 - area
    first = np.linalg.svd(points - points.mean(0))[2]
    flat = (points - points.mean(0)) @ first[:2].T
    cap = _area(points[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))])
    return area + cap, 6.0 - area + cap


def _cut(corners: F64, direction: F64, height: float, section: list[F64]) -> F64:
    """The part of a polygon below a plane; appends its corners in the plane to `section`."""
    at = corners @ direction - height
    kept = []
    for i, (here, there) in enumerate(zip(at, np.roll(at, -1), strict=True)):
        if here <= 0:
            kept.append(corners[i])
        if (here < 0) != (there < 0):
            crossing = corners[i] + (corners[(i + 1) % len(corners)] - corners[i]) * (here / (here - there))
            kept.append(crossing)
            section.append(crossing)
    return np.array(kept).reshape(-1, 3)


def _area(polygon: F64) -> float:
    """The area of a flat polygon of any number of corners."""
    if len(polygon) < 3:
        return 0.0
    spokes = polygon[1:] - polygon[0]
    return float(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0)) / 2)


def sah(direction: F64, ends: F64, heights: Sequence[float]) -> F64:
    """The surface area heuristic of planes across the unit cube, without the step's cost: (heights,).

    ends: (n, 2) least and greatest height of each triangle along the direction.
    """
    found = []
    for height in heights:
        low, high = below(direction, height)
        found.append(low * np.sum(ends[:, 0] < height) + high * np.sum(ends[:, 1] > height))
    return np.array(found)


def straight(_: Lab) -> Iterator[Outcome]:
    """Distance of the heuristic from a line between adjacent ends of triangles, in a cube."""
    rng = np.random.default_rng(7)
    corners = rng.uniform(0.2, 0.8, (SWEPT, 1, 3)) + rng.uniform(-0.2, 0.2, (SWEPT, 3, 3))
    for what, direction in {"axis": np.array([0.0, 0.0, 1.0]), "oblique": np.array([0.6, 0.48, 0.64])}.items():
        along = corners @ direction
        ends = np.stack([along.min(1), along.max(1)], axis=1)
        places = np.unique(ends)
        far, inside = 0.0, 0
        for a, b in itertools.pairwise(places):
            share = np.linspace(0.001, 0.999, GAPS)
            cost = sah(direction, ends, a + share * (b - a))
            line = np.interp(share, share[[0, -1]], cost[[0, -1]])
            far = max(far, float(np.abs(cost / line - 1).max()))
            inside += int(cost.argmin() not in (0, GAPS - 1))
        yield Outcome(
            "faithful",
            verdict(holds=far <= STRAIGHT),
            f"between two adjacent ends of {SWEPT} triangles in a cube, along an {what} direction: at most {far:.1e} "
            f"of the cost away from a line; the best plane lies inside {inside} of {len(places) - 1} gaps",
            "the surface of a part of a box is linear in the height of a plane along an axis; along other directions "
            "it is not, as the section changes",
            values={"distance": far, "inside": float(inside)},
        )


CLAIMS = (
    Claim(
        "sweep-trees-linear",
        PAPER,
        "The heuristic is linear between the ends of triangles, so the best plane lies at an end (Havran 2000).",
        straight,
    ),
    Claim(
        "sweep-trees-constant-cost",
        PAPER,
        "A constant cost of a step makes mostly oblique nodes; one linear in the triangles does not.",
        constant_cost,
        MODELS,
    ),
    Claim(
        "sweep-trees-axis-steps",
        PAPER,
        "80 to 90 % of the steps are axis steps, although 30 to 45 % of the nodes are axis nodes.",
        share_of_axes,
        MODELS,
    ),
    Claim(
        "sweep-trees-levels",
        PAPER,
        "The upper levels are almost only axis nodes, the lower ones almost only oblique nodes.",
        by_level,
        MODELS,
    ),
    Claim("sweep-trees-cost", PAPER, "The expected cost of the tree drops by 40 % and more.", expected_cost, MODELS),
    Claim(
        "sweep-trees-clusters",
        PAPER,
        "Clustering normals gains nothing over picking them.",
        clusters,
        MODELS,
    ),
    Claim(
        "sweep-trees-directions",
        PAPER,
        "Random directions gain with K to 10; with normals the time is flat from K = 5.",
        directions,
        MODELS,
    ),
    Claim(
        "sweep-trees-hot-spots",
        PAPER,
        "Oblique planes make the cost per pixel more even than the kd-tree's, with fewer hot spots.",
        hot_spots,
        MODELS,
    ),
    Claim(
        "sweep-trees-stability",
        PAPER,
        "BSP trees are not numerically unstable, against common belief (Ize, Wald and Parker 2008).",
        stable,
        MODELS,
    ),
    Claim(
        "sweep-trees-singular",
        PAPER,
        "The same for rays in walls, along edges and through corners.",
        singular,
    ),
    Claim(
        "rbsp-convex-cells",
        PAPER,
        "Convex cells make the build about 25 times slower than boxes.",
        convex,
        MODELS,
    ),
    Claim(
        "rbsp-incremental",
        "Budge, Coming, Norpchen and Joy, Accelerated building and ray tracing of restricted BSP trees (2008)",
        "Areas that follow along the sweep make up for the costly cells.",
        incremental,
        MODELS,
    ),
    Claim(
        "sweep-trees-nodes",
        PAPER,
        "The numbers of nodes of the trees of the leg.",
        node_counts,
        (thesis.SCENES["leg"],),
    ),
    Claim(
        "sweep-trees-beta",
        PAPER,
        "Dividing a leaf of n triangles pays where a step costs at most beta n / 2 tests, beta the share of visits to "
        "one child alone.",
        by_beta,
        MODELS,
    ),
    Claim(
        "medians-one-triangle",
        PAPER,
        "Dividing pays down to one triangle a leaf (equations 3.2 to 3.6).",
        one_triangle,
        kd.SCENES,
    ),
)
