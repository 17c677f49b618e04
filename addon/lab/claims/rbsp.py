# SPDX-License-Identifier: GPL-3.0-or-later
"""Kammaje and Mora, and Budge and others: planes of few directions, onto which each ray is projected once."""

from __future__ import annotations

from collections.abc import Iterator

from . import kd, thesis
from .claims import Chart, Claim, Lab, Outcome, verdict

PAPER = "Kammaje and Mora, A study of restricted BSP trees (2007); Budge and others, Accelerated building (2008)"

DIRECTIONS = (3, 7, 13, 26)
"""Numbers of directions over which both traversals are measured."""

WAYS = ("dir", "projected")
"""The generic traversal, two dot products and a division at each oblique node, and the projected one."""

BASE = {"faithful": "kd-sah:traversal=dir,leaves=scalar", "best": "kd:traversal=dir"}
RULES = {"faithful": "costs=thesis,ties=pbrt,slab=0,clip=0,leaves=scalar,", "best": ""}


def spec(configuration: str, k: int, way: str, tree: str = "rbsp") -> str:
    """A tree of k directions that rays traverse in this way."""
    return f"{tree}:k={k},{RULES[configuration]}traversal={way}"


def projected(lab: Lab) -> Iterator[Outcome]:
    """Both traversals of the same trees, without triangle tests."""
    yield from thesis.nowhere(lab)
    for name, workload in thesis.scenes(lab):
        specs = {(k, way): spec("best", k, way) for k in DIRECTIONS for way in WAYS}
        base = BASE["best"]
        found = kd.times(lab, workload, [base, *specs.values()], alone=True)
        share = {k: found[specs[k, "projected"]].share(found[specs[k, "dir"]]) for k in DIRECTIONS}
        alike = all(
            found[specs[k, "projected"]].counters["steps"] == found[specs[k, "dir"]].counters["steps"]
            for k in DIRECTIONS
        )
        step = {one: found[one].nanoseconds / max(found[one].counters["steps"], 1e-9) for one in found}
        yield Outcome(
            "best",
            verdict(*(one.below() for one in share.values()), holds=alike),
            f"{name}: traversal alone, of the time of the generic node: "
            + ", ".join(f"K={k} {share[k].value:.2f}" for k in DIRECTIONS)
            + f"; ns a step: {base} {step[base]:.1f}, "
            + ", ".join(f"K={k} {step[specs[k, 'dir']]:.1f} and {step[specs[k, 'projected']]:.1f}" for k in DIRECTIONS),
            "nodes a ray, the same in both traversals: "
            + ", ".join(f"K={k} {found[specs[k, 'projected']].counters['steps']:.1f}" for k in DIRECTIONS)
            + f"; {base} {found[base].counters['steps']:.1f}",
            lab.error(workload, [base, *specs.values()]),
            {f"K={k}": one.value for k, one in share.items()},
            (
                Chart(
                    f"{name}: traversal by directions",
                    "K",
                    "ns a ray",
                    {way: [(k, found[specs[k, way]].nanoseconds) for k in DIRECTIONS] for way in WAYS},
                    level=(found[base].nanoseconds, base),
                ),
            ),
        )


def fewer_but_slower(lab: Lab) -> Iterator[Outcome]:
    """Whole queries of projected rays against a kd-tree of the same rules."""
    yield from thesis.nowhere(lab)
    for name, workload in thesis.scenes(lab):
        for configuration, base in BASE.items():
            specs = {way: spec(configuration, 13, way) for way in WAYS}
            found = kd.times(lab, workload, [base, *specs.values()], alone=False)
            own = found[specs["projected"]]
            parts = {key: own.counters[key] / found[base].counters[key] for key in ("tests", "steps")}
            times = {way: found[one].share(found[base]) for way, one in specs.items()}
            yield Outcome(
                configuration,
                verdict(times["projected"].above(), holds=parts["tests"] < 1 and parts["steps"] < 1),
                f"{name}: {parts['tests']:.2f} of the tests of {base}, {parts['steps']:.2f} of its nodes, "
                f"{times['projected'].value:.2f} of its time; {times['dir'].value:.2f} with the generic node",
                f"per ray: {base} {found[base].counters['steps']:.1f} nodes and {found[base].counters['tests']:.1f} "
                f"tests; {specs['projected']} {own.counters['steps']:.1f} and {own.counters['tests']:.1f}",
                lab.error(workload, [base, *specs.values()]),
                parts | {f"time {way}": share.value for way, share in times.items()},
            )


CLAIMS = (
    Claim(
        "rbsp-projected",
        PAPER,
        "Projecting a ray onto the K directions once makes each step as cheap as in a kd-tree.",
        projected,
        thesis.MODELS,
    ),
    Claim(
        "rbsp-fewer-steps",
        PAPER,
        "RBSP takes fewer intersections and steps than a kd-tree, but is slower; with rays projected once.",
        fewer_but_slower,
        thesis.MODELS,
    ),
)
