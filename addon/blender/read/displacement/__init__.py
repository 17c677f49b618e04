# SPDX-License-Identifier: GPL-3.0-or-later
"""Displacement of surfaces by the nodes of their materials."""
