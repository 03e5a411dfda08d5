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

from sphinx.cmd.build import main as sphinx
from warpgait.schema import Schema, constants, entry, resolved, schema, variants

SITE = Path("docs/site")
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "validate/README.md")
FOLDERS = ("docs", "validate/examples")


# ---- The reference of keys --------------------------------------------------------------------------------------------


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("$", "\\$").replace("<", "&lt;")


def _table(part: Schema) -> list[str]:
    rows = ["| key | value | default | meaning |", "| --- | --- | --- | --- |"]
    for name, inner in part["properties"].items():
        key = entry(name, inner, name in part.get("required", []))
        words = [f"`{word}`" for word, _ in constants(resolved(inner))]
        default = (
            "required" if key.required else "" if key.default is None else f"`{json.dumps(key.default, ensure_ascii=False)}`"
        )
        rows.append(f"| `{name}` | {' or '.join(words) or key.value} | {default} | {_cell(key.meaning)} |")
    return [*rows, ""]


def _sections(name: str, part: Schema) -> Iterator[str]:
    """A table of the scenario, and the tables in it."""
    whole = resolved(part)
    if "properties" not in whole and not variants(part):
        return
    yield f"## `[{name}]`\n\n{_cell(part.get('description', whole.get('description', '')))}\n"
    for kind, variant in variants(part):
        yield f'### {name}: `kind = "{kind}"`\n\n{_cell(variant.get("description", ""))}\n'
        yield from _table(variant)
    if "properties" in whole:
        yield from _table(whole)
    for key, inner in whole.get("properties", {}).items():
        found = resolved(inner)
        yield from _sections(f"{name}.{key}", inner)
        if isinstance(found.get("items"), dict):
            yield from _sections(f"[{name}.{key}]", found["items"] | {"description": found.get("description", "")})


def reference() -> str:
    """The page of all keys, from the schema."""
    everything = schema()["properties"]
    tables = {key: part for key, part in everything.items() if "properties" in resolved(part) or variants(part)}
    lines = [
        "# Keys of a scenario",
        "",
        "Made from the schema that `warpgait schema` prints; `warpgait.keys()` has the same in Python. Lengths are in m, times in s, angles in rad, unless the table says otherwise.",
        "",
        "## At the top",
        "",
        *_table(schema() | {"properties": {key: part for key, part in everything.items() if key not in tables}}),
    ]
    for name, part in tables.items():
        lines += _sections(name, part)
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
    (source / "keys.md").write_text(reference(), encoding="utf-8")


def main(words: list[str]) -> int:
    """Build the site; returns the exit code."""
    (target,) = map(Path, words)
    lay_out(target / "source")
    code: int = sphinx(["-W", "--keep-going", "-q", "-d", str(target / "doctrees"), str(target / "source"), str(target / "html")])
    return code


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
