# SPDX-License-Identifier: GPL-3.0-or-later
"""Structures that follow moved triangles: fitted where only vertices moved, built again where that costs rays too much.

A fitted structure has the nodes of its build around the triangles where they are now, so its answers are the same and
only the time of its rays differs.
"""

from __future__ import annotations

import hashlib
from functools import cache
from typing import TYPE_CHECKING, Any

from ..base.native import first_line
from ..structures import specs
from ..structures.trees import InUse

if TYPE_CHECKING:
    from ..base.interface import Monitor, Native, Structure
    from ..scene.instances import Mesh
    from ..scene.scene import Geometry

DRIFT = 1.5
"""Largest expected cost of a ray in a fitted structure, as a multiple of that at its build; beyond it, it is built
again (chosen: rays then take about half as long again).
"""

REFITTED = "refitted"
TOO_DEAR = f"rebuilt: rays through the fitted tree would cost more than {DRIFT:g} times as much"
REFUSED = "rebuilt: "
"""Followed by the reason of the native module."""


def topology(triangles: Geometry | Mesh) -> bytes:
    """A digest of the number of vertices and of the triangles' indices: equal where only vertices can have moved."""
    digest = hashlib.blake2b(str((triangles.vertices.shape, triangles.triangles.shape)).encode(), digest_size=16)
    digest.update(triangles.triangles.data if triangles.triangles.size else b"")
    return digest.digest()


def fitted(
    native: Native, before: Structure, triangles: Geometry | Mesh, threads: int, monitor: Monitor
) -> tuple[Structure | None, str]:
    """The structure fitted to these triangles, which are those that it was built over or have moved since, and what was
    done. None, and the reason, if it must be built again. Raises Cancelled through the monitor.
    """
    try:
        structure = before.refit(triangles.vertices, threads=threads, monitor=monitor)
    except native.RefitError as error:
        return None, REFUSED + first_line(error)
    statistics = structure.statistics
    if statistics["sah_cost"] > DRIFT * statistics["sah_cost_built"]:
        return None, TOO_DEAR
    return structure, REFITTED


@cache
def can_fit(native: Native, spec: str) -> bool:
    """Whether structures of this configuration can be fitted at all; the nodes of others divide space."""
    structure = specs.tiny(native, spec)
    try:
        structure.refit(specs.CORNERS)
    except native.RefitError:
        return False
    return True


def duration(statistics: dict[str, Any]) -> str:
    """The origin of a picture's structure, a build or a refit, and its time, as shown to the user."""
    if statistics.get("refits"):
        return f"Refitted {statistics['refit_seconds']:.3f} s"
    return f"Build {statistics['build_seconds']:.2f} s"


class Followed(InUse):
    """The newest structure in use of each topology and configuration."""


FOLLOWED = Followed()
"""Blender's structures."""
