# SPDX-License-Identifier: GPL-3.0-or-later
"""Benchmark rows as CSV and as sentences: the answer of a scene, and what was found on it.

Every time is shown with the error measured for the same configuration.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base import csv_text
from ..base.notes import NAMES_IN_A_SENTENCE, few
from ..measure import counting, curve, inference, ranking, yardstick
from ..measure.rows import Row, agrees, building, by_scene, eager, is_lazy, set_names
from . import tables

PICTURES = ("map", "portrait")
"""Columns of rows that hold pictures."""


def names(rows: Sequence[Row]) -> str:
    """The configurations of rows in a sentence: at most three names, and the number of the others."""
    specs = [row["spec"] for row in rows]
    if len(specs) > NAMES_IN_A_SENTENCE:
        return f"{len(specs)} structures ({few(specs)})"
    return " and ".join(filter(None, [", ".join(specs[:-1]), *specs[-1:]]))


def without_pictures(row: Row) -> dict[str, Any]:
    """The columns of a row but those that hold pictures."""
    return {key: value for key, value in row.items() if key not in PICTURES}


def as_csv(rows: Sequence[Row]) -> str:
    """The rows with one column per number; nested keys are joined by dots. Pictures are only in `bench.json`."""
    flat = [dict(_flatten("", without_pictures(row))) for row in rows]
    columns = list(dict.fromkeys(name for row in flat for name in row))
    return csv_text.text(flat, columns)


def _flatten(prefix: str, value: Any) -> Iterable[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flatten(f"{prefix}.{name}" if prefix else name, inner)
    elif isinstance(value, list):
        yield prefix, "; ".join(map(str, value))
    else:
        yield prefix, value


IMAGE = "1024 × 1024 pixels with 16 samples"
"""The picture whose time `image_s` of a row predicts, as text."""

QUANTITIES = {
    ranking.PICTURE: f"the build and one picture of {IMAGE}",
    ranking.TRACING: "the build and one million rays of each set",
}
"""Quantities that the answer of a scene ranks, the most useful first."""


def answer(rows: Sequence[Row]) -> str:
    """The quickest structure of a scene's rows, and the errors of all; "" without two comparable rows."""
    found = winner(rows)
    compared = [row for row in rows if row["errors"] and not yardstick.is_foreign(row["spec"])]
    if not found or not compared:
        return found
    wrong = [row for row in compared if not agrees(row)]
    told = f"{names(wrong)} gave wrong ones and are not ranked" if wrong else "all are right"
    most = max(row["errors"]["rays"] for row in compared)
    return f"{found} Up to {most:,} answers of each were compared: {told}."


def winner(rows: Sequence[Row]) -> str:
    """The quickest structure of a scene's rows in one sentence; "" without two comparable rows."""
    by_table = ranking.by_table(
        [row for row in rows if not yardstick.is_foreign(row["spec"]) and row["rays"] and agrees(row)]
    )
    # The best of all is that which goes as fast as it can.
    own = next((by_table[name] for name in ("fastest", "", "chosen", "single") if name in by_table), [])
    return next((told for name in QUANTITIES for told in _about_quantity(own, name)), "")


def _about_quantity(rows: Sequence[Row], name: str) -> Iterator[str]:
    """The quickest of the rows of one table for one of QUANTITIES: one, or several that the rounds do not separate."""
    found = ranking.rank(rows, name)
    if found is None:
        return
    best, what = found.best["spec"], QUANTITIES[name]
    known = ranking.part(found.best, name)
    assert known is not None, "it was ranked"
    seconds = 1.0 / np.array(known["rounds"], np.float64)
    ends = inference.interval(seconds)
    between = f"{' to '.join(map(seconds_text, ends))} with 95 % confidence, " if ends else ""
    took = f"{seconds_text(float(np.median(seconds)))} (build {seconds_text(building(found.best))}; {between}"
    took += f"{found.rounds} rounds)"
    if not found.ranked:
        yield f"{best} has the best median for {what}, {took}: fewer than {inference.LEAST_ROUNDS} rounds rank nothing."
        return
    text = f"{best} is the quickest for {what}: {took}"
    if found.equal:
        text = (
            f"{names([found.best, *found.equal])} cannot be told apart for {what}: {took} with {best}, the best "
            f"median, and a noise of {100 * found.noise:.1f} %"
        )
    if found.second is not None:
        times = f"{found.times:.2f} times as long (95 %: {found.low:.2f} to {found.high:.2f})"
        text += f"; the next, {found.second['spec']}, takes {times}"
    yield text + "."


