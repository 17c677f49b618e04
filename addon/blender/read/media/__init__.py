# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume shaders and the grids of volume objects."""
