# SPDX-License-Identifier: GPL-3.0-or-later
"""The requested work and the failures recorded in a journal, so that a report of parts can list what is missing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from ..base.notes import some
from ..measure.rows import Row

Place = tuple[str, str]
"""A run, and a scene as named on its command line: the run may end before it reads the scene's own name."""

Finished = set[tuple[str, str, str]]
"""Runs, scene names and configurations of finished rows."""


def label(scene: str) -> str:
    """The name of a command line's scene without its folder, which differs between machines."""
    return PurePath(scene).stem


@dataclass
class Asked:
    """Requested configurations and failures of all runs in a journal.

    specs: the configurations requested for each scene. names: scene names as in the rows, for scenes that were read.
    options: per run, where recorded.

    failures: the row that gives the reason, and its order, by place and configuration; the configuration is empty if
    the whole scene failed. A failure counts only while no finished row exists, because a later run may have succeeded.
    """

    specs: dict[Place, list[str]] = field(default_factory=dict)
    names: dict[Place, str] = field(default_factory=dict)
    options: dict[str, dict[str, Any]] = field(default_factory=dict)
    failures: dict[tuple[str, str, str], tuple[tuple[int, int], Row]] = field(default_factory=dict)

    def take(self, line: dict[str, Any]) -> bool:
        """Record a journal line; returns whether it is one of this class's lines. Raises KeyError, TypeError and
        ValueError.
        """
        if "asked" in line:
            found = line["asked"]
            for scene in found["scenes"]:
                self._ask((found["run"], scene), found["specs"])
            if found.get("options"):
                self.options[found["run"]] = found["options"]
        elif "reached" in line:
            found = line["reached"]
            self.names[found["run"], found["scene"]] = found["name"]
        elif "failed" in line:
            found = line["failed"]
            scene, spec = found["order"]
            row = found["row"]
            self.failures[found["run"], found["scene"], row["spec"]] = (int(scene), int(spec)), row
        else:
            return False
        return True

    def _ask(self, place: Place, specs: Iterable[str]) -> None:
        """Add configurations that are new for a scene; a resumed run requests all of its configurations again."""
        self.specs[place] = list(dict.fromkeys([*self.specs.get(place, ()), *specs]))

    def merge(self, other: Asked) -> None:
        """Add the contents of another journal."""
        for place, specs in other.specs.items():
            self._ask(place, specs)
        self.names |= other.names
        self.options |= other.options
        self.failures |= other.failures

    def failures_left(self, finished: Finished) -> Iterator[tuple[tuple[int, int], Row]]:
        """The rows of failures that no later run replaced, each with its order."""
        for (run, scene, spec), found in self.failures.items():
            wanted = [spec] if spec else self.specs.get((run, scene), [])
            if self._unfinished((run, scene), wanted, finished) or not wanted:
                yield found

    def missing(self, finished: Finished) -> Iterator[str]:
        """One line per scene with configurations that are neither finished nor failed."""
        for place, specs in self.specs.items():
            failed = {spec for run, scene, spec in self.failures if (run, scene) == place}
            # A scene that could not be read has failed as a whole.
            if place not in self.names and "" in failed:
                continue
            lost = [spec for spec in self._unfinished(place, specs, finished) if spec not in failed]
            if lost:
                share = f"all of {len(specs)} rows" if len(lost) == len(specs) else f"{len(lost)} of {len(specs)} rows"
                yield f"{self.names.get(place, place[1])}: missing {share}: {some(lost)}"

    def _unfinished(self, place: Place, specs: Iterable[str], finished: Finished) -> list[str]:
        """The configurations without a finished row."""
        name = self.names.get(place)
        return [spec for spec in specs if (place[0], name, spec) not in finished]
