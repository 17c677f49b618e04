# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps: many configurations on many scenes, resumable, in one process, in several, or on a cluster.

A sweep is the product of a list of scenes and a list of configurations. Finished rows are in a journal; the others are
measured, here or by workers, and appended to it. One report is made of the journal.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ...core.measure import benchmark, rows
from ...core.measure.benchmark import Finished, Options, Row
from ...core.report import results
from ...core.scene.workload import Workload
from ..base.progress import Progress

if TYPE_CHECKING:
    from ...core.base.interface import Native

QUIET_SECONDS = 2.0
"""Shortest interval in seconds between two progress messages."""

Measured = tuple[Row, dict[str, Any]]
"""A row, and the machine that measured it."""

Measurer = Callable[[Workload, Sequence[str], str | None], Iterator[Measured]]
"""Measures configurations of a scene, with the anchor: workload, configurations, anchor."""


@dataclass(frozen=True)
class Shard:
    """Part `number` of `count`, from 1: every count-th row."""

    number: int = 1
    count: int = 1

    @property
    def name(self) -> str:
        """Name of its journal; "" for the whole."""
        return f"{self.number}-of-{self.count}" if self.count > 1 else ""

    def has(self, index: int) -> bool:
        """Whether this part measures the row of this index."""
        return index % self.count == self.number - 1


@dataclass
class Sweep:
    """The requested rows of a sweep and those already measured. identity: everything else that a row depends on, for
    its key.

    scenes: all of them, as named on the command line.
    """

    chosen: list[str]
    options: Options
    identity: list[Any]
    journal: results.Journal | None = None
    shard: Shard = field(default_factory=Shard)
    scenes: Sequence[str] = ()
    entries: dict[tuple[int, int], results.Entry] = field(default_factory=dict)

    @property
    def run_id(self) -> str:
        """A hash that is equal for all parts of a sweep on all machines, and for a retry with more memory."""
        own = self.options.identity()
        return results.key({name: own[name] for name in own if name not in ("threads", "memory_limit")})

    def begin(self) -> None:
        """Record the requested rows in the journal."""
        if self.journal is not None:
            self.journal.begin(self.options.as_dict())
            self.journal.ask(self.run_id, self.scenes, self.chosen)

    def run(self, number: int, workload: Workload, measurer: Measurer, say: Callable[[str], None]) -> list[Row]:
        """Measure the missing rows of the `number`-th scene. Returns its rows in the order of `chosen`."""
        # Compute the key of each row, and select this part's rows.
        scene = workload.fingerprint()
        if self.journal is not None:
            self.journal.reach(self.run_id, self.scenes[number], workload.name)
        known = {} if self.journal is None else self.journal.entries
        keys = [results.key(workload.name, scene, spec, *self.identity) for spec in self.chosen]
        # Take this part's rows from the journal where they are complete.
        mine = [i for i in range(len(self.chosen)) if self.shard.has(number * len(self.chosen) + i)]
        missing = [i for i in mine if keys[i] not in known or rows.lacks(known[keys[i]].row) is not None]
        lost = set(missing)
        for index in mine:
            if index not in lost:
                # Rows of another command line have another place in it.
                self.entries[number, index] = dataclasses.replace(known[keys[index]], order=(number, index))
        if missing and len(missing) < len(mine):
            say(f"{workload.name}: {len(mine) - len(missing)} of {len(mine)} rows exist already")
        if missing:
            wanted = [self.chosen[i] for i in missing]
            for row, machine in measurer(workload, wanted, benchmark.anchor_of(self.chosen)):
                self._keep(number, missing, keys, row, machine)
        return self.rows(number)

    def fail(self, number: int, name: str, error: BaseException) -> None:
        """Record a scene that cannot be used as a row behind its others; it is tried again by the next run."""
        place = number, len(self.chosen)
        self.entries[place] = results.Entry("", place, rows.failed_scene(name, error))
        if self.journal is not None:
            self.journal.fail(self.run_id, self.scenes[number], place, self.entries[place].row)

    def rows(self, number: int | None = None) -> list[Row]:
        """The rows of the `number`-th scene, or of all, in order."""
        places = sorted(place for place in self.entries if number in (None, place[0]))
        return [self.entries[place].row for place in places]

    def _keep(
        self, number: int, missing: Sequence[int], keys: Sequence[str], row: Row, machine: dict[str, Any]
    ) -> None:
        index = self.chosen.index(row["spec"])
        if index not in missing:
            # The anchor, measured with others although its row exists already.
            return
        entry = results.Entry(keys[index], (number, index), row, self.run_id)
        self.entries[number, index] = entry
        if self.journal is None:
            return
        if row["error"] is None:
            self.journal.add(entry, machine)
        else:
            self.journal.fail(self.run_id, self.scenes[number], entry.order, row)


def beside(wanted: Sequence[str], anchor: str | None) -> list[str]:
    """The configurations to measure so that `wanted` are timed with their anchor."""
    return [*([anchor] if anchor is not None and anchor not in wanted else []), *wanted]


def here(native: Native, options: Options) -> Measurer:
    """A measurer in this process, interleaved, which shows its progress."""
    machine = results.machine(native)

    def measurer(workload: Workload, wanted: Sequence[str], anchor: str | None) -> Iterator[Measured]:
        with Progress("bench", QUIET_SECONDS) as progress:
            for event in benchmark.events(native, workload, beside(wanted, anchor), options, None, anchor):
                if isinstance(event, Finished):
                    progress.clear()
                    yield event.row, machine
                else:
                    progress.show(f"{workload.name}: {100 * event.done:3.0f} % {event.text}", event.done)

    return measurer
