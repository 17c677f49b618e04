# SPDX-License-Identifier: GPL-3.0-or-later
"""Error and run time of acceleration structures, side by side.

`halfspace bench [SCENE ...] [options]`, or inside Blender: `blender --background [FILE] --python
scripts/bench.py -- [SCENE ...] [options]`. Exit status: 0 all answers agree with the reference; 1 some answer differs;
2 bad usage or input, with the reason in one line, or rows that failed or, with `--merge`, are missing; 130 stopped
from the keyboard.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.base import command, interrupt, native
from ...core.base.native import first_line
from ...core.measure import benchmark, curve, inference, offsets, preparation, processor, two_level, yardstick
from ...core.measure.rows import agrees_moved
from ...core.report import report, results, tables
from ...core.scene import rays, workload
from ...core.scene.instances import TOPS
from ...core.structures import catalogue, specs, ways
from ..base import levels
from ..base.usage import Parser, UsageError, output
from ..bench import cluster, inspecting, merging, peers, ray_files, scenes, sweep
from ..bench.bench_presets import AS_PUBLISHED, FAMILIES, PRESETS
from ..export import files
from ..motion import animations, motion
from ..report import history, page, thesis

if TYPE_CHECKING:
    from ...core.base.interface import Native

ROOT = Path(__file__).resolve().parents[3]
"""The clone, whose commit a history names."""

SECONDS = 45.0
"""Seconds of all timed passes of a scene. A run over all structures takes six minutes for 70,000 triangles (Zen 3)."""

CURVE = "1,2,4,8,16,32,64,128,256"
"""Samples per pixel of the pictures, of which those are rendered that fit into their time."""

MANY = 16
"""Largest number of configurations that are measured with all effort."""

REPEATS, FEWER = benchmark.Options.repeats, inference.LEAST_ROUNDS
"""Timed repeats, and those of many configurations: as few as can be ranked."""

CHECK_TESTS = 10_000_000_000
"""Triangle tests of the reference for the rays of all sets: about ten seconds of brute force on two cores."""

OF_MERGES = ("scenes", "merge", "out", "published", "export")
"""Options that are valid together with `--merge`."""

BAD_INPUT = 2


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="bench", description=(__doc__ or "").splitlines()[0])
    add = made.add_argument
    add(
        "scenes",
        nargs="*",
        metavar="SCENE",
        help=f"{scenes.CHOICES} (default)",
    )
    add("--structures", metavar="SPEC[,SPEC...]", help="specs, families or all (default: one a family); k=2..10 works")
    add(
        "--peers",
        metavar="NAME[,NAME...]",
        help=f"other ray tracers as further rows: {', '.join(peers.GROUPS)}, all (needs cargo, and minutes the first "
        "time), or a Python file, see docs/benchmark.md",
    )
    add("--k", metavar="RANGE", help="values of k, e.g. 2-10")
    add("--alpha", metavar="RANGE", help="values of alpha, e.g. 0.1,0.5,1")
    add("--seeds", metavar="RANGE", help="seeds of the structures, e.g. 1-7")
    add(
        "--rays",
        metavar="SET[,SET...]",
        help=f"ray sets: {', '.join(rays.NAMES)} (default: these), {', '.join(rays.ALL[len(rays.NAMES) :])}, and .npz "
        "files of one's own rays, see docs/benchmark.md",
    )
    add("--size", default="1024x1024", metavar="WxH", help="pixels of the primary rays, multiples of 8")
    add(
        "--repeats",
        type=int,
        help=f"timed repeats (default: {REPEATS}, or {FEWER} for more than {MANY} configurations)",
    )
    add("--seconds", type=float, default=SECONDS, help=f"for all timed passes of a scene, about (default: {SECONDS:g})")
    add(
        "--layout",
        choices=two_level.LAYOUTS,
        default="flatten",
        help="two-level: each structure is built over every mesh, below a tree over the instances; rays go one by one, "
        "so specs are taken as they are spelled",
    )
    add(
        "--top",
        choices=TOPS,
        help=f"with two-level: the tree over the instances (default: {TOPS[0]})",
    )
    levels.add_option(made)
    add("--threads", type=int, default=1, help="threads for builds and rays, 0 = all (default: 1)")
    add(
        "--curve",
        default=CURVE,
        metavar="SPP,...",
        help=f"also render with these samples per pixel, and report each error; none: no pictures (default: {CURVE})",
    )
    add(
        "--picture-seconds",
        type=float,
        default=curve.SECONDS,
        metavar="SECONDS",
        help=f"for these pictures of a scene, about; more samples than fit are left out (default: {curve.SECONDS:g})",
    )
    add("--reference", choices=benchmark.REFERENCES, default="brute", help="reference of the answers")
    add(
        "--check-rays",
        type=int,
        metavar="N",
        help=f"rays per set to compare (default: {benchmark.Options.check_rays}, fewer if the reference would make "
        f"more than {CHECK_TESTS:.0e} triangle tests; sets of files and of the scene grid are limited by these alone)",
    )
    add("--ray-seed", type=int, default=1, help="seed of the rays (default: 1)")
    add("--memory-limit", type=float, metavar="GB", help="memory limit of a build (default: most of the free memory)")
    add(
        "--only-rays",
        action="store_true",
        help="no peak memory, no other view sizes, no cost maps, no moved scenes: speeds and errors",
    )
    add(
        "--frames",
        metavar="A-B",
        help="measure each frame of animations instead, with structures that are fitted, built again or built lazily; "
        f"SCENE: {', '.join(animations.NAMES)} (default: all these), {', '.join(animations.LARGE)} or a .blend file; "
        f"writes {motion.NUMBERS} and {motion.PAGE}",
    )
    add("--preset", choices=sorted(PRESETS), help="a named choice of scenes, structures and ray sets")
    add("--out", type=output, metavar="DIR", help="write bench.json, bench.csv and report.html; an earlier run resumes")
    add(
        "--history",
        type=Path,
        metavar="FILE",
        help="append the speeds as multiples of Embree's to this file, a JSON line for each scene",
    )
    add("--shard", metavar="I/N", help="measure only every N-th row, from the I-th; the report is made by --merge")
    add(
        "--merge", action="store_true", help="measure nothing: one report of the folders that stand for SCENE, in --out"
    )
    add("--cluster", metavar="ADDRESS", help="measure on this Dask cluster; local:N starts N workers on this machine")
    add(
        "--export",
        metavar="FORMAT,...",
        help=f"also write figures and tables for papers into DIR/{files.FOLDER}: "
        + ", ".join(f"{name} ({what})" for name, what in files.FORMATS.items()),
    )
    inspecting.add_option(made)
    add("--published", type=Path, metavar="FILE", help="published results to draw next to the K sweep")
    return made


def main(arguments: Sequence[str]) -> int:
    """Run the benchmark. Returns the exit status."""
    return command.run(
        "bench",
        arguments,
        parser().parse_args,
        lambda asked: merge(asked) if asked.merge else moving(asked) if asked.frames else run(asked),
        keeps=lambda asked: None if asked.merge else asked.out,
    )


def run(asked: argparse.Namespace) -> int:
    """Check everything, then measure scene by scene. Raises one of the errors that `main` turns into a line."""
    module = levels.load_module(asked.level)
    chosen = [*foreign(asked), *read_structures(asked, module)]
    given = read_own(asked)
    options = read_options(asked, len(chosen), given)
    if options.brief:
        say(
            f"{len(chosen)} configurations are more than {MANY}: fewer timed rays and {options.repeats} repeats each, "
            "builds timed once, no smaller views, pictures, memory and maps only with --out; as many answers compared"
        )
    shard = read_shard(asked)
    check_history(asked)
    published, formats, pages = thesis.published(asked.published), read_export(asked), inspecting.read(asked, module)
    if asked.cluster is not None:
        cluster.check(asked.cluster)
    named = asked.scenes or scenes.of_preset(asked.preset, say)
    chosen_scenes = workload.distinct({scene: scenes.find(scene) for scene in named})
    loaders = read_loaders(asked, options, chosen_scenes)
    if asked.out is not None:
        results.prepare_folder(asked.out)
    with results.writing(asked.out), contextlib.ExitStack() as stack:
        journal = None if asked.out is None else results.Journal(asked.out, shard.name)
        measurer = sweep.here(module, options)
        if asked.cluster is not None:
            measurer = stack.enter_context(cluster.measurer(asked.cluster, options, say))
        identity = [module.__version__, results.native_fingerprint(module), options.identity()]
        todo = sweep.Sweep(chosen, options, identity, journal, shard, chosen_scenes)
        todo.begin()
        for number, (scene, load) in enumerate(zip(chosen_scenes, loaders, strict=True)):
            try:
                loaded = ray_files.added(load(), given)
            except native.FAILURES as error:
                if len(chosen_scenes) == 1:
                    raise
                print(f"bench: {first_line(error)}", file=sys.stderr)
                todo.fail(number, scene, error)
                continue
            for note in notes(loaded, options, module):
                say(f"{scene}: {note}")
            try:
                own = todo.run(number, loaded, measurer, say)
            except cluster.ClusterError:
                raise
            except native.FAILURES as error:
                print(f"bench: {loaded.name}: {first_line(error)}", file=sys.stderr)
                own = todo.rows(number)
                todo.fail(number, loaded.name, error)
            for line in workload.left_out(loaded, dropped(own)):
                say(f"{loaded.name}: {line}")
            if own:
                pages.add(loaded, options.size, say)
                print("\n" + tables.text(own) + "\n", flush=True)
    rows = todo.rows()
    if better := report.worth_it(rows):
        say(f"build and one 1024x1024 picture at 16 spp faster with oblique planes than with kd: {', '.join(better)}")
    record(asked, rows, module, options.size)
    if asked.out is not None and not shard.name:
        machines = {} if journal is None else journal.machines
        save(asked.out, results.document(module, rows, options.as_dict(), machines) | pages.links(), published, formats)
    return status(rows)


def read_loaders(
    asked: argparse.Namespace, options: benchmark.Options, chosen: Sequence[str]
) -> list[Callable[[], workload.Workload]]:
    """The functions that load the scenes."""
    loaders = [scenes.loader(scene, options.size, asked.preset in AS_PUBLISHED, options.layout) for scene in chosen]
    # Scenes that are sent to the workers of a cluster take no Blender along.
    return list(map(beside_cycles, loaders)) if options.curve and asked.cluster is None else loaders


def beside_cycles(load: Callable[[], workload.Workload]) -> Callable[[], workload.Workload]:
    """A function that loads the same scene with Cycles as its other renderer, where Blender has it."""

    def loaded() -> workload.Workload:
        found = load()
        try:
            with interrupt.guarded():
                from ..pictures.cycles import Cycles
        except ImportError as error:
            return replace(found, notes=(*found.notes, f"Cycles' pictures are left out: {first_line(error)}"))
        return replace(found, peer=Cycles(found if found.render_scene is None else None))

    return loaded


def foreign(asked: argparse.Namespace) -> list[str]:
    """The configurations of other ray tracers, Embree first. Raises UsageError."""
    chosen = []
    if (reason := yardstick.problem()) is None:
        chosen.append(yardstick.SPEC)
    else:
        say(f"Embree is left out: {reason}")
    for name, told in (peers.register(asked.peers, say) if asked.peers else {}).items():
        say(f"{name}: {told}")
        chosen.append(name)
    return chosen


def notes(loaded: workload.Workload, options: benchmark.Options, module: Native) -> list[str]:
    """Notes on a scene before it is measured."""
    count, most = preparation.compared(loaded, options), options.check_rays
    told = [f"{count:,} rays per set compared, not {most:,}, to end sooner"] if count < most and options.sets else []
    own, largest = preparation.compared_own(loaded, options), max(map(len, loaded.extra), default=0)
    if own < largest:
        told.append(f"{own:,} of {largest:,} rays of each of its own sets compared, to end sooner")
    if (refusal := processor.refusal(module)) is not None:
        told.append(refusal)
    return [*loaded.notes, *told]


def moving(asked: argparse.Namespace) -> int:
    """Measure the frames of animations. Returns 1 where answers differ, else 0. Raises as `run`."""
    usual = parser().parse_args([])
    for name, value in vars(asked).items():
        if name not in motion.OPTIONS and value != getattr(usual, name):
            raise UsageError(f"--{name.replace('_', '-')}: expected no --frames, whose animations have no use for it")
    numbers = motion.read_frames(asked.frames)
    size = read_options(asked, 1).size
    module = levels.load_module(asked.level)
    listed = list(motion.SPECS)
    if asked.structures:
        listed = specs.prove(module, specs.expand(asked.structures, module.structures(), {}, []))
    names = motion.check(asked.scenes or animations.NAMES)
    if asked.out is not None:
        results.prepare_folder(asked.out)
    rows = motion.run(module, map(motion.find, names), numbers, listed, size=size, threads=asked.threads, say=say)
    if asked.out is not None:
        document = results.document(module, [], {"size": asked.size, "threads": asked.threads}) | {"frames": rows}
        with results.writing(asked.out):
            results.write_all({asked.out / name: text for name, text in motion.written(document).items()})
        say(f"wrote {asked.out / motion.PAGE} and {motion.NUMBERS}")
    return int(any(row["wrong"] for row in rows))


def merge(asked: argparse.Namespace) -> int:
    """Make one report of finished rows, and print which are missing. Raises one of the errors that `main` turns into a
    line.

    Returns 1 where answers differ, else 2 where rows failed or are missing, else 0.
    """
    usual = parser().parse_args([])
    for name, value in vars(asked).items():
        if name not in OF_MERGES and value != getattr(usual, name):
            raise UsageError(f"--{name.replace('_', '-')}: expected no --merge, which measures nothing")
    module = native.load()
    if asked.out is None or not asked.scenes:
        raise UsageError("--merge: name the folders of the rows, and --out for the report")
    published, formats = thesis.published(asked.published), read_export(asked)
    folders = [Path(folder) for folder in dict.fromkeys(asked.scenes)]
    merged = merging.read(folders)
    rows, missing = merged.rows(), merged.missing()
    if not rows:
        raise UsageError(f"--merge: there are no rows in {', '.join(map(str, folders))}")
    results.prepare_folder(asked.out)
    print(tables.text(rows) + "\n", flush=True)
    for line in merged.disagreements:
        print(f"bench: {line}: the answers or the trees differ", file=sys.stderr)
    for line in missing:
        print(f"bench: {line}", file=sys.stderr)
    save(asked.out, results.document(module, rows, merged.options, merged.machines, missing), published, formats)
    found = 1 if merged.disagreements else status(rows)
    return found or (BAD_INPUT if missing else 0)


def dropped(rows: Sequence[benchmark.Row]) -> int:
    """Number of triangles of their scene that these rows' structures leave out."""
    return max(((row["statistics"] or {}).get("dropped_triangles", 0) for row in rows), default=0)


