# SPDX-License-Identifier: GPL-3.0-or-later
"""Time against the number of triangles."""
