# SPDX-License-Identifier: GPL-3.0-or-later
"""The output folder of a benchmark: a journal of rows that survives interruption, and files written atomically."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..measure.rows import lacks, without_times
from .asked import Asked, Finished, label

if TYPE_CHECKING:
    from ..base.interface import Native

Kept = Any
"""A row of a journal: `rows.Row` of the benchmark, or the JSON object of another command."""

SCHEMA = 1
"""Version of the layout of bench.json."""

JOURNAL = "rows.jsonl"
"""File name of the journal of a process that measures alone."""


class FolderError(OSError):
    """The folder cannot be written, or a file in it cannot be read. The message names it."""


def write(path: Path, text: str) -> None:
    """Write one file, as `write_all` does."""
    write_all({path: text})


def write_all(files: Mapping[Path, str | bytes]) -> None:
    """Write files atomically: none is ever visible half-written, and after an error all old ones are back in place.

    files: contents by path; texts are written as UTF-8, and what a name of a file contains that is none as escapes.
    Raises FolderError, which names the file that cannot be
    written, and old files that could not be restored.
    """
    complete: list[tuple[Path, Path]] = []
    try:
        for path in files:
            with writing(path):
                if path.is_dir():
                    raise FolderError(f"{path}: cannot be written: it is a folder")
        for path, content in files.items():
            with writing(path):
                handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name + ".")
                complete.append((Path(temporary), path))
                with os.fdopen(handle, "wb") as file:
                    file.write(content if isinstance(content, bytes) else content.encode("utf-8", "backslashreplace"))
                    file.flush()
                    os.fsync(file.fileno())
                # mkstemp makes files that only their owner can read; give the report the user's default permissions.
                Path(temporary).chmod(0o666 & ~_umask())
        _put_in_place(complete)
    except BaseException:
        for one, _ in complete:
            _remove(one)
        raise


def _put_in_place(complete: Sequence[tuple[Path, Path]]) -> None:
    """Rename new files (temporary name, name) to their names, all or none. Raises FolderError.

    Errors here cannot be detected earlier, such as a file locked by another program. Old files keep a second name until
    all renames are done.
    """
    old: list[tuple[Path, Path | None]] = []
    try:
        # Give each old file a second name, then rename the new one.
        for new, path in complete:
            kept = new.with_name(new.name + ".old") if os.path.lexists(path) else None
            old.append((path, kept))
            with writing(path):
                if kept is not None:
                    _put_aside(path, kept)
                new.replace(path)
    except BaseException as error:
        # After an error, give all old files their names back.
        failed = [line for path, kept in old if (line := _put_back(path, kept))]
        if failed and isinstance(error, Exception):
            raise FolderError("; ".join(filter(None, [str(error), *failed]))) from error
        raise
    for _, kept in old:
        if kept is not None:
            _remove(kept)


def _put_aside(path: Path, kept: Path) -> None:
    """Give an old file a second name."""
    if not path.is_symlink():  # systems differ in hard links to symbolic links
        with contextlib.suppress(OSError):
            kept.hardlink_to(path)
            return
    # Hard links may be unsupported, or denied for another user's file: for a moment the file has only its second name.
    path.replace(kept)


def _put_back(path: Path, kept: Path | None) -> str:
    """Restore an old file's name, or remove the new file if there was none. Returns what failed, or ""."""
    try:
        if kept is None:
            path.unlink(missing_ok=True)
        elif not os.path.lexists(kept):
            pass  # the loop ended before this file was set aside
        elif path.exists() and path.samefile(kept):
            _remove(kept)  # not replaced yet; a rename between two names of one file does nothing
        else:
            kept.replace(path)
    except OSError:
        return f"{path} cannot be removed" if kept is None else f"{path} cannot be put back: the old one is {kept}"
    return ""


def _remove(path: Path) -> None:
    """Remove a temporary name. Errors are ignored in favour of the one that led here."""
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)


def _umask() -> int:
    """The user's umask. Python can only read it by setting another one."""
    kept = os.umask(0o077)
    os.umask(kept)
    return kept


def prepare_folder(folder: Path) -> None:
    """Create the folder and check that it is writable. Raises FolderError."""
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass


