# SPDX-License-Identifier: GPL-3.0-or-later
"""The answers of the lessons, read from their pages in docs/lessons, which the Python package contains, too."""

from __future__ import annotations

import re
from pathlib import Path

PLACES = [root / "docs" / "lessons" for root in Path(__file__).resolve().parents[2:4]]

PAGES = PLACES[0] if PLACES[0].is_dir() else PLACES[1]
"""The folder of the pages: of the installed package, or of the clone."""

ANSWER = re.compile(r"<summary>Answer</summary>\n(.*?)\n</details>", re.DOTALL)

LINK = re.compile(r"\[([^\]]+)\]\([^)]+\)")


def answers(name: str) -> list[str]:
    """The answers of a lesson as plain text, in the order of its questions. Raises OSError without its page."""
    return [_plain(found.strip()) for found in ANSWER.findall((PAGES / f"{name}.md").read_text(encoding="utf-8"))]


def _plain(text: str) -> str:
    """A text of Markdown without marks of links, code and emphasis; tables keep their columns, without their rule."""
    lines = [line for line in LINK.sub(r"\1", text).splitlines() if not re.fullmatch(r"[|\s:-]+", line) or not line]
    return "\n".join(lines).replace("`", "").replace("*", "")
