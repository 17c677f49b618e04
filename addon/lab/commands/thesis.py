# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables and figures of Hoobergs 2019 in scalar form, measured again and compared with the published numbers.

`halfspace thesis [SCENE ...] [options]` continues an earlier run with the same `--out`: each finished row is
kept. Exit status: 0 everything was measured, whether it holds or not; 1 some answer differed from brute force; 2 bad
usage; 130 stopped.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.base import command, native
from ...core.report import results
from ...core.scene import workload
from ..base.usage import Parser, UsageError, output
from ..bench.bench_presets import BASE, as_published
from ..claims.thesis import BVHS
from ..report import thesis as published
from ..thesis import levels, measure, page, plan, tables

if TYPE_CHECKING:
    from ...core.base.interface import Native

VERSION = 1
"""Version of the measurements: increment when a row measures anything else; older rows are then not reused."""

MOST_SEEDS, MOST_REPEATS, LONGEST = 100, 1000, 1 << 14
"""Largest numbers of seeds, timed passes and pixels along a side (chosen)."""

FIGURES = {
    "kd": (BASE, 3),
    "rbsp": (as_published("rbsp:k=7"), 7),
    "ize": (as_published("bsp-ize"), 5),
    "random": (as_published("bsp-random:k=6,seed=1"), 6),
    "wn": (as_published("bsp-wn:k=6,seed=1"), 6),
}
"""Trees of table 2.1 and of figures 2.1 and 3.1, with their numbers of directions."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = Parser(prog="thesis", description=(__doc__ or "").splitlines()[0])
    add = made.add_argument
    add("scenes", nargs="*", metavar="SCENE", help=f"which scenes (default: {', '.join(plan.SCENES)})")
    add("--quick", action="store_true", help="one seed, few K, a small picture")
    add("--structures", metavar="ID[,ID...]", help="only these structures")
    add("--seeds", type=int, metavar="N", help="number of seeds (default: 7, quick: 1); more seeds keep finished rows")
    add("--size", metavar="WxH", help="pixels of the view (default: 512x512, quick: 128x128)")
    add("--repeats", type=int, metavar="N", help="timed passes of a row (default: 5, quick: 3)")
    add("--tried", choices=("all", "128"), help="triangles of a node whose planes Ize's trees try (quick: 128)")
    add("--no-figures", action="store_true", help="without table 2.1 and figures 2.1 and 3.1")
    add(
        "--published", type=Path, metavar="FILE", help=f"published results (default: {published.FILE.name}, if present)"
    )
    add("--out", type=output, metavar="DIR", help="write thesis.json and thesis.html, and keep finished rows")
    return made


def main(arguments: Sequence[str]) -> int:
    """Measure and print. Returns the exit status."""
    return command.run("thesis", arguments, parser().parse_args, run, keeps=lambda asked: asked.out)


def run(asked: argparse.Namespace) -> int:
    """Measure row by row. Returns the exit status. Raises the errors that `main` reports in one line."""
    module = native.load()
    effort = read_effort(asked)
    known = published.published(asked.published)
    chosen = read_structures(asked, effort)
    scenes = read_scenes(asked)
    if asked.out is not None:
        results.prepare_folder(asked.out)
    journal = results.Journal(asked.out) if asked.out is not None else None
    bench = Bench(module, effort, journal)
    rows: list[dict[str, Any]] = []
    figures: dict[str, dict[str, list[levels.Level]]] = {}
    # Measure scene by scene, so that one scene at a time is in memory.
    for place, path in enumerate(scenes):
        scene = workload.load_npz(path, published=True)
        rows += [bench.row(scene, tree, place) for tree in chosen]
        for line in tables.lines([row for row in rows if row["model"] == scene.name], known):
            print(tables.as_text(line), flush=True)
        if asked.out is not None:  # so that a run that is stopped leaves what it has
            save(asked.out, bench, rows, figures, known)
        if not asked.no_figures:
            figures[scene.name] = bench.figures(scene, place)
            if asked.out is not None:
                save(asked.out, bench, rows, figures, known)
    return 1 if any(row["wrong"] for row in rows) else 0


class Bench:
    """Measures rows, or takes them from the journal."""

    def __init__(self, module: Native, effort: plan.Effort, journal: results.Journal | None) -> None:
        self.module = module
        self.effort = effort
        self.journal = journal
        self.machine = results.machine(module)
        self._fixed = (VERSION, module.__version__, results.native_fingerprint(module), effort.of_row)
        self._model: measure.Model | None = None

    def row(self, scene: workload.Workload, tree: plan.Tree, place: int) -> dict[str, Any]:
        """One row, measured or kept."""

        def measured() -> dict[str, Any]:
            if self._model is None or self._model.workload is not scene:
                say(f"{scene.name}: the kd-tree, rays and the answers of brute force")
                self._model = measure.prepare(self.module, scene, self.effort)
            say(f"{scene.name}: {tree.spec}")
            return measure.row(self.module, self._model, tree, self.effort)

        return self._kept((scene.fingerprint(), asdict(tree)), place, measured)

    def figures(self, scene: workload.Workload, place: int) -> dict[str, list[levels.Level]]:
        """The levels of each tree of the figures."""
        found = {}
        for kind, (spec, k) in FIGURES.items():

            def measured(kind: str = kind, spec: str = spec, k: int = k) -> dict[str, Any]:
                say(f"{scene.name}: planes by level: {spec}")
                built = self.module.build(scene.vertices, scene.triangles, spec, threads=0)
                return {"levels": [asdict(level) for level in levels.levels(built, scene, kind, k)]}

            kept = self._kept((scene.fingerprint(), kind, spec), place, measured)
            found[kind] = [levels.Level(**level) for level in kept["levels"]]
        return found

    def _kept(self, what: tuple[Any, ...], place: int, measured: Any) -> dict[str, Any]:
        order = place, 0 if self.journal is None else len(self.journal.entries)
        return dict(results.kept(self.journal, results.key(*self._fixed, *what), order, self.machine, measured))


def save(
    folder: Path,
    bench: Bench,
    rows: Sequence[dict[str, Any]],
    figures: dict[str, dict[str, list[levels.Level]]],
    known: published.Published,
) -> None:
    """Write both files, each whole or not at all. Raises FolderError."""
    lines = list(tables.lines(rows, known))
    machines = {bench.machine["name"]: bench.machine} | (bench.journal.machines if bench.journal is not None else {})
    census = {}
    for scene, trees in figures.items():
        count = max((trees["random"][0].planes // (2 * FIGURES["random"][1])), 1)
        census[scene] = [
            row for kind, own in trees.items() for row in levels.table({kind: own}, count, FIGURES[kind][1])
        ]
    document = results.document(bench.module, list(rows), asdict(bench.effort), machines)
    document["lines"] = [line.as_row() for line in lines]
    document["levels"] = {
        scene: {kind: [asdict(level) for level in own] for kind, own in trees.items()}
        for scene, trees in figures.items()
    }
    document["planes"] = census
    shown = page.as_html(lines, figures, census, document["machines"], about(bench.effort))
    text = json.dumps(document, indent=1, allow_nan=False) + "\n"
    with results.writing(folder):
        results.write_all({folder / "thesis.json": text, folder / "thesis.html": shown})
    say(f"wrote {folder / 'thesis.html'} and thesis.json")


def about(effort: plan.Effort) -> str:
    """How the numbers were measured."""
    boxes = ", ".join(f"{name} ({spec})" for name, spec in zip(plan.HIERARCHIES, BVHS.values(), strict=True))
    return (
        "All trees have the costs, rules and draws of the thesis and test one triangle at a time, by single rays; so "
        f"has the kd-tree ({BASE}) that they are compared with. Beside them are hierarchies of boxes, {boxes}. Rays of "
        f"{effort.size[0]} x {effort.size[1]} pixels, "
        "their shadow rays and one bounce, one thread, processor time, the median of "
        f"{effort.repeats} passes in turn with the kd-tree's; {len(effort.seeds)} seeds. Ize's trees try the planes of "
        f"{'all' if effort.all_tried else '128'} triangles of a node."
    )


def read_effort(asked: argparse.Namespace) -> plan.Effort:
    """How much is measured. Raises UsageError."""
    effort = plan.QUICK if asked.quick else plan.FULL
    if asked.seeds is not None:
        if not 1 <= asked.seeds <= MOST_SEEDS:
            raise UsageError(f"--seeds: expected 1 to {MOST_SEEDS}, got {asked.seeds}")
        effort = replace(effort, seeds=tuple(range(1, asked.seeds + 1)))
    if asked.size is not None:
        width, _, height = asked.size.partition("x")
        if not (
            width.isdecimal() and height.isdecimal() and 1 <= int(width) <= LONGEST and 1 <= int(height) <= LONGEST
        ):
            raise UsageError(f"--size: expected WIDTHxHEIGHT up to {LONGEST}, got {asked.size!r}")
        effort = replace(effort, size=(int(width), int(height)))
    if asked.repeats is not None:
        if not 1 <= asked.repeats <= MOST_REPEATS:
            raise UsageError(f"--repeats: expected 1 to {MOST_REPEATS}, got {asked.repeats}")
        effort = replace(effort, repeats=asked.repeats)
    return effort if asked.tried is None else replace(effort, all_tried=asked.tried == "all")


def read_structures(asked: argparse.Namespace, effort: plan.Effort) -> list[plan.Tree]:
    """The trees to measure. Raises UsageError."""
    every = list(plan.trees(effort))
    if asked.structures is None:
        return every
    wanted = [name.strip() for name in asked.structures.split(",")]
    names = list(dict.fromkeys(tree.structure for tree in every))
    unknown = [name for name in wanted if name not in names]
    if unknown:
        raise UsageError(f"--structures: unknown structure {unknown[0]!r}; there are {', '.join(names)}")
    return [tree for tree in every if tree.structure in wanted]


def read_scenes(asked: argparse.Namespace) -> list[Path]:
    """The files of the scenes; by default those that are present. Raises UsageError."""
    if not asked.scenes:
        there = [path for name in plan.SCENES if (path := workload.SCENES / f"{name}.npz").is_file()]
        if not there:
            raise UsageError(f"none of the scenes {', '.join(plan.SCENES)} is present; name files")
        return there
    found = [workload.find(name) for name in asked.scenes]
    return [path for path in found if isinstance(path, Path)]


def say(text: str) -> None:
    """Print a line of progress."""
    print(f"[thesis] {text}", flush=True)