def status(rows: Sequence[benchmark.Row]) -> int:
    """The exit status for these rows. The yardstick has no influence on it."""
    ours = [row for row in rows if not yardstick.is_foreign(row["spec"])]
    compared = [row for row in ours if row["errors"] is not None]
    # Traversals without error bounds are measured for their wrong answers far from the origin.
    moved = [row for row in compared if not offsets.is_unguarded(row["spec"])]
    if not (all(map(benchmark.agrees, compared)) and all(map(agrees_moved, moved))):
        return 1
    return BAD_INPUT if any(row["error"] for row in ours) else 0


def save(
    folder: Path, document: dict[str, Any], published: thesis.Published | None, formats: Sequence[str] = ()
) -> None:
    """Write the files of a report, and those for papers in these formats, all or none. Raises FolderError."""
    contents: dict[Path, str | bytes] = {
        Path("bench.json"): json.dumps(document, indent=1, allow_nan=False) + "\n",
        Path("bench.csv"): report.as_csv(document["rows"]),
        Path("report.html"): page.as_html(document, published),
    }
    papers = files.of_rows(document["rows"], formats, published) if formats else {}
    if papers:
        results.prepare_folder(folder / files.FOLDER)
    with results.writing(folder):
        results.write_all({folder / name: content for name, content in (contents | papers).items()})
    say(f"wrote {folder / 'report.html'}, bench.json and bench.csv")
    if papers:
        say(f"wrote {len(papers)} files for papers into {folder / files.FOLDER}")