def findings(rows: Sequence[Row]) -> list[str]:
    """The findings of one scene's rows, as sentences."""
    measured = [row for row in rows if row["errors"] and not yardstick.is_foreign(row["spec"])]
    sentences = [*_about_errors(measured), *_about_moved(measured)]
    right = [row for row in measured if agrees(row)]
    # Compare like with like: rows of two tables trace their rays in different ways.
    for table, own in ranking.by_table(right).items():
        about = [*_about_rankings(own, set_names(rows)), *_about_first_pictures(own)]
        about += _about_quantity(own, ranking.TRACING)
        if about:
            about[0] = f"{tables.NAMED[table]}: {about[0]}"
        sentences += about
    sentences += [*_about_pictures(right), *tables.about_yardstick(rows)]
    failed = [row["spec"] or "the scene" for row in rows if row["error"]]
    if failed:
        sentences.append(f"Failed, with the reason below: {few(failed)}.")
    return sentences


def _about_rankings(right: Sequence[Row], sets: Sequence[str]) -> Iterator[str]:
    """The fastest rows of one table, per ray set; those of too few rounds in one sentence."""
    found, unsure = tables.rankings(right, sets)
    if unsure:
        yield unsure
    for name, one in found.items():
        told = [_about_ranking(one, name)] if one.ranked else []
        told += [f"The times of {names(one.apart)} are not comparable with theirs."] if one.apart else []
        if told:
            yield f"{name.capitalize()} rays: {' '.join(told)}"


def _about_errors(measured: Sequence[Row]) -> Iterator[str]:
    # Report errors first, because rows with wrong answers are not ranked.
    wrong = [row for row in measured if not agrees(row)]
    if wrong:
        yield f"Answers that differ from the reference, and are therefore not ranked: {names(wrong)}."
    elif measured:
        reference = measured[0]["errors"]["reference"]
        # The reference is compared with itself on only a few rays.
        others = [row for row in measured if row["spec"] != reference] or measured
        checked = min(row["errors"]["rays"] for row in others)
        # Rule of three: no event in n trials excludes a rate above 3/n with 95 % confidence.
        yield (
            f"All {len(others)} structures agree with {reference} on every ray compared, at least {checked:,} each: "
            f"fewer than one ray in {checked // 3:,} is answered wrongly, with 95 % confidence."
        )


def _about_moved(measured: Sequence[Row]) -> Iterator[str]:
    """Wrong answers on the moved grids, which are separate from the scene."""
    worst = {row["spec"]: max(row["offsets"], key=lambda point: point["wrong"]) for row in measured if row["offsets"]}
    wrong = [f"{spec} {p['wrong']:,} of {p['rays']:,}" for spec, p in worst.items() if p["wrong"]]
    if wrong:
        yield (
            "On the grid of touching boxes, moved away from the origin, other answers than brute force's, where they "
            f"are most: {few(wrong)}."
        )


def _about_first_pictures(measured: Sequence[Row]) -> Iterator[str]:
    """Time until the camera rays are answered, for lazily built trees against the same tree built at once."""
    timed = {row["spec"]: row for row in measured if row.get("first_s")}
    for spec, row in timed.items():
        at_once = timed.get(eager(spec))
        if is_lazy(spec) and at_once is not None and row["machine"] == at_once["machine"]:
            took, other = row["first_s"]["med"], at_once["first_s"]["med"]
            differing = row["errors"]["differing_pixels"] + at_once["errors"]["differing_pixels"]
            yield (
                f"Build and camera rays together take {seconds_text(took)} with {spec}, {took / other:.2f} of the "
                f"{seconds_text(other)} with {at_once['spec']}; {differing} rays differ."
            )


