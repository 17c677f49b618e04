# SPDX-License-Identifier: GPL-3.0-or-later
"""Two-level scenes with the interface of a structure that is measured: one structure per mesh, a tree over instances.

The reference and the rays are those of the flattened scene, whose triangles have the same numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from ..scene.instances import InstancedGeometry
from ..scene.workload import Workload, WorkloadError

if TYPE_CHECKING:
    from ..base.interface import Instances, Native, Structure

Layout = Literal["flatten", "two-level"]

LAYOUTS: tuple[Layout, ...] = ("flatten", "two-level")
"""Whether structures are built over the flattened scene, or over each mesh below a tree over the instances."""


def geometry_of(workload: Workload) -> InstancedGeometry:
    """The instances of a workload. Raises WorkloadError if it has none."""
    found = None if workload.kept is None else workload.kept.geometry
    if not isinstance(found, InstancedGeometry):
        raise WorkloadError(f"{workload.name}: two levels need instances, which only scenes of Blender have")
    return found


class TwoLevel:
    """Structures of one configuration over the meshes of a workload, and a tree over the instances.

    top: one of `instances.TOPS`. threads, memory_limit: as for `native.build`. Raises WorkloadError and the exceptions
    of the builds.
    """

    def __init__(
        self, native: Native, workload: Workload, spec: str, top: str, threads: int, memory_limit: int | None
    ) -> None:
        geometry = geometry_of(workload)
        # Build one structure per mesh, then the tree over the instances.
        self.meshes = [
            native.build(mesh.vertices, mesh.triangles, spec, threads=threads, memory_limit=memory_limit)
            for mesh in geometry.meshes
        ]
        self.instances: Instances = native.build_instances(
            self.meshes, geometry.mesh, geometry.matrices, top=top, threads=threads, memory_limit=memory_limit
        )
        self.spec = self.meshes[0].spec
        self.closest = self.instances.closest
        self.occluded = self.instances.occluded

    @property
    def statistics(self) -> dict[str, Any]:
        """Those of the instances."""
        return dict(self.instances.statistics)

    @property
    def routes(self) -> dict[str, dict[str, Any]]:
        """Rays go one by one through the meshes, whatever their batch."""
        route = {**self.meshes[0].routes["closest"], "rays": "single", "counted": True}
        return dict.fromkeys(self.meshes[0].routes, route)


if TYPE_CHECKING:
    AnyLayout = Structure | TwoLevel
    """A native structure over the flattened scene, or in two levels."""
