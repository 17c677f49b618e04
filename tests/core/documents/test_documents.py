# SPDX-License-Identifier: GPL-3.0-or-later
"""README, CHANGELOG and docs/ against the program: commands, configurations, paths, links, Python examples, lengths."""

from __future__ import annotations

import argparse
import contextlib
import fnmatch
import importlib
import io
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.core.structures import specs
from addon.lab.commands import bench, launcher
from scripts import test
from scripts.dev import environment, structures_page

ROOT: Path = environment.ROOT
DOCUMENTS = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
LONGEST = {"README.md": 120, "CHANGELOG.md": 60}
"""Lines that these documents may have at most."""

LANGUAGES = {"sh", "python", "text", "bibtex"}
PYTHONS = {"python", "python3", ".venv/bin/python"}
BLENDER_FLAGS = {"-b", "--background", "-a"}
BLENDER_VALUES = {"-E", "-f", "-s", "-e", "-j", "-o", "--python"}

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
PLACE = re.compile(r"(addon|docs|lab|native|requirements|scripts|tests)/[\w./-]*")
SPEC = re.compile(r"([a-z][a-z0-9-]*):[a-z_]+=[^\s|…]*")


class Parsed(BaseException):
    """Ends a command where its arguments are parsed. Holds them."""


class Problem(Exception):
    """A statement of a document that is not true."""


def prose(text: str) -> str:
    """The text without its fenced blocks."""
    return FENCE.sub("", text)


def anchors(text: str) -> set[str]:
    """The anchors that GitHub gives the headings of a document."""
    bare = (re.sub(r"[^\w\- ]", "", heading.strip().lower()) for heading in HEADING.findall(prose(text)))
    return {heading.replace(" ", "-") for heading in bare}


def parsed(module: Any, arguments: list[str]) -> argparse.Namespace:
    """The arguments as the command's own parser reads them; nothing is run. Raises Problem."""

    def stop(self: argparse.ArgumentParser, *given: Any) -> argparse.Namespace:
        raise Parsed(original(self, *given))

    original = argparse.ArgumentParser.parse_args
    said = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        patch.setattr(argparse.ArgumentParser, "parse_args", stop)
        try:
            module.main(arguments)
        except Parsed as end:
            return end.args[0]
        except SystemExit:
            pass
    raise Problem(said.getvalue().strip() or "its arguments are not parsed")


def build(spec: str) -> None:
    """Build a configuration over one triangle. Raises Problem."""
    try:
        native.build(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), spec, threads=1)
    except ValueError as error:
        raise Problem(str(error)) from error


def check_configurations(module: Any, asked: argparse.Namespace) -> None:
    """Build what `--structure` and `--structures` name. Raises Problem."""
    if module is bench:
        try:
            bench.read_structures(asked, native)
        except ValueError as error:
            raise Problem(str(error)) from error
    elif getattr(asked, "structures", None) not in (None, "all"):
        for spec in specs.split(asked.structures):
            build(spec)
    if getattr(asked, "structure", None):
        build(asked.structure)


def check_script(words: list[str]) -> None:
    """A command of the project, by its path and arguments. Raises Problem."""
    path = ROOT / words[0]
    if not path.is_file():
        raise Problem(f"{words[0]} does not exist")
    if path.name == "lock.py":  # options are those of uv
        return
    if path.name == "test.py":
        checks = test.checks()
        unknown = [word for word in words[1:] if word != "--all" and not any(name.startswith(word) for name in checks)]
        if unknown:
            raise Problem(f"no check begins with {unknown[0]}")
        return
    if path.name == "halfspace.py":
        check_halfspace(words[1:])
    elif path.stem in launcher.COMMANDS:
        check_halfspace([path.stem, *words[1:]])
    else:
        module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
        check_configurations(module, parsed(module, words[1:]))


def check_blender(words: list[str]) -> None:
    """A command line of Blender: known options, our engine, our scripts. Raises Problem."""
    own = words[: words.index("--")] if "--" in words else words
    rest = iter(own)
    for word in rest:
        if word in BLENDER_VALUES:
            value = next(rest, "")
            if word == "-E" and value != "HALFSPACE":
                raise Problem(f"the engine {value} is not ours")
            if word == "--python":
                check_script([value, *words[len(own) + 1 :]])
        elif word not in BLENDER_FLAGS and word.startswith("-"):
            raise Problem(f"the option {word} of Blender is not known here")