def _about_pictures(measured: Sequence[Row]) -> Iterator[str]:
    """Whether pictures are equal, and the time they take."""
    drawn = [row for row in measured if row["curve"]]
    if len(drawn) < 2:
        return
    # Compare at the largest sample count that at least half of them reached.
    samples = sorted(row["curve"][-1]["spp"] for row in drawn)[len(drawn) // 2]
    times = sorted((p["seconds"], row["spec"]) for row in drawn for p in row["curve"] if p["spp"] == samples)
    (quickest, _), (slowest, _) = times[0], times[-1]
    yield (
        f"The pictures of {len(drawn)} structures are equal bit for bit; with {samples} "
        f"{'sample' if samples == 1 else 'samples'} per pixel that took {seconds_text(quickest)} to "
        f"{seconds_text(slowest)}."
    )
    yield from about_sweeps(drawn)
    points = max((pictures_of(row) for row in drawn), key=len)
    alone = drawn[0].get("independent") or []
    yield from about_slopes(points, alone)


def pictures_of(row: Row) -> list[dict[str, Any]]:
    """The errors of the pictures of each sample count, also of those that a structure had no time for."""
    known = row.get("converged")
    return known["points"] if known else row["curve"]


def about_slopes(points: Sequence[Mapping[str, Any]], alone: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Convergence of the error with the samples, for pictures and for means of independent samples,
    each with `rmse`.
    """
    if len(points) < 3:
        return
    own = curve.slope(points)
    text = f"Their error (RMSE) falls with the samples to the power {signed(own)}"
    if own >= 0.0:
        text = f"Their error (RMSE) does not fall with so few samples (power {signed(own)}): bright pixels decide it"
    if len(alone) > 2:
        apart = curve.slope(alone)
        text += (
            f"; that of independent samples falls to the power {signed(apart)}, in theory −0.50 ({curve.judged(apart)})"
        )
        if own < apart:
            text += ": the difference is the gain of stratified samples"
    yield text + "."


def about_sweeps(rows: Sequence[Row]) -> Iterator[str]:
    """Whether a tree with oblique planes repays its build within one picture."""
    found = worth(rows)
    if found is None:
        return
    took = seconds_text(image_total(found.best) or 0.0)
    yield (
        f"The build and one picture of {IMAGE}, predicted from smaller ones, take {took} with {found.best['spec']}, "
        f"the best of {found.among} {'tree' if found.among == 1 else 'trees'} with oblique planes{_beside_kd(found)}."
    )


def _beside_kd(found: Worth) -> str:
    """Comparison with kd: by seconds if timed in the same rounds, else by the ratio, which seconds could contradict."""
    is_beside = ranking.together(found.best, found.plain)
    if found.verdict and not is_beside:
        times = statistics.median(ranking.against(found.best, found.plain, ranking.PICTURE))
        return f", {found.verdict} than with kd, which takes {times:.2f} times as long"
    plain = f"the {seconds_text(image_total(found.plain) or 0.0)} with kd" if is_beside else "kd"
    return f", {found.verdict} than {plain}" if found.verdict else f"; equal within noise to {plain}"


def image_total(row: Row) -> float | None:
    """Median seconds of a row's build plus one picture; None without a picture."""
    seconds = row.get("image_s")
    if seconds is None or not row["build_s"]:
        return None
    return building(row) + float(seconds["med"])


def image_interval(row: Row) -> tuple[float, float] | None:
    """95 % interval of the same, from those of build and picture, or None without one of them."""
    seconds, build = row.get("image_s"), row["first_s"] if is_lazy(row["spec"]) and row["first_s"] else row["build_s"]
    if not seconds or not build or "low" not in seconds or "low" not in build:
        return None
    # Their errors are independent, so that half widths add up as squares.
    half = math.hypot(*((one["high"] - one["low"]) / 2 for one in (seconds, build)))
    middle = sum(float(one["high"] + one["low"]) / 2 for one in (seconds, build))
    return middle - half, middle + half


@dataclass(frozen=True)
class Worth:
    """The best of `among` trees with oblique planes, against `kd`. verdict: faster, slower, or "" within noise."""

    best: Row
    plain: Row
    among: int
    verdict: str


def worth(rows: Sequence[Row]) -> Worth | None:
    """Build plus picture of the best tree with oblique planes against those of kd; None if either is missing."""
    totals = [(whole, row) for row in rows if agrees(row) and (whole := image_total(row)) is not None]
    # Compare the fastest traversals of both sides.
    totals = [(whole, row) for whole, row in totals if "fastest" in row["tables"]]
    plains = [(whole, row) for whole, row in totals if row["tree"] == "kd"]
    plain = min(plains, key=lambda item: item[0], default=(0.0, None))[1]
    # If all normals are axes, it is a kd-tree.
    sweeps = [(whole, row) for whole, row in totals if (row["statistics"] or {}).get("nodes_oblique")]
    if plain is None or not sweeps:
        return None
    _, best = min(sweeps, key=lambda item: item[0])
    verdict = ""
    if ranking.faster(best, plain, ranking.PICTURE, among=len(sweeps)):
        verdict = "faster"
    elif ranking.faster(plain, best, ranking.PICTURE):
        verdict = "slower"
    return Worth(best, plain, len(sweeps), verdict)


def worth_it(rows: Sequence[Row]) -> list[str]:
    """The scenes on which build plus picture are faster with a tree with oblique planes than with kd, beyond noise."""
    found = {scene: worth(own) for scene, own in by_scene(rows).items()}
    return [scene for scene, one in found.items() if one is not None and one.verdict == "faster"]


def _about_ranking(found: ranking.Ranking, name: str) -> str:
    """The fastest rows of a ray set with enough rounds, as a sentence."""
    best = found.best["spec"]
    noise = f"the noise is {100 * found.noise:.1f} %"
    if found.equal:
        text = f"{names([found.best, *found.equal])} are equal within noise ({noise})"
        if found.second is not None:
            text += f"; the next, {found.second['spec']}, is {found.times:.2f} times slower than {best}"
    else:
        assert found.second is not None
        text = (
            f"{best} is the fastest, {found.times:.2f} times {found.second['spec']} "
            f"(95 %: {found.low:.2f} to {found.high:.2f}; {noise})"
        )
    return f"{text}{_because(found, name)}."


def _because(found: ranking.Ranking, name: str) -> str:
    """The counters that explain a ranking: fewer steps, fewer tests, or neither; "" without step counts."""
    if found.second is None:
        return ""
    best, other = (dict(row["rays"][name]) for row in (found.best, found.second))
    if best["steps"] is None or other["steps"] is None:
        return ""
    pair = (found.best, found.second)
    uncounted = [row["spec"] for row in pair if not counting.counts_timed_traversal(row, name)]
    if uncounted:
        return f"; counters do not explain it: rays of {' and '.join(uncounted)} are {counting.ONE_BY_ONE}"
    words = {"steps": "steps", "tests": "triangle tests"}
    fewer = [key for key in words if best[key] < 0.95 * other[key]]
    reasons = " and ".join(f"{best[key]:.1f} {words[key]} per ray against {other[key]:.1f}" for key in fewer)
    if reasons:
        return f", because {found.best['spec']} needs {reasons}"
    if not best["steps"]:
        return ""
    return (
        f", because its steps are cheaper: it needs about as many of them, or more ({best['steps']:.1f} against "
        f"{other['steps']:.1f}), and about as many tests, or more ({best['tests']:.1f} against {other['tests']:.1f})"
    )


def signed(value: float) -> str:
    """A number with two digits and its sign."""
    return f"{value:.2f}".replace("-", "−")


def seconds_text(value: float) -> str:
    """Seconds with three digits."""
    return f"{1e3 * value:.3g} ms" if value < 0.9995 else f"{value:.3g} s" if value < 1000 else f"{value:,.0f} s"
