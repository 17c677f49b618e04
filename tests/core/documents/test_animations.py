# SPDX-License-Identifier: GPL-3.0-or-later
"""The animations of the documentation: what a window leaves becomes a film, and what a window fails at is one line."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from PIL import Image

from scripts.dev import animations
from tests.one_line import told

WINDOW = """\
import json, pathlib, sys
from PIL import Image

steps, last, archive = map(pathlib.Path, sys.argv[1:])
assert steps.is_file() and archive.read_bytes() == b"zip"
if {failing}:
    sys.exit("no screen")
frames = []
for number, colour in enumerate(["red", "red", "green", "blue"]):
    Image.new("RGB", (40, 30), colour).save(last.with_name(f"last-depth-{{number:03}}.png"))
    frames.append((f"depth-{{number:03}}", 100 * (number + 1)))
last.with_name("depth.json").write_text(json.dumps({{"box": (4, 6, 36, 30), "frames": frames}}))
"""
"""A window that draws nothing but colours."""


@pytest.fixture
def window(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The script of a window, and an extension."""
    archive = tmp_path / "extension.zip"
    archive.write_bytes(b"zip")
    monkeypatch.setattr(animations.package, "package", lambda *_: [archive])
    return tmp_path / "window.py"


def test_frames_of_a_window_become_an_animation(window: Path, tmp_path: Path) -> None:
    window.write_text(WINDOW.format(failing=False), encoding="utf-8")
    out = tmp_path / "out"
    command = f"{sys.executable} {window}"
    assert animations.main(["--only", "depth", "--window", command, "--out", str(out)]) == 0
    with Image.open(out / "depth.webp") as film:
        assert (film.size, film.n_frames, film.info["loop"]) == ((32, 24), 3, 0), "equal frames are one"
        colours = []
        for number in range(film.n_frames):
            film.seek(number)
            colours.append(film.convert("RGB").getpixel((16, 12)))
    assert [max(range(3), key=colour.__getitem__) for colour in colours] == [0, 1, 2]


def test_equal_frames_are_shown_as_long_as_both(tmp_path: Path) -> None:
    for name, colour in (("a", "red"), ("b", "red"), ("c", "blue")):
        Image.new("RGB", (8, 8), colour).save(tmp_path / f"last-{name}.png")
    listed = {"box": [0, 0, 8, 8], "frames": [["a", 300], ["b", 200], ["c", 100]]}
    (tmp_path / "film.json").write_text(json.dumps(listed), encoding="utf-8")
    assert animations.assemble(tmp_path, "film", tmp_path / "film.gif") == 2
    with Image.open(tmp_path / "film.gif") as film:
        assert (film.n_frames, film.info["duration"]) == (2, 500)


def test_a_window_that_fails_is_one_line(window: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    window.write_text(WINDOW.format(failing=True), encoding="utf-8")
    said = told(animations, ["--window", f"{sys.executable} {window}", "--out", str(tmp_path / "out")], capsys)
    assert said.startswith("animations: depth: the window ended with 1: no screen")


def test_every_animation_has_its_steps_and_a_place_in_the_manual() -> None:
    manual = (animations.ROOT / "docs" / "manual.md").read_text(encoding="utf-8")
    for name, (steps, size) in animations.ANIMATIONS.items():
        assert f'stage.Film("{name}")' in (animations.STEPS / f"{steps}.py").read_text(encoding="utf-8")
        assert f"(../.pictures/{name}.webp)" in manual
        width, _, height = size.partition("x")
        with Image.open(animations.PICTURES / f"{name}.webp") as film:
            assert film.n_frames > 3
            assert int(width) - 20 < film.width <= int(width)
            assert int(height) - 80 < film.height < int(height)
        assert (animations.PICTURES / f"{name}.webp").stat().st_size < 1_500_000
