# SPDX-License-Identifier: GPL-3.0-or-later
"""What the runs behind a journal were asked for, and what failed: a report of parts can tell what it lacks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from ..base.notes import some
from ..measure.rows import Row, blank

Place = tuple[str, str]
"""A run, and a scene as its command line calls it: it may end before the scene is read and has a name."""

There = set[tuple[str, str, str]]
"""Runs, names of scenes and configurations of finished rows; the run is empty in journals that do not tell it."""


def label(scene: str) -> str:
    """A scene of a command line without its folder, which differs from machine to machine."""
    return PurePath(scene).stem


@dataclass
class Asked:
    """specs: the configurations asked of each scene. names: of scenes that could be read, as their rows have it.
    options: of each run that tells them.

    failures: by place and configuration, the row that tells why, and its order; for a whole scene the configuration is
    empty. What failed may have been mended since: only what is not among the finished rows counts.
    """

    specs: dict[Place, list[str]] = field(default_factory=dict)
    names: dict[Place, str] = field(default_factory=dict)
    options: dict[str, dict[str, Any]] = field(default_factory=dict)
    failures: dict[tuple[str, str, str], tuple[tuple[int, int], Row]] = field(default_factory=dict)

    def begun(self, run: str, scenes: Sequence[str], specs: Sequence[str], options: dict[str, Any]) -> dict[str, Any]:
        """The journal's line about what a run is asked for: these configurations of all these scenes."""
        told = {"run": run, "scenes": list(map(label, scenes)), "specs": list(specs), "options": options}
        return {"asked": told}

    def reached(self, run: str, scene: str, name: str) -> dict[str, Any]:
        """The line about a scene that could be read."""
        return {"reached": {"run": run, "scene": label(scene), "name": name}}

    def failed(self, run: str, scene: str, order: tuple[int, int], row: Row) -> dict[str, Any]:
        """The line about a configuration that failed, or a scene."""
        return {"failed": {"run": run, "scene": label(scene), "order": order, "row": row}}

    def take(self, line: dict[str, Any]) -> bool:
        """Learn a journal's line; whether it is one of these. Raises KeyError, TypeError and ValueError."""
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
            # Of what failed nothing was measured: whichever version tells it, the other columns are empty.
            row = blank() | {"machine": ""} | found["row"]
            self.failures[found["run"], found["scene"], row["spec"]] = (int(scene), int(spec)), row
        else:
            return False
        return True

    def _ask(self, place: Place, specs: Iterable[str]) -> None:
        """Add what is not yet asked of a scene; each time that a run goes on it asks for all again."""
        self.specs[place] = list(dict.fromkeys([*self.specs.get(place, ()), *specs]))

    def merge(self, other: Asked) -> None:
        """Take over what another journal knows."""
        for place, specs in other.specs.items():
            self._ask(place, specs)
        self.names |= other.names
        self.options |= other.options
        self.failures |= other.failures

    def failures_left(self, there: There) -> Iterator[tuple[tuple[int, int], Row]]:
        """The rows of failures that nobody mended, each with its order."""
        for (run, scene, spec), found in self.failures.items():
            wanted = [spec] if spec else self.specs.get((run, scene), [])
            if self._lost((run, scene), wanted, there) or not wanted:
                yield found

    def missing(self, there: There) -> Iterator[str]:
        """What is neither finished nor failed, a line for each scene."""
        for place, specs in self.specs.items():
            failed = {spec for run, scene, spec in self.failures if (run, scene) == place}
            if place not in self.names and "" in failed:
                continue
            lost = [spec for spec in self._lost(place, specs, there) if spec not in failed]
            if lost:
                share = f"all of {len(specs)} rows" if len(lost) == len(specs) else f"{len(lost)} of {len(specs)} rows"
                yield f"{self.names.get(place, place[1])}: missing {share}: {some(lost)}"

    def _lost(self, place: Place, specs: Iterable[str], there: There) -> list[str]:
        """Which of the configurations have no finished row."""
        name = self.names.get(place)
        return [spec for spec in specs if not {(place[0], name, spec), ("", name, spec)} & there]
