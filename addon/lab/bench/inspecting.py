# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages of the inspector: one alone, and those next to the report of a benchmark."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ...core.base import native
from ...core.inspector import page
from ...core.measure import costmap
from ...core.report import results
from ...core.scene.workload import Workload
from ...core.structures import catalogue, specs
from ..base.usage import UsageError

if TYPE_CHECKING:
    from argparse import ArgumentParser, Namespace

    from ...core.base.interface import Native

WIDTH = 256
"""Camera rays side by side on a page next to a report."""


def add_option(parser: ArgumentParser) -> None:
    """Add `--inspector`."""
    parser.add_argument(
        "--inspector",
        metavar="SPEC[,SPEC...]",
        help="also write the inspector's page of these structures for each scene, and link it with the report",
    )


def read(asked: Namespace, module: Native) -> Beside:
    """The pages that `--inspector` names, none without it. Raises UsageError and SpecError."""
    if asked.inspector is None:
        return Beside(Path(), [])
    if asked.out is None or asked.shard is not None:
        raise UsageError("--inspector: expected --out, and no --shard, which writes no report")
    return Beside(asked.out, specs.prove(module, specs.expand(asked.inspector, module.structures(), {})))


@dataclass
class Beside:
    """The pages next to a report, of no structure or some. files: names of the written ones, by scene."""

    folder: Path
    specs: list[str]
    files: dict[str, str] = field(default_factory=dict)

    def add(self, workload: Workload, size: tuple[int, int], say: Callable[[str], None]) -> None:
        """Write the page of a scene, or state why it is left out. size: pixels of the benchmark's view, whose shape the
        page's has.
        """
        if not self.specs:
            return
        name = f"inspector-{len(self.files) + 1}.html" if self.files else "inspector.html"
        try:
            made = write(self.folder / name, workload, self.specs, costmap.shaped(WIDTH, size), report="report.html")
        except native.FAILURES as error:
            say(f"{workload.name}: the inspector's page is left out: {native.first_line(error)}")
            return
        self.files[workload.name] = name
        for line in made.worst:
            say(f"{workload.name}: {line}")

    def links(self) -> dict[str, dict[str, str]]:
        """The entry of the pages in bench.json, which the report reads; nothing without pages."""
        return {"inspectors": self.files} if self.files else {}


def write(path: Path, workload: Workload, chosen: Sequence[str], size: tuple[int, int], report: str = "") -> page.Page:
    """Write the page of these configurations of a scene. size: pixels of its view. report: see `page.inspect`.

    Raises what builds and files raise.
    """
    module, structures = native.load(), []
    for spec in chosen:
        label = catalogue.load()[specs.structure_of(spec)].label
        built = module.build(workload.vertices, workload.triangles, spec)
        structures.append((label if spec == specs.structure_of(spec) else f"{label} ({spec})", built))
    made = page.inspect(module, workload, structures, size, report)
    results.write(path, made.html)
    return made
