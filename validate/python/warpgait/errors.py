"""Errors that a user can act on, and the report that says so."""

from __future__ import annotations

from typing import Any

from .text import escape

REPORT_SCHEMA = 1  # of NAME.report.json


class InputError(ValueError):
    """Something given to warpgait cannot be used. The message says what, where, and what to do; the fields say where, as far as is known."""

    def __init__(self, message: str = "", file: str | None = None, line: int | None = None, key: str | None = None) -> None:
        """A message, and where its cause is."""
        super().__init__(message)
        self.file = file  # as it was named, or the override that set a value
        self.line = line  # from 1
        self.key = key  # of a scenario, such as gait.duty


def error_page(plan: str, message: str) -> str:
    """The page of a plan that could not be judged."""
    plan, message = escape(plan), escape(message)
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{plan}: error</title><h1>{plan}</h1>'
        f"<p><strong>error. There is no verdict on this plan.</strong></p><p>{message}</p></html>\n"
    )


def error_report(plan: str, message: str) -> dict[str, Any]:
    """The report, as plain data, of a plan that could not be judged."""
    return {"schema": REPORT_SCHEMA, "plan": plan, "verdict": "error", "trackable": False, "error": message}
