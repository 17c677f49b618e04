# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands whose command lines are tested alike."""

from __future__ import annotations

import animations
import bench
import choose
import claims
import compare
import export
import extraction
import growth
import inspector
import overlay_picture
import package
import pictures
import render
import reported
import stability
import thesis

COMMANDS = {
    "animations": animations,
    "bench": bench,
    "choose": choose,
    "claims": claims,
    "compare": compare,
    "export": export,
    "extraction": extraction,
    "growth": growth,
    "inspector": inspector,
    "overlay_picture": overlay_picture,
    "package": package,
    "pictures": pictures,
    "render": render,
    "reported": reported,
    "stability": stability,
    "thesis": thesis,
}
