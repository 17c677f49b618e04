# SPDX-License-Identifier: GPL-3.0-or-later
"""A built tree as tables of its nodes: what each node costs, and which nodes contain a point."""
