# SPDX-License-Identifier: GPL-3.0-or-later
"""Three short animations of the documentation: `python scripts/dev/animations.py [--out DIR] [--width PIXELS]`.

Writes depth.webp (the depth slider of a kd-tree), ray.webp (a picked ray, step by step) and use-this-one.webp (the
structures of a comparison one after another, the best last), all of the built-in scene as the viewport shows it. Needs
Blender 5.2 or newer, which draws without a window, and Pillow. Exit status: 0 done; 2 something failed; 130 stopped.
Failures are reported in one line.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import overlay_picture

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from addon.core.base import command
from lab.base.usage import Parser, UsageError, output

ROOT = Path(__file__).resolve().parents[2]

PICTURES = ROOT / ".pictures"

STRUCTURE, DEEPEST = "kd", 13
"""The structure whose levels and ray are shown, and its last level that is."""

RAY = ((5.5, -3.0, 3.2), (-0.35, 0.75, 1.0))
"""Origin and target of the picked ray."""

VIEW = ((-1.2, -8.6, 4.4), (0.6, -0.2, 1.0))
"""Eye and target from which the ray is seen."""

FRAMES, MILLISECONDS, LAST_MILLISECONDS = 24, 220, 1600
"""Largest number of frames of the ray, duration of a frame, and of the last one."""

LEAST, MOST, QUALITY = 64, 1920, 70
"""Limits of the width in pixels, and the quality of the frames in percent."""

TEXT, MARGIN = 15.0, 12
"""Height of letters and distance from the corner in pixels."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="animations", description=(__doc__ or "").splitlines()[0])
    made.add_argument("--out", type=output, default=PICTURES, help="a folder (default: .pictures)")
    made.add_argument("--width", type=int, default=480, help="pixels across (default: 480)")
    return made


def main(arguments: Sequence[str]) -> int:
    """The command line. Returns the exit status."""
    return command.run("animations", arguments, parser().parse_args, run)


def run(asked: argparse.Namespace) -> int:
    """Draw all animations. Returns the exit status. Raises the errors that `main` reports in one line."""
    if not LEAST <= asked.width <= MOST:
        raise UsageError(f"--width: expected {LEAST} to {MOST}, got {asked.width}")
    if importlib.util.find_spec("PIL") is None:
        raise RuntimeError("Pillow is not installed")
    size = asked.width, asked.width * 9 // 16 // 2 * 2
    asked.out.mkdir(parents=True, exist_ok=True)
    for name, frames in (("depth", depth), ("ray", ray), ("use-this-one", use_this_one)):
        path = asked.out / f"{name}.webp"
        save(path, list(frames(size)))
        print(f"{path} ({path.stat().st_size / 1024:.0f} KiB)")
    return 0


def opened() -> Any:
    """The scene of the built-in file, with the overlay shown."""
    import bpy
    import gpu

    import addon
    from lab.pictures import scenes

    if not hasattr(gpu, "init"):
        raise RuntimeError("this Blender cannot draw without a window; 5.2 and newer can")
    gpu.init()
    if not hasattr(bpy.context.scene, "halfspace"):
        addon.register()
    scenes.open_file(None)
    scene: Any = bpy.context.scene
    overlay = scene.halfspace.overlay
    overlay.show, overlay.auto_update = True, False
    overlay.line_width *= overlay_picture.SMOOTHING
    return scene


def depth(size: tuple[int, int]) -> Iterator[Any]:
    """The depth slider: each level joins, then the shallow ones leave."""
    scene = opened()
    build(scene, STRUCTURE)
    overlay = scene.halfspace.overlay
    for first, last in [(0, level) for level in range(DEEPEST + 1)] + [(level, DEEPEST) for level in range(1, 10)]:
        overlay.depth_min, overlay.depth_max = first, last
        yield frame(scene, size, [f"Depth from {first} to {last}"])


