# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes rendered with Halfspace and with Cycles, and the comparison of both pictures."""
