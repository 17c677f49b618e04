# SPDX-License-Identifier: GPL-3.0-or-later
"""Error and run time of acceleration structures, side by side.

`python scripts/bench.py [SCENE ...] [options]`, or inside Blender: `blender --background [FILE] --python
scripts/bench.py -- [SCENE ...] [options]`. Exit status: 0 all answers agree with the reference; 1 some answer differs;
2 bad usage or input, said in one line.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from addon.core import benchmark, grid, native, rays, report, results, specs, workload, yardstick

SUFFIXES = (".npz", ".blend", ".obj", ".ply", ".stl", ".glb", ".gltf", ".usd", ".usda", ".usdc", ".usdz")

SCENES = Path(__file__).resolve().parents[2] / "shared" / "scenes"
"""Where the scenes of the presets lie, beside the repository; those that are not there are left out, and told."""

PRESETS: dict[str, dict[str, str]] = {
    "yardstick": {
        "scenes": "sponza-dabrovic,conference,killeroo-feet,stanford-dragon,country-kitchen",
        "structures": "kd",
        "rays": "primary,shadow,diffuse,shuffled",
    },
    "thesis": {"scenes": "conference,killeroo-feet,sponza-dabrovic", "structures": "kd-sah", "rays": "primary,shadow"},
    "beams": {"scenes": "sponza-dabrovic,conference", "structures": "kd", "rays": "primary,shadow"},
}
"""What a preset chooses unless the command line says otherwise."""

BAD_INPUT = 2


class UsageError(ValueError):
    """The command line or the input is wrong. The message is one line."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(message)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = _Parser(prog="bench", description=(__doc__ or "").splitlines()[0])
    add = made.add_argument
    add("scenes", nargs="*", metavar="SCENE", help=f"a file ({' '.join(SUFFIXES)}), grid, or showcase (default)")
    add("--structures", metavar="SPEC[,SPEC...]", help="configurations, families, or all (default: all)")
    add("--k", metavar="RANGE", help="values of k, e.g. 2-10")
    add("--alpha", metavar="RANGE", help="values of alpha, e.g. 0.1,0.5,1")
    add("--seeds", metavar="RANGE", help="seeds of the structures, e.g. 1-7")
    add("--rays", metavar="SETS", help=f"ray sets (default: {','.join(rays.NAMES)})")
    add("--size", default="1024x1024", metavar="WxH", help="pixels of the primary rays, multiples of 8")
    add("--repeats", type=int, default=7, help="timed repeats (default: 7)")
    add("--threads", type=int, default=1, help="threads for builds and rays, 0 = all (default: 1)")
    add("--curve", metavar="SPP,...", help="also render, with these samples per pixel, and report the error of each")
    add("--reference", choices=benchmark.REFERENCES, default="brute", help="what answers are compared with")
    add("--check-rays", type=int, default=20_000, metavar="N", help="rays per set to compare (default: 20000)")
    add("--ray-seed", type=int, default=1, help="seed of the rays (default: 1)")
    add("--memory-limit", type=float, metavar="GB", help="what a build may take (default: most of what is free)")
    add("--preset", choices=sorted(PRESETS), help="a named choice of scenes, structures and ray sets")
    add("--out", type=Path, metavar="DIR", help="write bench.json, bench.csv and report.html; an earlier run resumes")
    return made


def main(arguments: Sequence[str]) -> int:
    """Run the benchmark. Returns the exit status."""
    try:
        return run(parser().parse_args(arguments))
    except (
        UsageError,
        native.NativeError,
        specs.SpecError,
        workload.WorkloadError,
        results.FolderError,
        MemoryError,
    ) as error:
        print(f"bench: {' '.join(str(error).split())}", file=sys.stderr)
        return BAD_INPUT


