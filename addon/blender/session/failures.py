# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors that end the work of an operator, reported in Blender."""

from __future__ import annotations

import logging
from typing import Any

from ...core.base import native


def reported(operator: Any, error: BaseException, work: str = "") -> set[str]:
    """Report what ended an operator. Returns the operator's result. Raises what ends the program: see native.reason().

    work: as in "could not `work`", for the log, which gets the error with its trace. Without it only an error that no
    input explains goes there.
    """
    reason = native.reason(error)
    if work or not isinstance(error, (*native.FAILURES, OSError)):
        logging.getLogger(type(operator).__module__).error("Halfspace could not %s", work or "end", exc_info=error)
    operator.report({"ERROR"}, reason)
    return {"CANCELLED"}
