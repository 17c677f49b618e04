# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the `addon` package importable from a checkout, under the name that the tests use."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))
