# SPDX-License-Identifier: GPL-3.0-or-later
"""Finished rows survive, and files are whole or not there."""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import halfspace_native
import pytest

from addon.core.report import results
from addon.core.report.asked import Asked

HERE = {"name": "here", "cores": 2}


def entry(key: str, number: int, **values: Any) -> results.Entry:
    row = {"scene": "s", "spec": key, "machine": "here", **values}
    return results.Entry(key, (0, number), row)


@pytest.mark.skipif(os.name != "posix", reason="this system keeps nobody from new files by a mask")
@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_all_files_are_for_whom_the_user_s_other_files_are_for(tmp_path: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        results.Journal(tmp_path).add(entry("a", 0), HERE)
        results.write(tmp_path / "bench.json", "{}")
        assert os.umask(mask) == mask, "it stays as it was"
    finally:
        os.umask(before)
    modes = {path.name: oct(path.stat().st_mode & 0o777) for path in tmp_path.iterdir()}
    assert modes == dict.fromkeys(("rows.jsonl", "bench.json"), oct(0o666 & ~mask))


@pytest.mark.parametrize(
    ("name", "reason"),
    [("folder", "it is a folder"), ("x" * 300, "File name too long"), ("nowhere/report.html", "No such file")],
)
def test_a_file_that_cannot_be_written_is_named_and_the_others_stay(tmp_path: Path, name: str, reason: str) -> None:
    first, second = tmp_path / "bench.json", tmp_path / name
    first.write_text("old")
    (tmp_path / "folder").mkdir()
    with pytest.raises(results.FolderError) as told:
        results.write_all({first: "new", second: "new"})
    assert str(told.value).startswith(f"{second}: cannot be written: {reason}")
    assert first.read_text() == "old"
    assert set(tmp_path.iterdir()) == {first, tmp_path / "folder"}


def test_rows_come_back(tmp_path: Path) -> None:
    first = results.Journal(tmp_path)
    first.begin({"seed": 1})
    first.add(entry("a", 0), HERE)
    first.add(entry("b", 1), HERE)
    again = results.Journal(tmp_path)
    assert again.entries == {"a": entry("a", 0), "b": entry("b", 1)}
    assert (again.machines, again.options) == ({"here": HERE}, {"seed": 1})


@pytest.mark.parametrize("cut", [1, 8, 20])
def test_a_half_written_last_line_loses_only_itself(tmp_path: Path, cut: int) -> None:
    journal = results.Journal(tmp_path)
    journal.add(entry("a", 0), HERE)
    journal.add(entry("b", 1), HERE)
    file = tmp_path / results.JOURNAL
    file.write_bytes(file.read_bytes()[:-cut])
    again = results.Journal(tmp_path)
    assert again.entries["a"] == entry("a", 0)
    again.add(entry("c", 2), HERE)
    assert set(results.Journal(tmp_path).entries) >= {"a", "c"}


def test_who_only_reads_a_journal_leaves_it_as_it_is(tmp_path: Path) -> None:
    results.Journal(tmp_path).add(entry("a", 0), HERE)
    file = tmp_path / results.JOURNAL
    torn = file.read_bytes() + b'{"key": "b", "or'
    file.write_bytes(torn)
    journal = results.Journal(tmp_path)
    assert file.read_bytes() == torn
    for number, name in enumerate("cd"):
        journal.add(entry(name, number), HERE)
    assert set(results.Journal(tmp_path).entries) == {"a", "c", "d"}
    assert file.read_bytes().startswith(torn + b"\n")


def test_rows_of_other_commands_in_the_same_folder_are_not_those_of_a_benchmark(tmp_path: Path) -> None:
    journals = []
    for wrong in (0, 1):
        (tmp_path / str(wrong)).mkdir()
        journals.append(results.Journal(tmp_path / str(wrong)))
        journals[-1].add(results.Entry("claim", (0, 0), {"outcomes": [], "wrong": wrong}), {"name": "other"})
        journals[-1].add(entry("a", 1), HERE)
    merged, other = journals
    merged.merge(other)
    assert merged.rows() == [entry("a", 1).row]
    assert merged.missing() == merged.disagreements == []
    assert merged.entries["claim"].row["wrong"] == 0
    document = results.document(halfspace_native, merged.rows(), {}, merged.machines)
    assert document["machines"] == {"here": HERE}


def test_rubbish_in_the_journal_is_passed_over(tmp_path: Path) -> None:
    good = '{"key": "b", "order": [0, 1], "row": {"x": 1}}'
    (tmp_path / results.JOURNAL).write_text(f'nonsense\n[]\n3\n{{"key": "a"}}\n{good}\n{{"machine": 1}}\n')
    assert results.Journal(tmp_path).entries == {"b": results.Entry("b", (0, 1), {"x": 1})}


def test_parts_of_a_sweep_know_each_other_and_write_for_themselves(tmp_path: Path) -> None:
    for number in (1, 2):
        part = results.Journal(tmp_path, f"{number}-of-2")
        part.add(entry(f"row {number}", number), HERE)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rows-1-of-2.jsonl", "rows-2-of-2.jsonl"]
    assert set(results.Journal(tmp_path).entries) == {"row 1", "row 2"}


def test_a_row_measured_twice_must_differ_in_times_only(tmp_path: Path) -> None:
    journals = []
    for name, seconds, missed in (("x", 1.0, 0), ("y", 2.0, 0), ("z", 1.0, 3)):
        (tmp_path / name).mkdir()
        journal = results.Journal(tmp_path / name)
        journal.add(entry("a", 0, build_s={"med": seconds}, errors={"false_miss": missed}), {"name": name})
        journals.append(journal)
    merged, *others = journals
    merged.merge(others[0])
    assert (len(merged.entries), merged.disagreements, set(merged.machines)) == (1, [], {"x", "y"})
    merged.merge(others[1])
    assert merged.disagreements == ["s, a: measured twice, on here"]


def test_reports_disagreement_within_a_merged_folder_too(tmp_path: Path) -> None:
    for number, missed in ((1, 0), (2, 3)):
        part = results.Journal(tmp_path, f"{number}-of-2")
        part.add(entry("a", 0, errors={"false_miss": missed}), HERE)
    inside = results.Journal(tmp_path)
    assert inside.disagreements == ["s, a: measured twice, on here"]
    (tmp_path / "other").mkdir()
    merged = results.Journal(tmp_path / "other")
    merged.merge(inside)
    assert merged.disagreements == inside.disagreements


def test_of_several_files_none_is_replaced_when_one_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results.write_all(report(tmp_path, "old"))
    calls = []

    def full_at_the_last(_: int) -> None:
        calls.append(1)
        if len(calls) == len(REPORT):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(results.os, "fsync", full_at_the_last)
    with pytest.raises(results.FolderError, match="No space left"):
        results.write_all(report(tmp_path, "new"))
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys(REPORT, "old")


REPORT = ("bench.json", "bench.csv", "report.html")


def report(folder: Path, text: str) -> dict[Path, str]:
    """Contents of a report's files."""
    return dict.fromkeys((folder / name for name in REPORT), text)


def held(monkeypatch: pytest.MonkeyPatch, path: Path, error: BaseException) -> None:
    """Let no file be moved to this name nor away from it, as where another program keeps it open on Windows."""
    replace = os.replace

    def refuse(source: Any, target: Any) -> None:
        if path in (Path(source), Path(target)):
            raise error
        replace(source, target)

    monkeypatch.setattr(os, "replace", refuse)


def no_links(*_: Any, **__: Any) -> None:
    raise OSError(1, "Operation not permitted")


@pytest.mark.parametrize("links", [True, False])
@pytest.mark.parametrize("name", REPORT)
def test_a_report_is_all_old_when_a_file_is_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, links: bool
) -> None:
    results.write_all(report(tmp_path, "old"))
    results.Journal(tmp_path).add(entry("kd", 0), HERE)
    journal = (tmp_path / results.JOURNAL).read_bytes()
    if not links:
        monkeypatch.setattr(os, "link", no_links)
    held(monkeypatch, tmp_path / name, PermissionError(13, "Permission denied"))
    with pytest.raises(results.FolderError) as told:
        results.write_all(report(tmp_path, "new"))
    assert str(told.value) == f"{tmp_path / name}: cannot be written: Permission denied"
    assert {path.name: path.read_text() for path in report(tmp_path, "")} == dict.fromkeys(REPORT, "old")
    assert (tmp_path / results.JOURNAL).read_bytes() == journal
    assert len(list(tmp_path.iterdir())) == len(REPORT) + 1, "no remains"


