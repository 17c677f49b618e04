# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements of the open scene: speed, comparison, cost maps."""
