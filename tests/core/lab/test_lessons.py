# SPDX-License-Identifier: GPL-3.0-or-later
"""The lessons: the numbers on their pages are measured ones, and the notebooks run."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import halfspace_native as native
import pytest

from addon.lab.lessons import lessons, slides
from scripts import package_python
from scripts.dev import environment
from tests import browsers

PAGES = environment.ROOT / "docs" / "lessons"
NOTEBOOKS = sorted(PAGES.glob("*.ipynb"))


@pytest.mark.parametrize("lesson", lessons.LESSONS, ids=lambda lesson: lesson.name)
def test_the_numbers_of_a_page_are_measured(lesson: lessons.Lesson) -> None:
    text = " ".join((PAGES / f"{lesson.name}.md").read_text(encoding="utf-8").lower().split())
    facts = lesson.facts(native)
    assert len(facts) >= 3
    assert {name: value for name, value in facts.items() if not re.search(rf"(?<![\d.]){value}(?![\d.]\d)", text)} == {}


@pytest.mark.parametrize("lesson", lessons.LESSONS, ids=lambda lesson: lesson.name)
def test_a_page_has_the_questions_of_its_file(lesson: lessons.Lesson) -> None:
    text = (PAGES / f"{lesson.name}.md").read_text(encoding="utf-8").replace("*", "")
    assert text.startswith(f"# {lesson.title}\n")
    assert [question for question in lesson.questions if question not in " ".join(text.split())] == []
    assert text.count("<summary>Answer</summary>") == len(lesson.questions)


def test_lessons_say_what_they_teach() -> None:
    """The comparisons that the answers explain hold."""
    facts = {lesson.name: lesson.facts(native) for lesson in lessons.LESSONS}

    def number(name: str, key: str) -> float:
        return float(facts[name][key].replace(",", ""))

    assert number("1-split", "kd steps") < number("1-split", "kd-median steps") / 3
    assert number("2-oblique", "bsp-wn-plus-kd turned tests") < number("2-oblique", "kd turned tests") / 2
    assert facts["2-oblique"]["kd along tests"] == facts["2-oblique"]["bsp-wn-plus-kd along tests"]
    assert facts["3-intervals"]["bih references"] == "1.00"
    assert number("4-beams", "together") < number("4-beams", "alone") / 3
    assert facts["5-rounding"]["with bounds"] == "0"
    tests = {spec: number("0-families", f"{spec} tests") for spec in lessons.BY_NAME["0-families"].structures}
    assert min(tests, key=lambda spec: tests[spec]) == "bsp-wn-plus-kd"
    assert [facts["0-families"][f"{spec} references"] for spec in ("bvh-sah", "bih")] == ["1.00", "1.00"]
    assert number("6-boxes", "bvh-sah steps") < number("6-boxes", "bvh-sah:width=2 steps") / 2
    assert number("6-boxes", "bvh-sah:splits=1 tests") < 0.6 * number("6-boxes", "bvh-sah tests")
    assert facts["7-error"]["slope"] == "−0.50"


def test_slides_have_the_pictures_of_the_plan_and_all_questions(tmp_path: Path) -> None:
    path = tmp_path / "slides.html"
    pictures = (PAGES / slides.PLAN).read_text(encoding="utf-8").count("![")
    assert slides.write(path) == pictures + len(lessons.LESSONS)
    text = path.read_text(encoding="utf-8")
    assert text.count("<img") == pictures >= 5
    assert text.count("<li>") == sum(len(lesson.questions) for lesson in lessons.LESSONS)
    assert 'src="data:image/jpeg;base64,' in text
    assert "http" not in re.sub(r"base64,[^\"]*", "", text), "needs no network"


def test_no_slide_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "slides.html"
    slides.write(path)
    with browsers.opened() as browser:
        for width, height in ((1280, 720), (1024, 768)):
            tab = browser.new_page(viewport={"width": width, "height": height})
            tab.goto(path.as_uri())
            cut = "[...document.querySelectorAll('section')].map(one => one.scrollHeight - one.clientHeight)"
            assert max(tab.evaluate(cut)) <= 0


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source of the Python package."""
    folder = tmp_path_factory.mktemp("package")
    package_python.stage(folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore")  # Jupyter's own
def test_a_notebook_runs(path: Path, package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    client = pytest.importorskip("nbclient", reason="nbclient is not installed in this environment")
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed in this environment")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed in this environment")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(package), str(Path(native.__file__).parents[1])]))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    notebook = nbformat.read(path, as_version=4)
    runner = client.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    runner.execute()
    printed = "".join(one.get("text", "") for cell in notebook.cells for one in cell.get("outputs", []))
    assert ("0 of 300 answers differ" if path.stem == "add-a-structure" else "Errors against brute on") in printed


def test_notebooks_are_stored_without_results() -> None:
    assert len(NOTEBOOKS) == 2
    for path in NOTEBOOKS:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        code = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
        assert all(not cell["outputs"] and cell["execution_count"] is None for cell in code)
