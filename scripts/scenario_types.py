"""Makes the types of scenarios in Python, validate/python/warpgait/scenario_types.py, from the schema of the compiled part.

    python scripts/scenario_types.py            # write the file
    python scripts/scenario_types.py --check    # say whether it is as it should be

Run at the top of the repository, with a Python that has the package `warpgait`. CI checks it: `validate/tests/test_scenario_types.py`.
"""

from __future__ import annotations

import keyword
import sys
import textwrap
from pathlib import Path
from typing import Any

from warpgait.schema import constants, schema, variants

TARGET = Path("validate/python/warpgait/scenario_types.py")
WIDTH = 140
# Keyword arguments of `Scenario` that may be something else than their table.
BESIDES = {"robot": "Robot | str", "terrain": "Terrain", "gait": "GaitKind", "start": "Numbers", "goal": "Numbers"}
NAMES = {"number": "float", "integer": "int", "string": "str", "boolean": "bool"}
HEAD = '''"""The tables and keys of scenarios as types. Made by scripts/scenario_types.py from the schema; what `warpgait schema` prints has the ranges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from .scenario import Robot
    from .surface import Terrain

Numbers: TypeAlias = Sequence[float] | npt.NDArray[np.floating[Any] | np.integer[Any]]
"""Several numbers, such as a position."""
'''

Schema = dict[str, Any]


def is_table(part: Schema) -> bool:
    """Whether a definition has keys of its own."""
    return "properties" in part or bool(variants(part))


def expression(part: Schema) -> str:
    """The type of a value."""
    if "$ref" in part:
        name = str(part["$ref"].rpartition("/")[2])
        return "float | Numbers" if name == "Numbers" else name
    if words := constants(part):
        return f"Literal[{', '.join(repr(word) for word, _ in words).replace(chr(39), chr(34))}]"
    for key in ("anyOf", "oneOf"):
        if key in part:
            return " | ".join(dict.fromkeys(expression(each) for each in part[key] if each.get("type") != "null"))
    kinds = part.get("type", "object")
    kind = next(each for each in ([kinds] if isinstance(kinds, str) else kinds) if each != "null")
    if kind == "array":
        inner = expression(part["items"]) if isinstance(part.get("items"), dict) else "Any"
        return "Numbers" if inner in ("float", "int") else f"Sequence[{inner}]"
    return NAMES[kind]


def meaning(part: Schema, indent: str) -> str:
    """A docstring."""
    words = " ".join(str(part.get("description", "")).split()).replace("\\", "\\\\").replace('"', "'")
    lines = textwrap.wrap(words, WIDTH - len(indent) - 6) or ["As its name says."]
    return f'{indent}"""' + f"\n{indent}".join(lines) + '"""'


def table(name: str, part: Schema, besides: dict[str, str] | None = None) -> str:
    """A table as a class; where a key is a word of Python, a call makes it."""
    types = {}
    for key, inner in part["properties"].items():
        words = " | ".join([expression(inner), *([besides[key]] if besides and key in besides else [])])
        types[key] = words
    if any(keyword.iskeyword(key) for key in types):
        fields = ", ".join(f'"{key}": "{words}"' for key, words in types.items())
        return f'{name} = TypedDict("{name}", {{{fields}}}, total=False)\n{meaning(part, "")}\n'
    fields = "\n".join(f"    {key}: {words}\n{meaning(part['properties'][key], '    ')}" for key, words in types.items())
    return f"\nclass {name}(TypedDict, total=False):\n{meaning(part, '    ')}\n\n{fields}\n"


def text() -> str:
    """The whole file."""
    definitions = {name: part for name, part in schema()["$defs"].items() if name != "Numbers"}
    parts = [HEAD]
    for name, part in definitions.items():
        if not is_table(part):
            parts.append(
                f'{name}: TypeAlias = "{expression(part)}"\n{meaning(part, "")}\n'.replace('["', "['")
                .replace('", "', "', '")
                .replace('"]', "']")
            )
    for name, part in definitions.items():
        kinds = variants(part)
        for kind, each in kinds:
            parts.append(table(f"{name.removesuffix('Spec')}{kind.title().replace('-', '')}Spec", each))
        if kinds:
            union = " | ".join(f"{name.removesuffix('Spec')}{kind.title().replace('-', '')}Spec" for kind, _ in kinds)
            parts.append(f'{name}: TypeAlias = "{union}"\n{meaning(part, "")}\n')
        elif "properties" in part:
            parts.append(table(name, part))
    parts.append(
        table("ScenarioTables", schema() | {"description": "The keyword arguments of `Scenario`.", "required": []}, BESIDES)
    )
    return "\n".join(parts)


if __name__ == "__main__":
    if "--check" not in sys.argv:
        TARGET.write_text(text(), encoding="utf-8")
    elif TARGET.read_text(encoding="utf-8") != text():
        sys.exit(f"{TARGET} is not what the schema says. Run: python scripts/scenario_types.py")
