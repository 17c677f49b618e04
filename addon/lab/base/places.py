# SPDX-License-Identifier: GPL-3.0-or-later
"""Where commands write by default."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
"""The clone, with the documents; meaningless where the package is installed."""

OUT = ROOT / "out" if (ROOT / "native" / "Cargo.toml").is_file() else Path("out")
"""The folder `out` of the clone, or, where the package is installed, of the current folder."""
