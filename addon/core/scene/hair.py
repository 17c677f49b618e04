# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour of hair by its pigments."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

EUMELANIN = (0.506, 0.841, 1.653)
PHEOMELANIN = (0.343, 0.733, 1.924)
"""Absorption of pigments per concentration: d'Eon, Francois, Hill, Letteri and Aubry 2011, "An Energy-Conserving Hair
Reflectance Model", as Cycles scales them."""

ROUGHNESS = (5.969, -0.215, 2.532, -10.73, 5.574, 0.245)
"""Coefficients by ascending powers of the azimuthal roughness: Chiang, Bitterli, Tappan and Burley 2016, "A Practical
and Controllable Hair and Fur Model for Production Path Tracing", eq. 9."""


def colour_of_absorption(absorption: Sequence[float], roughness: float) -> tuple[float, ...]:
    """The colour of a mass of hair whose fibres absorb this much per channel."""
    scale = float(np.polynomial.polynomial.polyval(min(max(roughness, 0.0), 1.0), ROUGHNESS))
    return tuple(float(np.exp(-np.sqrt(max(a, 0.0)) * scale)) for a in absorption)


def absorption_of_melanin(melanin: float, redness: float) -> tuple[float, ...]:
    """The absorption per channel of hair with this share of melanin, of which `redness` is pheomelanin."""
    concentration = -np.log(max(1.0 - min(max(melanin, 0.0), 1.0), 1e-4))
    red = min(max(redness, 0.0), 1.0)
    pairs = zip(EUMELANIN, PHEOMELANIN, strict=True)
    return tuple(float(concentration * ((1.0 - red) * dark + red * light)) for dark, light in pairs)
