# SPDX-License-Identifier: GPL-3.0-or-later
"""All files of an export: figures and tables of each scene, and one document that shows them."""

from __future__ import annotations

import re
import shutil
import tempfile
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from ...core.measure import ranking, yardstick
from ...core.measure.rows import Row, by_scene, set_names
from ...core.report import tables
from ..report import plots
from ..report.thesis import Published

FORMATS = {"pdf": "figures as vector PDF", "pgf": "figures for LaTeX's pgf", "latex": "tables for booktabs"}

WIDTH = 7.0
"""Width of a figure in inches: both columns of a page."""

PREAMBLE = r"\usepackage[T1]{fontenc}\usepackage{lmodern}"
"""Fonts of the overview, with which matplotlib measures the text of PGF."""

STYLE: dict[str, Any] = {
    "font.size": 8,
    "legend.fontsize": 7,
    # TrueType, whose text can be searched, as many publishers require.
    "pdf.fonttype": 42,
    "pgf.texsystem": "pdflatex",
    "pgf.rcfonts": False,
    "pgf.preamble": PREAMBLE,
}

FOLDER = "paper"
"""Name of the folder inside that of the report."""

OVERVIEW = "overview.tex"

WRONG = (
    ". Wrong are false misses and hits, other triangles, u, v or any-hits; t is the largest difference of a distance. "
    "Bold is the fastest structure, with those equal to it within noise; Embree is the yardstick."
)


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
    "±": r"$\pm$",
    "⁵": r"$^5$",
    "\u00a0": "~",
    "\u202f": r"\,",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}
"""Characters that LaTeX reads as commands, or that its usual fonts lack."""


def chosen(text: str) -> tuple[str, ...]:
    """The formats that an option names. Raises ValueError for an unknown one, or for one that cannot be written."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    unknown = [name for name in names if name not in FORMATS]
    if unknown:
        raise ValueError(f"unknown format {unknown[0]!r}; there are {', '.join(FORMATS)}")
    for name in names:
        if (reason := problem(name)) is not None:
            raise ValueError(f"{name} cannot be written: {reason}")
    return names


def problem(name: str) -> str | None:
    """The reason why a format cannot be written, or None."""
    if name == "latex":
        return None
    if name == "pgf" and shutil.which("pdflatex") is None:
        return "matplotlib measures its text with pdflatex, which is not installed; pdf and latex need none"
    return plots.problem()


def of_rows(rows: Sequence[Row], formats: Iterable[str], published: Published | None = None) -> dict[Path, str | bytes]:
    """The files, by their paths within the folder of a report. formats: keys of `FORMATS`. published: results of the
    thesis, drawn next to ours.
    """
    wanted = set(formats)
    found: dict[Path, str | bytes] = {}
    shown: list[str] = []
    for scene, own in zip(_names(by_scene(rows)), by_scene(rows).items(), strict=True):
        shown.append(f"\\section*{{{escape(own[0])}}}")
        if "latex" in wanted:
            shown += _tables(scene, own[1], found)
        if wanted & {"pdf", "pgf"}:
            shown += _figures(scene, plots.scene_figures(own[1], published), wanted, found)
    found[Path(FOLDER, OVERVIEW)] = _overview(shown, wanted)
    return found


def _tables(scene: str, rows: Sequence[Row], found: dict[Path, str | bytes]) -> Iterator[str]:
    """Add the tables of a scene to `found`. Yields the lines of the overview."""
    caption = escape(" ".join(tables.measured(rows[0]["scene"], rows)) + WRONG)
    for table, own in ranking.by_table([row for row in rows if not row["error"]]).items():
        if any(not yardstick.is_foreign(row["spec"]) for row in own):
            name = f"{scene}-table-{table}"
            found[Path(FOLDER, f"{name}.tex")] = f"% {caption}\n{tabular(own, table)}"
            yield from (
                r"\begin{table}[htp]\centering\scriptsize",
                f"\\caption{{{tables.NAMED[table]}. {caption}}}",
            )
            yield from (f"\\resizebox{{\\linewidth}}{{!}}{{\\input{{{name}.tex}}}}", r"\end{table}")


def _figures(
    scene: str, figures: Sequence[plots.Figure], wanted: set[str], found: dict[Path, str | bytes]
) -> Iterator[str]:
    """Add the figures of a scene to `found`. Yields the lines of the overview."""
    for figure in (one for one in figures if one.draw is not None):
        name, caption = f"{scene}-{figure.about.name}", escape(figure.caption)
        if "pdf" in wanted:
            found |= _drawn(figure, f"{name}.pdf", metadata={"CreationDate": None, "Title": figure.caption})
        if "pgf" in wanted:
            found |= _drawn(figure, f"{name}.pgf")
        included = f"\\includegraphics[width=\\linewidth]{{{name}.pdf}}"
        if "pgf" in wanted:
            included = f"\\resizebox{{\\linewidth}}{{!}}{{\\input{{{name}.pgf}}}}"
        yield from (r"\begin{figure}[htp]\centering", included, f"\\caption{{{caption}}}")
        yield from (r"\end{figure}", r"\clearpage")


def _drawn(figure: plots.Figure, name: str, **given: Any) -> dict[Path, str | bytes]:
    """The file of a figure; with PGF also the pictures in it."""
    assert figure.draw is not None, "there is something to draw"
    with tempfile.TemporaryDirectory() as folder:
        plots.save(figure.draw, (WIDTH, figure.height), Path(folder, name), STYLE, **given)
        return {Path(FOLDER, path.name): path.read_bytes() for path in sorted(Path(folder).iterdir())}


def _overview(lines: Iterable[str], wanted: set[str]) -> str:
    """A document with all figures and tables."""
    head = [r"\documentclass{article}", PREAMBLE, r"\usepackage{booktabs,graphicx}"]
    if "pgf" in wanted:
        head += [r"\usepackage{pgf}", r"\usepackage[strings]{underscore}", r"\def\mathdefault#1{#1}"]
    return "\n".join([*head, r"\begin{document}", *lines, r"\end{document}"]) + "\n"


def _names(scenes: Iterable[str]) -> list[str]:
    """Names of scenes as beginnings of file names, each once."""
    found: list[str] = []
    for scene in scenes:
        plain = re.sub(r"[^A-Za-z0-9]+", "-", scene).strip("-").lower() or "scene"
        number = 1 + sum(re.fullmatch(rf"{plain}(-\d+)?", other) is not None for other in found)
        found.append(plain if number == 1 else f"{plain}-{number}")
    return found


def escape(text: str) -> str:
    """Any text as LaTeX that shows it. Letters beyond those of Latin scripts become their code points."""
    return "".join(SPECIAL.get(sign) or _plain(sign) for sign in unicodedata.normalize("NFC", text))


def _plain(sign: str) -> str:
    """A character without a command of its own."""
    if sign.isspace() or ord(sign) < 0x20:
        return " "
    return sign if ord(sign) < 0x7F or 0xC0 <= ord(sign) < 0x17F else f"U+{ord(sign):04X}"


def tabular(rows: Sequence[Row], name: str) -> str:
    """A tabular of like configurations. Bold: the fastest, and those equal to it within noise.

    rows: of one scene and table. name: the table's, as in `tables.TITLES`.
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
