# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a picture with Halfspace, without a Blender window: `halfspace render [FILE] [options]`.

FILE: as for `bench`. Bare geometry (an .npz with the keys of the manual, .ply, .stl, .obj) gets a matte surface and, as
do glTF and USD without any, a sun, a lamp and a sky. Without FILE the built-in showcase is rendered. Where the module
bpy is missing, only bare geometry is rendered, without a lamp. Exit status: 0 done; 2 bad usage or input; 130 stopped.
Failures are reported in one line, and leave an older picture of the same name unchanged.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.base import command, interrupt, native, picture_files
from ...core.base.arrays import F64
from ...core.choose import choice
from ...core.report import results
from ...core.scene import grid
from ...core.structures import specs
from ...core.structures.settings import RenderSettings
from ..base.places import OUT
from ..base.progress import Progress
from ..base.usage import NO_BLENDER, Parser, UsageError, output
from ..bench import mesh_files, ray_files, scenes
from ..pictures import bare

MOST = {"samples": 1 << 20, "percentage": 32767}
"""Largest values of Blender's own settings."""

QUIET_SECONDS = 5.0
"""Shortest interval in seconds between two lines of progress."""

RECORDED = 1 << 16
"""Largest number of recorded rays of a kind: the most that the native module records."""

FORMATS = {".exr": "OPEN_EXR_MULTILAYER", ".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG"}
"""Blender's name of the format by the suffix of a picture."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="render", description=(__doc__ or "").splitlines()[0])
    made.add_argument("file", nargs="?", help=f"{scenes.CHOICES} (default)")
    made.add_argument(
        "--out",
        type=output,
        default=OUT / "showcase.png",
        help=f"the picture, {', '.join(FORMATS)} (default: out/showcase.png); an .exr has all passes",
    )
    made.add_argument(
        "--compression", choices=picture_files.COMPRESSIONS, help="of an .exr (default: zip, which loses nothing)"
    )
    made.add_argument("--structure", metavar="SPEC", help="the acceleration structure (default: the file's)")
    made.add_argument("--samples", type=int, help="samples per pixel (default: the file's)")
    made.add_argument(
        "--integrator", choices=("path", "whitted", "ao"), help="how light is followed (default: the file's)"
    )
    made.add_argument(
        "--exact", action="store_true", help="all samples, and no denoising (default: the file's settings)"
    )
    made.add_argument("--percentage", type=int, help="size in percent of the file's (default: the file's)")
    made.add_argument(
        "--record-rays",
        type=output,
        metavar="FILE.npz",
        help=f"also write at most {RECORDED:,} rays of each kind, for `bench --rays`; the render takes longer",
    )
    return made


def main(arguments: Sequence[str]) -> int:
    """Render. Returns the exit status."""
    return command.run("render", arguments, read, render)


def read(arguments: Sequence[str]) -> argparse.Namespace:
    """The command line, checked before any work. Raises UsageError, WorkloadError and FolderError."""
    asked = parser().parse_args(arguments)
    if asked.file is not None:
        scenes.find(asked.file)
    for name, most in MOST.items():
        value = getattr(asked, name)
        if value is not None and not 1 <= value <= most:
            raise UsageError(f"--{name}: expected 1 to {most}, got {value}")
    if asked.out.suffix.lower() not in FORMATS:
        raise UsageError(f"{asked.out}: expected a name that ends in {' or '.join(FORMATS)}")
    is_exr = asked.out.suffix.lower() == ".exr"
    if asked.compression is not None and not is_exr:
        raise UsageError("--compression: expected --out with a name that ends in .exr")
    if is_exr or importlib.util.find_spec("bpy") is None:
        picture_files.module()
    if asked.out.is_dir():
        raise UsageError(f"{asked.out}: cannot be written: it is a folder")
    if asked.record_rays is not None:
        if asked.record_rays.suffix.lower() != ray_files.SUFFIX:
            raise UsageError(f"{asked.record_rays}: expected a name that ends in {ray_files.SUFFIX}")
        if asked.record_rays.is_dir():
            raise UsageError(f"{asked.record_rays}: cannot be written: it is a folder")
        results.prepare_folder(asked.record_rays.parent)
    results.prepare_folder(asked.out.parent)
    return asked


def render(asked: argparse.Namespace) -> int:
    """Render with Blender's module, or bare geometry without it. Returns the exit status.

    Raises the exceptions of opening, building and rendering.
    """
    native.load()
    if importlib.util.find_spec("bpy") is None:
        return render_bare(asked)
    with interrupt.guarded():
        import bpy

        from ... import register

        if not hasattr(bpy.context.scene, "halfspace"):
            register()
        from ...blender.session import reports, trees
        from ...blender.settings import properties
        from ..pictures import scenes as opened

        opened.open_file(asked.file)
    # Apply the options and render.
    scene: Any = bpy.context.scene
    _configure(scene, asked)
    if asked.record_rays is not None:
        reports.RECORD.keep(scene, RECORDED)
    with picture_files.replacing(asked.out) as picture, _shown(bpy.app.handlers.render_stats):
        scene.render.filepath = str(picture)
        start = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        if not picture.is_file():
            raise RuntimeError("nothing was rendered")
        seconds = time.perf_counter() - start
        tree = trees.last(scene)
        spec = tree.spec if tree is not None else properties.spec(scene.halfspace)
        if asked.out.suffix.lower() == ".exr":
            told = {**_told(spec, scene.halfspace.samples, seconds), "sampling": _sampling(scene.halfspace)}
            picture_files.describe(picture, told, asked.compression or "zip")
    # Print the picture's size, structure and checked answers.
    width, height = _size(scene, asked.out)
    report = reports.last(scene)
    answers = choice.NOT_COMPARED if report is None else report.answers
    # Print a time only together with the errors of all that it covers; the report covers the last view layer alone.
    is_known = answers != choice.NOT_COMPARED and sum(layer.use for layer in scene.view_layers) == 1
    took = f" in {seconds:.1f} s" * is_known
    peak = None if report is None else report.statistics.get("peak_bytes")
    if peak is not None:
        print(f"Memory of reading, build and render at their peak: {peak / 1e6:,.0f} MB")
    print(f"Sampling: {_sampling(scene.halfspace)}")
    print(f"{asked.out}: {width} × {height} pixels{took} with {spec}, {answers}")
    if asked.record_rays is not None:
        recorded = reports.RECORDED.of(scene)
        assert recorded is not None, "the engine has rendered"
        _write_rays(asked, recorded.kinds, recorded.origin)
    return 0


def render_bare(asked: argparse.Namespace) -> int:
    """Render a bare geometry without Blender. Returns the exit status. Raises UsageError for other scenes."""
    found = scenes.find(asked.file or "showcase")
    if found != "grid" and not (isinstance(found, Path) and found.suffix.lower() in mesh_files.BARE):
        raise UsageError(f"{'the built-in showcase' if found == 'showcase' else found}: {NO_BLENDER}")
    module = native.load()
    scene = mesh_files.bare(found, module.free_memory()) if isinstance(found, Path) else grid.workload()
    width, height = (max(1, side * (asked.percentage or 100) // 100) for side in bare.FULL)
    given = {name: getattr(asked, name) for name in ("samples", "integrator") if getattr(asked, name) is not None}
    spec = specs.prove(module, [asked.structure or "kd"])[0]
    settings = RenderSettings(width, height, record_rays=RECORDED if asked.record_rays else 0, **given)
    start = time.perf_counter()
    passes = bare.PASSES if asked.out.suffix.lower() == ".exr" else ()
    rendered, kinds = bare.render(module, scene, spec, settings, passes)
    attributes = _told(spec, settings.samples, time.perf_counter() - start)
    picture = picture_files.Picture(rendered.pixels, rendered.names, attributes=attributes)
    picture_files.write(asked.out, picture, asked.compression or "zip")
    print(f"{asked.out}: {width} × {height} pixels with {spec}, {choice.NOT_COMPARED}")
    if asked.record_rays is not None:
        _write_rays(asked, kinds, np.zeros(3))
    return 0


def _write_rays(asked: argparse.Namespace, kinds: Mapping[str, Mapping[str, Any]], origin: F64) -> None:
    """Write the recorded rays in the coordinates of the rendered file, and print their numbers. Raises FolderError."""
    results.write_all({asked.record_rays: ray_files.packed(kinds, origin)})
    told = ", ".join(f"{name} {len(one['origins']):,} of {one['traced']:,}" for name, one in kinds.items())
    print(f"{asked.record_rays}: rays recorded of those traced: {told or 'none'}")


@contextlib.contextmanager
def _shown(handlers: Any) -> Iterator[None]:
    """Show the engine's status line and the time left. handlers: Blender's of `render_stats`."""
    from ...blender.render import running

    with Progress("render", QUIET_SECONDS) as progress:
        text, done = "", 0.0

        def show() -> None:
            # Blender would print a traceback; the command reports a failed output at its end.
            with contextlib.suppress(command.OutputError):
                progress.show(text, done)

        def stated(stats: Any, *_: Any) -> None:
            nonlocal text
            if isinstance(stats, str):
                text = stats
                show()

        def went_on(share: float) -> None:
            nonlocal done
            done = share
            show()

        handlers.append(stated)
        running.watchers.append(went_on)
        try:
            yield
        finally:
            running.watchers.remove(went_on)
            handlers.remove(stated)


def _configure(scene: Any, asked: argparse.Namespace) -> None:
    """Apply the options to the scene. Raises UsageError."""
    from ...blender.measure import pictures
    from ...blender.settings import presets

    scene.render.engine = "HALFSPACE"
    file_format = FORMATS[asked.out.suffix.lower()]
    pictures.as_file(scene.render.image_settings, file_format)
    if file_format == "OPEN_EXR_MULTILAYER":
        scene.render.image_settings.color_depth = "32"
    if scene.render.use_multiview:
        # Blender would write one file for each eye, under names of its own.
        scene.render.use_multiview = False
        print("render: one picture from the middle is rendered, not one for each eye", file=sys.stderr)
    if asked.structure is not None:
        try:
            presets.apply(scene.halfspace, asked.structure)
        except specs.SpecError as error:
            raise UsageError(f"--structure: {error}") from error
        scene.halfspace.automatic = False
    if asked.exact:
        scene.halfspace.use_adaptive = scene.halfspace.use_denoising = False
    if asked.samples is not None:
        scene.halfspace.samples = asked.samples
    if asked.integrator is not None:
        scene.halfspace.integrator = asked.integrator
    if asked.percentage is not None:
        scene.render.resolution_percentage = asked.percentage


def _size(scene: Any, picture: Path) -> tuple[int, int]:
    """The width and height of a picture, which a render border may have cropped; without OpenImageIO the scene's."""
    try:
        return picture_files.size(picture)
    except ImportError:
        share = scene.render.resolution_percentage
        return scene.render.resolution_x * share // 100, scene.render.resolution_y * share // 100


def _sampling(group: Any) -> str:
    """How the settings of a `scene.halfspace` group sample a picture and treat its noise."""
    limit = f"at most {group.samples:,} samples per pixel, noise threshold {group.noise_threshold:g}"
    samples = limit if group.use_adaptive else f"{group.samples:,} samples per pixel"
    return f"{samples}, {'denoised' if group.use_denoising else 'not denoised'}"


def _told(spec: str, samples: int, seconds: float) -> dict[str, Any]:
    """The attributes of a picture file."""
    return {"version": native.VERSION, "structure": spec, "samples": samples, "seconds": seconds}
