# SPDX-License-Identifier: GPL-3.0-or-later
"""Slides for a class as one page: the pictures of the teacher's plan, then each lesson with its task and questions."""

from __future__ import annotations

import base64
import re
from html import escape
from pathlib import Path

from . import pages
from .lessons import LESSONS

PLAN = "teaching.md"

PICTURE = re.compile(r"^!\[([^\]]+)\]\(([^)]+)\)$", re.MULTILINE)

STYLE = """\
body { margin: 0; font: 2.6vw/1.35 sans-serif; }
section { box-sizing: border-box; height: 100vh; padding: 4vh 5vw; break-after: page; overflow: hidden;
  display: flex; flex-direction: column; }
h1 { font-size: 1.3em; margin: 0 0 2vh; }
img { flex: 1; min-height: 0; width: 100%; object-fit: contain; }
p, li { margin: 0 0 1.5vh; font-size: 0.75em; }
@page { size: 297mm 167mm; margin: 0; }
"""


def write(path: Path) -> int:
    """Write the slides to a file of HTML that needs no other file. Returns the number of slides.

    Pictures that the installation lacks are left out. Raises OSError if the plan is missing or the page cannot be
    written.
    """
    slides = [_picture(title, place) for title, place in PICTURE.findall((pages.PAGES / PLAN).read_text("utf-8"))]
    for lesson in LESSONS:
        do, see = (escape(words) for words in lesson.first)
        questions = "".join(f"<li>{escape(question)}</li>" for question in lesson.questions)
        slides.append(_slide(lesson.title, f"<p>Do: {do}</p><p>See: {see}</p><ol>{questions}</ol>"))
    kept = [slide for slide in slides if slide]
    head = f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>Halfspace</title>\n<style>{STYLE}</style>\n'
    path.write_text(head + "\n".join(kept) + "\n</html>\n", "utf-8")
    return len(kept)


def _picture(title: str, place: str) -> str:
    """A slide of a picture, whose path is relative to the pages; "" without its file."""
    file = pages.PAGES / place
    if not file.is_file():
        return ""
    kind = {".jpg": "jpeg", ".webp": "webp", ".png": "png"}[file.suffix]
    content = base64.b64encode(file.read_bytes()).decode()
    return _slide(title, f'<img alt="{escape(title)}" src="data:image/{kind};base64,{content}">')


def _slide(title: str, content: str) -> str:
    return f"<section><h1>{escape(title)}</h1>{content}</section>"