def run(asked: argparse.Namespace) -> int:
    """Check everything, then measure scene by scene. Raises one of the errors that `main` turns into a line."""
    module = native.load()
    options = read_options(asked)
    chosen = read_structures(asked, module)
    if yardstick.problem() is None:
        chosen = [yardstick.SPEC, *chosen]
    else:
        say(f"Embree is left out: {yardstick.problem()}")
    scenes = asked.scenes or default_scenes(asked.preset)
    loaders = [loader(scene, options.size) for scene in scenes]
    if asked.out is not None:
        results.prepare_folder(asked.out)
    journal = results.Journal(asked.out) if asked.out is not None else None
    fixed = [module.__version__, results.native_fingerprint(module), options.as_dict()]
    rows: list[benchmark.Row] = []
    failed = False
    for scene, load in zip(scenes, loaders, strict=True):
        try:
            loaded = load()
        except workload.WorkloadError:
            if len(scenes) == 1:
                raise
            failed = True
            print(f"bench: {sys.exc_info()[1]}", file=sys.stderr)
            continue
        for note in loaded.notes:
            say(f"{scene}: {note}")
        own = measure_scene(module, loaded, chosen, options, journal, fixed)
        rows += own
        print("\n" + report.table(own) + "\n", flush=True)
    if asked.out is not None:
        save(asked.out, results.document(module, rows, options.as_dict()))
    return status(rows, failed=failed)


def measure_scene(
    module: Any,
    loaded: workload.Workload,
    chosen: list[str],
    options: benchmark.Options,
    journal: results.Journal | None,
    fixed: list[Any],
) -> list[benchmark.Row]:
    """The rows of one scene in the order of `chosen`: those of an earlier run, and the rest measured now."""
    scene = loaded.fingerprint()
    keys = {spec: results.key(loaded.name, scene, spec, *fixed) for spec in chosen}
    rows = {} if journal is None else {s: journal.rows[k] for s, k in keys.items() if k in journal.rows}
    # The yardstick alone measures nothing; with others it is measured again, beside them.
    missing = [spec for spec in chosen if spec not in rows]
    if missing and missing != [yardstick.SPEC]:
        if yardstick.SPEC in chosen and yardstick.SPEC not in missing:
            missing.insert(0, yardstick.SPEC)
        if rows:
            say(f"{loaded.name}: {len(chosen) - len(missing)} of {len(chosen)} rows are there already")
        for row in benchmark.measure(module, loaded, missing, options, say):
            rows[row["spec"]] = row
            if journal is not None and row["error"] is None:
                journal.add(keys[row["spec"]], row)
    return [rows[spec] for spec in chosen if spec in rows]


def status(rows: Sequence[benchmark.Row], *, failed: bool) -> int:
    """The exit status that the rows mean. The yardstick is no structure of ours and decides nothing."""
    ours = [row for row in rows if row["spec"] != yardstick.SPEC]
    if any(row["errors"] is not None and not benchmark.agrees(row) for row in ours):
        return 1
    return BAD_INPUT if failed or any(row["error"] for row in ours) else 0


def save(folder: Path, document: dict[str, Any]) -> None:
    """Write the files of a report, each whole or not at all."""
    try:
        results.write(folder / "bench.json", json.dumps(document, indent=1, allow_nan=False) + "\n")
        results.write(folder / "bench.csv", report.as_csv(document["rows"]))
        results.write(folder / "report.html", report.as_html(document))
    except OSError as error:
        raise results.FolderError(f"{folder}: cannot be written: {error.strerror or error}") from error
    say(f"wrote {folder / 'report.html'}, bench.json and bench.csv")


