# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands whose command lines are tested alike."""

from __future__ import annotations

from addon.lab.commands import (
    bench,
    choose,
    claims,
    compare,
    export,
    inspector,
    render,
    reported,
    stability,
    thesis,
)
from scripts import package
from scripts.dev import animations, extraction, overlay_picture, pictures

COMMANDS = {
    "animations": animations,
    "bench": bench,
    "choose": choose,
    "claims": claims,
    "compare": compare,
    "export": export,
    "extraction": extraction,
    "inspector": inspector,
    "overlay_picture": overlay_picture,
    "package": package,
    "pictures": pictures,
    "render": render,
    "reported": reported,
    "stability": stability,
    "thesis": thesis,
}
