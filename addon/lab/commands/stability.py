# SPDX-License-Identifier: GPL-3.0-or-later
"""Number of wrong answers of each structure on extreme scenes, against brute force and exact arithmetic.

`halfspace stability [options]` prints the sums of each structure over all cases, and the rays that leak out of closed
surfaces; all rows are in the folder of `--out`, else in `out/stability.csv`. With `--long N` it compares N answers on
random and extreme scenes instead, with `--scenes` camera rays, shadow rays and bounces on whole scenes. All
measurements except the leaks continue an earlier run with the same `--out`. Exit status: 0 no structure differs; 1 some
structure does; 2 bad usage; 130 stopped.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.base import command, csv_text, native
from ...core.report import results
from ...core.scene import workload
from ...core.structures import specs, ways
from ..base.places import OUT
from ..base.usage import Parser, UsageError, output
from ..bench import scenes
from ..stability import agreement, leaks, slowdown, slowdown_page, stability, trials

if TYPE_CHECKING:
    from ...core.base.interface import Native

BUNNY = workload.SCENES / "stanford-bunny.npz"
"""A scanned surface whose few holes are closed by fans."""

INSIDE_BUNNY = (-0.025, 0.1, 0.0), 0.015
"""Centre and radius of a ball inside the bunny."""

VIEW = 64, 64
"""Pixels of the view that comes with a scene of Blender; only its ratio matters."""

RAYS = 100_000
"""Default number of rays of each set with `--scenes`."""

MOST = 1e18
"""Limit on the numbers of --long and --seconds."""

MEANINGLESS = {
    "long": ("scenes", "leaks_only", "leak_rays", "size"),
    "scenes": ("leaks_only", "leak_rays", "size"),
    "leaks_only": ("out",),
    "slowdown": ("long", "scenes", "leaks_only", "leak_rays"),
}
"""For each option, the options that have no meaning together with it."""

PROGRESS_SECONDS = 30.0
"""Interval of the progress lines of a long run."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="stability", description=(__doc__ or "").splitlines()[0])
    add = made.add_argument
    add("--size", choices=("small", "large"), help="hundreds (default) or tens of thousands of triangles")
    add("--structures", default="all", metavar="SPEC[,SPEC...]", help="configurations, families, or all (default)")
    add("--long", type=float, metavar="N", help="compare N answers on random and extreme scenes, e.g. 1e9")
    add("--seconds", type=float, metavar="S", help="with --long: end after this time")
    add("--scenes", nargs="+", metavar="SCENE", help=f"compare on these: {scenes.CHOICES}")
    add("--rays", type=int, metavar="N", help="with --scenes: rays of each set (default: 100000)")
    add("--slowdown", type=int, metavar="N", help="slowdown by offset, scale and shape; N timings each, 0 = work only")
    add("--copies", type=int, metavar="N", help="with --slowdown: coincident triangles (default: 1000, large 10^6)")
    add("--threads", type=int, default=0, metavar="N", help="threads of long runs and leaks, 0 = all (default)")
    add("--leaks-only", action="store_true", help="only send rays out of closed surfaces")
    add("--seed", type=int, default=7, help="seed of the scenes (default: 7)")
    add("--leak-rays", type=int, metavar="N", help="rays from inside each closed surface (default: 10^4, large 10^6)")
    add("--out", type=output, metavar="DIR", help="write stability.json, .csv and .html, or slowdown.*")
    return made


def main(arguments: Sequence[str]) -> int:
    """Measure and print. Returns the exit status."""
    return command.run("stability", arguments, parser().parse_args, run, keeps=lambda asked: asked.out)


