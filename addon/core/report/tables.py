# SPDX-License-Identifier: GPL-3.0-or-later
"""Benchmark rows as text tables for a terminal of 100 columns.

Each scene has up to three: one ray at a time, as fast as it goes, and configurations that fit neither. Like is with
like: no mark and no sentence compares rows of two tables. Every time is next to the errors of its configuration.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..base.notes import few
from ..measure import inference, ranking, yardstick
from ..measure.rows import Row, agrees, by_scene, set_names
from ..structures import specs

TITLES = {
    "single": "One ray at a time: each structure through its own nodes",
    "fastest": "As fast as it goes: each structure with its quickest nodes and rays",
    "chosen": "As chosen: configurations that fit neither table",
}
"""Title of each table."""

NAMED = {table: title.partition(":")[0] for table, title in TITLES.items()}
"""Name of each table."""

ULPS = "t_ulp_max"

ERRORS = {
    "false_miss": ("m", "false misses"),
    "false_hit": ("h", "false hits"),
    "wrong_triangle": ("t", "wrong triangles"),
    "wrong_values": ("v", "wrong u or v"),
    "wrong_any_hit": ("a", "wrong any-hits"),
    ULPS: ("d", "largest difference of t in ulps"),
}
"""Error columns: title and meaning."""

WIDTH = 100
"""Columns of the terminal that the tables are made for."""

NAMES = 3
"""Number of columns with names; the others hold numbers."""

DASH = "-"


def text(rows: Sequence[Row]) -> str:
    """The rows as aligned tables, with what their columns mean, the fastest rows, and the reasons for gaps."""
    return "\n\n".join(block for scene, own in by_scene(rows).items() for block in _of_scene(scene, own))


def _of_scene(scene: str, rows: Sequence[Row]) -> Iterator[str]:
    """The blocks of text of one scene."""
    yield "\n".join(heading(scene, rows))
    # Failed rows have only a reason, whatever their table.
    done = [row for row in rows if not row["error"]]
    for table, own in ranking.by_table(done).items():
        if any(not yardstick.is_foreign(row["spec"]) for row in own):
            yield "\n".join(_table(table, own))
    failed = (f"{row['spec'] or scene}: {row['error']}" for row in rows if row["error"])
    reasons = [*about_yardstick(done), *_gaps(done), *failed]
    if reasons:
        yield "\n".join(map(_wrapped, reasons))


def heading(scene: str, rows: Sequence[Row]) -> list[str]:
    """The lines above the tables of a scene: what was measured, and what the columns of errors mean."""
    first, second, errors = measured(scene, rows)
    *most, last = (f"{title} {meaning}" for title, meaning in ERRORS.values())
    return [first, second, f"{errors}: {', '.join(most[:3])},", f"{', '.join(most[3:])}, {last}."]


def measured(scene: str, rows: Sequence[Row]) -> tuple[str, str, str]:
    """The head of the tables of a scene: scene and units in two lines, and the reference of the answers."""
    checked = max((row["errors"]["rays"] for row in rows if row["errors"]), default=0)
    reference = next((row["errors"]["reference"] for row in rows if row["errors"]), "nothing")
    ours = sorted({row["threads"] for row in rows if not yardstick.is_foreign(row["spec"]) and row["threads"]} or {1})
    threads = f"{' and '.join(map(str, ours))} {'thread' if ours == [1] else 'threads'}"
    if ours != [1] and any(row["spec"] == yardstick.SPEC for row in rows):
        threads += " (Embree: 1)"
    count = rows[0]["triangles"]
    layout = "".join(f", {found}" for found in dict.fromkeys(row["layout"] for row in rows if row.get("layout")))
    return (
        f"{scene}: {count:,} {'triangle' if count == 1 else 'triangles'}{layout}, {threads}. Build in seconds,",
        "memory in MB, median speeds in million rays per second, ± half their 95 % interval.",
        f"Errors against {reference} on {checked:,} rays each",
    )


def _table(table: str, rows: Sequence[Row]) -> Iterator[str]:
    """The lines of one table."""
    sets = set_names(rows)
    kept = shown(rows, sets) if table == "fastest" else list(rows)
    yield TITLES[table]
    # Align names to the left and numbers to the right.
    titles = ["structure", "nodes", "rays", "build", "MB", *sets, *(title for title, _ in ERRORS.values())]
    lines = [titles, *(cells(row, sets) for row in kept)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(titles))]
    aligned = [" ".join(map(_aligned, line, widths, range(len(widths)))) for line in lines]
    yield from (aligned[0], "-" * len(aligned[0]), *aligned[1:])
    if len(kept) < len(rows):
        yield f"Left out: {len(rows) - len(kept)} rows whose structure has quicker nodes for each ray set."
    yield from map(_wrapped, (*_legend(kept), *winners(rows, sets)))


def _wrapped(line: str) -> str:
    """A sentence in lines of at most WIDTH columns."""
    return textwrap.fill(line, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)


def _aligned(cell: str, width: int, column: int) -> str:
    return cell.ljust(width) if column < NAMES else cell.rjust(width)


def shown(rows: Sequence[Row], sets: Sequence[str]) -> list[Row]:
    """The rows of each structure that are its quickest on at least one ray set, in order; rows that err always."""
    best: set[int] = set()
    trees: dict[str, list[Row]] = {}
    for row in rows:
        trees.setdefault(row["tree"], []).append(row)
    for own in trees.values():
        for name in sets:
            timed = [row for row in own if _speed(row, name) is not None]
            best.update(id(row) for row in sorted(timed, key=lambda row: -(_speed(row, name) or 0.0))[:1])
        if not any(id(row) in best for row in own):
            best.update(map(id, own))
    return [row for row in rows if id(row) in best or (row["errors"] and not agrees(row))]


def best(rows: Sequence[Row], sets: Sequence[str]) -> set[tuple[int, str]]:
    """Pairs of a row's id and a ray set to mark: the fastest, and those equal to it within noise.

    No row is marked if a faster one is not: where noise separates a faster row but not this one, neither is. rows: of
    one table, in which a row that is in several tables is compared with the others of this one only.
    """
    ours = [row for row in rows if not yardstick.is_foreign(row["spec"])]
    found: set[tuple[int, str]] = set()
    for name, ranked in rankings(rows, sets)[0].items():
        if not ranked.ranked:
            continue
        equal = [ranked.best, *ranked.equal]
        known = set(map(id, equal))
        # Rows with wrong answers are not ranked, so their speed is no limit.
        slower = (_speed(row, name) or 0.0 for row in ours if id(row) not in known and agrees(row))
        limit = max(slower, default=0.0)
        found |= {(id(row), name) for row in equal if (_speed(row, name) or 0.0) > limit}
    return found


def _speed(row: Row, name: str) -> float | None:
    """Median million rays per second of a set; None if it was not timed."""
    one = (row["rays"] or {}).get(name)
    return None if not one or one["mrays_s"] is None else float(one["mrays_s"]["med"])


def cells(row: Row, sets: Sequence[str]) -> list[str]:
    """The texts of one line; missing numbers are dashes. Foreign tracers' errors have lines of their own."""
    build, size = row["build_s"], row["bytes"]
    errors = None if yardstick.is_foreign(row["spec"]) else row["errors"]
    return [
        row["label"],
        row["nodes"] or DASH,
        rays_text(row),
        DASH if not build else f"{build['med']:.3f}{plus_minus(build)}",
        DASH if size is None else f"{size / 1e6:.1f}",
        *(_speed_text(row, name) for name in sets),
        *(DASH if errors is None else str(errors[key]) for key in ERRORS),
    ]


