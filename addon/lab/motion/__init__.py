# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving scenes: animations, and what their frames cost with each way of keeping a structure up to date."""