def read_options(asked: argparse.Namespace) -> benchmark.Options:
    """The options, checked. Raises UsageError."""
    preset = PRESETS.get(asked.preset or "", {})
    sets = tuple(name.strip() for name in (asked.rays or preset.get("rays") or ",".join(rays.NAMES)).split(","))
    unknown = [name for name in sets if name not in rays.NAMES]
    if unknown:
        raise UsageError(f"--rays: unknown set {unknown[0]!r}; there are {', '.join(rays.NAMES)}")
    width, by, height = asked.size.partition("x")
    if not (by and specs.is_whole(width) and specs.is_whole(height)):
        raise UsageError(f"--size: expected WIDTHxHEIGHT, got {asked.size!r}")
    size = int(width), int(height)
    if not all(0 < side <= 1 << 14 and side % rays.TILE == 0 for side in size):
        raise UsageError(f"--size: expected multiples of {rays.TILE} up to {1 << 14}, got {asked.size!r}")
    for name, least in (("repeats", 1), ("threads", 0), ("check_rays", 1), ("ray_seed", 0)):
        if getattr(asked, name) < least:
            raise UsageError(f"--{name.replace('_', '-')}: expected at least {least}, got {getattr(asked, name)}")
    if asked.reference == yardstick.SPEC and (reason := yardstick.problem()):
        raise UsageError(f"--reference embree: {reason}")
    if asked.memory_limit is not None and not 0 <= asked.memory_limit < 1 << 30:
        raise UsageError(f"--memory-limit: expected a number of gigabytes, got {asked.memory_limit}")
    samples = [] if asked.curve is None else specs.numbers(asked.curve)
    if not all(specs.is_whole(value) and 0 < int(value) <= 1 << 24 for value in samples):
        raise UsageError(f"--curve: expected numbers of samples such as 1,2,4, got {asked.curve!r}")
    return benchmark.Options(
        size=size,
        sets=sets,
        repeats=asked.repeats,
        threads=asked.threads or os.cpu_count() or 1,
        reference=asked.reference,
        check_rays=asked.check_rays,
        seed=asked.ray_seed,
        curve=tuple(sorted({int(value) for value in samples})),
        memory_limit=None if asked.memory_limit is None else int(asked.memory_limit * 1e9),
    )


def read_structures(asked: argparse.Namespace, module: Any) -> list[str]:
    """The configurations, each proved to be valid by a tiny build. Raises SpecError."""
    preset = PRESETS.get(asked.preset or "", {})
    ranges = {"k": asked.k, "alpha": asked.alpha, "seed": asked.seeds}
    given = {name: specs.numbers(text) for name, text in ranges.items() if text is not None}
    chosen = specs.expand(asked.structures or preset.get("structures") or "all", module.structures(), given)
    corners, triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]
    for spec in chosen:
        try:
            module.build(_array(corners, "float32"), _array(triangle, "int32"), spec, threads=1)
        except ValueError as error:
            raise specs.SpecError(f"{spec}: {error}") from error
    return chosen


def _array(values: list[Any], dtype: str) -> Any:
    import numpy as np

    return np.array(values, dtype)


def loader(scene: str, size: tuple[int, int]) -> Callable[[], workload.Workload]:
    """A function that loads the scene. Raises UsageError when there is no such scene."""
    if scene == "grid":
        return grid.workload
    path = Path(scene)
    built_in = scene in ("showcase", "open file")
    if not built_in:
        if path.suffix.lower() not in SUFFIXES:
            raise UsageError(f"{scene}: expected grid, showcase or a file ending in {' '.join(SUFFIXES)}")
        try:
            with path.open("rb"):
                pass
        except OSError as error:
            raise UsageError(f"{scene}: cannot be read: {error.strerror}") from error
    if path.suffix.lower() == ".npz":
        return lambda: workload.load_npz(path, memory_limit=native.load().free_memory())
    try:
        from addon.blender import workloads
    except ImportError as error:
        raise UsageError(f"{scene}: needs Blender: {error}") from error
    if scene == "showcase":
        return lambda: workloads.built_in_showcase(size)
    return (lambda: workloads.current(scene, size)) if built_in else (lambda: workloads.load(path, size))


def default_scenes(preset: str | None) -> list[str]:
    """What is measured when no scene is named: the preset's scenes, the file open in Blender, or the showcase."""
    if preset is None:
        return ["open file" if _open_file() else "showcase"]
    names = PRESETS[preset]["scenes"].split(",")
    found = [name for name in names if (SCENES / f"{name}.npz").is_file()]
    for name in names:
        if name not in found:
            say(f"{name} is left out: it is not in {SCENES}")
    if not found:
        raise UsageError(f"--preset {preset}: none of its scenes is in {SCENES}")
    return [str(SCENES / f"{name}.npz") for name in found]


def _open_file() -> bool:
    """Whether this runs inside Blender with a file open."""
    bpy = sys.modules.get("bpy")
    return bpy is not None and bool(bpy.data.filepath)


def say(text: str) -> None:
    """Tell what is being done."""
    print(f"[bench] {text}", flush=True)


if __name__ == "__main__":
    # Inside Blender, what stands before "--" is Blender's own.
    split = sys.argv.index("--") + 1 if "--" in sys.argv else 1
    sys.exit(main(sys.argv[split:]))
