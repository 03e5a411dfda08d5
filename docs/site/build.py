"""Builds the site of the documentation: lays its pages out, makes the reference of the scenario's keys from the schema, and runs Sphinx.

    python docs/site/build.py target/docs

Run at the top of the repository, with a Python that has the package `warpgait` and scripts/requirements-docs.txt. Warnings, such as links
that lead nowhere, are errors. Nothing is fetched.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sphinx.cmd.build import main as sphinx

from warpgait import _native

SITE = Path("docs/site")
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "validate/README.md")
FOLDERS = ("docs", "validate/examples")


# ---- The reference of keys --------------------------------------------------------------------------------------------


def _resolved(schema: dict[str, Any], defs: dict[str, Any]) -> dict[str, Any]:
    """A schema with what it refers to; its own words come first."""
    if "$ref" in schema:
        return _resolved(defs[schema["$ref"].rpartition("/")[2]] | {k: v for k, v in schema.items() if k != "$ref"}, defs)
    for key in ("anyOf", "oneOf", "allOf"):
        parts = [part for part in schema.get(key, []) if part.get("type") != "null"]
        if len(parts) == 1:
            return _resolved(parts[0] | {k: v for k, v in schema.items() if k != key}, defs)
    return schema


def _constants(schema: dict[str, Any]) -> list[tuple[str, str]]:
    """The words that a value may be, with what they mean."""
    if "enum" in schema:
        return [(str(word), "") for word in schema["enum"] if word is not None]
    parts = schema.get("oneOf", schema.get("anyOf", []))
    found = [pair for part in parts for pair in _constants(part | {"description": part.get("description", "")})]
    return found or ([(str(schema["const"]), schema.get("description", ""))] if "const" in schema else [])


def _range(schema: dict[str, Any]) -> str:
    low, high = schema.get("minimum", schema.get("exclusiveMinimum")), schema.get("maximum", schema.get("exclusiveMaximum"))
    if low is None and high is None:
        return ""
    return f" from {low:g}" * (low is not None) + f" to {high:g}" * (high is not None)


def _kind(schema: dict[str, Any], defs: dict[str, Any]) -> str:
    """What a value is, in words."""
    schema = _resolved(schema, defs)
    words = _constants(schema)
    if words:
        return " or ".join(f"`{word}`" for word, _ in words)
    kinds = schema.get("type", [])
    kinds = [kind for kind in (kinds if isinstance(kinds, list) else [kinds]) if kind != "null"]
    if kinds == ["array"]:
        items = schema.get("items")
        count = schema.get("minItems") if schema.get("minItems") == schema.get("maxItems") else None
        each = _kind(items, defs) if isinstance(items, dict) else "values"
        return f"{count} values: {each}" if count else f"list: {each}"
    if kinds == ["object"]:
        return "table"
    names = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}
    named = " or ".join(names.get(kind, kind) for kind in kinds)
    if not named:
        named = " or ".join(dict.fromkeys(_kind(part, defs) for part in schema.get("anyOf", schema.get("oneOf", []))))
    return named + _range(schema)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("$", "\\$").replace("<", "&lt;")


def _table(schema: dict[str, Any], defs: dict[str, Any]) -> list[str]:
    rows = ["| key | value | default | meaning |", "| --- | --- | --- | --- |"]
    required = schema.get("required", [])
    for key, part in schema["properties"].items():
        resolved = _resolved(part, defs)
        meaning = _cell(part.get("description", resolved.get("description", "")))
        for word, what in _constants(resolved):
            if what:
                meaning += f" `{word}`: {_cell(what)}"
        default = part.get("default", resolved.get("default"))
        shown = "required" if key in required else "" if default is None or isinstance(default, dict) else f"`{json.dumps(default, ensure_ascii=False)}`"
        rows.append(f"| `{key}` | {_kind(part, defs)} | {shown} | {meaning} |")
    return [*rows, ""]


def _sections(name: str, schema: dict[str, Any], defs: dict[str, Any]) -> Iterator[str]:
    """A table of the scenario, and the tables in it."""
    resolved = _resolved(schema, defs)
    variants = [part for part in resolved.get("oneOf", []) if "properties" in part]
    if variants:
        yield f"## `[{name}]`\n\n{_cell(resolved.get('description', ''))}\n"
        for variant in variants:
            kind = variant["properties"]["kind"]["const"]
            yield f'### {name}: `kind = "{kind}"`\n\n{_cell(variant.get("description", ""))}\n'
            yield from _table(variant, defs)
    elif "properties" in resolved:
        yield f"## `[{name}]`\n\n{_cell(schema.get('description', ''))}\n"
        yield from _table(resolved, defs)
        for key, part in resolved["properties"].items():
            inner = _resolved(part, defs)
            items = _resolved(inner["items"], defs) if isinstance(inner.get("items"), dict) else {}
            if "properties" in inner:
                yield from _sections(f"{name}.{key}", part, defs)
            elif "properties" in items:
                yield from _sections(f"[{name}.{key}]", inner["items"] | {"description": inner.get("description", "")}, defs)


def keys(schema: dict[str, Any]) -> str:
    """The page of all keys, from the schema."""
    defs = schema["$defs"]
    tables = {key: part for key, part in schema["properties"].items() if {"properties", "oneOf"} & _resolved(part, defs).keys()}
    tables = {key: part for key, part in tables.items() if not _constants(_resolved(part, defs))}
    top = schema | {"properties": {key: part for key, part in schema["properties"].items() if key not in tables}}
    lines = [
        "# Keys of a scenario",
        "",
        "Made from the schema that `warpgait schema` prints. Lengths are in m, times in s, angles in rad, unless the table says otherwise.",
        "",
        "## At the top",
        "",
        *_table(top, defs),
    ]
    for name, part in tables.items():
        lines += _sections(name, part, defs)
    return "\n".join(lines) + "\n"


# ---- The pages --------------------------------------------------------------------------------------------------------


def lay_out(source: Path) -> None:
    """Copy the pages and the pictures, each where it is in the repository, so that their links hold."""
    shutil.rmtree(source, ignore_errors=True)
    for folder in FOLDERS:
        shutil.copytree(folder, source / folder, ignore=shutil.ignore_patterns("site", "__pycache__"))
    for page in PAGES:
        (source / page).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(page, source / page)
    for page in SITE.glob("*.md"):
        shutil.copy(page, source / page.name)
    shutil.copy(SITE / "conf.py", source / "conf.py")
    (source / "keys.md").write_text(keys(json.loads(_native.schema())), encoding="utf-8")


def main(words: list[str]) -> int:
    """Build the site; returns the exit code."""
    (target,) = map(Path, words)
    lay_out(target / "source")
    code: int = sphinx(["-W", "--keep-going", "-q", "-d", str(target / "doctrees"), str(target / "source"), str(target / "html")])
    return code


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
