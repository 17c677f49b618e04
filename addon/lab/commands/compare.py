# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparison of Halfspace with Cycles on one scene, or of two pictures: `halfspace compare FILE [options]`.

FILE: as for `bench`; a bare geometry (an .npz with the keys of docs/manual.md, .ply, .stl, .obj) gets a matte surface,
a sun, a lamp and a sky; without FILE the built-in showcase. Both engines render the same file several times with
different random numbers, so that their difference can be compared with their noise. Writes NAME-halfspace.png,
NAME-cycles.png and NAME-compared.png (both, and their difference × 8), prints the numbers, and lists what each engine
left out.

`--scene NAME` or `--scene all` instead of FILE: both engines render one or all of nine scenes: seven that cover the
renderer's features, and two composed ones; or one of production size: woods (instances with images), meadow and fur
(hair), foliage (cut-outs), patina (Ambient Occlusion, Bevel), wax (subsurface), sand (points). The verdict is Welch's
test of each square of 16 × 16 pixels and of the means, with a false alarm in 1 % of all cases, beyond 1 % of a mean and
what is known of the models; the histogram of p and the ratio of the times to equal error are printed with it. With
`--slope` too, Halfspace alone renders them, and the slopes of the error over the number of samples are printed, for
independent samples and for samples as they are rendered.

`--whole`: the time and the memory of a whole render of FILE, from the call of the render operator (F12) to the picture,
including reading the scene and the build. Default: one sample of 1920 × 1080 pixels, direct light without bounces, and
for an .npz only a lamp without size, so that each pixel takes a camera ray and a shadow ray. The engines alternate;
medians and their ratio are printed with the errors of the pictures and of the rays. With `--most R` a larger ratio is a
failure. The time to unit variance, the inverse of the efficiency 1/(variance × time), is printed with its 95 % interval
for both. Instead of FILE `--scene` names one of the scenes above.

`--equal-error`: the time to equal error of FILE or of the scenes of `--scene`, with the defaults of Cycles (filter
glossy 1, clamp indirect 10, light tree; adaptive sampling and denoising off) in both engines. Each engine renders a
converged picture and several numbers of samples; the table has the ratios of their times at equal error, with and
without the constant part of reading and building. NAME-equal.png has the crop with the largest errors side by side:
converged, by Cycles, by Halfspace at equal time and at equal error, with the numbers of samples. A mean that differs by
more than 1 %, or with `--most R` a larger ratio of processor times, is a failure.

`compare A B`, with two pictures (.exr, .png, .jpg and all that OpenImageIO reads): prints how the colours of A differ
from those of B, without Blender. With `--most R` an RMSE above R is a failure.

Exit status: 0 compared, and all requirements hold; 1 some do not; 2 bad usage or input; 130 stopped. Failures are
reported in one line.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.base import command, interrupt, native, picture_files
from ...core.base.arrays import F32
from ...core.measure import curve, flip
from ...core.report import results
from ...core.structures import specs
from ..base.places import OUT
from ..base.progress import Progress
from ..base.usage import Parser, UsageError, no_blender, output
from ..bench import scenes

DIFFERENT = 1
"""Exit status if a requirement does not hold."""

LARGEST = 1 << 14
"""Pixels along a side of a picture."""

QUIET_SECONDS = 5.0
"""Shortest interval in seconds between two lines of progress."""

