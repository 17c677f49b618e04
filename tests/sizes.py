# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes of source files and of their functions, read from the text of Rust and Python files."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SKIPPED = {"target", "__pycache__", "build", "out", ".venv"}


@dataclass(frozen=True)
class Function:
    """A function. lines: of code, without comments, docstrings and blank lines.

    parameters: their number, without the receiver. tuples: names of those whose type is a tuple.
    """

    name: str
    line: int
    lines: int
    parameters: int
    tuples: tuple[str, ...] = ()


def sources(folder: Path) -> Iterator[Path]:
    """All Rust and Python files below a folder that are not products of a build."""
    for path in sorted(folder.rglob("*")):
        if path.suffix in {".rs", ".py"} and not SKIPPED & set(path.relative_to(folder).parts):
            yield path


def code_of(path: Path) -> str:
    """The text of a Rust file with spaces in place of comments and `_` in place of strings, line by line as before."""
    return _HIDDEN.sub(_blank, path.read_text(encoding="utf-8"))


def functions(path: Path) -> list[Function]:
    """All functions of a file, also those inside others, in the order of their text."""
    return _rust(code_of(path)) if path.suffix == ".rs" else _python(path.read_text(encoding="utf-8"))


# Rust ----------------------------------------------------------------------------------------------------------------

_HIDDEN = re.compile(
    r"""//[^\n]*|/\*.*?\*/|\bb?r(?P<hash>\#*)".*?"(?P=hash)|\bb?"(?:\\.|[^"\\])*"|"(?:\\.|[^"\\])*"|b?'(?:\\.[^']*|[^'\\])'""",
    re.DOTALL,
)
"""Comments, strings and characters. A lifetime has no closing quote, so it is none of them."""

_BEGIN = re.compile(r"\bfn\s+([A-Za-z_]\w*)")
_RECEIVER = re.compile(r"(&\s*('\w+\s+)?)?(mut\s+)?self(\s*:.*)?", re.DOTALL)


def _rust(code: str) -> list[Function]:
    closing = _closing(code)
    found = []
    for begin in _BEGIN.finditer(code):
        opening = _parenthesis(code, begin.end())
        close = closing[opening]
        body = close + 1
        while code[body] not in "{;)}":
            body = closing.get(body, body) + 1
        if code[body] in ")}":
            # Arguments of a macro that makes functions.
            continue
        lines = [line for line in code[body + 1 : closing.get(body, body)].splitlines() if line.strip()]
        parameters = [one.strip() for one in _split(code[opening + 1 : close]) if one.strip()]
        named = [one for one in parameters if not _RECEIVER.fullmatch(one)]
        tuples = tuple(pattern.strip() for pattern, kind in map(_typed, named) if _is_tuple(kind))
        line = code.count("\n", 0, begin.start()) + 1
        found.append(Function(begin[1], line, len(lines), len(named), tuples))
    return found


def _closing(code: str) -> dict[int, int]:
    """For each bracket that opens, where it closes."""
    found, opened = {}, []
    for bracket in re.finditer(r"[(){}\[\]]", code):
        if bracket[0] in "([{":
            opened.append(bracket.start())
        else:
            found[opened.pop()] = bracket.start()
    return found


def _blank(hidden: re.Match[str]) -> str:
    """Spaces in place of a comment, `_` in place of a string: lines of a string are lines of code."""
    text = hidden[0]
    if text.startswith(("//", "/*")):
        return re.sub(r"[^\n]", " ", text)
    return re.sub(r"[^\n]", "_", text)


def _parenthesis(code: str, start: int) -> int:
    """The parenthesis that opens the parameters, behind the generic ones."""
    depth = 0
    for i in range(start, len(code)):
        if code[i] == "<":
            depth += 1
        elif code[i] == ">" and code[i - 1] not in "-=":
            depth -= 1
        elif code[i] == "(" and depth == 0:
            return i
    raise ValueError("a function without parameters")


def _split(code: str) -> list[str]:
    """The parts between commas outside brackets."""
    parts, depth = [""], 0
    for i, sign in enumerate(code):
        arrow = sign == ">" and code[i - 1] in "-="
        depth += (sign in "([{<") - (sign in ")]}>" and not arrow)
        if sign == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return parts


def _typed(parameter: str) -> tuple[str, str]:
    """The pattern and the type of a parameter, "" if macros write it another way. The colon is no part of a path."""
    pattern, _, kind = re.sub(r"(?<!:):(?!:)", "\n", parameter, count=1).partition("\n")
    return pattern, kind


def _is_tuple(kind: str) -> bool:
    """Whether a type is a tuple of several members, or refers to one."""
    kind = re.sub(r"^(&\s*('\w+\s+)?(mut\s+)?)*", "", kind.strip())
    return kind.startswith("(") and len([one for one in _split(kind[1 : _closing(kind)[0]]) if one.strip()]) > 1


# Python --------------------------------------------------------------------------------------------------------------


def _python(text: str) -> list[Function]:
    kinds = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in kinds:
            code.update(range(token.start[0], token.end[0] + 1))
    found = []
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        body = node.body[1:] if ast.get_docstring(node) is not None else node.body
        lines = {line for line in range(body[0].lineno, (node.end_lineno or 0) + 1) if line in code} if body else set()
        own = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
        receiver = bool(own) and own[0].arg in {"self", "cls"}
        found.append(Function(node.name, node.lineno, len(lines), len(own) - receiver))
    return sorted(found, key=lambda one: one.line)
