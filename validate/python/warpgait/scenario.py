"""Scenarios in Python: what is to be planned. Keys, units and defaults are those of the scenario file, which `warpgait init` explains."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from . import _native
from .errors import InputError
from .files import write_text
from .surface import Terrain
from .text import escape
from .toml import table_text

if TYPE_CHECKING:
    from .plans import Plan
    from .scenario_types import ScenarioTables

_MOST_TEXT = 1 << 20  # bytes of a scenario file that is read


@dataclass(frozen=True)
class Robot:
    """A robot of a scenario: one that ships with warpgait, by name, or a file."""

    name: str | None = None
    file: str | Path | None = None
    adhesive_feet: Sequence[str] = ()

    @property
    def values(self) -> dict[str, Any]:
        """The table [robot]."""
        if (self.name is None) == (self.file is None):
            raise InputError("a robot has either a name or a file")
        named = {"name": self.name} if self.file is None else {"file": str(Path(self.file).resolve())}
        return named | ({"adhesive_feet": list(self.adhesive_feet)} if self.adhesive_feet else {})

    @staticmethod
    def with_joints() -> list[str]:
        """Names of the robots with a full model, which can be replayed and have joint angles."""
        from .model import available_models

        return available_models()


_SHORT = {"robot": "name", "gait": "kind", "start": "position", "goal": "position"}
"""What is meant by a value that is given for a whole table."""


def _table(key: str, value: Any) -> Any:
    """The table that a keyword argument stands for."""
    if isinstance(value, Terrain | Robot):
        return dict(value.values)
    return {_SHORT[key]: value} if key in _SHORT and not isinstance(value, Mapping) else value


class Scenario:
    """What is to be planned. It does not change; `set` returns another one.

    `Scenario(terrain=Terrain.shape("rippled"), robot="anymal_c", start=(0, 0), goal=(1, 0), gait="trot", horizon=10.0)` has the tables of a
    scenario file as keyword arguments: dicts, `Terrain` and `Robot`, or for `robot` a name, for `gait` a kind, for `start` and `goal` a
    position (2,) in m; `warpgait.scenario_types` has their types. `Scenario.read` takes a file, and `Scenario.from_text` TOML.
    """

    def __init__(self, **tables: Unpack[ScenarioTables]) -> None:
        """Values are judged when the scenario is solved; here only whether TOML has such values."""
        values = {"schema": 1} | {key: _table(key, value) for key, value in tables.items()}
        self._kept = [value for value in tables.values() if isinstance(value, Terrain)]
        self._text, self._path = table_text(values), None  # type: str, Path | None
        self._overrides: dict[str, Any] = {}

    @classmethod
    def read(cls, path: str | Path) -> Scenario:
        """The scenario in a file. Its relative paths are relative to the file."""
        file = Path(path)
        try:
            with file.open("rb") as opened:
                content = opened.read(_MOST_TEXT + 1)
            text = content.decode()
        except FileNotFoundError as error:
            raise InputError(f"{file}: there is no such file") from error
        except (OSError, UnicodeDecodeError) as error:
            why = error.strerror if isinstance(error, OSError) else error
            raise InputError(f"{file}: cannot be read as a scenario: {why}") from error
        if len(content) > _MOST_TEXT:
            raise InputError(f"{file}: too large for a scenario")
        made = cls.from_text(text)
        made._path = file.resolve()
        return made

    @classmethod
    def from_text(cls, text: str) -> Scenario:
        """The scenario in a TOML text. Its relative paths are relative to the working folder."""
        made = cls()
        made._text = text if "\n" in text else f"{text}\n"  # a text without a line break would be taken for a path
        return made

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Scenario:
        """The scenario with these tables."""
        return cls(**values)

    def set(self, key: str | Mapping[str, Any], value: Any = None) -> Scenario:
        """A scenario in which the value of a dotted key, such as `gait.duty`, is another; or the values of several, in a dict.

        `terrain` takes a `Terrain` and `robot` a `Robot` as a whole; `robot`, `gait`, `start` and `goal` take a name, a kind or a position.
        """
        changes = dict(key) if isinstance(key, Mapping) else {key: value}
        made = Scenario.__new__(Scenario)
        made._text, made._path, made._kept = self._text, self._path, list(self._kept)
        made._overrides = dict(self._overrides)
        for name, each in changes.items():
            if isinstance(each, Terrain | Robot):
                made = made._with_table(name, each)
            else:
                made._overrides[f"{name}.{_SHORT[name]}" if name in _SHORT else name] = each
        return made

    def _with_table(self, name: str, part: Terrain | Robot) -> Scenario:
        """Replace a whole table."""
        values = self.to_dict()
        values[name] = dict(part.values)
        made = Scenario(**values)
        made._kept = [*self._kept, *([part] if isinstance(part, Terrain) else [])]
        return made

    @property
    def path(self) -> Path | None:
        """The file that it was read from, if nothing was changed since."""
        return None if self._overrides else self._path

    def to_dict(self) -> dict[str, Any]:
        """The values as given, without defaults; paths of files are absolute if this was read from a file. Raises `InputError`."""
        try:
            values: dict[str, Any] = tomllib.loads(self._text)
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"{self._path or 'scenario'}: not TOML: {error}") from error
        for key, value in self._overrides.items():
            *way, last = key.split(".")
            place = values
            for part in way:
                place = place.setdefault(part, {})
                if not isinstance(place, dict):
                    raise InputError(f"{key}: {part} is a value, not a table")
            place[last] = deepcopy(value)
        if self._path is not None:
            for table in ("terrain", "robot", "guess"):
                if isinstance(values.get(table), dict) and isinstance(values[table].get("file"), str):
                    values[table]["file"] = str(self._path.parent / values[table]["file"])
        return values

    def text(self) -> str:
        """The scenario as TOML."""
        return table_text(self.to_dict())

    def save(self, path: str | Path) -> None:
        """Write a scenario file."""
        write_text(Path(path), self.text())

    @property
    def terrain(self) -> Terrain:
        """The ground, as it is planned on."""
        values = self.to_dict().get("terrain", {})
        source = self._path if self._path is not None else self._text
        return Terrain(values, _known=_native.terrain(source, overrides=self._overrides or None))

    def solve(
        self,
        progress: Callable[[int, float, float], object] | None = None,
        watch: Callable[[_native.Iterate], object] | None = None,
    ) -> Plan:
        """Plan the motion, as `warpgait solve` does; see `warpgait.solve`."""
        from .plans import Plan

        source = self._path if self._path is not None else self._text
        return Plan(_native.solve(source, overrides=self._overrides or None, progress=progress, watch=watch))

    def __repr__(self) -> str:
        """Where it is from, and what was changed."""
        place = f"Scenario.read({str(self._path)!r})" if self._path is not None else f"Scenario.from_text({self._text!r})"
        return place + (f".set({self._overrides!r})" if self._overrides else "")

    def _repr_html_(self) -> str:
        """The text for notebooks."""
        return f"<pre>{escape(self.text())}</pre>"

    def __eq__(self, other: object) -> bool:
        """Whether the values are the same."""
        return isinstance(other, Scenario) and self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]
