# SPDX-License-Identifier: GPL-3.0-or-later
"""All files of an export: figures and tables of each scene, and one document that shows them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from ...core.measure import ranking, yardstick
from ...core.measure.rows import Row
from ...core.report import tables
from ...core.report.report import by_scene
from . import figures, latex, pdf, pgfplots

FORMATS = {"pdf": "figures as vector PDF", "pgf": "figures for pgfplots", "latex": "tables for booktabs"}

FOLDER = "paper"
"""Name of the folder inside that of the report."""

OVERVIEW = "overview.tex"

WRONG = (
    ". Wrong are false misses and hits, other triangles, u, v or any-hits; t is the largest difference of a distance. "
    "Bold is the fastest structure, with those equal to it within noise; Embree is the yardstick."
)


def chosen(text: str) -> tuple[str, ...]:
    """The formats that an option names. Raises ValueError for an unknown one, or for one that cannot be written."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    unknown = [name for name in names if name not in FORMATS]
    if unknown:
        raise ValueError(f"unknown format {unknown[0]!r}; there are {', '.join(FORMATS)}")
    if "pdf" in names and (reason := pdf.problem()) is not None:
        raise ValueError(f"pdf cannot be written: {reason}; pgf and latex need none")
    return names


def of_rows(rows: Sequence[Row], formats: Iterable[str]) -> dict[Path, str | bytes]:
    """The files, by their paths within the folder of a report. formats: keys of `FORMATS`."""
    wanted = set(formats)
    found: dict[Path, str | bytes] = {}
    shown: list[str] = []
    for scene, own in zip(_names(by_scene(rows)), by_scene(rows).items(), strict=True):
        shown.append(f"\\section*{{{latex.escape(own[0])}}}")
        if "latex" in wanted:
            shown += _tables(scene, own[1], found)
        if wanted & {"pdf", "pgf"}:
            shown += _figures(scene, own[1], wanted, found)
    found[Path(FOLDER, OVERVIEW)] = _overview(shown)
    return found


def _tables(scene: str, rows: Sequence[Row], found: dict[Path, str | bytes]) -> Iterator[str]:
    """Add the tables of a scene to `found`. Yields the lines of the overview."""
    caption = latex.escape(" ".join(tables.measured(rows[0]["scene"], rows)) + WRONG)
    for table, own in ranking.by_table([row for row in rows if not row["error"]]).items():
        if any(row["spec"] != yardstick.SPEC for row in own):
            name = f"{scene}-table-{table or 'all'}"
            found[Path(FOLDER, f"{name}.tex")] = f"% {caption}\n{latex.table(own, table)}"
            yield from (r"\begin{table}[htp]\centering\scriptsize", f"\\caption{{{latex.TITLES[table]}. {caption}}}")
            yield from (f"\\resizebox{{\\linewidth}}{{!}}{{\\input{{{name}.tex}}}}", r"\end{table}")


def _figures(scene: str, rows: Sequence[Row], wanted: set[str], found: dict[Path, str | bytes]) -> Iterator[str]:
    """Add the figures of a scene to `found`. Yields the lines of the overview."""
    for figure in figures.of_scene(rows):
        name = f"{scene}-{figure.name}"
        caption = latex.escape(figure.caption)
        if "pdf" in wanted:
            found[Path(FOLDER, f"{name}.pdf")] = pdf.page(figure)
        if "pgf" in wanted:
            found[Path(FOLDER, f"{name}.tex")] = f"% {caption}\n{pgfplots.picture(figure)}"
        included = f"\\includegraphics[width=\\linewidth]{{{name}.pdf}}"
        if "pgf" in wanted:
            included = f"\\input{{{name}.tex}}"
        yield from (r"\begin{figure}[htp]\centering", included, f"\\caption{{{caption}}}")
        yield from (r"\end{figure}", r"\clearpage")


def _overview(lines: Iterable[str]) -> str:
    """A document with all figures and tables."""
    head = [
        r"\documentclass{article}",
        r"\usepackage[T1]{fontenc}",
        r"\usepackage[utf8]{inputenc}",
        r"\usepackage{booktabs,graphicx,pgfplots}",
        r"\pgfplotsset{compat=1.16}",
        r"\begin{document}",
    ]
    return "\n".join([*head, *lines, r"\end{document}"]) + "\n"


def _names(scenes: Iterable[str]) -> list[str]:
    """Names of scenes as beginnings of file names, each once."""
    found: list[str] = []
    for scene in scenes:
        plain = re.sub(r"[^A-Za-z0-9]+", "-", scene).strip("-").lower() or "scene"
        number = 1 + sum(re.fullmatch(rf"{plain}(-\d+)?", other) is not None for other in found)
        found.append(plain if number == 1 else f"{plain}-{number}")
    return found
