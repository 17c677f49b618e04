# SPDX-License-Identifier: GPL-3.0-or-later
"""The site of the documents: it builds without warnings, every link leads somewhere, every structure has its page."""

from __future__ import annotations

import json
import re
import urllib.parse
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import halfspace_native as native
import pytest

from addon.lab.claims import orderings
from addon.lab.claims.table import CLAIMS
from scripts.dev import documents_site, overlay_picture, structure_pages
from tests.one_line import told

pytestmark = pytest.mark.slow

ROOT = documents_site.ROOT


class Page(HTMLParser):
    """The links of a page, those that are loaded with it, and the places in it that links can lead to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.places: set[str] = set()
        self.words = re.sub(r"<[^>]+>", " ", text)
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value and (name == "src" or (name == "href" and tag in ("a", "link"))):
                self.links.append(value)
                self.loaded += [value] * (tag != "a")
            if value and name in ("id", "name"):
                self.places.add(value)


def dead(folder: Path) -> Iterator[str]:
    """The links of all pages of a site that lead nowhere, or to another server when a page is shown."""
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in folder.rglob("*.html")}
    for path, page in pages.items():
        for link in page.links:
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.loaded and parts.scheme != "data":
                    yield f"{path.name}: {link}: outside"
                continue
            target = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
            if path.name == "404.html" and parts.path.startswith("/"):
                target = folder / parts.path.lstrip("/")
            target = target / "index.html" if target.is_dir() else target
            if not target.is_file():
                yield f"{path.name}: {link}: no such file"
            elif target in pages and urllib.parse.unquote(parts.fragment) not in {"", "__skip", *pages[target].places}:
                yield f"{path.name}: {link}: no such place"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site").resolve()
    documents_site.build(folder, pictures=False)
    return folder


def test_no_link_is_dead(site: Path) -> None:
    assert len(list(site.rglob("*.html"))) > 50
    assert list(dead(site)) == []


def test_a_dead_link_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<a href="b.html#there">x</a><a href="b.html#gone">x</a><a href="c.html">x</a>')
    (tmp_path / "b.html").write_text('<h1 id="there"><img src="https://example.org/x.png"></h1><a href="a.html">x</a>')
    assert sorted(line.rpartition(": ")[2] for line in dead(tmp_path)) == ["no such file", "no such place", "outside"]


def test_every_structure_has_a_page_with_source_cost_and_parameters(site: Path) -> None:
    gallery = (site / "structures" / "index.html").read_text(encoding="utf-8")
    for row in native.structures():
        words = " ".join(Page((site / "structures" / f"{row['id']}.html").read_text(encoding="utf-8")).words.split())
        assert f'href="{row["id"]}.html"' in gallery
        for expected in ("Source", "Claims", "bytes per triangle", "triangle tests of a diffuse ray", "Nodes and rays"):
            assert expected in words, row["id"]


def test_every_structure_has_claims_or_a_statement() -> None:
    stated = [row["id"] for row in native.structures() if not any(structure_pages.claims_of(row))]
    assert sorted(stated) == sorted(structure_pages.STATED), "a structure has either"


def test_every_claim_stands_on_a_page_of_a_structure() -> None:
    rows = native.structures()
    shown = {text for row in rows for text, _ in structure_pages.claims_of(row)}
    # Published orders of other tracers are about no structure of the registry.
    ours = [claim.id for claim in CLAIMS if claim not in orderings.CLAIMS]
    assert [one for one in ours if not any(f"`{one}`" in text for text in shown)] == []
    patterns = {one for row in rows for one in row["claims"]} | set(structure_pages.HEADINGS)
    assert [one for one in patterns if not structure_pages.fnmatch.filter([claim.id for claim in CLAIMS], one)] == []


def test_the_cost_on_a_page_is_the_structures_own() -> None:
    scene = structure_pages.Scene(native)
    plain, oblique = (scene.cost(native, name) for name in ("kd", "bsp-wn-plus-kd"))
    row = native.structures()[0]
    assert structure_pages.page(row, plain, ()) == structure_pages.page(row, scene.cost(native, "kd"), ())
    assert structure_pages.page(row, plain, ()) != structure_pages.page(row, oblique, ())
    assert "pictures/kd.jpg" not in structure_pages.page(row, plain, ())
    assert "![kd-tree of the built-in scene](../pictures/kd.jpg)" in structure_pages.page(row, plain, {"kd"})


def test_the_gallery_promises_pictures_only_where_there_are_some() -> None:
    rows = native.structures()
    assert "with its picture, source" in structure_pages.index(rows, {row["id"] for row in rows})
    assert "picture" not in structure_pages.index(rows, ())


def test_the_reference_describes_what_can_be_called(site: Path) -> None:
    page = Page((site / "reference.html").read_text(encoding="utf-8"))
    for name in (
        "halfspace.load",
        "halfspace.measure",
        "halfspace.expand",
        "halfspace.trimesh.RayMeshIntersector.intersects_id",
        "halfspace.open3d.RaycastingScene.cast_rays",
        "halfspace.bvhtree.BVHTree.FromPolygons",
        "halfspace_native.build",
    ):
        assert name in page.places
    assert "Build a configuration" in page.words or "Builds" in page.words


def test_the_reference_has_every_public_module() -> None:
    folder = ROOT / "distribution" / "halfspace"
    public = {f"halfspace.{path.stem}" for path in folder.glob("*.py") if not path.stem.startswith("_")}
    assert set(documents_site.REFERENCE) == {"halfspace", "halfspace_native", *public}


def test_a_notebook_is_a_page_with_its_results(site: Path) -> None:
    for name, printed in (("add-a-structure", "0 of 300 answers differ"), ("sweep", "Errors against brute on")):
        page = Page((site / "lessons" / f"{name}.html").read_text(encoding="utf-8"))
        assert printed in " ".join(page.words.split())
        assert f"{name}.ipynb" in page.links, "the file itself"
    assert "sweep.html" in Page((site / "lessons" / "notebooks.html").read_text(encoding="utf-8")).links
    pictures = [link for link in page.links if link.endswith(".png") and "sweep_files" in link]
    assert [(site / "lessons" / link).read_bytes()[:4] for link in pictures] == [b"\x89PNG"]


def test_a_notebook_that_fails_ends_the_build(tmp_path: Path) -> None:
    pytest.importorskip("nbconvert", reason="nbconvert is not installed in this environment")
    cell = {"cell_type": "code", "execution_count": None, "id": "a", "metadata": {}, "outputs": [], "source": "1 / 0"}
    document = {"cells": [cell], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}
    (tmp_path / "bad.ipynb").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(documents_site.SiteError, match=r"bad\.ipynb: ZeroDivisionError: division by zero"):
        documents_site.run_notebook(tmp_path / "bad.ipynb", tmp_path)
    assert not (tmp_path / "bad.md").exists()


def test_a_history_becomes_a_page_of_the_site(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    machine = {"processor": "P", "level": "avx2"}
    line = {"commit": "a" * 40, "date": "2026", "machine": machine, "scene": "grid", "size": [64, 64]}
    file = tmp_path / "speed.jsonl"
    file.write_text(json.dumps({**line, "ratios": {"kd": {"primary": [0.4, 0.5, 0.6]}}}) + "\n", encoding="utf-8")
    documents_site.stage_history(tmp_path, file)
    assert "pictures/speed-1.svg" in (tmp_path / "speed.md").read_text(encoding="utf-8")
    assert "times Embree" in (tmp_path / "pictures" / "speed-1.svg").read_text(encoding="utf-8")
    assert {"Read": [*documents_site.NAVIGATION["Read"], "speed.md"]} in documents_site.navigation(tmp_path)
    file.write_text("nonsense", encoding="utf-8")
    with pytest.raises(documents_site.SiteError, match="line 1 is no line of speeds"):
        documents_site.stage_history(tmp_path, file)
    with pytest.raises(documents_site.SiteError, match=r"--history: .*No such file"):
        documents_site.stage_history(tmp_path, tmp_path / "gone")


def test_links_lead_to_the_staged_places() -> None:
    text = "[a](../README.md#top) [b](papers.md) ![c](../.pictures/x.jpg) [d](https://x.org) [e](#here)"
    assert documents_site.retargeted(text, "docs/index.md") == (
        "[a](readme.md#top) [b](papers.md) ![c](pictures/x.jpg) [d](https://x.org) [e](#here)"
    )
    assert documents_site.retargeted("[a](docs/manual.md) [b](LICENSE)", "README.md") == "[a](manual.md) [b](LICENSE)"
    assert documents_site.retargeted("[a](../manual.md)", "docs/lessons/1.md") == "[a](../manual.md)"
    assert documents_site.retargeted("[a](b.ipynb)", "docs/lessons/1.md") == "[a](b.md)", "a page, not the file"


def test_pictures_that_are_missing_are_drawn_with_valid_options(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[str] = []

    def draw(arguments: list[str]) -> int:
        asked = overlay_picture.read(arguments)
        drawn.append(asked.structure)
        asked.out.write_bytes(b"a picture")
        return 0

    monkeypatch.setattr(documents_site, "PICTURES", tmp_path)
    monkeypatch.setattr(overlay_picture, "main", draw)
    (tmp_path / "kd.jpg").write_bytes(b"drawn before")
    documents_site.draw()
    assert drawn == [row["id"] for row in native.structures() if row["id"] != "kd"]
    assert (tmp_path / "kd.jpg").read_bytes() == b"drawn before"
    documents_site.draw()
    assert len(drawn) == len(set(drawn)), "nothing is drawn twice"
    monkeypatch.setattr(overlay_picture, "main", lambda _: 2)
    (tmp_path / "bih.jpg").unlink()
    with pytest.raises(documents_site.SiteError, match="the picture of bih cannot be drawn"):
        documents_site.draw()


def test_a_warning_of_zensical_ends_the_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stage(folder: Path, _: Path | None, _package: Path) -> None:
        (folder / "index.md").write_text("# Index\n\n[gone](gone.md)\n", encoding="utf-8")

    monkeypatch.setattr(documents_site, "stage", stage)
    monkeypatch.setattr(documents_site, "navigation", lambda _: ["index.md"])
    monkeypatch.setattr(documents_site.package_python, "stage", lambda folder: folder.mkdir())
    said = told(documents_site, ["--no-pictures", "--out", str(tmp_path / "out")], capsys)
    assert said.startswith("documents_site: Zensical: ")
    assert "page does not exist" in said
    assert "gone.md" in said
