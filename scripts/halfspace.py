# SPDX-License-Identifier: GPL-3.0-or-later
"""All commands: `python scripts/halfspace.py COMMAND [options]`; without a command it lists them.

Inside Blender: `blender --background [FILE] --python scripts/halfspace.py -- COMMAND [options]`. The commands that the
README names also have a script each.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from addon.lab.base import inside
from addon.lab.commands import launcher

if __name__ == "__main__":
    # Inside Blender, everything before "--" is Blender's own.
    split = sys.argv.index("--") + 1 if "--" in sys.argv else 1
    sys.exit(launcher.main(sys.argv[split:], inside.adopt))
