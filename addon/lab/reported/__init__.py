# SPDX-License-Identifier: GPL-3.0-or-later
"""Wrong answers of other ray tracers, rebuilt from the public reports about them."""
