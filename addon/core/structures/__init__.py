# SPDX-License-Identifier: GPL-3.0-or-later
"""The registry of acceleration structures, configurations of them, and settings."""
