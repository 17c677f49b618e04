# SPDX-License-Identifier: GPL-3.0-or-later
"""Wrong answers of structures on extreme cases: against brute force for every ray, exact arithmetic for some.

Each row of a case also has the processor time of its rays, and its ratio to that of brute force.

A structure without error bounds (`robust=none`) is measured next to the others: its failures prove that the comparison
can fail.
"""

from __future__ import annotations

import html
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.measure import accuracy
from ...core.measure.accuracy import Answers, Errors, Mask
from ...core.structures import catalogue, specs, ways

if TYPE_CHECKING:
    from ...core.base.interface import Native, Structure

Row = dict[str, Any]

COUNTS = ("rays", "false_miss", "false_hit", "wrong_triangle", "wrong_values", "wrong_any_hit")
TITLES = {
    "rays": "rays",
    "false_miss": "false misses",
    "false_hit": "false hits",
    "wrong_triangle": "wrong triangles",
    "wrong_values": "wrong u, v",
    "wrong_any_hit": "wrong any hit",
    "t_ulp_max": "|Δt| ulps",
    "exact_rays": "exact rays",
    "exact_wrong": "exact wrong",
    "exact_t_ulp_max": "exact |Δt| ulps",
    "on_boundary": "on a boundary",
}
"""Columns of the tables, and their titles."""

TIMES = {"microseconds": "µs a ray", "times_brute": "× brute"}
"""Columns of time, and their titles: processor time of a nearest hit and an any-hit, and its ratio to brute force."""

SECONDS = ("trace_seconds", "brute_seconds")
"""Columns from which those of time are computed: seconds of all rays through the structure, and by brute force."""

SLOWER = 1.25
"""Ratio to the time of brute force above which a structure counts as slower; rounds of one machine differ by less."""

CALL = 2e-4
"""Seconds by which a structure that counts as slower exceeds brute force at least: what two calls take without rays."""

REPEATS, LONG = 3, 0.1
"""Number of times that rays are traced for the least time, and seconds from which on once is enough."""

BOUNDARY = (
    "A ray is on a declared boundary when exact arithmetic finds that it passes exactly through an edge or a corner of "
    "the triangle that it hits; a ray in a triangle's plane hits nothing. Other comparisons exclude such rays, because "
    "rounding decides them. Here none is excluded: the column is the number of exact rays of that kind."
)
"""Explanation of the column *on a boundary*."""

NEUTRAL = ("rays", "exact_rays", "on_boundary")
"""Columns that do not count errors."""

EXACT_PAIRS = {"small": 200_000, "large": 4_000_000}
"""Number of ray-triangle pairs per case that exact arithmetic decides."""


MOST_RAYS = {
    "small": {"needles": 100, "mixed exponents": 400, "camera far away": 150, "chain": 200, "random bits": 50},
}
"""By size: cases of which only this number of evenly spaced rays is traced. Nearly all their ray-triangle pairs are
undecided in f64 and need exact arithmetic; all of their rays would take as long as all other cases together.
"""


RAYS = ("origins", "directions", "t_min", "t_max")
"""The arrays of a case's rays, in the order of a structure's arguments."""


def fewer_rays(case: Mapping[str, Any], most: int | None) -> dict[str, Any]:
    """A case of `native.cases()` with at most `most` of its rays; None for all."""
    count = len(case["origins"])
    if most is None or count <= most:
        return dict(case)
    chosen = np.linspace(0, count - 1, most).astype(np.int64)
    return {**case, **{name: case[name][chosen] for name in RAYS}}


