"""The option `--set KEY=VALUE` of commands that plan."""

from __future__ import annotations

import tomllib
from typing import Any

from ..errors import InputError


def assigned(assignments: list[str]) -> dict[str, Any]:
    """Values by dotted key; a value is TOML, or a bare word as a string. Raises `InputError`."""
    found: dict[str, Any] = {}
    for assignment in assignments:
        key, equals, value = assignment.partition("=")
        if not equals or not key.strip():
            raise InputError(f"--set {assignment}: expected KEY=VALUE, such as gait.kind=trot")
        try:
            parsed = tomllib.loads(f"value = {value}")
            if list(parsed) != ["value"]:
                raise InputError(f"--set {assignment}: expected one value")
            found[key.strip()] = parsed["value"]
        except tomllib.TOMLDecodeError:
            found[key.strip()] = value.strip()
    return found