def read_shard(asked: argparse.Namespace) -> sweep.Shard:
    """The part of the sweep that is measured, checked. Raises UsageError."""
    if asked.shard is None:
        return sweep.Shard()
    number, slash, count = asked.shard.partition("/")
    if not (slash and specs.is_whole(number) and specs.is_whole(count) and 1 <= int(number) <= int(count)):
        raise UsageError(f"--shard: expected I/N with I from 1 to N, got {asked.shard!r}")
    if asked.out is None:
        raise UsageError("--shard: name a folder for the rows with --out")
    return sweep.Shard(int(number), int(count))


def check_history(asked: argparse.Namespace) -> None:
    """Refuse to append what would be no history. Raises UsageError."""
    if asked.history is None:
        return
    if asked.shard is not None or asked.cluster is not None:
        raise UsageError("--history: expected no --shard and no --cluster, whose rows are of several machines")
    if reason := yardstick.problem():
        raise UsageError(f"--history: without Embree there is nothing to divide by: {reason}")
    if not history.commit(ROOT):
        raise UsageError("--history: needs a clone of the project, whose commit it names")
    if asked.history.exists():
        try:
            history.read(asked.history)
        except (history.HistoryError, OSError, UnicodeDecodeError) as error:
            raise UsageError(f"--history: {first_line(error)}") from error


