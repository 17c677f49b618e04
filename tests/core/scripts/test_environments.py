# SPDX-License-Identifier: GPL-3.0-or-later
"""Setting up: finding Pythons, making environments, and installing into them once."""

from __future__ import annotations

import sys
import threading
import venv
from pathlib import Path
from typing import Any

import environment
import interpreters
import pytest


def test_our_own_python_is_found_and_answers() -> None:
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    found = interpreters.find(version)
    assert found is not None
    assert interpreters.answers(found, version)
    assert not interpreters.answers(found, "3.99")


def test_no_python_is_invented() -> None:
    assert interpreters.find("3.99") is None


def test_a_python_that_cannot_make_environments_is_passed_over(tmp_path: Path) -> None:
    shim = tmp_path / "python3.11"
    shim.write_text("#!/bin/sh\necho 'command not found' >&2\nexit 127\n")
    shim.chmod(0o755)
    assert not interpreters.answers(shim, "3.11")
    assert not interpreters.answers(tmp_path / "absent", "3.11")


def test_versions_are_compared_as_numbers() -> None:
    names = [Path("3.13.9"), Path("3.13.10"), Path("3.13.0")]
    assert [p.name for p in interpreters.newest_first(iter(names))] == ["3.13.10", "3.13.9", "3.13.0"]


HERE = f"{sys.version_info.major}.{sys.version_info.minor}"


def files_of_pip(where: environment.Environment, *names: str) -> None:
    """Files as pip leaves them in an environment, the last one after all others."""
    folder = environment._package_folder(where, "pip-1.dist-info")
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).write_text("Metadata-Version: 2.1\nName: pip\nVersion: 1\n")


@pytest.mark.parametrize(
    ("names", "made_again"),
    [((), True), (("METADATA", "RECORD"), True), (("METADATA", "RECORD", "INSTALLER"), False)],
    ids=["ended before pip", "ended within pip", "whole"],
)
def test_an_environment_whose_making_was_cut_short_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...], made_again: bool
) -> None:
    where = environment.Environment("0", HERE, tmp_path / "env", ())
    venv.EnvBuilder(symlinks=True, with_pip=False).create(where.folder)
    if names:
        files_of_pip(where, *names)
    made: list[environment.Environment] = []
    monkeypatch.setattr(environment, "_create", made.append)
    monkeypatch.setattr(environment, "_install_requirements", lambda _: None)
    monkeypatch.setattr(environment.system_libraries, "provide", lambda _: [])
    environment.prepare(where)
    assert made == [where] * made_again


def test_requirements_come_from_the_project_file() -> None:
    assert environment.requirements(environment.LTS.groups)[0].startswith("bpy==4.5")
    assert environment.requirements(environment.CURRENT.groups)[0].startswith("bpy==5.2")
    with pytest.raises(environment.SetupError, match="no dependency group 'nothing'"):
        environment.requirements(("nothing",))


def test_tests_do_without_what_only_the_portable_wheel_needs() -> None:
    assert any(line.startswith("ziglang==") for line in environment.requirements(environment.PORTABLE.groups))
    for where in (environment.CURRENT, environment.LTS):
        assert not any("zig" in line for line in environment.requirements(where.groups))


def test_work_is_done_once_and_again_after_a_failure(tmp_path: Path) -> None:
    where = environment.Environment("0", "3.13", tmp_path, ())
    done: list[int] = []
    environment._once(where, "x", "a", lambda: done.append(1))
    environment._once(where, "x", "a", lambda: done.append(2))
    environment._once(where, "x", "b", lambda: done.append(3))

    def fail() -> None:
        raise environment.SetupError("no")

    with pytest.raises(environment.SetupError):
        environment._once(where, "x", "c", fail)
    environment._once(where, "x", "b", lambda: done.append(4))
    assert done == [1, 3, 4]


def test_another_wheel_of_the_same_name_is_installed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    where = environment.Environment("0", "3.13", tmp_path, ())
    path = tmp_path / "x-1-cp311-abi3-linux_x86_64.whl"
    monkeypatch.setattr(environment.wheel, "build", lambda *_: (path, True))
    installed: list[bytes] = []
    monkeypatch.setattr(environment, "_pip", lambda *_: installed.append(path.read_bytes()))
    for content in (b"one", b"one", b"two", b"two"):
        path.write_bytes(content)
        environment.install_wheel(where)
    assert installed == [b"one", b"two"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does without the lock")
def test_two_set_ups_take_turns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    order: list[str] = []

    def second() -> None:
        with environment.alone():
            order.append("second")

    thread = threading.Thread(target=second)
    with environment.alone():
        thread.start()
        thread.join(0.3)
        assert thread.is_alive(), "the second set-up waits"
        order.append("first")
    thread.join(30)
    assert order == ["first", "second"]
    assert "waiting for another set-up" in capsys.readouterr().out
