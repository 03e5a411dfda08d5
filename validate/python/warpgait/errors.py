"""Errors that a user can act on, and the report that says so."""

from __future__ import annotations

from typing import Any

REPORT_SCHEMA = 1  # of NAME.report.json


class InputError(ValueError):
    """Something given to warpgait cannot be used. The message says what, where, and what to do."""


def error_report(plan: str, message: str) -> dict[str, Any]:
    """The report, as plain data, of a plan that could not be judged."""
    return {"schema": REPORT_SCHEMA, "plan": plan, "verdict": "error", "trackable": False, "error": message}