def configurations(structures: Sequence[Mapping[str, Any]], chosen: Sequence[str]) -> list[str]:
    """Each chosen configuration with every traversal, every shadow method, and without error bounds.

    structures: the native registry. A key that a configuration sets is not varied, nor is one that its structure lacks.
    """
    rows = {row["id"]: row for row in structures}
    known = catalogue.of(structures)
    made: list[str] = []
    for spec in chosen:
        # Add the traversals, the shadow methods and the unbounded variants of the structure.
        row = rows[specs.structure_of(spec)]
        keys = {parameter["name"]: parameter for parameter in row["parameters"]}
        walks = [spec]
        if not ways.is_spelled(spec):
            others = (ways.spelled(known[row["id"]], spec, way) for way in known[row["id"]].ways[1:])
            walks += [other for other in others if not specs.idle(other)]
        made += walks
        if "shadow" in keys and "shadow=" not in spec:
            shadows = (specs.joined(spec, f"shadow={name}") for name in keys["shadow"]["options"][1:])
            made += [other for other in shadows if not specs.idle(other)]
        if "robust" in keys and "robust=" not in spec and "none" in (keys["robust"]["options"] or ()):
            made += [specs.joined(walk, "robust=none") for walk in walks]
    return list(dict.fromkeys(made))


VERSION = 4
"""Version of the rows: increment when a row's content changes; rows of earlier runs are then not reused."""


def only_shadows(spec: str) -> bool:
    """Whether the configuration only changes the shadow method, which does not affect nearest hits."""
    return dict(specs.pairs(spec)).get("shadow", "none") != "none"


def different(*arrays: Any) -> int:
    """Number of bitwise distinct rays in arrays of n rows (a row is a ray) or n numbers."""
    columns = np.concatenate([np.asarray(one, np.float32).reshape(len(one), -1) for one in arrays], axis=1)
    rows = np.ascontiguousarray(columns).view(np.dtype((np.void, columns.shape[1] * 4)))
    return len(np.unique(rows))


def allowed_to_fail(spec: str) -> bool:
    """Whether the configuration is measured to demonstrate failures."""
    return "robust=none" in spec


TILE = 64
"""Rays that tile and beam traversals trace together if their order is a tile order."""


def nearest(structure: Structure, rays: Sequence[Any], *, threads: int = 0) -> Answers:
    """The nearest hits, traced in tiles where possible. rays: (origins, directions, t_min, t_max) as arrays.

    Traversals without tiles trace the rays singly, and all traversals do so beyond the last whole tile.
    """
    whole = len(rays[0]) // TILE * TILE
    tiles = Answers.of(structure.closest(*(part[:whole] for part in rays), order="tile8", threads=threads))
    if whole == len(rays[0]):
        return tiles
    rest = Answers.of(structure.closest(*(part[whole:] for part in rays), threads=threads))
    return Answers(
        np.concatenate([tiles.t, rest.t]),
        np.concatenate([tiles.triangle, rest.triangle]),
        np.concatenate([tiles.u, rest.u]),
        np.concatenate([tiles.v, rest.v]),
    )


def measure_case(
    native: Native, case: Mapping[str, Any], specs: Iterable[str], *, exact_pairs: int, threads: int = 0
) -> Iterator[Row]:
    """One row per configuration on one case of `native.cases()`, from the errors of `case_errors`."""
    apart = different(*(case[name] for name in RAYS))
    for spec, errors, beside, seconds in case_errors(native, case, specs, exact_pairs=exact_pairs, threads=threads):
        about = {"case": case["name"], "spec": spec, "triangles": len(case["triangles"]), "different_rays": apart}
        yield {**about, **columns(errors, beside), **dict(zip(SECONDS, seconds, strict=True))}