def run(asked: argparse.Namespace) -> int:
    """Check everything, then measure. Returns the exit status. Raises the errors that `main` reports in one line."""
    # Check the options and choose the configurations.
    check(asked)
    asked.size, asked.rays = asked.size or "small", asked.rays or RAYS
    module = native.load()
    expanded = specs.expand(asked.structures, module.structures(), {})
    chosen = specs.prove(module, stability.configurations(module.structures(), expanded))
    if any(mode not in (None, False) for mode in (asked.long, asked.scenes, asked.slowdown, asked.leaks_only)):
        chosen = [spec for spec in chosen if not stability.allowed_to_fail(spec)]
    if asked.long is not None:
        chosen = [spec for spec in chosen if not is_brute(spec) or stability.only_shadows(spec)]
    elif asked.scenes is not None or asked.slowdown is not None:
        chosen = [spec for spec in chosen if not is_brute(spec)]
    if not chosen:
        raise UsageError("--structures: nothing to compare with brute force")
    if asked.leaks_only and not with_leaks(chosen, asked):
        raise UsageError("--structures: no rays leave closed surfaces through brute force with --size large")
    loaders = [scenes.loader(name, VIEW) for name in asked.scenes or ()]
    if asked.out is not None:
        results.prepare_folder(asked.out)
    if asked.slowdown is not None:
        return run_slowdown(module, chosen, asked)
    if asked.long is not None:
        return run_long(module, chosen, asked)
    if asked.scenes is not None:
        return run_scenes(module, chosen, [load() for load in loaders], asked)
    # Measure leaks alone, or the cases and leaks.
    start = time.monotonic()
    if asked.leaks_only:
        leaking = find_leaks(module, chosen, asked)
        say(f"seed {asked.seed}, {time.monotonic() - start:.0f} s")
        return int(leaking)
    rows = measure_cases(module, chosen, asked)
    leaking = find_leaks(module, chosen, asked)
    wrong = [row for row in rows if not stability.allowed_to_fail(row["spec"]) and stability.differs(row)]
    # Print the tables, and what they leave out.
    show(rows, asked)
    for name, most in stability.MOST_RAYS.get(asked.size, {}).items():
        say(f"of {name} {most} rays, since each takes long")
    failing = {row["spec"] for row in rows if stability.allowed_to_fail(row["spec"])}
    noticed = {row["spec"] for row in rows if row["spec"] in failing and stability.differs(row)}
    if failing:
        say(f"{len(noticed)} of {len(failing)} configurations without allowance for rounding answer wrongly somewhere")
    slow = [row for row in rows if not stability.allowed_to_fail(row["spec"]) and stability.is_slower(row)]
    for row in slow:
        say(f"{row['case']}, {row['spec']} is slower than brute force")
    say(f"{len(slow)} of {len(rows)} rows are more than {stability.SLOWER} times as slow as brute force")
    verdict = stability.limit(rows)
    say(f"{verdict}; seed {asked.seed}, {time.monotonic() - start:.0f} s")
    if asked.out is not None:
        document = {**results.document(module, rows, {"size": asked.size, "seed": asked.seed}), "verdict": verdict}
        save(asked.out, document)
    return 1 if wrong or leaking else 0


def check(asked: argparse.Namespace) -> None:
    """Check that each option is in range and has a meaning together with the others. Raises UsageError."""
    if asked.long is not None and not 0 < asked.long <= MOST:
        raise UsageError(f"--long: expected a number above 0, up to {MOST:g}, got {asked.long:g}")
    if asked.seconds is not None and not 0 <= asked.seconds <= MOST:
        raise UsageError(f"--seconds: expected a number of at least 0, up to {MOST:g}, got {asked.seconds:g}")
    for name, least, most in (
        ("threads", 0, 1024),
        ("seed", 0, 1 << 62),
        ("rays", 1, 1 << 30),
        ("leak_rays", int(asked.leaks_only), 1 << 40),
        ("slowdown", 0, 1000),
        ("copies", 1, 1 << 24),
    ):
        given = getattr(asked, name)
        if given is not None and not least <= given <= most:
            raise UsageError(f"--{name.replace('_', '-')}: expected {least} to {most}, got {given}")
    for name, needed in (("seconds", "long"), ("rays", "scenes"), ("copies", "slowdown")):
        if getattr(asked, name) is not None and getattr(asked, needed) is None:
            raise UsageError(f"--{name}: expected --{needed}, whose runs it is about")
    for mode, meaningless in MEANINGLESS.items():
        for name in meaningless:
            if getattr(asked, mode) not in (None, False) and getattr(asked, name) not in (None, False):
                raise UsageError(f"--{name.replace('_', '-')}: expected no --{mode.replace('_', '-')} with it")


def is_brute(spec: str) -> bool:
    """Whether the configuration is brute force itself."""
    return ways.nodes_of(spec) == "none"


def measure_cases(module: Native, chosen: list[str], asked: argparse.Namespace) -> list[stability.Row]:
    """The rows of all extreme cases; those of an earlier run with the same folder are reused, case by case."""
    # A row is reused only if everything that it depends on is the same.
    journal = results.Journal(asked.out) if asked.out is not None else None
    machine = results.machine(module)
    pairs = stability.EXACT_PAIRS[asked.size]
    fixed = [
        module.__version__,
        results.native_fingerprint(module),
        stability.VERSION,
        chosen,
        asked.size,
        asked.seed,
        pairs,
    ]
    rows: list[stability.Row] = []
    for place, case in enumerate(module.cases(asked.size, seed=asked.seed)):
        most = stability.MOST_RAYS.get(asked.size, {}).get(case["name"])
        key = results.key(*fixed, case["name"], *([] if most is None else [most]))
        some = stability.fewer_rays(case, most)

        def measured(some: dict[str, Any] = some) -> dict[str, Any]:
            return {
                "rows": list(stability.measure_case(module, some, chosen, exact_pairs=pairs, threads=asked.threads))
            }

        rows += results.kept(journal, key, (0, place), machine, measured)["rows"]
    return rows


