# SPDX-License-Identifier: GPL-3.0-or-later
"""Locks the file of a loaded native module as Windows does: no program can remove it or write into it.

Windows itself locks it; elsewhere the functions that Blender's installer calls fail as they do there. A locked file
can be renamed. Whether the folders around it can is not documented, so that both are tried.
"""

import builtins
import errno
import os
import sys
from pathlib import Path
from typing import Any

_locked: set[str] = set()


def lock(file: str, folders_too: bool) -> None:
    """Lock this file until the process ends. folders_too: its folders cannot be renamed. Without effect on Windows."""
    if sys.platform == "win32":
        return
    _locked.add(os.path.realpath(file))
    if len(_locked) == 1:
        _patch(folders_too)


def still_there() -> bool:
    """Whether all locked files are there, under whatever name."""
    return all(Path(path).is_file() for path in _locked)


def _patch(folders_too: bool) -> None:
    """Replace the functions that remove, rename and open files."""
    remove, rename, opened = os.unlink, os.rename, builtins.open

    def removed(path: Any, *arguments: Any, dir_fd: int | None = None, **named: Any) -> None:
        # With the number of a folder the name is alone.
        place = f"/proc/self/fd/{dir_fd}/{path}" if dir_fd is not None else path
        _refuse_if(os.path.realpath(place) in _locked, path)
        remove(path, *arguments, dir_fd=dir_fd, **named)

    def renamed(source: Any, target: Any, *arguments: Any, **named: Any) -> None:
        real = os.path.realpath(source)
        inside = [path for path in _locked if path.startswith(real + os.sep)]
        _refuse_if(bool(inside) and folders_too, source)
        rename(source, target, *arguments, **named)
        for path in [path for path in _locked if path == real or path in inside]:
            _locked.remove(path)
            _locked.add(os.path.realpath(target) + path.removeprefix(real))

    def open_if_free(file: Any, mode: str = "r", *arguments: Any, **named: Any) -> Any:
        is_path = isinstance(file, str | os.PathLike)
        _refuse_if(is_path and "w" in mode and os.path.realpath(file) in _locked, file)
        return opened(file, mode, *arguments, **named)

    os.unlink = os.remove = removed  # type: ignore[assignment]
    os.rename, builtins.open = renamed, open_if_free  # type: ignore[assignment]


def _refuse_if(locked: bool, path: Any) -> None:
    """Raise what Windows raises."""
    if locked:
        raise PermissionError(errno.EACCES, "Access is denied", os.fspath(path))
