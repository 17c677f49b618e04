# SPDX-License-Identifier: GPL-3.0-or-later
"""Text as LaTeX, and tables in the style of the package booktabs."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

from ...core.measure import yardstick
from ...core.measure.rows import Row
from ...core.report import tables
from ...core.report.report import set_names

SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
    "`": "'",
    "…": r"\ldots{}",
    "–": "--",
    "−": "$-$",
    "×": r"$\times$",
    "⊥": r"$\perp$",
    "β": r"$\beta$",
    "²": r"$^2$",
    "⁵": r"$^5$",
    "\u00a0": "~",
    "\u202f": r"\,",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}
"""Characters that LaTeX reads as commands, or that its usual fonts lack."""

TITLES = {
    "single": "One ray at a time",
    "fastest": "As fast as it goes",
    "chosen": "As chosen",
    "": "All configurations",
}
"""Captions of the tables of like configurations."""


def escape(text: str) -> str:
    """Any text as LaTeX that shows it. Letters beyond those of Latin scripts become their code points."""
    return "".join(SPECIAL.get(sign) or _plain(sign) for sign in unicodedata.normalize("NFC", text))


def _plain(sign: str) -> str:
    """A character without a command of its own."""
    if sign.isspace() or ord(sign) < 0x20:
        return " "
    return sign if ord(sign) < 0x7F or 0xC0 <= ord(sign) < 0x17F else f"U+{ord(sign):04X}"


def table(rows: Sequence[Row], name: str) -> str:
    """A tabular of like configurations. Bold: the fastest, and those equal to it within noise.

    rows: of one scene and table. name: the table's, as in `TITLES`.
    """
    sets = set_names(rows)
    shown = tables.shown(rows, sets) if name == "fastest" else list(rows)
    best = tables.best(rows, sets)
    titles = ["structure", "nodes", "rays", "build, s", "MB", *sets, "wrong", "t, ulp"]
    lines = [r"\begin{tabular}{lll" + "r" * (len(titles) - 3) + "}", r"\toprule"]
    if sets:
        # One title spans all speeds.
        first, last = 6, 5 + len(sets)
        lines.append(f"& & & & & \\multicolumn{{{len(sets)}}}{{c}}{{million rays per second}} & & \\\\")
        lines.append(f"\\cmidrule(lr){{{first}-{last}}}")
    lines += [" & ".join(map(escape, titles)) + r" \\", r"\midrule"]
    lines += [" & ".join(_cells(row, sets, best)) + r" \\" for row in shown]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"


def _cells(row: Row, sets: Sequence[str], best: set[tuple[int, str]]) -> list[str]:
    """The cells of one line, as LaTeX."""
    name, nodes, rays, build, size, *others = tables.cells(row, sets)
    speeds = [
        f"\\textbf{{{text}}}" if (id(row), one) in best else text
        for one, text in zip(sets, others[: len(sets)], strict=True)
    ]
    errors = row["errors"]
    wrong = "" if errors is None else str(sum(errors[key] or 0 for key in tables.ERRORS if key != tables.ULPS))
    ulps = "" if errors is None else str(errors[tables.ULPS])
    title = "Embree" if row["spec"] == yardstick.SPEC else f"\\texttt{{{escape(name)}}}"
    found = [title, escape(nodes), escape(rays), build, size, *speeds, wrong, ulps]
    return [cell.replace(tables.DASH, "--") if cell in ("", tables.DASH) else cell for cell in found]
