# SPDX-License-Identifier: GPL-3.0-or-later
"""The names that Cryptomatte distinguishes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.cryptomatte import identities


@dataclass(frozen=True)
class Mattes:
    """Names of what is in a scene.

    objects: by the name in `Geometry.runs`, an object's name and that of its asset, its topmost parent. materials: of
    each of the scene's materials.
    """

    objects: dict[str, tuple[str, str]] = field(default_factory=dict)
    materials: tuple[str, ...] = ()

    def arrays(self, runs: list[tuple[int, str]]) -> dict[str, NDArray[Any]]:
        """The identities as the native module takes them. runs: number of triangles and name of each run, in order."""
        named = [part for _, name in runs for part in self.objects.get(name, (name, name))]
        return {
            "identities": identities(named).view(np.uint32).reshape(-1, 2),
            "material_identities": identities(self.materials).view(np.uint32),
        }

    def names(self) -> dict[str, set[str]]:
        """The names in the mattes, by the beginning of the names of their passes."""
        return {
            "CryptoObject": {name for name, _ in self.objects.values()},
            "CryptoMaterial": set(self.materials),
            "CryptoAsset": {asset for _, asset in self.objects.values()},
        }
