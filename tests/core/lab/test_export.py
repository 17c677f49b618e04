# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures and tables for papers: PDF of one page, pgfplots and booktabs that TeX accepts, names that LaTeX shows."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from report_rows import document, everything, row

from addon.core.measure.analysis import field
from addon.core.report import plots
from addon.lab.commands import bench
from addon.lab.export import figures, files, latex, pdf, pgfplots
from addon.lab.export.figure import counting, logarithmic

SPREAD = {"mean": 2.0, "p50": 2, "p90": 3, "p99": 3, "max": 3, "histogram": [1, 2, 5]}


def whole(spec: str, slowness: float, sah: float) -> dict[str, Any]:
    """A row with all columns that an export uses."""
    made = everything(spec, slowness)
    levels = {"nodes": [1, 2, 3], "directions_axis": [1, 2, 3], "directions_oblique": [0, 1, 0]}
    tree = {"nodes": 6, "leaves": 7, "depth": SPREAD, "size": SPREAD, "depths": [0, 1, 2, 4], "levels": levels}
    made["field"] = {"tree": {**tree, "sah": sah}, "rays": {"primary": {"steps": SPREAD, "tests": SPREAD}}}
    made["tradeoff"] = [
        {
            "place": "here",
            "set": "primary",
            "bounds": bounds,
            "rays": 1000,
            "wrong": 0 if bounds else 7,
            "ulp_max": 9,
            "ulp_p999": 3,
            "ulp_mean": 0.5,
            "ns": {"min": 90.0, "med": 100 * slowness, "max": 110.0},
        }
        for bounds in (True, False)
    ]
    return made


ROWS = [whole("kd", 1.0, 100.0), whole("bvh-sah", 1.5, 180.0), whole("bsp-wn-plus-kd:k=3,costs=thesis", 1.2, 120.0)]
NAMES = [
    *("error-time-relmse", "error-time-rmse", "error-time-flip", "wrong-time-here-primary", "ulp-time-here-primary"),
    *("leaf-depth", "leaf-size", "nodes-level", "directions-level", "steps-primary", "tests-primary", "sah-time"),
]


def test_every_figure_has_its_data() -> None:
    found = {figure.name: figure for figure in figures.of_scene(ROWS)}
    assert list(found) == NAMES
    labels = [series.mark.label for series in found["leaf-depth"].series]
    assert labels[:2] == ["kd", "bvh-sah"]
    assert str(labels[2]).startswith("bsp-wn-plus-")
    depths = found["leaf-depth"].series[0]
    assert depths.x == (0.0, 1.0, 2.0, 3.0)
    assert sum(depths.y) == pytest.approx(100.0)
    assert depths.y[3] == pytest.approx(100.0 * 4 / 7)
    assert found["directions-level"].series[0].y == (1.0, 3.0, 3.0)
    assert [text for _, text in found["leaf-size"].x.ticks] == ["0", "1", "2–3"]
    # Zero wrong answers have a tick of their own on the logarithmic axis.
    wrong = found["wrong-time-here-primary"]
    assert wrong.y.ticks[0] == (min(series.y[0] for series in wrong.series), "0")
    assert {(series.hollow, series.y[0]) for series in wrong.series} == {(False, 100.0), (True, 7000.0)}
    assert found["sah-time"].note == "Pearson 0.99, Spearman 1.00"
    assert {series.x[0] for series in found["sah-time"].series} == {100.0, 180.0, 120.0}


def test_nodes_and_traversals_of_one_tree_are_one_line_of_its_shape() -> None:
    slow, quick = whole("kd:traversal=dir", 2.0, 100.0), whole("kd", 1.0, 100.0)
    for one, table in ((slow, "single"), (quick, "fastest")):
        one |= {"tree": "kd", "table": table, "tables": [table]}
    found = {figure.name: figure for figure in figures.of_scene([slow, quick])}
    assert [series.mark.label for series in found["leaf-depth"].series] == ["kd"]
    assert len(found["error-time-relmse"].series) == 1, "pictures are those of the fastest traversals"
    assert [series.mark.label for series in found["steps-primary"].series] == ["kd:traversal=dir"]