def check_halfspace(words: list[str]) -> None:
    """The command `halfspace`: one of its commands, with the arguments of that. Raises Problem."""
    if words[:1] in ([], ["--version"], ["--help"]):
        return
    if words[0] not in launcher.COMMANDS:
        raise Problem(f"halfspace has no command {words[0]}")
    if not words[1:]:  # its name alone
        return
    module = importlib.import_module(f"addon.lab.commands.{words[0]}")
    check_configurations(module, parsed(module, words[1:]))


def check_pip(words: list[str]) -> None:
    """An installation of what `scripts/package_python.py` and `scripts/package.py` build. Raises Problem."""
    ours = [fnmatch.fnmatch(word, "build/*/halfspace_*.whl") for word in words[1:]]
    if words[0] != "install" or not ours or not all(ours):
        raise Problem("expected pip install and our wheels below build")


def check_cargo(words: list[str]) -> None:
    """A command of cargo: what it names exists. Raises Problem."""
    for option, folder in (("--test", "tests"), ("--example", "examples"), ("--bench", "benches/benches")):
        if option in words and not (ROOT / "native" / folder / f"{words[words.index(option) + 1]}.rs").is_file():
            raise Problem(f"{option} {words[words.index(option) + 1]} does not exist")


def check_command(line: str) -> None:
    """One command line. Raises Problem."""
    words = shlex.split(re.sub(r"(^|\s)#\s.*", "", line))
    if not words:
        return
    if words[0] in PYTHONS:
        own = words[1:]
        check_script([f"{own[1].replace('.', '/')}.py", *own[2:]] if own[0] == "-m" else own)
    elif words[0] == "blender":
        check_blender(words[1:])
    elif words[0] == "cargo":
        check_cargo(words[1:])
    elif words[0] == "halfspace" and len(words) > 1:
        check_halfspace(words[1:])
    elif words[0] == "pip" and len(words) > 1:
        check_pip(words[1:])
    else:
        raise Problem(f"{words[0]} is no command that this test knows")


def check_fence(language: str, body: str) -> None:
    """A fenced block: commands are parsed, Python is run. Raises Problem."""
    if language not in LANGUAGES:
        raise Problem(f"a block of the language {language!r}; expected {', '.join(sorted(LANGUAGES))}")
    if language == "sh":
        for line in body.replace("\\\n", " ").splitlines():
            check_command(line)
    elif language == "python":
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(body, "example", "exec"), {})  # noqa: S102
        except Exception as error:
            raise Problem(f"the example fails: {error!r}") from error


def check_inline(code: str) -> None:
    """Code in a line of prose: a command, a path, or a configuration. Raises Problem."""
    words = shlex.split(code) if "'" not in code else [code]
    if words[0] in (*PYTHONS, "blender", "cargo") and len(words) > 1:
        check_command(code)
    elif re.fullmatch(r"(scripts|tests)/[\w/]+\.py", words[0]) and len(words) > 1:
        check_script(words)
    elif PLACE.fullmatch(words[0]) and not (ROOT / words[0]).exists():
        raise Problem(f"{words[0]} does not exist")
    spec = SPEC.fullmatch(code)
    if spec and spec[1] in {name for row in native.structures() for name in (row["id"], *row["aliases"])}:
        build(code)


def check_link(document: Path, target: str) -> None:
    """A link to a file of the project or to a heading. Raises Problem."""
    if re.match(r"[a-z]+:", target):
        return
    name, _, anchor = target.partition("#")
    path = (document.parent / name).resolve() if name else document
    if not path.exists() or not path.is_relative_to(ROOT):
        raise Problem(f"{name} does not exist in the project")
    if anchor and anchor not in anchors(path.read_text(encoding="utf-8")):
        raise Problem(f"{path.name} has no heading #{anchor}")


