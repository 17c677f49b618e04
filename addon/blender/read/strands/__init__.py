# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair curves, particle hair and point clouds, which become tubes and spheres of triangles."""