def record(asked: argparse.Namespace, rows: Sequence[benchmark.Row], module: Native, size: Sequence[int]) -> None:
    """Append the speeds to the requested file. Raises FolderError."""
    if asked.history is not None:
        found = history.lines(rows, history.commit(ROOT), results.machine(module), size)
        with results.writing(asked.history):
            history.append(asked.history, found)


def read_export(asked: argparse.Namespace) -> tuple[str, ...]:
    """The formats of figures and tables for papers. Raises UsageError."""
    if asked.export is None:
        return ()
    if asked.out is None or asked.shard is not None:
        raise UsageError("--export: expected --out, and no --shard, whose rows --merge exports")
    try:
        return files.chosen(asked.export)
    except ValueError as error:
        raise UsageError(f"--export: {error}") from error


def read_sets(asked: argparse.Namespace) -> tuple[list[str], dict[Path, list[str]]]:
    """The names of the requested ray sets; the files of one's own rays, each with the sets of it that are named, none
    for all. Raises UsageError.
    """
    preset = PRESETS.get(asked.preset or "", {})
    given = [name.strip() for name in (asked.rays or preset.get("rays") or ",".join(rays.NAMES)).split(",")]
    names: list[str] = []
    files: dict[Path, list[str]] = {}
    for name in given:
        if name in rays.ALL:
            names.append(name)
        elif found := re.fullmatch(rf"(.*{re.escape(ray_files.SUFFIX)})(?::(.+))?", name, re.IGNORECASE):
            files.setdefault(Path(found[1]), []).append(found[2] or "")
        else:
            raise UsageError(f"--rays: unknown set {name!r}; there are {', '.join(rays.ALL)}, and .npz files")
    return names, {path: [] if "" in wanted else wanted for path, wanted in files.items()}