def ray(size: tuple[int, int]) -> Iterator[Any]:
    """A picked ray, step by step, with the numbers of each step."""
    import bpy
    import numpy as np

    from addon.blender.overlay import replaying
    from addon.blender.samples import camera
    from addon.core.inspector import replay
    from addon.core.scene import workload

    scene = opened()
    tree = build(scene, STRUCTURE)
    eye, target = (np.array(point) for point in VIEW)
    camera.see(scene, workload.View(eye, target, np.array([0.0, 0.0, 1.0]), 40.0))
    scene.halfspace.overlay.parts = {"RAY"}
    origin, towards = (np.array(point) for point in RAY)
    operators: Any = bpy.ops
    operators.halfspace.pick_ray(origin=origin, direction=towards - origin)
    settings = scene.halfspace.inspector
    settings.replaying = True
    frame(scene, size, [])
    found = replaying.known(scene)
    assert found is not None, "the frame has drawn the ray"
    for step in np.unique(np.linspace(1, len(found), min(len(found), FRAMES)).astype(int)).tolist():
        settings.step = step
        words = replay.words(tree.table(), found.steps[step - 1])
        yield frame(scene, size, [f"Step {step} of {len(found)}", *words])


def use_this_one(size: tuple[int, int]) -> Iterator[Any]:
    """The lines of a comparison, the worst first, each with its structure; the best is used."""
    import bpy

    from addon.blender.measure import comparing

    scene = opened()
    operators: Any = bpy.ops
    operators.halfspace.compare()
    result = comparing.last(scene)
    assert result is not None, "the operator has finished"
    compared = result.comparison
    wrong, checked = (sum(getattr(line, name) for line in compared.lines) for name in ("wrong", "checked"))
    scene.halfspace.overlay.depth_auto = True
    for line in reversed(compared.sound):
        text = [
            comparing.name(line.spec),
            f"Build {line.build:.2f} s, render {line.trace:.2f} s",
            f"{checked:,} answers compared, {wrong:,} wrong",
        ]
        build(scene, line.spec)
        picture = frame(scene, size, text)
        yield from (picture,) * 4
    if compared.best is not None:
        build(scene, compared.best.spec)
        yield frame(scene, size, ["Use This One:", comparing.name(compared.best.spec)])


def build(scene: Any, spec: str) -> Any:
    """Choose this configuration and build it. Returns the tree."""
    import bpy

    from addon.blender.session import trees
    from addon.blender.settings import presets

    presets.apply(scene.halfspace, spec)
    operators: Any = bpy.ops
    operators.halfspace.build_structure()
    return trees.last(scene)


def frame(scene: Any, size: tuple[int, int], lines: Sequence[str]) -> Any:
    """The scene and its overlay with lines of text in the lower left corner: (height, width, 3) display values."""
    import bpy
    import gpu
    import numpy as np

    from addon.blender.measure import lettering, pictures
    from addon.blender.overlay import drawing

    width, height = size
    doubled = width * overlay_picture.SMOOTHING, height * overlay_picture.SMOOTHING
    picture = pictures.halved(overlay_picture.drawn(bpy, gpu, drawing, scene, doubled))
    high = int(TEXT * 1.4)
    words = [(text, float(MARGIN), MARGIN + high * place + 4.0) for place, text in enumerate(reversed(lines))]
    if words:
        across = MARGIN * 2 + max(lettering.width(text, TEXT) for text in lines)
        picture[: MARGIN + high * len(words) + 4, :across] *= np.float32(0.35)
    lettering.write(picture, words, TEXT)
    return picture


def save(path: Path, frames: Sequence[Any]) -> None:
    """Write frames as an endless animation; the last one stays longer. Raises OSError."""
    import numpy as np
    from PIL import Image

    shown = [Image.fromarray(np.round(255 * np.clip(one[::-1], 0, 1)).astype(np.uint8)) for one in frames]
    durations = [MILLISECONDS] * (len(shown) - 1) + [LAST_MILLISECONDS]
    shown[0].save(path, save_all=True, append_images=shown[1:], duration=durations, loop=0, quality=QUALITY, method=6)


if __name__ == "__main__":
    result = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(result)
