"""The file of a sweep: a scenario, and the values in which its cases differ.

scenario = "hill.toml"      # relative to this file
kind = "grid"               # grid: every combination | random: `count` draws
count = 100                 # random: how many cases
seed = 0                    # random
time_limit = 300.0          # s, of a case
memory_limit = 2.0          # GiB, of a case
keep_plans = true
replay = false              # replay good plans on the full robot, as `warpgait validate --quick` does
export = "isaaclab"         # write the motions of plans that are good, and tracked where they are replayed, in this format

[values]                    # keys of the scenario
gait.kind = ["walk", "trot"]                            # one of these
start.yaw = { from = -1.0, to = 1.0, count = 5 }        # evenly spaced in a grid, uniform at random
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..scenario import Scenario

KINDS = ("grid", "random")
_KEYS = ("scenario", "kind", "count", "seed", "time_limit", "memory_limit", "keep_plans", "replay", "export", "values")
_RANGE = {"from", "to", "count"}
_MOST_CASES = 1_000_000
_MOST_TEXT = 1 << 20  # bytes


@dataclass(frozen=True)
class Case:
    """One scenario of a sweep."""

    number: int  # from 0, in the order of the file
    name: str  # a digest of everything that it depends on
    values: Mapping[str, Any]  # by dotted key


@dataclass(frozen=True)
class Range:
    """Numbers from one to another."""

    first: float
    last: float
    count: int | None  # in a grid


@dataclass(frozen=True)
class Sweep:
    """What is to be planned."""

    scenario: Scenario
    inputs: tuple[Path, ...]  # files that it was read from
    kind: str  # grid or random, by `values`; listed, one by one
    time_limit: float  # s
    memory_limit: float  # GiB
    keep_plans: bool = True
    replay: bool = False
    export: str | None = None  # a format of motions
    values: Mapping[str, list[Any] | Range] = field(default_factory=dict)
    count: int = 1  # random
    seed: int = 0
    listed: tuple[Mapping[str, Any], ...] = ()

    @property
    def keys(self) -> list[str]:
        """The keys in which the cases differ."""
        return list(self.listed[0]) if self.listed else list(self.values)

    @property
    def source(self) -> dict[str, str]:
        """The scenario, for a process of this machine: its file or its text."""
        path = self.scenario.path
        return {"scenario": str(path)} if path is not None else {"text": self.scenario.text()}

    def cases(self) -> list[Case]:
        """All cases, the same every time. Raises `InputError`."""
        known = self.scenario.to_dict()
        files = [known.get(table, {}).get("file") for table in ("terrain", "robot")]
        digests = [
            hashlib.sha256(Path(file).read_bytes()).hexdigest() for file in files if file is not None and Path(file).is_file()
        ]
        extras = [self.replay, self.export] if self.replay or self.export else []
        base = json.dumps([known, digests, *extras], sort_keys=True, default=str)
        drawn = self.listed or (self._grid() if self.kind == "grid" else self._random())
        found = []
        for number, values in enumerate(drawn):
            content = f"{base}\n{json.dumps(values, sort_keys=True, default=str)}"
            found.append(Case(number, hashlib.sha256(content.encode()).hexdigest()[:16], values))
        return found

    def _grid(self) -> Iterator[dict[str, Any]]:
        each = [v if isinstance(v, list) else np.linspace(v.first, v.last, v.count or 2).tolist() for v in self.values.values()]
        if math.prod(len(values) for values in each) > _MOST_CASES:
            raise InputError(f"{self.inputs[0] if self.inputs else 'sweep'}: values: more than {_MOST_CASES} combinations")
        for chosen in itertools.product(*each):
            yield dict(zip(self.values, chosen, strict=True))

    def _random(self) -> Iterator[dict[str, Any]]:
        random = np.random.default_rng(self.seed)
        for _ in range(self.count):
            yield {
                key: v[int(random.integers(len(v)))] if isinstance(v, list) else float(random.uniform(v.first, v.last))
                for key, v in self.values.items()
            }


def _flat(table: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and their values; a table of a range is a value."""
    for key, value in table.items():
        name = f"{path}.{key}" if path else key
        if isinstance(value, dict) and not ("from" in value or "to" in value):
            yield from _flat(value, name)
        else:
            yield name, value


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _plain(value: Any) -> Any:
    """A value as a file would have it: NumPy's and tuples as numbers and lists."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(each) for each in value] if isinstance(value, list | tuple) else value


def _choices(where: str, value: Any, grid: bool) -> list[Any] | Range:
    if isinstance(value, list | tuple):
        if not value:
            raise InputError(f"{where}: has no value to choose from")
        return [_plain(each) for each in value]
    if not isinstance(value, dict):
        raise InputError(f"{where}: {value!r}: expected a list of values, or {{ from = …, to = …, count = … }}")
    if not set(value) <= _RANGE or not _number(value.get("from")) or not _number(value.get("to")):
        raise InputError(f"{where}: a range has numbers `from` and `to`, and in a grid `count`; found {', '.join(value)}")
    count = value.get("count")
    if grid and (not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= _MOST_CASES):
        raise InputError(f"{where}: count: in a grid, a range says how many values it has, 1 or more")
    return Range(float(value["from"]), float(value["to"]), count if grid else None)


def _refuse_unknown(table: Mapping[str, Any], where: str) -> None:
    for key in table:
        if key not in _KEYS:
            raise InputError(f"{where}{key}: unknown key; allowed here: {', '.join(_KEYS)}")


def read(path: Path) -> Sweep:
    """Read the file of a sweep; raises `InputError` with file, key and what is allowed."""
    try:
        with path.open("rb") as file:
            content = file.read(_MOST_TEXT + 1)
        if len(content) > _MOST_TEXT:
            raise InputError(f"{path}: too large for a sweep")
        table = tomllib.loads(content.decode())
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read as a sweep: {error}") from error
    _refuse_unknown(table, f"{path}: ")
    name = table.pop("scenario", None)
    if not isinstance(name, str):
        raise InputError(f"{path}: scenario: expected the name of a scenario file, relative to this file")
    scenario = path.parent / name
    made = of(lambda: Scenario.read(scenario), table, f"{path}: ")
    return replace(made, inputs=(path, scenario))


def of(scenario: Callable[[], Scenario], table: Mapping[str, Any], where: str = "") -> Sweep:
    """A sweep over a scenario, with the other keys of the file; raises `InputError`, each message with `where` in front."""
    _refuse_unknown(table, where)

    def limited(key: str, default: float, low: float, high: float, whole: bool = False) -> float:
        value = table.get(key, default)
        if not _number(value) or not low <= value <= high or (whole and not isinstance(value, int)):
            raise InputError(f"{where}{key}: {value!r}: expected a {'whole ' if whole else ''}number from {low:g} to {high:g}")
        return float(value)

    kind, export = table.get("kind", "grid"), table.get("export")
    keep, replay = table.get("keep_plans", True), table.get("replay", False)
    if kind not in KINDS:
        raise InputError(f"{where}kind: {kind!r}: expected {' or '.join(KINDS)}")
    for key, value in (("keep_plans", keep), ("replay", replay)):
        if not isinstance(value, bool):
            raise InputError(f"{where}{key}: {value!r}: expected true or false")
    if export is not None:
        from ..commands.export import formats

        if export not in formats():
            raise InputError(f"{where}export: {export!r}: there is no such format; the formats are {', '.join(formats())}")
    if (replay or export is not None) and not keep:
        raise InputError(f"{where}keep_plans: false: a plan that is replayed or exported is kept")
    if kind == "random" and "count" not in table:
        raise InputError(f"{where}count: is missing; how many cases to draw")
    values = table.get("values")
    if not isinstance(values, Mapping) or not values:
        raise InputError(f"{where}values: expected a table with keys of the scenario, each with what to choose from")
    return Sweep(
        scenario=scenario(),
        inputs=(),
        kind=kind,
        count=int(limited("count", 1, 1, _MOST_CASES, whole=True)),
        seed=int(limited("seed", 0, 0, 2**63, whole=True)),
        time_limit=limited("time_limit", 300.0, 1.0, 1e6),
        memory_limit=limited("memory_limit", 2.0, 0.1, 1024.0),
        keep_plans=keep,
        replay=replay,
        export=export,
        values={key: _choices(f"{where}values.{key}", value, kind == "grid") for key, value in _flat(values)},
    )