def read_own(asked: argparse.Namespace) -> tuple[ray_files.Given, ...]:
    """One's own rays. Raises UsageError and WorkloadError."""
    _, files = read_sets(asked)
    return ray_files.load(files, native.load().free_memory()) if files else ()


def read_options(
    asked: argparse.Namespace, configurations: int, own: Sequence[ray_files.Given] = ()
) -> benchmark.Options:
    """The options, checked; the time is divided equally among the configurations. own: the rays of `read_own`. Raises
    UsageError.
    """
    sets, _ = read_sets(asked)
    width, by, height = asked.size.partition("x")
    if not (by and specs.is_whole(width) and specs.is_whole(height)):
        raise UsageError(f"--size: expected WIDTHxHEIGHT, got {asked.size!r}")
    size = int(width), int(height)
    if not all(0 < side <= 1 << 14 and side % rays.TILE == 0 for side in size):
        raise UsageError(f"--size: expected multiples of {rays.TILE} up to {1 << 14}, got {asked.size!r}")
    count, brief = len(sets) + len(own), configurations > MANY
    # Only a report shows pictures, peak memory, cost maps and the shapes of trees.
    shown = asked.out is not None or not brief
    flat = asked.layout == "flatten"
    if flat and asked.top is not None:
        raise UsageError("--top: expected --layout two-level, whose instances it is for")
    repeats = asked.repeats if asked.repeats is not None else FEWER if brief else REPEATS
    for name, least, most in (
        ("repeats", 1, 1000),
        ("threads", 0, 1024),
        ("check_rays", 1, 1 << 30),
        ("ray_seed", 0, rays.MOST_SEED),
    ):
        given = getattr(asked, name)
        if given is not None and not least <= given <= most:
            raise UsageError(f"--{name.replace('_', '-')}: expected {least} to {most}, got {given}")
    if asked.reference == yardstick.SPEC and (reason := yardstick.problem()):
        raise UsageError(f"--reference embree: {reason}")
    if asked.memory_limit is not None and not 0 <= asked.memory_limit < 1 << 30:
        raise UsageError(f"--memory-limit: expected a number of gigabytes, got {asked.memory_limit}")
    for name in ("seconds", "picture_seconds"):
        if not 0 < getattr(asked, name) < float("inf"):
            raise UsageError(f"--{name.replace('_', '-')}: expected more than 0, got {getattr(asked, name):g}")
    samples = [] if asked.curve in ("none", None if shown else CURVE) else specs.numbers(asked.curve, "--curve")
    if not all(specs.is_whole(value) and 0 < int(value) <= curve.MOST_SAMPLES for value in samples):
        raise UsageError(f"--curve: expected numbers of samples up to {curve.MOST_SAMPLES}, got {asked.curve!r}")
    return benchmark.Options(
        size=size,
        sets=tuple(sets),
        repeats=repeats,
        threads=asked.threads or os.cpu_count() or 1,
        level=asked.level,
        reference=asked.reference,
        check_rays=benchmark.Options.check_rays if asked.check_rays is None else asked.check_rays,
        own_rays=asked.check_rays,
        own=rays.fingerprint(one.rays for one in own),
        check_tests=CHECK_TESTS if asked.check_rays is None else None,
        seed=asked.ray_seed,
        curve=tuple(sorted({int(value) for value in samples})),
        picture_seconds=asked.picture_seconds,
        memory_limit=None if asked.memory_limit is None else int(asked.memory_limit * 1e9),
        offsets=offsets.OFFSETS if flat and not asked.only_rays else (),
        scaling=not asked.only_rays and not brief,
        tradeoff=flat and shown and not asked.only_rays,
        peak=flat and shown and not asked.only_rays,
        maps=flat and shown and not asked.only_rays,
        shapes=shown,
        pass_seconds=min(preparation.PASS_SECONDS, asked.seconds / (configurations * count * (repeats + 1))),
        brief=brief,
        layout=asked.layout,
        top=asked.top or TOPS[0],
    )