def test_a_scene_without_rays_has_no_figures() -> None:
    failed = row("kd") | {"rays": None, "error": "too large"}
    assert figures.of_scene([failed]) == []
    assert field.value(failed, "tree") is None


@pytest.mark.parametrize(
    ("values", "zero", "ticks"),
    [
        ([0.0, 20.0, 300.0], 1.0, ["0", "10", "20", "50", "100", "200"]),
        ([0.0, 20.0, 1300.0], 1.0, ["0", "10^1", "10^2", "10^3"]),
        ([2.0, 30.0], 0.1, ["2", "5", "10", "20"]),
        ([101.0, 105.0], 10.0, ["90", "100", "110", "120"]),
        ([1e-3, 1e6], 1e-4, ["10^-3", "10^-1", "10^1", "10^3", "10^5"]),
        ([0.0, 0.0], 1.0, ["0"]),
    ],
)
def test_a_logarithmic_axis_has_round_ticks_and_a_place_for_zeros(
    values: list[float], zero: float, ticks: list[str]
) -> None:
    axis, place = logarithmic("errors", values)
    assert place == pytest.approx(zero)
    assert [text for _, text in axis.ticks] == ticks
    assert axis.low is not None
    assert axis.high is not None
    assert all(axis.low < (value or place) < axis.high for value in values)
    assert all(axis.low <= at <= axis.high for at, _ in axis.ticks)


@pytest.mark.parametrize(("most", "last"), [(3, "3"), (10, "10"), (23, "20"), (61, "60"), (1000, "1000"), (5000, "0")])
def test_an_axis_of_whole_numbers_has_few_ticks(most: int, last: str) -> None:
    axis = counting("level", most)
    assert len(axis.ticks) <= 11
    assert axis.ticks[-1][1] == last


def test_a_pdf_has_one_page_and_the_same_bytes_again() -> None:
    pages = [pdf.page(figure) for figure in figures.of_scene(ROWS)[-2:]]
    for page in pages:
        assert page.startswith(b"%PDF-")
        assert len(re.findall(rb"/Type /Page\b", page)) == 1
    assert [pdf.page(figure) for figure in figures.of_scene(ROWS)[-2:]] == pages
    assert pages[0] != pages[1]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("bsp_wn & 100 % {x} $y #z", r"bsp\_wn \& 100 \% \{x\} \$y \#z"),
        ("a\\b~c^d", r"a\textbackslash{}b\textasciitilde{}c\textasciicircum{}d"),
        ("<room> |1|", r"\textless{}room\textgreater{} \textbar{}1\textbar{}"),
        ("8 × 8 – −1", r"8 $\times$ 8 -- $-$1"),
        ("Küche 場\n", "Küche U+5834 "),
    ],
)
def test_names_are_escaped(text: str, expected: str) -> None:
    assert latex.escape(text) == expected


def test_the_tables_mark_the_fastest_and_show_errors() -> None:
    text = latex.table([row("kd", 4.0), row("bvh_sah", 2.0, wrong_triangle=3), row("grid", 1.0)], "single")
    lines = [line for line in text.splitlines() if r"\texttt" in line]
    assert lines[0] == r"\texttt{kd} & -- & -- & 0.200 & 2.0 & \textbf{4.000} & -- & 0 & 0 \\"
    assert lines[1] == r"\texttt{bvh\_sah} & -- & -- & 0.200 & 2.0 & 2.000 & -- & 3 & 0 \\"
    assert text.count(r"\textbf") == 1
    for rule in (r"\toprule", r"\midrule", r"\bottomrule"):
        assert text.count(rule) == 1
    width = re.search(r"\{tabular\}\{(\w+)\}", text)
    assert width is not None
    assert {line.count("&") for line in lines} == {len(width[1]) - 1}


