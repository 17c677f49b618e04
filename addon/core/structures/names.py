# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for people of the options of choices, for registries whose rows have no `labels`."""

from __future__ import annotations

NAMES = {
    "traversal": {
        "auto": "Automatic",
        "dir": "By distances",
        "wide": "Wide nodes",
        "boxes": "Boxes",
        "tile8": "Tiles of 64",
        "tile16": "Tiles of 256",
        "p4": "Packets of 4",
        "p8": "Packets of 8",
        "p16": "Packets of 16",
        "ta-b": "TA-B",
        "ta-a": "TA-A",
        "ta-b-poly": "TA-B, oblique",
        "seq": "Sequential",
        "rope": "Ropes",
        "ropetree": "Rope trees",
        "ordered": "Nearest first",
    },
    "costs": {"fitted": "Measured", "thesis": "Of the thesis"},
    "robust": {"widen": "Error bounds", "none": "As published"},
    "rule": {"text": "As in its text", "code": "As in its code"},
    "shadow": {"none": "As other rays", "cache": "Blocker first", "beam": "Beams"},
    "ties": {"clean": "To one side", "pbrt": "As in pbrt"},
}
"""By the names of parameters; other options are their own names."""


def name_of(parameter: str, option: str) -> str:
    """The name of an option: the one listed here, or the value as a word."""
    return NAMES.get(parameter, {}).get(option) or option.replace("-", " ").capitalize()
