# SPDX-License-Identifier: GPL-3.0-or-later
"""Setting up: uv is found or installed, environments are made once, and the locked packages are those wanted."""

from __future__ import annotations

import re
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import environment
import lock
import pytest
import uv

HERE = f"{sys.version_info.major}.{sys.version_info.minor}"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Sequence[str]]:
    """The arguments of uv, which is not run."""
    calls: list[Sequence[str]] = []
    monkeypatch.setattr(uv, "run", lambda arguments, _: calls.append(arguments))
    return calls


def program(path: Path, text: str, status: int = 0) -> Path:
    """A program that prints a line and ends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\necho '{text}'\nexit {status}\n")
    path.chmod(0o755)
    return path


posix = pytest.mark.skipif(sys.platform == "win32", reason="the programs of these tests are shell scripts")


@posix
@pytest.mark.parametrize(
    ("version", "status", "used"), [("uv 0.99.1", 0, True), ("uv 0.4.30", 0, False), ("uv 0.99.1", 127, False)]
)
def test_a_uv_on_the_path_is_used_if_it_is_new_enough(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str, status: int, used: bool
) -> None:
    theirs = program(tmp_path / "theirs" / "uv", version, status)
    ours = program(tmp_path / "ours" / "bin" / "uv", f"uv {uv.VERSION} (a build)")
    monkeypatch.setenv("PATH", str(theirs.parent), prepend=":")
    monkeypatch.setattr(uv, "FOLDER", tmp_path / "ours")
    assert uv.command.__wrapped__() == (theirs if used else ours)


@posix
def test_uv_is_installed_where_there_is_none_of_this_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = program(tmp_path / "bin" / "uv", "uv 0.1.0")
    commands: list[list[str]] = []
    monkeypatch.setattr(uv.shutil, "which", lambda _: None)
    monkeypatch.setattr(uv, "FOLDER", tmp_path)
    monkeypatch.setattr(uv, "ROOT", tmp_path.parent)
    monkeypatch.setattr(uv, "_checked", lambda arguments, *_: commands.append(arguments))
    assert uv.command.__wrapped__() == ours
    assert [command[1:3] for command in commands] == [["-m", "venv"], ["-m", "pip"]]
    assert commands[1][-1] == f"uv=={uv.VERSION}"


def test_a_failure_ends_with_the_last_lines() -> None:
    code = "import sys; print('\\n'.join(map(str, range(99))), file=sys.stderr); sys.exit(2)"
    with pytest.raises(environment.SetupError, match=r"^it failed:\n84\n(.*\n)*98$"):
        uv._checked([sys.executable, "-c", code], "it failed")


def test_what_pip_and_pyenv_know_is_passed_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("3.13.0", "3.11.7"):
        (tmp_path / "versions" / name).mkdir(parents=True)
    for name in ("UV_DEFAULT_INDEX", "SSL_CERT_FILE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path))
    monkeypatch.setenv("PIP_INDEX_URL", "https://index.example")
    monkeypatch.setenv("PIP_CERT", "certificates.pem")
    found = uv.variables()
    assert found["PYENV_VERSION"] == "3.13.0:3.11.7"
    assert found["UV_DEFAULT_INDEX"] == "https://index.example"
    assert found["SSL_CERT_FILE"] == "certificates.pem"


def test_an_environment_is_made_once(tmp_path: Path, asked: list[Sequence[str]], monkeypatch: Any) -> None:
    where = environment.Environment("0", HERE, tmp_path / "env", ())
    environment.make(where)
    assert len(asked) == 1
    assert asked[0][0] == "venv"
    monkeypatch.setattr(environment.Environment, "python", Path(sys.executable))
    environment.make(where)
    assert len(asked) == 1
    environment.make(environment.Environment("0", "3.99", tmp_path / "env", ()))
    assert len(asked) == 2, "one of another version is made again"


@pytest.mark.parametrize(("there", "error"), [(True, environment.SetupError), (False, environment.NoPythonError)])
def test_a_python_that_is_missing_is_told_from_other_failures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool, error: type[Exception]
) -> None:
    def fail(*_: Any) -> str:
        raise environment.SetupError("no")

    monkeypatch.setattr(uv, "run", fail)
    monkeypatch.setattr(environment, "available", lambda _: there)
    with pytest.raises(environment.SetupError) as raised:
        environment.make(environment.Environment("0", "3.99", tmp_path, ()))
    assert raised.type is error


def pinned(where: environment.Environment) -> dict[str, str]:
    """Package to version, as locked."""
    found = re.findall(r"^([\w.-]+)==([^\s;]+)", where.lock.read_text(encoding="utf-8"), re.MULTILINE)
    return {name.lower(): version for name, version in found}


@pytest.mark.parametrize("where", environment.ALL, ids=lambda where: where.folder.name)
def test_what_is_locked_is_what_the_project_file_wants(where: environment.Environment) -> None:
    import tomllib

    groups = tomllib.loads((environment.ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]
    locked = pinned(where)
    for requirement in (line for group in where.groups for line in groups[group]):
        name, _, version = requirement.partition(";")[0].strip().partition("==")
        assert locked.get(name.lower()) == version, f"run scripts/dev/lock.py: {requirement}"


@pytest.mark.parametrize("where", environment.ALL, ids=lambda where: where.folder.name)
def test_a_lock_has_hashes_and_names_no_host(where: environment.Environment) -> None:
    text = where.lock.read_text(encoding="utf-8")
    assert "://" not in text
    assert text.count("==") <= text.count(" --hash=sha256:")


def test_tests_do_without_what_only_the_portable_wheel_needs() -> None:
    assert "ziglang" in pinned(environment.PORTABLE)
    for where in (environment.CURRENT, environment.LTS):
        assert "ziglang" not in pinned(where)


def test_packages_are_installed_by_their_hashes_and_the_wheel_after_them(
    tmp_path: Path, asked: list[Sequence[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    where = environment.Environment("0", HERE, tmp_path / ".venv-x", ())
    monkeypatch.setattr(environment, "make", lambda _: None)
    monkeypatch.setattr(environment.wheel, "build", lambda *_: (tmp_path / "x.whl", True))
    environment.prepare_packages(where)
    environment.install_wheel(where)
    packages, wheel = asked
    assert {"--require-hashes", "--no-build", str(environment.ROOT / "requirements" / "venv-x.txt")} <= set(packages)
    assert list(wheel[-2:]) == ["--no-deps", str(tmp_path / "x.whl")]


def test_all_files_are_locked_by_one_command(asked: list[Sequence[str]], capsys: pytest.CaptureFixture[str]) -> None:
    assert lock.main([]) == 0
    assert [Path(call[call.index("--output-file") + 1]) for call in asked] == [one.lock for one in environment.ALL]
    assert not any("--upgrade" in call for call in asked)
    assert lock.main(["--upgrade"]) == 0
    assert all("--upgrade" in call for call in asked[len(environment.ALL) :])
    assert "requirements/venv.txt" in capsys.readouterr().out.replace("\\", "/")


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
    thread.join(300)
    assert order == ["first", "second"]
    assert "waiting for another set-up" in capsys.readouterr().out
