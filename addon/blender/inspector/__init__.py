# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector's operators: nodes of the tree, worst rays, costs of levels, files."""