def _speed_text(row: Row, name: str) -> str:
    """Median speed of a set in three digits, with its interval."""
    speed = _speed(row, name)
    if speed is None:
        return DASH
    digits = max(0, 2 - math.floor(math.log10(speed))) if speed > 0 else 2
    return f"{speed:.{min(digits, 3)}f}{plus_minus(row['rays'][name]['mrays_s'])}"


def plus_minus(found: Mapping[str, Any]) -> str:
    """Half the 95 % interval of a median in percent of it; "" where too few rounds give none."""
    if "low" not in found:
        return ""
    share = 100 * inference.half_width(found["low"], found["high"])
    return f"±{share:.0f}%" if share >= 1 else f"±{share:.1f}%"


def rays_text(row: Row) -> str:
    """The way of a row's rays: the name of its traversal if they go singly, else the different ways of its ray sets."""
    kinds = list(dict.fromkeys(_kinds(row).values()))
    if kinds == ["single"]:
        return dict(specs.pairs(row["spec"])).get("traversal", "single")
    return "+".join(kinds) or DASH


def _kinds(row: Row) -> dict[str, str]:
    """How the rays of each set that has rays go."""
    ways, timed = row["ways"] or {}, row["rays"] or {}
    return {name: way["rays"] for name, way in ways.items() if name in timed and timed[name]["n"]}