def problems(document: Path, text: str) -> Iterator[str]:
    """Faults of a document, each in a line."""

    def found(what: str, check: Callable[[], None]) -> Iterator[str]:
        try:
            check()
        except Problem as problem:
            yield f"{document.name}: {what}: {problem}"

    for language, body in FENCE.findall(text):
        yield from found(body.strip().partition("\n")[0], lambda: check_fence(language, body))  # noqa: B023
    for code in INLINE.findall(prose(text)):
        yield from found(code, lambda: check_inline(code))  # noqa: B023
    for line in re.findall(r"\n\n {1,3}(?! )(.+)", text):
        yield f"{document.name}: {line[:40]}: the site ends a list before a part of it that is indented by less than 4"
    for target in LINK.findall(prose(text)):
        yield from found(target, lambda: check_link(document, target))  # noqa: B023


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_statements_of_a_document_are_true(document: Path) -> None:
    assert list(problems(document, document.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("```sh\npython3 scripts/no_such.py\n```\n", "does not exist"),
        ("```sh\npython3 -m scripts.dev.no_such\n```\n", "does not exist"),
        ("```sh\npython3 scripts/bench.py --no-such-option\n```\n", "--no-such-option"),
        ("```sh\npython3 -m scripts.dev.pictures --no-such-option\n```\n", "--no-such-option"),
        ("```sh\npython3 scripts/demo.py --fast  # a comment\n```\n", "--fast"),
        ("```sh\npython3 scripts/test.py no-such-check\n```\n", "no-such-check"),
        ("```sh\n.venv/bin/python scripts/bench.py --structures kd,no-such-tree\n```\n", "no-such-tree"),
        ("```sh\n.venv/bin/python scripts/bench.py \\\n    --structures kd:k=3\n```\n", "k"),
        ("```sh\n.venv/bin/python scripts/render.py a.blend --structure kd:lazy=7\n```\n", "lazy"),
        ("```sh\nblender -b a.blend -E CYCLES -f 1\n```\n", "CYCLES"),
        ("```sh\nblender -b a.blend --python scripts/bench.py -- --no-such-option\n```\n", "--no-such-option"),
        ("```sh\ncargo test --test no_such_test\n```\n", "no_such_test"),
        ("```sh\nhalfspace oak\n```\n", "no command oak"),
        ("```sh\nhalfspace bench --no-such-option\n```\n", "--no-such-option"),
        ("```sh\npip install build/python/other.whl\n```\n", "our wheels"),
        ("```sh\nrm -r folder\n```\n", "no command"),
        ("```\npython3 scripts/no_such.py\n```\n", "language"),
        ("```python\nimport halfspace_native\nhalfspace_native.no_such_call()\n```\n", "no_such_call"),
        ("See `scripts/halfspace.py claims --no-such-option`.", "--no-such-option"),
        ("See `scripts/halfspace.py no-such-command`.", "no command no-such-command"),
        ("See `native/src/no_such_room`.", "does not exist"),
        ("Use `kd:traversal=no-such-way`.", "no-such-way"),
        ("See [this](no-such-page.md).", "does not exist"),
        ("See [this](docs/manual.md#no-such-heading).", "#no-such-heading"),
        ("See ![this](.pictures/no-such.jpg).", "does not exist"),
        ("1. First\n\n   A part of it.\n", "indented by less"),
    ],
)
def test_finds_untrue_statements(text: str, words: str) -> None:
    found = list(problems(ROOT / "README.md", text))
    assert len(found) == 1, found
    assert words in found[0]


@pytest.mark.parametrize("name", LONGEST)
def test_the_front_door_is_short(name: str) -> None:
    assert len((ROOT / name).read_text(encoding="utf-8").splitlines()) <= LONGEST[name]


def test_the_page_of_structures_is_current() -> None:
    rows = native.structures()
    written = structures_page.PAGE.read_text(encoding="utf-8")
    assert written == structures_page.page(rows), "run python -m scripts.dev.structures_page"
    changed = structures_page.page([{**rows[0], "summary": "Another one."}, *rows[1:]])
    assert written != changed, "a change of a row shows"


def test_the_readme_names_every_structure() -> None:
    table = (ROOT / "README.md").read_text(encoding="utf-8").partition("| family | ids |")[2].partition("\n\n")[0]
    named = [pattern for line in table.splitlines()[2:] for pattern in INLINE.findall(line.split("|")[2])]
    ids = [row["id"] for row in native.structures()]
    assert f"any of {len(ids)} structures" in " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert [one for one in ids if not any(fnmatch.fnmatch(one, pattern) for pattern in named)] == []
    assert [pattern for pattern in named if not fnmatch.filter(ids, pattern)] == []


def test_the_question_mark_of_every_panel_finds_a_heading() -> None:
    headings = HEADING.findall(prose((ROOT / "docs" / "manual.md").read_text(encoding="utf-8")))
    sources = [path.read_text(encoding="utf-8") for path in (ROOT / "addon" / "blender").rglob("*panels.py")]
    sections = {name for source in sources for name in re.findall(r'^    section = "(.+)"$', source, re.MULTILINE)}
    assert len(sections) >= 9
    assert sorted(sections - set(headings)) == []


def test_the_index_links_every_page() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    pages = {path.name for path in DOCUMENTS if path.parent == ROOT / "docs"} - {"index.md"}
    assert pages - set(LINK.findall(index)) == set()
