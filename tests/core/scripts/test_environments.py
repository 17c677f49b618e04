# SPDX-License-Identifier: GPL-3.0-or-later
"""Setting up: uv is found or installed, environments are made once, and the locked packages are those wanted."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from scripts.dev import environment

HERE = "{}.{}".format(*sys.version_info)

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has neither shell scripts nor this lock")


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Sequence[str]]:
    """The arguments of uv, which is not run."""
    calls: list[Sequence[str]] = []
    monkeypatch.setattr(environment, "uv", lambda arguments, _: calls.append(arguments))
    monkeypatch.setattr(environment, "command", lambda: Path("uv"))
    return calls


def program(path: Path, text: str, status: int = 0) -> Path:
    """A program that prints a line and ends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\necho '{text}'\nexit {status}\n")
    path.chmod(0o755)
    return path


@posix
@pytest.mark.parametrize(
    ("version", "status", "used"), [("uv 0.99.1", 0, True), ("uv 0.4.30", 0, False), ("uv 0.99.1", 127, False)]
)
@pytest.mark.parametrize("ours", [environment.VERSION, "0.1.0"])
def test_a_uv_on_the_path_is_used_if_it_is_new_enough_else_one_is_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str, status: int, used: bool, ours: str
) -> None:
    theirs = program(tmp_path / "theirs" / "uv", version, status)
    own = program(tmp_path / "ours" / "bin" / "uv", f"uv {ours} (a build)")
    commands: list[Sequence[str]] = []
    monkeypatch.setenv("PATH", str(theirs.parent), prepend=":")
    monkeypatch.setattr(environment, "UV", tmp_path / "ours")
    monkeypatch.setattr(environment, "checked", lambda arguments, *_: commands.append(arguments))
    assert environment.command.__wrapped__() == (theirs if used else own)
    is_current = used or ours == environment.VERSION
    assert [words[1:3] for words in commands] == ([] if is_current else [["-m", "venv"], ["-m", "pip"]])
    assert is_current or commands[1][-1] == f"uv=={environment.VERSION}"


def test_a_failure_is_one_line_with_the_last_words() -> None:
    code = "import sys; print('\\n'.join(map(str, range(999))), file=sys.stderr); sys.exit(2)"
    with pytest.raises(environment.SetupError, match=r"^it failed: .{,600} 997 998$"):
        environment.checked([sys.executable, "-c", code], "it failed")


def test_passes_on_settings_of_pip_and_pyenv(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("3.13.0", "3.11.7"):
        (tmp_path / "versions" / name).mkdir(parents=True)
    for name in ("UV_DEFAULT_INDEX", "SSL_CERT_FILE"):
        monkeypatch.delenv(name, raising=False)
    given = {"PYENV_ROOT": str(tmp_path), "PIP_INDEX_URL": "https://index.example", "PIP_CERT": "certificates.pem"}
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(environment, "command", lambda: Path("uv"))
    monkeypatch.setattr(environment, "checked", lambda _, __, variables: variables)
    found: Any = environment.uv([], "")
    assert found["PYENV_VERSION"] == "3.13.0:3.11.7"
    assert (found["UV_DEFAULT_INDEX"], found["SSL_CERT_FILE"]) == ("https://index.example", "certificates.pem")


def test_an_environment_is_made_once(tmp_path: Path, asked: list[Sequence[str]], monkeypatch: Any) -> None:
    where = environment.Environment("0", HERE, tmp_path / "env", ())
    environment.make(where)
    assert [words[0] for words in asked] == ["venv"]
    monkeypatch.setattr(environment.Environment, "python", Path(sys.executable))
    environment.make(where)
    assert len(asked) == 1
    environment.make(environment.Environment("0", "3.99", tmp_path / "env", ()))
    assert len(asked) == 2, "one of another version is made again"


@pytest.mark.parametrize(("there", "error"), [(True, environment.SetupError), (False, environment.NoPythonError)])
def test_a_python_that_is_missing_is_told_from_other_failures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool, error: type[Exception]
) -> None:
    def uv(arguments: Sequence[str], failure: str) -> str:
        if arguments[0] == "venv" or not there:
            raise environment.SetupError(failure)
        return ""

    monkeypatch.setattr(environment, "uv", uv)
    monkeypatch.setattr(environment, "command", lambda: Path("uv"))
    with pytest.raises(environment.SetupError) as raised:
        environment.make(environment.Environment("0", "3.99", tmp_path, ()))
    assert raised.type is error


@pytest.mark.parametrize("where", environment.ALL, ids=lambda where: where.folder.name)
def test_locked_versions_are_those_of_the_project_file(where: environment.Environment) -> None:
    import tomllib

    groups = tomllib.loads((environment.ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]
    text = where.lock.read_text(encoding="utf-8")
    locked = {name.lower(): version for name, version in re.findall(r"(?m)^([\w.-]+)==([^\s;]+)", text)}
    for requirement in (line for group in where.groups for line in groups[group]):
        name, _, version = requirement.partition(";")[0].strip().partition("==")
        assert locked.get(name.lower()) == version, f"run python -m scripts.dev.lock: {requirement}"
    assert ("ziglang" in locked) == (where == environment.PORTABLE)
    # Hashes, and no host.
    assert "://" not in text
    assert text.count("==") <= text.count(" --hash=sha256:")


def test_packages_are_installed_by_their_hashes_and_the_wheel_after_them(
    tmp_path: Path, asked: list[Sequence[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    where = environment.Environment("0", HERE, tmp_path / ".venv-x", ())
    monkeypatch.setattr(environment, "make", lambda _: None)
    monkeypatch.setattr(environment, "build_wheel", lambda *_: (tmp_path / "x.whl", True))
    environment.prepare(where)
    environment.prepare(where, "measure")
    environment.install_wheel(where)
    packages, some, wheel = asked
    lock = str(environment.ROOT / "requirements" / "venv-x.txt")
    assert list(packages[-4:]) == ["--require-hashes", "--no-build", "--requirements", lock]
    assert list(some[-6:]) == ["--require-hashes", "--no-build", "--constraints", lock, "--group", "measure"]
    assert list(wheel[-2:]) == ["--no-deps", str(tmp_path / "x.whl")]


@posix
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


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Blender brings all libraries on other systems")
@pytest.mark.parametrize("may", [True, False])
def test_missing_libraries_are_installed_or_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, may: bool) -> None:
    def run(words: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        steps.append(words[:2])
        status = 0 if may or words[0] == "ldd" else 100
        return subprocess.CompletedProcess(
            words, status, "\tlibX.so => /x (0x7)\n\tlibSM.so.6 => not found\n" * 2, "root?"
        )

    steps: list[list[str]] = []
    environment.provide_libraries(environment.CURRENT)
    where = environment.Environment("0", HERE, tmp_path, ())
    module = tmp_path / "lib" / f"python{HERE}" / "site-packages" / "bpy" / "__init__.abi3.so"
    module.parent.mkdir(parents=True)
    module.touch()
    monkeypatch.setattr(environment.subprocess, "run", run)
    monkeypatch.setattr(environment.shutil, "which", lambda name: name)
    monkeypatch.setattr(environment.ctypes.util, "find_library", lambda _: None)
    if may:
        environment.provide_libraries(where)
    else:
        line = r"^Blender lacks libEGL\.so\.1, libSM\.so\.6: on Debian or Ubuntu run: sudo apt-get install .*: root\?$"
        with pytest.raises(environment.SetupError, match=line):
            environment.provide_libraries(where)
    assert steps == [["ldd", str(module)], ["apt-get", "update"], *([["apt-get", "install"]] if may else [])]
