# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts that all command lines of the laboratory share."""