@contextlib.contextmanager
def writing(path: Path | None) -> Iterator[None]:
    """Turn an OSError, such as a full disk, into a FolderError with the name of this file or folder."""
    try:
        yield
    except FolderError:
        raise
    except OSError as error:
        raise FolderError(f"{path}: cannot be written: {error.strerror or error}") from error


def machine(native: Native) -> dict[str, Any]:
    """Properties of the machine that the numbers depend on. `name` identifies it in rows."""
    return {
        "name": platform.node(),
        "system": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "level": native.level(),
    }


def native_fingerprint(native: Native) -> str:
    """A hash of the compiled module: rows measured with another build of it are not reused."""
    folder = Path(native.__file__ or "").parent
    own = sorted(p for p in folder.glob("halfspace_native*") if p.suffix in {".so", ".pyd"})
    digest = hashlib.sha256(native.__version__.encode())
    for path in own:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def key(*parts: Any) -> str:
    """A short hash of everything that a row depends on."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


@dataclass(frozen=True)
class Entry:
    """A finished row. order: its place among all rows of the same command line. run: the run it belongs to, see
    `Asked`.
    """

    key: str
    order: tuple[int, int]
    row: Kept
    run: str = ""

    @property
    def is_benchmark(self) -> bool:
        """Whether it is a row of a benchmark; other commands may keep rows of their own in the same folder."""
        return "scene" in self.row


class Journal:
    """Finished rows, one JSON line each, appended as they come.

    shard: the name of this process's part of a sweep; parts that share a folder write their own files, and each reads
    the rows of all. machines: by name, those on which the rows were measured. options: of the last run. asked: the
    requested work of all runs. Raises FolderError.
    """

    def __init__(self, folder: Path, shard: str = "") -> None:
        self._path = folder / (f"rows-{shard}.jsonl" if shard else JOURNAL)
        self.entries: dict[str, Entry] = {}
        self.machines: dict[str, dict[str, Any]] = {}
        self.options: dict[str, Any] = {}
        self.asked = Asked()
        self.disagreements: list[str] = []
        # Whether the last line is incomplete. The next line ends it, so that a mere reader leaves the file unchanged.
        self._torn = False
        for path in sorted(folder.glob("rows*.jsonl")):
            self._read(path)

    def add(self, entry: Entry, machine: dict[str, Any]) -> None:
        """Append a finished row and flush it to disk before returning. Raises FolderError."""
        if self.machines.get(machine["name"]) != machine:
            self._append({"machine": machine})
            self.machines[machine["name"]] = machine
        self._append({"key": entry.key, "order": entry.order, "row": entry.row, "run": entry.run})
        self.entries[entry.key] = entry

    def begin(self, options: dict[str, Any]) -> None:
        """Record the options of the rows to come."""
        if self.options != options:
            self._append({"options": options})
            self.options = options

    def ask(self, run: str, scenes: Sequence[str], specs: Sequence[str]) -> None:
        """Record the requested rows of a run: these configurations of all these scenes, with the recorded options."""
        named = list(map(label, scenes))
        self._record({"asked": {"run": run, "scenes": named, "specs": list(specs), "options": self.options}})

    def reach(self, run: str, scene: str, name: str) -> None:
        """Record that a scene of a run was read, and its name in rows."""
        self._record({"reached": {"run": run, "scene": label(scene), "name": name}})

    def fail(self, run: str, scene: str, order: tuple[int, int], row: Kept) -> None:
        """Record a row that failed, or a whole scene if its configuration is empty."""
        self._record({"failed": {"run": run, "scene": label(scene), "order": order, "row": row}})

    def _record(self, line: dict[str, Any]) -> None:
        self.asked.take(line)
        self._append(line)

    def missing(self) -> list[str]:
        """One line per scene with configurations that are neither finished nor failed."""
        return list(self.asked.missing(self._finished()))

    def rows(self) -> list[Kept]:
        """The finished rows and those of failures that no later run replaced, in order."""
        found = [(entry.order, entry.row) for entry in self.entries.values() if entry.is_benchmark]
        found += self.asked.failures_left(self._finished())
        return [row for _, row in sorted(found, key=lambda item: item[0])]

    def _finished(self) -> Finished:
        """Run, scene and configuration of each finished row of a benchmark."""
        own = (entry for entry in self.entries.values() if entry.is_benchmark)
        return {(entry.run, entry.row["scene"], entry.row["spec"]) for entry in own}

    def lacking(self) -> dict[str, str]:
        """By key, the missing columns of benchmark rows that a report needs: rows of another version of the program."""
        found = {}
        for key, entry in self.entries.items():
            column = lacks(entry.row) if entry.is_benchmark else None
            if column is not None:
                place = f"{entry.row.get('scene')}, {entry.row.get('spec')}"
                found[key] = f"the row of {place} has no {column!r}, as those of another version: measure it again"
        return found

    def merge(self, other: Journal) -> None:
        """Add the rows of another journal, in memory only."""
        self.machines |= other.machines
        self.asked.merge(other.asked)
        self.disagreements += other.disagreements
        self.options = self.options or other.options
        for entry in other.entries.values():
            self._take(entry)

    def _take(self, entry: Entry) -> None:
        """Add an entry; a duplicate with other results is recorded as a disagreement."""
        known = self.entries.setdefault(entry.key, entry)
        if not entry.is_benchmark:
            return
        if (lacks(known.row) is None) != (lacks(entry.row) is None):
            # Keep the complete one of two measurements of the same row.
            self.entries[entry.key] = known if lacks(known.row) is None else entry
            return
        if without_times(known.row) != without_times(entry.row):
            where = " and ".join(sorted({str(row.get("machine")) for row in (known.row, entry.row)}))
            self.disagreements.append(f"{entry.row['scene']}, {entry.row.get('spec')}: measured twice, on {where}")

    def _read(self, path: Path) -> None:
        try:
            text = path.read_text(encoding="utf-8", errors="replace")
        except OSError as error:
            raise FolderError(f"{path}: cannot be read: {error.strerror or error}") from error
        for line in text.splitlines():
            try:
                found = json.loads(line)
                if "machine" in found:
                    self.machines[found["machine"]["name"]] = found["machine"]
                elif "options" in found:
                    self.options = found["options"]
                elif not self.asked.take(found):
                    scene, spec = found["order"]
                    entry = Entry(found["key"], (int(scene), int(spec)), found["row"], found.get("run", ""))
                    if not entry.is_benchmark:
                        self.entries[entry.key] = entry  # the last measurement wins
                    self._take(entry)
            except (ValueError, KeyError, TypeError):
                # An incomplete line, left by a process that was interrupted; its row is measured again.
                continue
        if path == self._path:
            self._torn = bool(text) and not text.endswith("\n")

    def _append(self, line: dict[str, Any]) -> None:
        text = "\n" * self._torn + json.dumps(line, allow_nan=False) + "\n"
        self._torn = True
        with writing(self._path), self._path.open("a", encoding="utf-8", newline="\n") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        self._torn = False


def kept(
    journal: Journal | None, key: str, order: tuple[int, int], machine: dict[str, Any], measure: Callable[[], Kept]
) -> Kept:
    """The row of this key: that of the journal, or a measured one, which is then added. Raises FolderError."""
    if journal is None:
        return measure()
    if key not in journal.entries:
        journal.add(Entry(key, order, measure()), machine)
    return journal.entries[key].row


def document(
    native: Native,
    rows: list[Kept],
    options: dict[str, Any],
    machines: Mapping[str, dict[str, Any]] | None = None,
    missing: Sequence[str] = (),
) -> dict[str, Any]:
    """The content of bench.json.

    machines: all known ones, by name; if rows name theirs, the others are omitted. missing: requested rows that are
    absent; without any, the key is omitted.

    Keys of the result: machine: where it was written. machines: where the rows were measured. native: a hash of the
    writer's compiled module; rows of a run were measured with the same build, those of a merge with the builds of their
    machines.
    """
    here = machine(native)
    named = {row["machine"] for row in rows if "machine" in row}
    used = {name: facts for name, facts in (machines or {}).items() if name in named or not named}
    return {
        "schema": SCHEMA,
        "project_version": native.__version__,
        "native": native_fingerprint(native),
        "machine": here,
        "machines": used or {here["name"]: here},
        "options": options,
        **({"missing": list(missing)} if missing else {}),
        "rows": rows,
    }


def _processor() -> str:
    if sys.platform.startswith("linux"):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
