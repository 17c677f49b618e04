# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits of the sources: lines and parameters of functions, and names that were given up.

`native/clippy.toml` and `pyproject.toml` hold the limits of functions for the linters. These tests read all sources
without a compiler, among them the tests and those parts that only some platforms compile.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import environment
import pytest
import sizes

FOLDERS = [environment.ROOT / name for name in ("native", "addon", "scripts")]

FUNCTION_LINES = 80
PARAMETERS = 7

KEYWORDS = {
    ("native/python/src/instances.rs", "all_hits"),
    ("native/python/src/instances.rs", "closest"),
    ("native/python/src/instances.rs", "occluded"),
    ("native/python/src/oracle.rs", "exact"),
    ("native/python/src/render.rs", "new"),
    ("native/python/src/structure.rs", "all_hits"),
    ("native/python/src/structure.rs", "closest"),
    ("native/python/src/structure.rs", "occluded"),
}
"""Functions with more parameters than others: each parameter is a keyword of a Python function, most have defaults."""

GIVEN_UP = re.compile(r"\b(Walk|Place|Course|Lately|Method|Alone|waiting)\b")
"""Names for which the glossary of docs/architecture.md has others: traversal, instance, state, entry."""


def of_all(folders: list[Path]) -> Iterator[tuple[str, sizes.Function]]:
    """Each function with the name of its file."""
    for folder in folders:
        for path in sizes.sources(folder):
            for function in sizes.functions(path):
                yield path.relative_to(folder.parent).as_posix(), function


def long_functions(folders: list[Path]) -> list[str]:
    return [f"{at}:{f.line} {f.name}: {f.lines}" for at, f in of_all(folders) if f.lines > FUNCTION_LINES]


def many_parameters(folders: list[Path]) -> list[tuple[str, str]]:
    return [(at, f.name) for at, f in of_all(folders) if f.parameters > PARAMETERS]


def packed(folders: list[Path]) -> list[str]:
    return [f"{at}:{f.line} {f.name}: {', '.join(f.tuples)}" for at, f in of_all(folders) if f.tuples]


def given_up(folders: list[Path]) -> list[str]:
    rust = [path for one in folders for path in sizes.sources(one) if path.suffix == ".rs"]
    return [f"{path.name}: {name}" for path in rust for name in GIVEN_UP.findall(sizes.code_of(path))]


def test_functions_are_short() -> None:
    assert not long_functions(FOLDERS)


def test_functions_take_few_parameters_and_no_tuples() -> None:
    assert set(many_parameters(FOLDERS)) == KEYWORDS
    assert not packed(FOLDERS)


def test_names_are_those_of_the_glossary() -> None:
    assert not given_up(FOLDERS)


def test_the_linters_have_the_same_limits() -> None:
    root = environment.ROOT
    clippy = tomllib.loads((root / "native" / "clippy.toml").read_text(encoding="utf-8"))
    assert clippy == {"too-many-lines-threshold": FUNCTION_LINES, "too-many-arguments-threshold": PARAMETERS}
    native = tomllib.loads((root / "native" / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]
    assert {"too_many_lines", "too_many_arguments"} <= set(native["lints"]["clippy"])
    for crate in native["members"]:
        manifest = tomllib.loads((root / "native" / crate / "Cargo.toml").read_text(encoding="utf-8"))
        assert manifest["lints"] == {"workspace": True}, crate
    python = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["ruff"]["lint"]
    assert python["pylint"]["max-args"] == PARAMETERS


BODY = "    let x = 1;\n"
RUST = """
/// fn documented(a: (u8, u8)) {{
#[inline(always)]
pub fn cast<'a, S: Fn(u8) -> u8, const N: usize>(
    &'a self, // one, two
    simd: S,
    pairs: &[(u8, u8)],
    call: impl Fn((u8, u8)) -> (u8, u8),
    one: (u8),
    {parameter}
) -> (u8, u8)
where
    S: Copy,
{{
    let (text, sign, line) = ("}}\\"{{", '{{', r#"fn text(a: (u8, u8)) {{"#);

    // A comment.
{body}}}
"""


def rust(folder: Path, name: str = "cast.rs", lines: int = 1, parameter: str = "last: u8") -> Path:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(RUST.format(body=BODY * lines, parameter=parameter), encoding="utf-8")
    return folder / name


def test_a_rust_function_is_read_without_comments_and_strings(tmp_path: Path) -> None:
    [read] = sizes.functions(rust(tmp_path, lines=3))
    assert read == sizes.Function("cast", 4, 4, 5)


@pytest.mark.parametrize(
    "parameter",
    ["(a, b): (u8, u8)", "pair: &(u8, Vec<u8>)", "pair: &'a mut (u8, fn(u8) -> u8)", "(i, _): (usize, T::A)"],
)
def test_a_packed_tuple_is_found(tmp_path: Path, parameter: str) -> None:
    folder = tmp_path / "crate"
    rust(folder)
    assert not packed([folder])
    rust(folder, parameter=parameter)
    [found] = packed([folder])
    assert found.startswith("crate/cast.rs:4 cast: ")


def test_too_many_parameters_are_found(tmp_path: Path) -> None:
    rust(tmp_path, parameter="e: u8, f: u8, g: u8")
    assert not many_parameters([tmp_path])
    path = rust(tmp_path, parameter="e: u8, f: HashMap<u8, u8>, g: u8, h: u8")
    assert many_parameters([tmp_path]) == [(f"{tmp_path.name}/cast.rs", "cast")]
    path.write_text("trait T { fn f(a: u8, b: u8, c: u8, d: u8, e: u8, f: u8, g: u8, h: u8); }", encoding="utf-8")
    assert many_parameters([tmp_path]) == [(f"{tmp_path.name}/cast.rs", "f")]
    path.unlink()
    (tmp_path / "cast.py").write_text("def f(self, a, b, c, d, *, e, f, g=1): ...\n", encoding="utf-8")
    assert not many_parameters([tmp_path])
    (tmp_path / "cast.py").write_text("def f(a, b, c, d, *, e, f, g, h=1): ...\n", encoding="utf-8")
    assert many_parameters([tmp_path]) == [(f"{tmp_path.name}/cast.py", "f")]


def test_long_functions_are_found(tmp_path: Path) -> None:
    rust(tmp_path, lines=FUNCTION_LINES - 1)
    assert not long_functions([tmp_path])
    rust(tmp_path, lines=FUNCTION_LINES)
    assert long_functions([tmp_path]) == [f"{tmp_path.name}/cast.rs:4 cast: {FUNCTION_LINES + 1}"]
    (tmp_path / "cast.rs").unlink()
    text = 'def f():\n    """Line.\n\n    Line.\n    """\n    # Comment.\n\n' + "    f()\n" * FUNCTION_LINES
    (tmp_path / "cast.py").write_text(text, encoding="utf-8")
    assert not long_functions([tmp_path])
    (tmp_path / "cast.py").write_text(text + "    f()\n", encoding="utf-8")
    assert long_functions([tmp_path]) == [f"{tmp_path.name}/cast.py:1 f: {FUNCTION_LINES + 1}"]


def test_given_up_names_are_found_in_code_alone(tmp_path: Path) -> None:
    (tmp_path / "a.rs").write_text('// Place the child.\nlet s = "waiting"; struct Walker;\n', encoding="utf-8")
    assert not given_up([tmp_path])
    (tmp_path / "a.rs").write_text("struct Place; let waiting = 0;\n", encoding="utf-8")
    assert given_up([tmp_path]) == ["a.rs: Place", "a.rs: waiting"]
