"""The keys of scenarios, from the schema of the compiled part: what each may be, its default, and what it means."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from . import _native
from .errors import InputError
from .text import escape

Schema = dict[str, Any]


@dataclass(frozen=True)
class Key:
    """A key of a scenario."""

    name: str  # dotted, such as gait.duty
    variant: str | None  # the kind of terrain that has it, where not all have
    value: str  # what it may be, in words
    required: bool
    default: Any  # None where there is none, or where it depends on other values, as `meaning` then says
    meaning: str


class Keys(tuple[Key, ...]):
    """Several keys; a notebook shows a table."""

    __slots__ = ()

    def __repr__(self) -> str:
        """One line for each."""
        return "\n".join(
            f"{key.name}: {key.value}{'' if key.default is None else f', default {key.default}'}. {key.meaning}" for key in self
        )

    def _repr_html_(self) -> str:
        body = "".join(
            f"<tr><td><code>{escape(key.name)}</code>{f' ({escape(key.variant)})' if key.variant else ''}</td><td>{escape(key.value)}</td>"
            f"<td>{'required' if key.required else '' if key.default is None else escape(json.dumps(key.default))}</td>"
            f"<td style='text-align:left'>{escape(key.meaning)}</td></tr>"
            for key in self
        )
        return f"<table><tr><th>key</th><th>value</th><th>default</th><th>meaning</th></tr>{body}</table>"


@cache
def schema() -> Schema:
    """The JSON Schema of scenarios."""
    found: Schema = json.loads(_native.schema())
    return found


def resolved(part: Schema) -> Schema:
    """A part of the schema with what it refers to; its own words come first."""
    if "$ref" in part:
        target = schema()["$defs"][part["$ref"].rpartition("/")[2]]
        return resolved(target | {key: value for key, value in part.items() if key != "$ref"})
    for key in ("anyOf", "oneOf", "allOf"):
        others = [each for each in part.get(key, []) if each.get("type") != "null"]
        if len(others) == 1:
            return resolved(others[0] | {name: value for name, value in part.items() if name != key})
    return part


def _choices(part: Schema) -> list[Schema]:
    return part.get("oneOf") or part.get("anyOf") or []


def _text(part: Schema) -> str:
    return " ".join(str(part.get("description", "")).split())


def constants(part: Schema) -> list[tuple[str, str]]:
    """The words that a value may be, with what they mean."""
    if "enum" in part:
        return [(str(word), "") for word in part["enum"] if word is not None]
    found = [pair for each in _choices(part) for pair in constants(each)]
    return found or ([(str(part["const"]), _text(part))] if "const" in part else [])


def variants(part: Schema) -> list[tuple[str, Schema]]:
    """The kinds of a table that has other keys for each kind."""
    found = [each for each in resolved(part).get("oneOf", []) if "properties" in each]
    return [(each["properties"]["kind"]["const"], each) for each in found]


def _range(part: Schema) -> str:
    low, high = part.get("minimum", part.get("exclusiveMinimum")), part.get("maximum", part.get("exclusiveMaximum"))
    return ("" if low is None else f" from {low:g}") + ("" if high is None else f" to {high:g}")


def value_words(part: Schema) -> str:
    """What a value may be, in words."""
    part = resolved(part)
    words = constants(part)
    if words:
        return " or ".join(word for word, _ in words)
    kinds = part.get("type", [])
    kinds = [kind for kind in (kinds if isinstance(kinds, list) else [kinds]) if kind != "null"]
    if kinds == ["array"]:
        count = part.get("minItems") if part.get("minItems") == part.get("maxItems") else None
        each = value_words(part["items"]) if isinstance(part.get("items"), dict) else "values"
        return f"{count} values: {each}" if count else f"list: {each}"
    names = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false", "object": "table"}
    named = " or ".join(names.get(kind, kind) for kind in kinds)
    if not named:
        named = " or ".join(dict.fromkeys(value_words(each) for each in _choices(part)))
    return named + _range(part)


def entry(name: str, part: Schema, required: bool, variant: str | None = None) -> Key:
    """What the schema says about a key."""
    whole = resolved(part)
    meaning = _text(part) or _text(whole)
    told = "; ".join(f"{word}: {what}" for word, what in constants(whole) if what)
    default = part.get("default", whole.get("default"))
    default = None if isinstance(default, dict) else default
    return Key(name, variant, value_words(part), required, default, f"{meaning} {told}".strip())


def _walk(part: Schema, path: str, variant: str | None = None) -> Iterator[Key]:
    whole = resolved(part)
    for kind, each in variants(part):
        yield from _walk(each, path, kind)
    for key, inner in whole.get("properties", {}).items():
        name = f"{path}.{key}" if path else key
        found = resolved(inner)
        if "properties" in found or variants(inner):
            yield from _walk(inner, name, variant)
        else:
            yield entry(name, inner, key in whole.get("required", []), variant)


def keys(name: str = "") -> Keys:
    """The keys of a scenario, all or those under `name`, such as `gait` or `gait.duty`; raises `InputError` if there is none."""
    found = Keys(key for key in _walk(schema(), "") if not name or key.name == name or key.name.startswith(f"{name}."))
    if not found:
        raise InputError(f"{name}: there is no such key; tables are {', '.join(schema()['properties'])}", key=name)
    return found
