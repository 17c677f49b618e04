# SPDX-License-Identifier: GPL-3.0-or-later
"""How to cite: CITATION.cff by its schema, and an entry in docs/papers.bib for each source of each structure."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import bibtexparser
import halfspace_native as native
import pytest
import yaml
from bibtexparser import middlewares

from addon.core.base import native as core_native
from scripts.dev import environment

ROOT: Path = environment.ROOT

NEEDED = {
    "article": {"journal"},
    "book": {"publisher"},
    "incollection": {"booktitle", "publisher"},
    "inproceedings": {"booktitle"},
    "mastersthesis": {"school"},
    "misc": {"eprint"},
    "phdthesis": {"school"},
    "unpublished": {"note"},
}
"""Fields by kind of entry, besides author, title and year."""


def read(text: str) -> list[Any]:
    """The entries of a BibTeX text, with characters in place of commands of LaTeX."""
    found = bibtexparser.parse_string(text, append_middleware=[middlewares.LatexDecodingMiddleware()])
    assert not found.failed_blocks
    return list(found.entries)


def problems(text: str, structures: list[dict[str, Any]]) -> list[str]:
    """Faults of the entries as sources of these structures."""
    entries, found = read(text), []
    ids = {row["id"] for row in structures}
    by_key = {entry.key: set(re.split(r",\s*", entry["keywords"])) for entry in entries}
    found += [f"{key}: no structure {one}" for key, named in by_key.items() for one in sorted(named - ids)]
    for row in structures:
        own = [entry for entry in entries if row["id"] in by_key[entry.key]]
        parts = row["paper"].split(";")
        found += [f"{row['id']}: no entry for {one.strip()!r}" for one in parts if not any(is_of(e, one) for e in own)]
        found += [f"{row['id']}: {e.key} is no source" for e in own if not any(is_of(e, one) for one in parts)]
    return found


def is_of(entry: Any, part: str) -> bool:
    """Whether a part of a source names the first author of an entry, or its number at arXiv, and its year if any."""
    fields = {field.key: field.value for field in entry.fields}
    family = re.split(r",| and ", fields["author"])[0]
    year = re.search(r"\b(?:19|20)\d\d\b", part)
    named = re.search(rf"\b{re.escape(family)}\b", part) is not None or fields.get("eprint", "-") in part
    # The first author's name alone may be that of a later author of another paper.
    return named and (year is None or year[0] == fields.get("year"))


def test_the_citation_follows_its_schema(tmp_path: Path) -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    for broken in (False, True):
        path = tmp_path / f"{broken}.cff"
        path.write_text(text.replace("title:", "titel:") if broken else text, encoding="utf-8")
        words = ["--builtin-schema", "vendor.citation-file-format", "--force-filetype", "yaml", str(path)]
        words = [sys.executable, "-m", "check_jsonschema", *words]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert (done.returncode == 0) is not broken, done.stdout + done.stderr


def test_the_citation_is_of_this_version() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    names = ("pyproject.toml", "native/Cargo.toml", "blender_manifest.toml")
    files = [tomllib.loads((ROOT / name).read_text(encoding="utf-8")) for name in names]
    project = files[0]["project"]
    versions = {project["version"], files[1]["workspace"]["package"]["version"], files[2]["version"]}
    assert versions == {native.__version__, core_native.VERSION}
    assert [one["name"] for one in cited["authors"]] == [one["name"] for one in project["authors"]]
    assert (cited["version"], cited["license"]) == (project["version"], project["license"])
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    stated = {"title": cited["title"], "version": cited["version"]}
    assert [key for key, value in stated.items() if f"{key} = {{{value}}}" not in readme] == []
    assert cited["license"] in readme
    assert "docs/papers.bib" in cited["message"]


def test_every_structure_has_an_entry_for_each_source() -> None:
    text = (ROOT / "docs" / "papers.bib").read_text(encoding="utf-8")
    assert problems(text, native.structures()) == []


def test_entries_are_whole() -> None:
    entries = read((ROOT / "docs" / "papers.bib").read_text(encoding="utf-8"))
    assert len({entry.key for entry in entries}) == len(entries) > 30
    for entry in entries:
        fields = {field.key for field in entry.fields}
        dated = set() if entry.entry_type == "unpublished" else {"year"}
        assert {"author", "title", "keywords", *dated, *NEEDED[entry.entry_type]} <= fields, entry.key


@pytest.mark.parametrize(
    ("changed", "by", "problem"),
    [
        ("keywords = {kd},", "keywords = {kdd},", "wald-havran-2006: no structure kdd"),
        ("keywords = {brute},", "keywords = {kd},", "brute: no entry for 'Whitted 1980, An improved illumination"),
        ("keywords = {brute},", "keywords = {brute, kd},", "kd: whitted-1980 is no source"),
        ("year = {1980},\n  pages = {343", "year = {1981},\n  pages = {343", "brute: no entry for 'Whitted 1980"),
    ],
)
def test_a_wrong_entry_is_found(changed: str, by: str, problem: str) -> None:
    text = (ROOT / "docs" / "papers.bib").read_text(encoding="utf-8")
    assert text.count(changed) == 1
    assert any(one.startswith(problem) for one in problems(text.replace(changed, by), native.structures()))
