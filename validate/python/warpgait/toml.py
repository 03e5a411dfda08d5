"""Values as TOML text."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from .errors import InputError

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def _text(value: str) -> str:
    """A basic string: JSON's escapes are TOML's, but for the character DEL."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def value_text(key: str, value: Any) -> str:
    """A value as TOML; raises `InputError` with the key for what TOML does not have."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise InputError(f"{key}: {value} is no number that a scenario can have")
        return repr(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(value_text(key, item) for item in value)}]"
    raise InputError(f"{key}: {value!r} is no bool, number, string, list of these, or table")


def _key(key: Any) -> str:
    if not isinstance(key, str):
        raise InputError(f"the key {key!r} is no string")
    return key if _BARE.fullmatch(key) else _text(key)


def table_text(table: Mapping[str, Any], name: str = "") -> str:
    """A table, its own values first, then the tables in it. None leaves a key out."""
    lines, tables = [], []
    for key, value in table.items():
        path = f"{name}.{_key(key)}" if name else _key(key)
        if value is None:
            continue
        if isinstance(value, Mapping):
            tables.append(f"\n[{path}]\n{table_text(value, path)}")
        else:
            lines.append(f"{_key(key)} = {value_text(path, value)}\n")
    return "".join([*lines, *tables])
