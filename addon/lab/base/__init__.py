# SPDX-License-Identifier: GPL-3.0-or-later
"""What all command lines of the laboratory share."""