def read_structures(asked: argparse.Namespace, module: Native) -> list[str]:
    """The configurations, each validated by a tiny build. Raises SpecError."""
    preset = PRESETS.get(asked.preset or "", {})
    ranges = {
        "k": ("--k", asked.k or preset.get("k")),
        "alpha": ("--alpha", asked.alpha),
        "seed": ("--seeds", asked.seeds or preset.get("seeds")),
    }
    given = {name: specs.numbers(text, option) for name, (option, text) in ranges.items() if text is not None}
    left_out: list[str] = []
    wanted = asked.structures or preset.get("structures") or FAMILIES
    if wanted is FAMILIES:
        say(f"one structure of each family: {FAMILIES}; --structures all measures all {len(module.structures())}")
    chosen = specs.expand(wanted, module.structures(), given, left_out)
    chosen = specs.prove(module, chosen)
    if asked.layout == "two-level":
        return chosen
    chosen, trees = ways.compared(module, catalogue.of(module.structures()), chosen, left_out)
    for line in left_out:
        say(f"left out: {line}")
    if len(chosen) > trees:
        say(f"{trees} structures, each one ray at a time and as fast as it goes: {len(chosen)} configurations")
    return chosen


def say(text: str) -> None:
    """Print a line of progress."""
    print(f"[bench] {text}", flush=True)