@pytest.mark.parametrize("links", [True, False])
def test_a_report_is_all_new_and_nothing_remains_of_the_old(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    if not links:
        monkeypatch.setattr(os, "link", no_links)
    for text in ("old", "new"):
        results.write_all(report(tmp_path, text))
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys(REPORT, "new")


@pytest.mark.parametrize("error", [PermissionError(13, "Permission denied"), KeyboardInterrupt()])
def test_no_file_of_a_first_report_is_left_when_it_is_not_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    held(monkeypatch, tmp_path / REPORT[1], error)
    with pytest.raises((results.FolderError, KeyboardInterrupt)):
        results.write_all(report(tmp_path, "new"))
    assert list(tmp_path.iterdir()) == []


def test_an_old_file_that_cannot_be_put_back_is_kept_and_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    results.write_all(report(tmp_path, "old"))
    first, second, _ = report(tmp_path, "")
    replace, moved = os.replace, []

    def refuse(source: Any, target: Any) -> None:
        moved.append(Path(target))
        if Path(target) == second or moved.count(first) > 1:
            raise PermissionError(13, "Permission denied")
        replace(source, target)

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(results.FolderError) as told:
        results.write_all(report(tmp_path, "new"))
    [kept] = set(tmp_path.iterdir()) - set(report(tmp_path, ""))
    assert str(told.value) == (
        f"{second}: cannot be written: Permission denied; {first} cannot be put back: the old one is {kept}"
    )
    assert (first.read_text(), second.read_text(), kept.read_text()) == ("new", "old", "old")


@pytest.mark.skipif(os.name != "posix", reason="links of this kind need a right on this system")
def test_a_link_is_put_back_as_a_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("old")
    first, second, _ = report(tmp_path, "")
    first.symlink_to(elsewhere)
    held(monkeypatch, second, PermissionError(13, "Permission denied"))
    with pytest.raises(results.FolderError):
        results.write_all(report(tmp_path, "new"))
    assert first.readlink() == elsewhere
    assert set(tmp_path.iterdir()) == {elsewhere, first}
    assert elsewhere.read_text() == "old"


def test_an_error_names_the_file_where_its_remains_cannot_be_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a folder that is made read-only meanwhile."""
    results.write_all(report(tmp_path, "old"))
    first, *_ = report(tmp_path, "")

    def read_only(*_: Any, **__: Any) -> None:
        raise PermissionError(13, "Permission denied")

    for call in ("link", "replace", "unlink"):
        monkeypatch.setattr(os, call, read_only)
    with pytest.raises(results.FolderError) as told:
        results.write_all(report(tmp_path, "new"))
    assert str(told.value) == f"{first}: cannot be written: Permission denied"
    assert {path.read_text() for path in report(tmp_path, "")} == {"old"}


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(results.FolderError, match="file/inside: cannot be written"):
        results.prepare_folder(file / "inside")


def test_a_key_depends_on_every_part() -> None:
    parts: list[Any] = ["scene", "kd", {"size": [64, 64], "seed": 1}]
    base = results.key(*parts)
    assert results.key(*json.loads(json.dumps(parts))) == base
    assert results.key("scene", "kd", {"seed": 1, "size": [64, 64]}) == base
    assert results.key("scene", "kd", {"seed": 2, "size": [64, 64]}) != base
    assert results.key("scene", "kd-sah", parts[2]) != base


def test_a_document_names_the_build_of_the_compiled_module(tmp_path: Path) -> None:
    made = []
    for number in (1, 2):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "halfspace_native.so").write_bytes(bytes([number]))
        module = SimpleNamespace(
            __file__=str(folder / "__init__.py"), __version__="0.1.0", level=halfspace_native.level
        )
        made.append(results.document(module, [], {}))
        assert made[-1]["native"] == results.native_fingerprint(module)
    assert made[0]["native"] != made[1]["native"]
    assert made[0] | {"native": ""} == made[1] | {"native": ""}


def test_finds_known_rows_without_searching_a_list():
    compared = []

    class Told(str):
        __hash__ = str.__hash__

        def __eq__(self, other):
            compared.append(other)
            return str.__eq__(self, other)

    def specs():
        return [Told(f"kd:alpha=0.{i}") for i in range(1000)]

    asked = Asked()
    for _ in range(2):
        asked.take({"asked": {"run": "a", "scenes": ["room"], "specs": specs()}})
    other = Asked()
    other.take({"asked": {"run": "a", "scenes": ["room"], "specs": [*specs(), "kd"]}})
    asked.merge(other)
    assert asked.specs["a", "room"] == [*specs(), "kd"]
    assert len(compared) < 10_000
