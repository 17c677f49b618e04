# SPDX-License-Identifier: GPL-3.0-or-later
"""A real Blender window with the installed extension: all panels, a final render, the viewport, cost maps, a film."""

import json
import os
import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest

from addon.blender.measure import pictures
from addon.blender.ui import (
    bake_panels,
    compare_panels,
    data_panels,
    inspector_panels,
    overlay_panels,
    panels,
    pass_panels,
)
from scripts import package
from scripts.dev import animations

COMMAND = "HALFSPACE_WINDOW"
"""Environment variable: a command that opens a Blender window; see `scripts/dev/window/README.md`."""

STEPS = package.ROOT / "scripts" / "dev" / "window"

MODULES = (panels, data_panels, pass_panels, bake_panels, overlay_panels, inspector_panels, compare_panels)

ELSEWHERE = {"HALFSPACE_PT_image_maps"}
"""Panels of other editors."""


@pytest.fixture(scope="module", name="archive")
def the_zip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip with the wheel that the environment was set up with."""
    if not os.environ.get(COMMAND):
        pytest.skip(f"no command that opens a Blender window in the variable {COMMAND}")
    wheels = sorted((package.ROOT / "build" / "wheel").glob("*.whl"))
    (made,) = package.package(wheels, tmp_path_factory.mktemp("zip"))
    return made


def opened(script: str, archive: Path, folder: Path, size: str) -> tuple[dict[str, Any] | list[str], list[Path]]:
    """Findings of the steps of a script in a window of this size, and the pictures of the screen."""
    command = [*shlex.split(os.environ[COMMAND]), str(STEPS / f"{script}.py"), str(folder / "last.png"), str(archive)]
    done = subprocess.run(
        command,
        env={**os.environ, "GUI_SIZE": size, "GUI_TIMEOUT": "500"},
        capture_output=True,
        text=True,
        timeout=590,
        check=False,
    )
    log = done.stdout + done.stderr
    assert done.returncode == 0, log
    assert not re.search(r"Traceback|^(Error|ERROR)|rna_uiItem|unknown (operator|icon)", log, re.MULTILINE), log
    found = json.loads((folder / f"{script}.json").read_text(encoding="utf-8"))
    return found, sorted(folder.glob("last-*.png"))


def test_every_panel_is_drawn_in_a_window(archive: Path, tmp_path: Path) -> None:
    drawn, shots = opened("panel_steps", archive, tmp_path, "1600x2400")
    expected = {panel.__name__ for module in MODULES for panel in module.CLASSES}
    assert expected - set(drawn) == ELSEWHERE
    assert len(shots) > 15
    assert all(pictures.load(shot).std() > 0.05 for shot in shots), "a picture is of one colour"


def test_a_render_begins_with_a_whole_picture_and_cost_maps_share_a_window(archive: Path, tmp_path: Path) -> None:
    found, shots = opened("picture_steps", archive, tmp_path, "1600x900")
    assert isinstance(found, dict)
    assert found["finished"]
    # The first picture covers all pixels, as all later ones do.
    assert len(found["shown"]) > 3
    assert {share for _, share in found["shown"]} == {1.0}
    assert found["map 0"] == found["map 1"] == ["FINISHED"]
    assert found["windows 0"] == found["windows 1"] == 2
    assert all(pictures.load(shot).std() > 0.05 for shot in shots)


def test_the_overlay_follows_each_view_and_isolation_ends_as_it_began(archive: Path, tmp_path: Path) -> None:
    found, shots = opened("overlay_steps", archive, tmp_path, "1600x900")
    assert isinstance(found, dict)
    for view in ("inside", "outside"):
        assert found[f"grid {view}"][3] >= 0
        assert all(0 < found[f"{structure} {view}"][0] <= 1000 for structure in ("octree-net", "bvh-sah", "kd"))
    assert (
        found["bvh-sah inside"] != found["bvh-sah outside"] or found["octree-net inside"] != found["octree-net outside"]
    )
    assert set(found["isolated"]) < set(found["before"])
    assert found["isolated"] == found["redo"]
    assert found["before"] == found["undo"] == found["after"]
    assert not found["local"]
    assert found["selected"] == ["Cube"]
    assert len(shots) >= 11


def test_the_depth_moves_in_an_animation_of_a_window(archive: Path, tmp_path: Path) -> None:
    animations.record(shlex.split(os.environ[COMMAND]), "depth", archive, tmp_path)
    frames = animations.assemble(tmp_path, "depth", tmp_path / "depth.webp")
    assert frames > 15, "equal frames are joined"
    assert (tmp_path / "depth.webp").stat().st_size < 1_500_000
