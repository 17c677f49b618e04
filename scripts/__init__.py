# SPDX-License-Identifier: GPL-3.0-or-later
"""What is run in a clone of the repository."""