CROP = 320
"""Least pixels along a side of a magnified crop, if the crop has fewer."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="compare", description=(__doc__ or "").splitlines()[0])
    made.add_argument("file", nargs="?", help=f"{scenes.CHOICES} (default), or a picture")
    made.add_argument("reference", nargs="?", type=Path, metavar="PICTURE", help="with a picture: what it should be")
    made.add_argument(
        "--scene",
        metavar="NAME",
        help="judge a scene of addon/lab/pictures/proving.py or large.py; all: those of proving.py",
    )
    made.add_argument(
        "--plant",
        type=float,
        metavar="SHARE",
        help="with --scene: darken a part of Halfspace's pictures, to see the verdict fall",
    )
    made.add_argument("--slope", action="store_true", help="with --scene: only the slope of the error over the samples")
    made.add_argument(
        "--whole", action="store_true", help="time whole renders, one sample per run, and the time to unit variance"
    )
    made.add_argument("--equal-error", action="store_true", help="time to equal error, at the defaults of Cycles")
    made.add_argument(
        "--most",
        type=float,
        metavar="R",
        help="the largest ratio of times with --whole and --equal-error, the largest RMSE of two pictures",
    )
    made.add_argument(
        "--lights",
        metavar="LIST",
        help="with a geometry: some of sun, lamp, point, area, sky, panorama, separated by commas",
    )
    made.add_argument(
        "--size",
        metavar="WxH",
        help="pixels (default: 960x540; with --scene 192x128, --whole 1920x1080, --equal-error 240x135)",
    )
    made.add_argument(
        "--samples",
        type=int,
        help="samples per pixel, all runs together (default: 64; with --whole one per run; with --equal-error the "
        "most of a picture, 32)",
    )
    made.add_argument(
        "--runs", type=int, help="independent pictures per engine (default: 4; --whole: 7; --equal-error: 3)"
    )
    made.add_argument("--seed", type=int, default=0, help="random numbers of the first picture of each engine")
    made.add_argument("--bounces", type=int, help="bounces of light in both engines (default: 4; with --whole 0)")
    made.add_argument("--threads", type=int, default=0, help="threads of both engines, 0 = all (default)")
    made.add_argument("--structure", default="kd", metavar="SPEC", help="Halfspace's acceleration structure")
    made.add_argument("--out", type=output, default=OUT / "compare", metavar="DIR", help="where to write")
    return made


def main(arguments: Sequence[str]) -> int:
    """Compare. Returns the exit status."""
    return command.run("compare", arguments, read, work)


def work(asked: argparse.Namespace) -> int:
    """Run the comparison that the options select. Returns the exit status."""
    if asked.reference is not None:
        return 0 if compare_pictures(Path(asked.file), asked.reference, asked.most) else DIFFERENT
    if asked.whole:
        return 0 if time_whole(asked) else DIFFERENT
    if asked.equal_error:
        return 0 if time_to_equal_error(asked) else DIFFERENT
    if asked.scene is None:
        run(asked)
        return 0
    return 0 if (judge_slopes if asked.slope else judge_scenes)(asked) else DIFFERENT


def read(arguments: Sequence[str]) -> argparse.Namespace:
    """The command line with the defaults of its comparison. Raises UsageError."""
    # Reject options that do not belong together.
    asked = parser().parse_args(arguments)
    if asked.reference is not None:
        plain = parser().parse_args([])
        for name, value in vars(asked).items():
            if name not in ("file", "reference", "most") and value != getattr(plain, name):
                raise UsageError(f"--{name.replace('_', '-')}: expected a scene to render, got two pictures")
        if asked.most is not None and not asked.most >= 0:
            raise UsageError(f"--most: expected an RMSE of at least 0, got {asked.most:g}")
        return asked
    if asked.scene is None:
        for name in ("slope", "plant"):
            if getattr(asked, name) not in (None, False):
                raise UsageError(f"--{name}: expected --scene, whose scenes it is about")
    elif asked.file is not None:
        raise UsageError(f"{asked.file}: expected a file or --scene, not both")
    if asked.plant is not None and not 0 < asked.plant <= 1:
        raise UsageError(f"--plant: expected a share above 0, up to 1, got {asked.plant:g}")
    if asked.whole and (asked.slope or asked.plant is not None or asked.scene == "all"):
        raise UsageError("--whole: expected one scene, without --slope and --plant")
    if asked.equal_error and (asked.whole or asked.slope or asked.plant is not None):
        raise UsageError("--equal-error: expected without --whole, --slope and --plant")
    if asked.seed and (asked.slope or asked.equal_error):
        raise UsageError("--seed: expected without --slope and --equal-error, which have seeds of their own")
    if asked.most is not None and not ((asked.whole or asked.equal_error) and asked.most > 0):
        raise UsageError("--most: expected --whole or --equal-error, and a ratio above 0")
    if asked.lights is not None and asked.file is None:
        raise UsageError("--lights: expected a file")
    # Set the defaults, which depend on the comparison, and check the ranges.
    usual: dict[str, Any] = {"size": "960x540", "samples": 64, "runs": 4, "bounces": 4}
    if asked.scene is not None:
        usual["size"] = "192x128"
    if asked.whole:
        runs = asked.runs if asked.runs is not None else 7
        usual = {"size": "1920x1080", "samples": runs, "runs": runs, "bounces": 0}
    if asked.equal_error:
        usual |= {"size": "240x135", "samples": 32, "runs": 3}
    for name, value in usual.items():
        if getattr(asked, name) is None:
            setattr(asked, name, value)
    for name, least, most in (
        ("threads", 0, 1024),
        ("samples", 1, 1 << 20),
        ("runs", 2, 1 << 16),
        ("bounces", 0, 64),
        ("seed", 0, 1 << 30),
    ):
        if not least <= getattr(asked, name) <= most:
            raise UsageError(f"--{name}: expected {least} to {most}, got {getattr(asked, name)}")
    if asked.samples < asked.runs:
        raise UsageError(f"--samples: expected at least one for each of {asked.runs} runs, got {asked.samples}")
    _size(asked.size)
    if asked.file is not None:
        scenes.find(asked.file)
    return asked


def run(asked: argparse.Namespace) -> None:
    """Render with both engines, write the pictures, print the numbers."""
    from ..pictures import comparison

    bpy = _start(asked)
    name = _open(asked)
    found, _ = _render_both(bpy, asked, name)
    ours, theirs = found["HALFSPACE"], found["CYCLES"]
    print(f"\n{name}, {asked.size}, Halfspace and Cycles")
    for line in comparison.compare(ours, theirs).lines():
        print(f"  {line}")
    _print_left_out(bpy.context.scene)
    print(f"Pictures: {asked.out / name}-{{halfspace,cycles,compared}}.png")


def compare_pictures(path: Path, reference: Path, most: float | None) -> bool:
    """Print how a picture differs from another. Returns whether its RMSE is at most `most`.

    Raises UsageError if their sizes differ, and OSError and ValueError for files that cannot be read or lack colours.
    """
    shown, expected = (_colours(one) for one in (path, reference))
    if shown.shape != expected.shape:
        sizes = (f"{one.shape[1]} × {one.shape[0]}" for one in (shown, expected))
        raise UsageError(f"{path}, {reference}: expected pictures of one size, got {' and '.join(sizes)}")
    # Compute the errors in linear light.
    found = curve.errors(shown.reshape(-1, 3), np.nan_to_num(expected.reshape(-1, 3)))
    difference = np.abs(np.nan_to_num(shown) - np.nan_to_num(expected)).max(axis=2)
    visible = flip.mean(shown, expected)
    row, column = np.unravel_index(int(difference.argmax()), difference.shape)
    means = [" ".join(f"{value:.6g}" for value in np.nan_to_num(one).mean(axis=(0, 1))) for one in (shown, expected)]
    print(f"{path}: {shown.shape[1]} × {shown.shape[0]} pixels, compared with {reference}")
    print(f"  means      {means[0]}, expected {means[1]}")
    print(f"  RMSE       {found['rmse']:.6g}, relMSE {found['relmse']:.6g}")
    print(f"  FLIP       {flip.problem() if visible is None else f'{visible:.6g}'}")
    print(f"  largest    {difference.max():.6g} at pixel {column}, {row} from the left and the bottom")
    print(f"  different  {int((difference > 0).sum()):,} pixels; {found['not_finite']:,} not finite")
    return most is None or found["rmse"] <= most


def _colours(path: Path) -> F32:
    """The colours of a picture in linear light. Raises OSError, and UsageError without colours."""
    try:
        return picture_files.read(path).light()
    except ValueError as error:
        raise UsageError(f"{path}: {error}") from error


def judge_scenes(asked: argparse.Namespace) -> bool:
    """Build, render and judge the scenes of `--scene`. Returns whether all are the same in both engines."""
    from ..pictures import comparison

    bpy = _start(asked)
    from ..pictures import proving

    verdicts = []
    for name in _built(bpy, asked.scene):
        found, seconds = _render_both(bpy, asked, name)
        # Darken the middle of Halfspace's pictures to show that the verdict fails.
        if asked.plant is not None:
            pictures = found["HALFSPACE"].pictures.copy()
            height, width = pictures.shape[1:3]
            pictures[:, height // 3 : height * 2 // 3, width // 3 : width * 2 // 3] *= 1 - asked.plant
            found["HALFSPACE"] = comparison.Runs("HALFSPACE", pictures)
        known, allowed = proving.DIFFERENCES.get(name, ("", comparison.ROUNDING))
        verdict = comparison.judge(found["HALFSPACE"], found["CYCLES"], tolerance=allowed)
        verdicts.append(verdict)
        print(f"{name}, {asked.size}: Halfspace and Cycles")
        for line in verdict.lines():
            print(f"  {line}")
        if known:
            limit = f"up to {100 * allowed:g} % of a square in addition to its noise"
            print(f"  known difference of the models, {limit}: {known}")
        ratio = seconds["HALFSPACE"] / seconds["CYCLES"]
        print(
            f"  time of a sample × {ratio:.2f}, its variance × {verdict.noise:.2f}: "
            f"time to equal error × {ratio * verdict.noise:.2f}"
        )
        _print_left_out(bpy.context.scene)
    print(f"{sum(v.same for v in verdicts)} of {len(verdicts)} scenes are the same up to noise")
    return all(verdict.same for verdict in verdicts)


def time_whole(asked: argparse.Namespace) -> bool:
    """Time whole renders, with the errors of the pictures and of the rays. Returns whether all requirements hold."""
    from ..pictures import comparison

    bpy = _start(asked)
    from ..pictures import whole

    name = _open(asked, whole.LIGHTS) if asked.scene is None else next(_built(bpy, asked.scene))
    scene: Any = bpy.context.scene
    _prepare(scene, asked, name)
    times = whole.measure(scene, asked.runs)
    ratio, worked = times.ratio("clock"), times.ratio("processor")
    found, _ = _pictures(scene, asked, name)
    checked = whole.check_rays(scene)
    print(f"\n{name}, {asked.size}, {-(-asked.samples // asked.runs)} spp, {asked.bounces} bounces, whole renders:")
    for line in times.lines():
        print(f"  {line}")
    print(f"  Halfspace over Cycles: {ratio:.3f} by the clock, {worked:.3f} by the processor")
    # Print no squares: with so few samples the estimate of their noise is too uncertain.
    ours, theirs = found["HALFSPACE"], found["CYCLES"]
    for line in comparison.compare(ours, theirs).lines()[:2]:
        print(f"  {line}")
    low, apart, high = (100 * value for value in comparison.bias(ours, theirs))
    seen = (
        f"{apart:.3f} % of the brightness ({low:.3f} to {high:.3f})"
        if low
        else f"none beyond noise, below {high:.3f} %"
    )
    print(f"  bias, √(MSE − variance): {seen}")
    spp = -(-asked.samples // asked.runs)
    print(f"  Cycles takes the first of {spp} samples at the centre of a pixel: less noise, and a bias at details")
    if asked.runs >= comparison.LEAST_RUNS:
        noises = {run.name: comparison.noise_of(run, times.processor[run.name]) for run in (ours, theirs)}
        for engine, noise in noises.items():
            for line in noise.lines(engine):
                print(f"  {line}")
        print(f"  {comparison.against(noises['HALFSPACE'], noises['CYCLES'])}")
    if checked is None:
        print(f"  rays of {asked.structure} through instances not compared with brute force")
    else:
        print(f"  {checked.errors.rays:,} rays of {asked.structure} compared with brute force: ", end="")
        print("no difference" if checked.right else f"WRONG: {checked.errors.as_row('brute')}")
    _print_left_out(scene)
    return (checked is None or checked.right) and (asked.most is None or ratio <= asked.most)


def time_to_equal_error(asked: argparse.Namespace) -> bool:
    """Measure the time to equal error, scene by scene, and print a table. Returns whether all requirements hold."""
    bpy = _start(asked)
    from ...blender.measure import pictures
    from ..pictures import engines, equal_error

    names = _built(bpy, asked.scene) if asked.scene else [_open(asked)]
    counts = sorted({max(asked.samples // part, 1) for part in (16, 4, 1)})
    if len(counts) < 2:
        raise UsageError(f"--samples: expected at least 2, got {asked.samples}")
    measured = []
    for name in names:
        scene: Any = bpy.context.scene
        _prepare(scene, asked, name, engines.DEFAULT)

        def render(engine: str, samples: int, seed: int, scene: Any = scene) -> Any:
            scene.render.engine = engine
            scene.halfspace.samples = scene.cycles.samples = samples
            return _run(pictures, scene, seed)[..., :3].astype("float64")

        result = equal_error.measure(name, render, counts, asked.runs, equal_error.CONVERGED * asked.samples)
        measured.append(result)
        print(f"\n{name}, {asked.size}, {asked.bounces} bounces, {asked.structure}:")
        for line in result.lines():
            print(f"  {line}", flush=True)
        path = asked.out / f"{name}-equal.png"
        _save_crops(path, scene, result, render)
        print(f"  the same crop at equal time and at equal error: {path}", flush=True)
    here = results.machine(native.load())
    print(f"\n{here['processor']}, {here['level']}: Halfspace over Cycles at the error of its {counts[-1]} samples\n")
    print(equal_error.HEAD)
    for result in measured:
        print(result.row())
    most = asked.most if asked.most is not None else float("inf")
    return all(result.same and result.ratios("processor")[0] <= most for result in measured)


def _save_crops(path: Path, scene: Any, result: Any, render: Callable[[str, int, int], Any]) -> None:
    """Write one crop of four pictures, magnified: converged; by Cycles with its last number of samples; by Halfspace in
    the same time, and with the same error.
    """
    from ...blender.measure import lettering, pictures
    from ..pictures import equal_error

    last = result.points["CYCLES"][-1].samples
    in_time, in_error = result.equal_samples()
    # Use random numbers of no measured picture.
    wanted = ("CYCLES", last), ("HALFSPACE", in_time), ("HALFSPACE", in_error)
    found = [render(engine, samples, 500) for engine, samples in wanted]
    rows, columns = equal_error.crop(result.reference, found)
    shown = [one[rows, columns] for one in (result.reference, *found)]
    gap = np.zeros((shown[0].shape[0], 1, 3))
    strip = np.concatenate([part for one in shown for part in (one, gap)][:-1], axis=1)
    displayed = pictures.save_displayed(path, strip.astype("float32"), scene)
    # Magnify the pixels, and write below each crop which one it is.
    factor = max(CROP // len(gap), 1)
    large = displayed.repeat(factor, axis=0).repeat(factor, axis=1)
    ours = (f"Halfspace, same {what}, {count} spp" for what, count in (("time", in_time), ("error", in_error)))
    labels = "converged", f"Cycles, {last} spp", *ours
    size = factor * len(gap) / 18
    foot = np.zeros((int(2.2 * size), large.shape[1], 3), np.float32)
    lines = [(text, i * factor * (len(gap) + 1) + 0.4 * size, 0.8 * size) for i, text in enumerate(labels)]
    whole = np.concatenate([foot, large], axis=0)
    lettering.write(whole, lines, size)
    pictures.save(path, whole)


def judge_slopes(asked: argparse.Namespace) -> bool:
    """Fit the slopes of RMSE on the scenes of `--scene`. Returns whether those of independent samples are right."""
    from ...core.measure import curve

    bpy = _start(asked)
    from ...blender.measure import pictures
    from ..pictures import engines

    # Average at most a quarter of the pictures: four such means are left, while chance would decide about a single one.
    counts = [1 << k for k in range(asked.samples.bit_length()) if 4 << k <= asked.samples]
    if len(counts) < 3:
        raise UsageError("--samples: expected at least 16 to fit a slope")
    right = []
    for name in _built(bpy, asked.scene):
        scene: Any = bpy.context.scene
        _set_picture(scene, asked)
        scene.render.engine = "HALFSPACE"

        def rendered(samples: int, seed: int, scene: Any = scene) -> Any:
            engines.configure_halfspace(scene, asked.structure, samples, asked.bounces)
            scene.halfspace.render_seed = seed
            return pictures.render(scene)[..., :3].reshape(-1, 3)

        reference = rendered(asked.samples * curve.CONVERGED, 0)
        alone = [rendered(1, seed) for seed in range(1, asked.samples + 1)]
        independent = curve.slope(list(curve.of_independent(alone, reference, counts)))
        spread = [{"spp": n, **curve.errors(rendered(n, 1), reference)} for n in counts]
        right.append(curve.is_right(independent))
        print(
            f"{name}, {asked.size}, 1 to {counts[-1]} samples: RMSE falls with the power {independent:.3f} of "
            f"independent samples ({curve.judged(independent)}), {curve.slope(spread):.3f} of samples as rendered",
            flush=True,
        )
    print(f"{sum(right)} of {len(right)} scenes: the error of independent samples falls as it should")
    return all(right)


def _built(bpy: Any, asked: str) -> Iterator[str]:
    """Build a scene of `proving` or `large`, or all of `proving` one after the other. Raises UsageError."""
    from ..pictures import large, proving

    if asked != "all" and asked not in (known := [*proving.SCENES, *large.SCENES]):
        raise UsageError(f"--scene: expected all or one of {', '.join(known)}, got {asked!r}")
    for name in list(proving.SCENES) if asked == "all" else [asked]:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        (proving if name in proving.SCENES else large).build(name, bpy.context.scene)
        yield name


def _set_picture(scene: Any, asked: argparse.Namespace) -> None:
    """Set size and threads of the pictures, for both engines."""
    render = scene.render
    render.resolution_x, render.resolution_y = _size(asked.size)
    render.resolution_percentage = 100
    render.use_border, render.film_transparent, render.use_compositing = False, False, False
    if asked.threads:
        render.threads_mode, render.threads = "FIXED", asked.threads


def _start(asked: argparse.Namespace) -> Any:
    """Check the options and start Blender with the extension. Returns bpy. Raises FolderError, and UsageError without
    Blender.
    """
    results.prepare_folder(asked.out)

    with interrupt.guarded():
        try:
            import bpy
        except ImportError as error:
            raise UsageError(no_blender(error)) from error

        from ... import register

        native.load()
        if not hasattr(bpy.context.scene, "halfspace"):
            register()
    return bpy


def _render_both(bpy: Any, asked: argparse.Namespace, name: str) -> tuple[dict[str, Any], dict[str, float]]:
    """Prepare the current scene and render it with both engines."""
    _prepare(bpy.context.scene, asked, name)
    return _pictures(bpy.context.scene, asked, name)


def _prepare(scene: Any, asked: argparse.Namespace, name: str, sampling: Any = None) -> None:
    """Give both engines the same settings: `sampling`, None for exact ones. Raises UsageError."""
    from ..pictures import engines

    if scene.camera is None:
        raise UsageError(f"{name}: the scene has no camera")
    _set_picture(scene, asked)
    samples = -(-asked.samples // asked.runs)
    try:
        engines.configure_halfspace(scene, asked.structure, samples, asked.bounces, sampling or engines.EXACT)
        engines.configure_cycles(scene, samples, asked.bounces, sampling or engines.EXACT)
    except specs.SpecError as error:
        raise UsageError(f"--structure: {error}") from error
    except engines.EngineError as error:
        raise UsageError(str(error)) from error


def _pictures(scene: Any, asked: argparse.Namespace, name: str) -> tuple[dict[str, Any], dict[str, float]]:
    """The runs of both engines, and the seconds each took. The runs alternate."""
    from ...blender.measure import pictures
    from ..pictures import comparison

    samples = -(-asked.samples // asked.runs)
    seconds = {"HALFSPACE": 0.0, "CYCLES": 0.0}
    linear: dict[str, list[Any]] = {"HALFSPACE": [], "CYCLES": []}
    with Progress("compare", QUIET_SECONDS) as progress:
        for run in range(asked.runs):
            for part, engine in enumerate(seconds):
                done = (run + part / len(seconds)) / asked.runs
                progress.show(f"{name}: {engine.lower()}, picture {run + 1} of {asked.runs}", done)
                scene.render.engine = engine
                begun = time.perf_counter()
                linear[engine].append(_run(pictures, scene, asked.seed + run))
                seconds[engine] += time.perf_counter() - begun
    found, shown = {}, {}
    for engine, taken in seconds.items():
        print(f"{engine}: {asked.runs} × {samples} samples in {taken:.1f} s", flush=True)
        found[engine] = comparison.Runs(engine, comparison.stack(linear[engine]))
        path = asked.out / f"{name}-{engine.lower()}.png"
        shown[engine] = pictures.save_displayed(path, found[engine].mean.astype("float32"), scene)
    compared = comparison.side_by_side(shown["HALFSPACE"], shown["CYCLES"])
    pictures.save(asked.out / f"{name}-compared.png", compared)
    return found, seconds


def _print_left_out(scene: Any) -> None:
    """Print what each engine left out of the last pictures."""
    from ...blender.session import reports
    from ..pictures import engines

    report = reports.last(scene)
    print("Left out by Halfspace, because it does not know it:")
    for line in (report.warnings if report else []) or ["nothing"]:
        print(f"  {line}")
    print("Left out by Halfspace, because the scene has none of it:")
    for line in report.left_out if report else []:
        print(f"  {line}")
    print("Left out by Cycles, so that its picture is exact up to noise:")
    print(f"  {', '.join(key.removeprefix('use_').replace('_', ' ') for key in engines.EXACT.cycles)}")


def _run(pictures: Any, scene: Any, seed: int) -> Any:
    """Render one picture with this seed, by the scene's engine."""
    scene.halfspace.render_seed = scene.cycles.seed = seed
    return pictures.render(scene)


def _size(text: str) -> tuple[int, int]:
    """Width and height of `WIDTHxHEIGHT`. Raises UsageError."""
    width, _, height = text.partition("x")
    if not all(specs.is_whole(side) and 8 <= int(side) <= LARGEST for side in (width, height)):
        raise UsageError(f"--size: expected WIDTHxHEIGHT of 8x8 to {LARGEST}x{LARGEST}, got {text!r}")
    return int(width), int(height)


def _open(asked: argparse.Namespace, lights: Sequence[str] | None = None) -> str:
    """Open the file, a geometry with these lights unless others are given. Returns its name. Raises UsageError."""
    from ..pictures import scenes as opened
    from ..pictures import stage

    if asked.lights is not None:
        lights = asked.lights.split(",")
        if unknown := set(lights) - set(stage.ALL_LIGHTS):
            raise UsageError(f"--lights: expected some of {', '.join(stage.ALL_LIGHTS)}, got {min(unknown)!r}")
    return opened.open_saved(asked.file, lights)