def _legend(rows: Sequence[Row]) -> Iterator[str]:
    """One line per combination of ways: which ray sets go which way."""
    lines = []
    for row in rows:
        kinds = _kinds(row)
        if len(set(kinds.values())) > 1:
            sets = {kind: ", ".join(name for name in kinds if kinds[name] == kind) for kind in kinds.values()}
            lines.append(f"{rays_text(row)}: {'; '.join(f'{names} by {kind}' for kind, names in sets.items())}")
    yield from dict.fromkeys(lines)


def rankings(rows: Sequence[Row], sets: Sequence[str]) -> tuple[dict[str, ranking.Ranking], str]:
    """The rankings of one table's rows by ray set, and a sentence on those of too few rounds; "" without any."""
    ours = [row for row in rows if not yardstick.is_foreign(row["spec"])]
    found = {name: one for name in sets if (one := ranking.rank(ours, name)) is not None}
    unsure = {name: one for name, one in found.items() if not one.ranked}
    if not unsure:
        return found, ""
    least = min(one.rounds for one in unsure.values())
    best = ", ".join(f"{name} {one.best['spec']}" for name, one in unsure.items())
    return found, f"Best medians: {best}. {least} rounds rank nothing; it takes {inference.LEAST_ROUNDS} (--repeats)."


def winners(rows: Sequence[Row], sets: Sequence[str]) -> Iterator[str]:
    """The fastest rows of one table, a line per ray set, as far as noise and number of rounds allow."""
    found, unsure = rankings(rows, sets)
    for name, one in found.items():
        best = f"Fastest, {name}: {one.best['spec']}"
        if one.ranked and one.equal:
            yield f"{best}; equal within noise: {few([row['spec'] for row in one.equal])}"
        elif one.ranked:
            assert one.second is not None, "two rows are ranked"
            yield f"{best}, {one.times:.2f} times {one.second['spec']} (95 %: {one.low:.2f} to {one.high:.2f})"
    if unsure:
        yield unsure


def about_yardstick(rows: Sequence[Row]) -> Iterator[str]:
    """The errors of foreign tracers, whose arithmetic differs."""
    for row in rows:
        if yardstick.is_foreign(row["spec"]) and row["errors"]:
            told = ", ".join(f"{row['errors'][key]:,} {meaning}" for key, (_, meaning) in ERRORS.items() if key != ULPS)
            name = "Embree" if row["spec"] == yardstick.SPEC else row["spec"]
            yield f"{name}, whose arithmetic differs: {told}, t up to {row['errors'][ULPS]:,} ulps apart."


def _gaps(rows: Sequence[Row]) -> Iterator[str]:
    """The reasons why ray sets have no rays."""
    timed = {name for row in rows for name, one in (row["rays"] or {}).items() if one["n"]}
    empty = [name for name in set_names(rows) if name not in timed]
    if empty:
        yield f"No {', '.join(empty)} rays: they start where camera rays hit, and none hits the scene."