def case_errors(
    native: Native, case: Mapping[str, Any], specs: Iterable[str], *, exact_pairs: int, threads: int = 0
) -> Iterator[tuple[str, Errors, Errors, tuple[float, float]]]:
    """Each configuration with its errors against brute force, and against exact arithmetic, and its times, on one case.

    Nearest hits and any-hits are compared with both references. exact_pairs: approximate number of ray-triangle pairs
    that exact arithmetic decides; 0 for none. Times are the processor seconds of all rays, and those of brute force.
    """
    # Compute both references, then compare each configuration with them.
    scene = case["vertices"], case["triangles"]
    rays = tuple(case[name] for name in RAYS)
    count = len(rays[0])
    brute, _, limit = answered(native.build(*scene, "brute", threads=threads), rays, threads=threads)
    wanted = min(count, exact_pairs // max(1, len(scene[1])))
    sample = np.unique(np.linspace(0, count - 1, wanted).astype(np.int64))
    exact = Answers.of(native.exact_closest(*scene, *(part[sample] for part in rays), threads=threads))
    for spec in specs:
        structure = native.build(*scene, spec, threads=threads)
        answers, occluded, seconds = answered(structure, rays, threads=threads)
        errors = accuracy.compare(brute, answers, occluded, native.ulp_distance, bitwise=True)
        beside = accuracy.compare(exact, answers.take(sample), occluded[sample], native.ulp_distance, bitwise=True)
        yield spec, errors, beside, (seconds, limit)


def answered(structure: Structure, rays: Sequence[Any], *, threads: int = 0) -> tuple[Answers, Mask, float]:
    """The nearest hits, the any-hits, and the least processor seconds that both took. rays: as for `nearest`."""
    least = float("inf")
    for _ in range(REPEATS):
        began = time.process_time()
        answers = nearest(structure, rays, threads=threads)
        occluded = structure.occluded(*rays, threads=threads)
        least = min(least, time.process_time() - began)
        if least > LONG:
            break
    return answers, occluded, least


def is_slower(row: Row) -> bool:
    """Whether a row's rays took longer than by brute force, beyond noise. Rows without times are not."""
    if SECONDS[0] not in row:
        return False
    taken, brute = (row[name] for name in SECONDS)
    return bool(taken > SLOWER * brute and taken - brute > CALL)


def columns(errors: Errors, exact: Errors) -> Row:
    """The columns of a row: errors against brute force, and against exact arithmetic."""
    row = errors.as_row("brute")
    columns = {name: row[name] for name in (*COUNTS, "t_ulp_max")}
    columns["exact_rays"] = exact.rays
    columns["on_boundary"] = exact.on_boundary
    columns["exact_wrong"] = exact.false_miss + exact.false_hit + exact.wrong_triangle
    columns["exact_t_ulp_max"] = int(exact.ulps.max()) if len(exact.ulps) else 0
    return columns


def differs(row: Row) -> bool:
    """Whether any answer of the row differs from brute force in any bit, or from the exact one."""
    return any(row[name] for name in (*COUNTS[1:], "t_ulp_max", "exact_wrong", "exact_t_ulp_max"))


def add(total: Row | None, row: Row) -> Row:
    """The sum of two rows of one configuration; distances keep the maximum."""
    if total is None:
        return {**row, "case": "all"}
    summed = (*COUNTS, "different_rays", "exact_rays", "exact_wrong", "on_boundary")
    largest = ("t_ulp_max", "exact_t_ulp_max", "triangles")
    timed = SECONDS if SECONDS[0] in row else ()
    return {
        **total,
        **{name: total[name] + row[name] for name in (*summed, *timed)},
        **{name: max(total[name], row[name]) for name in largest},
    }


def sums(rows: Iterable[Row]) -> list[Row]:
    """One row per configuration over all cases."""
    found: dict[str, Row] = {}
    for row in rows:
        found[row["spec"]] = add(found.get(row["spec"]), row)
    return list(found.values())


def limit(rows: Iterable[Row], reference: str = "brute force") -> str:
    """The statistical meaning of no differences, in one sentence.

    Answers of several configurations to one ray are dependent, and so are those to repeated rays: N is the number of
    distinct rays. reference: name of the reference.
    """
    ours = [row for row in rows if not allowed_to_fail(row["spec"])]
    answers = sum(row["rays"] for row in ours)
    wrong = sum(differs(row) for row in ours)
    if wrong or not answers:
        return f"{wrong} of {len(ours)} rows differ, {answers:,} answers compared"
    # All configurations trace the same rays.
    each = sums(ours)
    apart, exact = (min(row[name] for row in each) for name in ("different_rays", "exact_rays"))
    beside = f" and in {sum(row['exact_rays'] for row in each):,} to {exact:,} rays against exact arithmetic"
    return (
        f"no difference in {answers:,} answers of {len(each):,} configurations to {apart:,} different rays against "
        f"{reference}{beside if exact else ''}: fewer than {3 / apart:.1e} of such rays are answered wrongly by any of "
        "them, with 95 % confidence (3/N of N different rays)"
    )


def table(rows: Sequence[Row]) -> str:
    """The rows as aligned columns; zeros are dots, so that errors stand out. A mark: slower than brute force."""
    timed = all(SECONDS[0] in row for row in rows)
    lines = [["case", "structure", *TITLES.values(), *(TIMES.values() if timed else ())]]
    for row in rows:
        counts = (str(row[name] or "·") for name in TITLES)
        lines.append([row["case"], row["spec"], *counts, *(_times(row) if timed else ())])
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    aligned = [
        "  ".join(
            cell.ljust(w) if i < 2 else cell.rjust(w) for i, (cell, w) in enumerate(zip(line, widths, strict=True))
        )
        for line in lines
    ]
    return "\n".join([aligned[0], "-" * len(aligned[0]), *aligned[1:]])


def _times(row: Row) -> tuple[str, str]:
    """The cells of time: microseconds a ray, and the ratio to brute force, with a mark if the row counts as slower."""
    taken, brute = (row[name] for name in SECONDS)
    ratio = taken / brute if brute else 1.0
    return f"{1e6 * taken / max(1, row['rays']):.2f}", f"{ratio:.2f}{'!' if is_slower(row) else ' '}"


SCREEN = 40
"""Largest number of configurations that `screen` shows."""


def screen(rows: Sequence[Row]) -> str:
    """The sums of each configuration as a table of at most SCREEN lines: first those that differ and must not."""
    ordered = sorted(sums(rows), key=lambda row: allowed_to_fail(row["spec"]) or not differs(row))
    shown, rest = ordered[:SCREEN], ordered[SCREEN:]
    lines = [table(shown)] if shown else []
    if rest:
        lines.append(f"and {len(rest):,} more, {sum(map(differs, rest)):,} of which differ")
    return "\n".join(lines)


def as_html(document: Mapping[str, Any]) -> str:
    """One self-contained HTML page: errors of each configuration over all cases, and case by case."""
    rows: list[Row] = document["rows"]
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>Stability</title>'
        "<style>body{font:15px/1.4 sans-serif;margin:2em auto;max-width:75em}table{border-collapse:collapse}"
        "td,th{padding:.15em .6em;text-align:right;border-bottom:1px solid #8884}td:nth-child(-n+2),th:nth-child(-n+2)"
        "{text-align:left}.wrong{font-weight:bold}.none{color:#777}</style>"
        f"<h1>Stability</h1><p>{html.escape(document['verdict'])}.</p>"
        "<p>Rows with <code>robust=none</code> are textbook traversals without error bounds; they are never "
        f"used for pictures.</p><p>{html.escape(BOUNDARY)}</p>"
        f"<h2>All cases</h2>{_html_table(sums(rows))}<h2>Case by case</h2>{_html_table(rows)}</html>\n"
    )


def _html_table(rows: Sequence[Row]) -> str:
    timed = all(SECONDS[0] in row for row in rows)
    titles = ("case", "structure", *TITLES.values(), *(TIMES.values() if timed else ()))
    head = "".join(f"<th>{html.escape(title)}</th>" for title in titles)
    body = []
    for row in rows:
        cells = [f"<td>{html.escape(row[name])}</td>" for name in ("case", "spec")]
        for name in TITLES:
            wrong = row[name] and name not in NEUTRAL
            cells.append(f'<td class="wrong">{row[name]:,}</td>' if wrong else f"<td>{row[name]:,}</td>")
        times = _times(row) if timed else ()
        cells += [f"<td{' class=wrong' if cell.endswith('!') else ''}>{cell}</td>" for cell in times]
        body.append(f"<tr{' class=none' if allowed_to_fail(row['spec']) else ''}>{''.join(cells)}</tr>")
    return f"<table><tr>{head}</tr>{''.join(body)}</table>"
