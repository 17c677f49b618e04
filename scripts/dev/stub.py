# SPDX-License-Identifier: GPL-3.0-or-later
"""The texts of the native module's type stub, from the module itself: `.venv/bin/python -m scripts.dev.stub [--check]`.

Declarations are written by hand; what `help()` shows, which is written in Rust, replaces the texts below them. Exit
status: 0 written, or with --check equal; 1 with --check different; 2 bad usage; 130 stopped.
"""

from __future__ import annotations

import argparse
import ast
import itertools
import sys
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from addon.core.base import command, native
from addon.lab.base.usage import Parser

STUB = Path(__file__).resolve().parents[2] / "native" / "python" / "halfspace_native" / "__init__.pyi"

WIDTH = 120


def described(text: str, module: Any) -> Iterator[tuple[ast.Constant, Any]]:
    """Each text of a stub, and the object of the module that it describes."""
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and hasattr(module, node.name):
            yield from _own(node, getattr(module, node.name))
        if isinstance(node, ast.ClassDef) and hasattr(module, node.name):
            yield from _members(node, getattr(module, node.name))


def _own(node: ast.FunctionDef | ast.ClassDef, thing: Any) -> Iterator[tuple[ast.Constant, Any]]:
    first = node.body[0]
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str):
        yield first.value, thing


def _members(node: ast.ClassDef, owner: Any) -> Iterator[tuple[ast.Constant, Any]]:
    for one, following in itertools.pairwise([*node.body, None]):
        if isinstance(one, ast.FunctionDef) and not one.name.startswith("__"):
            yield from _own(one, getattr(owner, one.name))
        elif isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name) and isinstance(following, ast.Expr):
            assert isinstance(following.value, ast.Constant)
            yield following.value, getattr(owner, one.target.id)


def filled(text: str, module: Any) -> str:
    """A stub with the texts of the module."""
    lines = text.splitlines()
    for constant, thing in sorted(described(text, module), key=lambda pair: -pair[0].lineno):
        lines[constant.lineno - 1 : constant.end_lineno] = _block((thing.__doc__ or "").strip(), constant.col_offset)
    return "\n".join(lines) + "\n"


def _block(text: str, indent: int) -> list[str]:
    """The lines of a text, paragraphs with overlong lines wrapped."""
    found: list[str] = []
    for paragraph in ('"""' + text).split("\n\n"):
        own = paragraph.splitlines()
        if max(map(len, own)) > WIDTH - indent:
            own = textwrap.wrap(" ".join(own), WIDTH - indent)
        found += [*([""] if found else []), *own]
    closed = [*found, '"""'] if len(found) > 1 else [found[0] + '"""']
    return [(" " * indent + line).rstrip() for line in closed]


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    parser = Parser(prog="stub", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing")
    return command.run("stub", arguments, parser.parse_args, work)


def work(asked: argparse.Namespace) -> int:
    """Write or check the stub. Returns the exit status."""
    old = STUB.read_text(encoding="utf-8")
    new = filled(old, native.load())
    if not asked.check:
        STUB.write_text(new, encoding="utf-8")
    return int(asked.check and new != old)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