def balanced(text: str) -> bool:
    """Whether the environments and the braces of a TeX file close in order."""
    names: list[str] = []
    for begins, name in re.findall(r"\\(begin|end)\{(\w+)\}", text):
        if begins == "begin":
            names.append(name)
        elif not names or names.pop() != name:
            return False
    depth = 0
    for sign in re.sub(r"\\.", "", text):
        depth += {"{": 1, "}": -1}.get(sign, 0)
        if depth < 0:
            return False
    return depth == 0 and not names


def test_every_pgfplots_picture_is_complete() -> None:
    for figure in figures.of_scene(ROWS):
        text = pgfplots.picture(figure)
        assert balanced(text)
        assert not balanced(text.replace(r"\end{axis}", ""))
        assert text.count(r"\addplot[") == len(figure.series)
        rows = re.findall(r"^([-\d.e+]+) ([-\d.e+]+) \\\\$", text, re.MULTILINE)
        assert len(rows) == sum(len(series.x) for series in figure.series)


def test_files_have_the_names_of_their_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pdf, "page", lambda figure: figure.name.encode())
    other = [one | {"scene": "Room-1"} for one in ROWS]
    found = files.of_rows([*ROWS, *other], ("latex", "pgf"))
    names = {path.name for path in found}
    assert {path.parent.name for path in found} == {files.FOLDER}
    assert {"room-1-table-all.tex", "room-1-2-table-all.tex", "overview.tex"} <= names
    assert len(names) == 2 * (len(NAMES) + 1) + 1
    overview = str(found[Path(files.FOLDER, files.OVERVIEW)])
    assert sorted(re.findall(r"\\input\{(.+?)\}", overview)) == sorted(names - {"overview.tex"})
    assert not any(name.endswith(".pdf") for name in names)
    assert {path.name for path in files.of_rows(ROWS, ("pdf",))} == {
        *(f"room-1-{name}.pdf" for name in NAMES),
        "overview.tex",
    }


def test_a_report_and_its_paper_are_written_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "problem", lambda: "left out here")
    bench.save(tmp_path, document(ROWS), None, ("latex",))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bench.csv", "bench.json", files.FOLDER, "report.html"]
    assert {path.name for path in (tmp_path / files.FOLDER).iterdir()} == {"room-1-table-all.tex", files.OVERVIEW}
    (tmp_path / "other").mkdir()
    bench.save(tmp_path / "other", document(ROWS), None)
    assert not (tmp_path / "other" / files.FOLDER).exists()


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="there is no pdflatex")
@pytest.mark.parametrize("formats", [("latex", "pgf"), ("pdf",)])
def test_tex_accepts_the_overview(tmp_path: Path, formats: tuple[str, ...]) -> None:
    for path, content in files.of_rows(ROWS, formats).items():
        target = tmp_path / path
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(content if isinstance(content, bytes) else content.encode())
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", files.OVERVIEW],
        cwd=tmp_path / files.FOLDER,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    assert "Missing character" not in done.stdout
    assert (tmp_path / files.FOLDER / "overview.pdf").read_bytes().startswith(b"%PDF-")


@pytest.mark.parametrize("text", ["docx", "pdf,docx", ""])
def test_unknown_formats_are_named(text: str) -> None:
    with pytest.raises(ValueError, match=r"unknown format .*; there are pdf, pgf, latex"):
        files.chosen(text)


def test_a_missing_matplotlib_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    assert files.chosen("pdf, latex,pdf") == ("pdf", "latex")
    monkeypatch.setattr(pdf.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ValueError, match="pdf cannot be written: matplotlib is not installed in this Python"):
        files.chosen("pgf,pdf")
    assert files.chosen("pgf,latex") == ("pgf", "latex")
