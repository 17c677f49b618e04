# SPDX-License-Identifier: GPL-3.0-or-later
"""Building and rendering, cancelled on demand, and what is kept from one picture to the next."""
