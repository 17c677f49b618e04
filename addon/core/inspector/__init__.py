# SPDX-License-Identifier: GPL-3.0-or-later
"""Why a structure is fast or slow: its nodes, its worst rays, the steps of one ray, and the cost of each level."""