def run_long(module: Native, chosen: list[str], asked: argparse.Namespace) -> int:
    """Compare answers, block by block, until their number or the time is reached. Returns the exit status."""
    journal = results.Journal(asked.out) if asked.out is not None else None
    fixed = [module.__version__, results.native_fingerprint(module), trials.VERSION, chosen, asked.seed]
    machine = results.machine(module)
    start = shown = time.monotonic()
    totals: dict[str, stability.Row] = {}
    done = number = earlier = 0
    seconds = 0.0
    # Reuse or measure one block after the other, and sum up their rows.
    while done < asked.long:
        key = results.key(*fixed, number)
        known = journal is not None and key in journal.entries
        if not known and asked.seconds is not None and time.monotonic() - start >= asked.seconds:
            break

        def measured(number: int = number) -> dict[str, Any]:
            began = time.process_time()
            rows = trials.block(module, chosen, asked.seed, number, threads=asked.threads)
            return {"block": number, "seconds": time.process_time() - began, "rows": rows}

        kept = results.kept(journal, key, (0, number), machine, measured)
        earlier += known
        for row in kept["rows"]:
            totals[row["spec"]] = stability.add(totals.get(row["spec"]), row)
            done += row["rays"]
            for trial in row["wrong_in"]:
                say(f"{row['spec']} differs in trial {trial} of seed {asked.seed}")
        seconds += kept["seconds"]
        number += 1
        if time.monotonic() - shown >= PROGRESS_SECONDS:
            shown = time.monotonic()
            say(f"{number:,} blocks, {done:,} of {asked.long:,.0f} answers")
    rows = list(totals.values())
    show(rows, asked)
    verdict = stability.limit(rows)
    say(
        f"{verdict}; seed {asked.seed}, {number:,} blocks ({earlier:,} of an earlier run), {seconds:.0f} s of processor"
    )
    if asked.out is not None and rows:
        document = {**results.document(module, rows, {"seed": asked.seed, "blocks": number}), "verdict": verdict}
        save(asked.out, document)
    return 1 if any(stability.differs(row) for row in rows) else 0


def run_scenes(module: Native, chosen: list[str], loaded: list[workload.Workload], asked: argparse.Namespace) -> int:
    """Compare every configuration on whole scenes. Returns the exit status."""
    journal = results.Journal(asked.out) if asked.out is not None else None
    machine = results.machine(module)
    rows: list[stability.Row] = []
    # Reuse or measure the row of each configuration; the rays and their answers are made when the first row needs them.
    for place, scene in enumerate(loaded):
        dropped = 0
        program = [module.__version__, results.native_fingerprint(module), stability.VERSION]
        fixed = [*program, scene.fingerprint(), asked.rays, asked.seed]
        questions: list[agreement.Question] = []
        for spec in chosen:

            def measured(
                scene: workload.Workload = scene, spec: str = spec, questions: list[agreement.Question] = questions
            ) -> stability.Row:
                if not questions:
                    questions += agreement.questions(module, scene, asked.rays, asked.seed, threads=asked.threads)
                    counts = ", ".join(f"{len(q.rays):,} {q.rays.name} ({q.proven:,})" for q in questions)
                    say(f"{scene.name}, {len(scene.triangles):,} triangles: {counts} rays (of them by brute force)")
                began = time.process_time()
                row = agreement.row(module, scene, spec, questions, threads=asked.threads)
                row["seconds"] = time.process_time() - began
                return row

            order = place, chosen.index(spec)
            row = results.kept(journal, results.key(*fixed, spec), order, machine, measured)
            rows.append(row)
            say(f"{scene.name}, {spec}: {row['rays']:,} rays, {'DIFFERS' if wrong(row) else 'equal'}")
            dropped = max(dropped, row["statistics"].get("dropped_triangles", 0))
        for line in workload.left_out(scene, dropped):
            say(f"{scene.name}: {line}")
    show(rows, asked)
    for row in rows:
        for text in row["broken"]:
            say(f"{row['case']}, {row['spec']} is broken: {text}")
    verdict = stability.limit(rows, f"brute force, or beyond its share {agreement.REFERENCE} that agrees with it,")
    say(f"{verdict}; seed {asked.seed}, {sum(row['seconds'] for row in rows):.0f} s of processor")
    if asked.out is not None:
        document = {**results.document(module, rows, {"seed": asked.seed, "rays": asked.rays}), "verdict": verdict}
        save(asked.out, document)
    return int(any(wrong(row) for row in rows))


