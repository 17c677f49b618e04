# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures and tables for papers: PDF of one page, PGF and booktabs that TeX accepts, names that LaTeX shows."""

from __future__ import annotations

import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from addon.lab.commands import bench
from addon.lab.export import files
from addon.lab.report import plots
from tests.report_rows import document, everything, row

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
    *("error-time", "wrong-time", "other-errors", "ulp-time", "speed", "build-trace", "number-of-rays", "cost-maps"),
    *("offsets", "tree-shapes", "ray-work", "sah-time"),
]


def drawn(name: str, rows: list[dict[str, Any]]) -> Any:
    """The axes of a figure."""
    figure = Figure()
    (found,) = (one for one in plots.scene_figures(rows) if one.about.name == name)
    found.draw(figure)
    return figure


def test_every_figure_has_its_data() -> None:
    assert [figure.about.name for figure in plots.scene_figures(ROWS)] == NAMES
    depths, sizes, nodes, directions = drawn("tree-shapes", ROWS).axes
    lines = {line.get_label(): line for line in depths.lines}
    assert list(lines)[:2] == ["kd", "bvh-sah"]
    assert list(lines["kd"].get_xdata()) == [0, 1, 2, 3]
    assert list(lines["kd"].get_ydata()) == pytest.approx([0.0, 100 / 7, 200 / 7, 400 / 7])
    assert [text.get_text() for text in sizes.get_xticklabels()] == ["0", "1", "2–3"]
    assert list(nodes.lines[0].get_ydata()) == [1, 2, 3]
    assert list(directions.lines[0].get_ydata()) == [1, 3, 3]
    steps, tests = drawn("ray-work", ROWS).axes
    assert list(steps.lines[0].get_ydata()) == list(tests.lines[0].get_ydata()) == [12.5, 25.0, 62.5]
    (expected,) = drawn("sah-time", ROWS).axes
    assert expected.get_title() == "Pearson 0.99, Spearman 1.00"
    assert {line.get_xdata()[0] for line in expected.lines} == {100.0, 180.0, 120.0}


def test_nodes_and_traversals_of_one_tree_are_one_line_of_its_shape() -> None:
    slow, quick = whole("kd:traversal=dir", 2.0, 100.0), whole("kd", 1.0, 100.0)
    for one, table in ((slow, "single"), (quick, "fastest")):
        one |= {"tree": "kd", "table": table, "tables": [table]}
    labels = [line.get_label() for line in drawn("tree-shapes", [slow, quick]).axes[0].lines]
    assert labels == ["kd"]
    labels = [line.get_label() for line in drawn("ray-work", [slow, quick]).axes[0].lines]
    assert labels == ["kd:traversal=dir"], "rays that go together share their counts"


def test_a_scene_without_rays_has_no_figures() -> None:
    assert plots.scene_figures([row("kd") | {"rays": None, "error": "too large"}]) == []


def test_a_pdf_has_one_page_and_the_same_bytes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    some = plots.scene_figures(ROWS)[-2:]
    monkeypatch.setattr(plots, "scene_figures", lambda *_: some)
    first, again = (files.of_rows(ROWS, ("pdf",)) for _ in range(2))
    assert first == again
    pages = [content for content in first.values() if isinstance(content, bytes)]
    assert len({*pages}) == 2
    for page in pages:
        assert page.startswith(b"%PDF-")
        assert len(re.findall(rb"/Type /Page\b", page)) == 1


def test_figures_have_only_letters_that_latex_knows() -> None:
    texts = ("".join(ET.fromstring(plots.svg(one.draw, one.height)).itertext()) for one in plots.scene_figures(ROWS))
    assert {sign for text in texts for sign in text if not sign.isascii()} <= set("–−…×")


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
    assert files.escape(text) == expected


def test_the_tables_mark_the_fastest_and_show_errors() -> None:
    text = files.tabular([row("kd", 4.0), row("bvh_sah", 2.0, wrong_triangle=3), row("grid", 1.0)], "single")
    lines = [line for line in text.splitlines() if r"\texttt" in line]
    assert lines[0] == r"\texttt{kd} & -- & -- & 0.200 & 2.0 & \textbf{4.00} & -- & 0 & 0 \\"
    assert lines[1] == r"\texttt{bvh\_sah} & -- & -- & 0.200 & 2.0 & 2.00 & -- & 3 & 0 \\"
    assert text.count(r"\textbf") == 1
    for rule in (r"\toprule", r"\midrule", r"\bottomrule"):
        assert text.count(rule) == 1
    width = re.search(r"\{tabular\}\{(\w+)\}", text)
    assert width is not None
    assert {line.count("&") for line in lines} == {len(width[1]) - 1}


def test_files_have_the_names_of_their_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "save", lambda *given, **_: given[2].write_bytes(b""))
    other = [one | {"scene": "Room-1"} for one in ROWS]
    found = files.of_rows([*ROWS, *other], ("latex", "pgf"))
    names = {path.name for path in found}
    assert {path.parent.name for path in found} == {files.FOLDER}
    assert {"room-1-table-fastest.tex", "room-1-2-table-fastest.tex", "overview.tex"} <= names
    assert len(names) == 2 * (len(NAMES) + 1) + 1
    overview = str(found[Path(files.FOLDER, files.OVERVIEW)])
    assert sorted(re.findall(r"\\input\{(.+?)\}", overview)) == sorted(names - {"overview.tex"})
    assert {path.name for path in files.of_rows(ROWS, ("pdf",))} == {
        *(f"room-1-{name}.pdf" for name in NAMES),
        "overview.tex",
    }


def test_a_report_and_its_paper_are_written_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "problem", lambda: "left out here")
    bench.save(tmp_path, document(ROWS), None, ("latex",))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bench.csv", "bench.json", files.FOLDER, "report.html"]
    assert {path.name for path in (tmp_path / files.FOLDER).iterdir()} == {"room-1-table-fastest.tex", files.OVERVIEW}
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


def test_rejects_formats_whose_programs_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert files.chosen("pdf, latex,pdf") == ("pdf", "latex")
    monkeypatch.setattr(files.shutil, "which", lambda _: None)
    with pytest.raises(ValueError, match="pgf cannot be written: matplotlib measures its text with pdflatex, which is"):
        files.chosen("pgf,pdf")
    monkeypatch.setattr(plots, "problem", lambda: "matplotlib is not installed in this Python")
    with pytest.raises(ValueError, match="pdf cannot be written: matplotlib is not installed in this Python"):
        files.chosen("latex,pdf")
    assert files.chosen("latex") == ("latex",)