def run_slowdown(module: Native, chosen: list[str], asked: argparse.Namespace) -> int:
    """Measure the ratios of time and work of extreme scenes to ordinary ones. Returns the exit status."""
    journal = results.Journal(asked.out) if asked.out is not None else None
    machine = results.machine(module)
    rings, rays, copies = slowdown.SIZES[asked.size]
    copies = asked.copies or copies
    program = [module.__version__, results.native_fingerprint(module), slowdown.VERSION]
    fixed = [*program, asked.size, copies, asked.seed, asked.slowdown]
    rows: list[slowdown.Row] = []
    # Reuse or measure the rows of each case.
    for place, case in enumerate(slowdown.cases(rings, rays, copies, asked.seed)):
        key = results.key(*fixed, case.name, chosen)

        def measured(case: slowdown.Case = case) -> dict[str, Any]:
            return {"rows": list(slowdown.measure(module, case, chosen, repeats=asked.slowdown))}

        kept = results.kept(journal, key, (0, place), machine, measured)
        rows += kept["rows"]
        most = {kind: max(row[kind] for row in kept["rows"]) for kind in slowdown_page.kinds(kept["rows"])}
        shown = ", ".join(f"{slowdown_page.KINDS[kind]} up to {value:.2f} times" for kind, value in most.items())
        say(f"{case.name}: {shown}")
    # Print the tables, and write the page.
    for kind in slowdown_page.kinds(rows):
        print(slowdown_page.table(rows, kind), "\n")
    verdict = slowdown_page.verdict(rows)
    say(f"{verdict}; seed {asked.seed}")
    if asked.out is not None:
        document = {**results.document(module, rows, {"size": asked.size, "seed": asked.seed}), "verdict": verdict}
        save(asked.out, document, "slowdown", slowdown_page.as_html)
    return int(any(row["wrong"] or slowdown.slowed(row) for row in rows))


def wrong(row: stability.Row) -> bool:
    """Whether answers on a scene differ, or an invariant of the structure is violated."""
    return stability.differs(row) or bool(row["broken"])


def with_leaks(chosen: list[str], asked: argparse.Namespace) -> list[str]:
    """The configurations whose leaks are counted: in large surfaces brute force would take too long."""
    return [spec for spec in chosen if asked.size != "large" or not is_brute(spec)]


def find_leaks(module: Native, chosen: list[str], asked: argparse.Namespace) -> bool:
    """Trace rays from inside closed surfaces and print the leaks. Returns whether any structure leaks that must not."""
    large = asked.size == "large"
    count = asked.leak_rays if asked.leak_rays is not None else (1_000_000 if large else 10_000)
    if not count:
        say("no rays are sent out of closed surfaces")
        return False
    specs = with_leaks(chosen, asked)
    surfaces = list(leaks.surfaces(5 if large else 3))
    if BUNNY.is_file():
        surfaces.append(leaks.from_file(BUNNY, *INSIDE_BUNNY))
    else:
        say(f"the bunny is left out: {BUNNY} is not there")
    found = leaks.count_leaks(module, specs, surfaces, count, asked.seed, threads=asked.threads)
    for spec, leaking in found.items():
        counts = ", ".join(f"{name} {leaking[name]:,}" for name, *_ in surfaces)
        say(f"leaks of {spec} in {count:,} rays from inside each: {counts}")
    ours = [spec for spec in specs if not stability.allowed_to_fail(spec)]
    say(f"{len(ours) * len(surfaces) * count:,} rays in all, {sum(found[spec].total() for spec in ours):,} leaks")
    return any(found[spec].total() for spec in ours)


def show(rows: Sequence[stability.Row], asked: argparse.Namespace) -> None:
    """Print the sums of each configuration, and write all rows where no folder is named. Raises FolderError."""
    print(stability.screen(rows))
    if asked.out is None and rows:
        path = OUT / "stability.csv"
        results.prepare_folder(path.parent)
        results.write(path, csv_text.text(rows))
        say(f"all rows: {path}")


def save(
    folder: Path,
    document: dict[str, Any],
    name: str = "stability",
    page: Callable[[dict[str, Any]], str] = stability.as_html,
) -> None:
    """Write the files atomically. Raises FolderError."""
    with results.writing(folder):
        results.write_all(
            {
                folder / f"{name}.json": json.dumps(document, indent=1, allow_nan=False) + "\n",
                folder / f"{name}.csv": csv_text.text(document["rows"]),
                folder / f"{name}.html": page(document),
            }
        )
    say(f"wrote {folder / name}.html, {name}.json and {name}.csv")


def say(text: str) -> None:
    """Print a line of progress."""
    print(f"[stability] {text}", flush=True)
