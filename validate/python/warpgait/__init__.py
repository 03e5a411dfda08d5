"""Plans gaits, evaluates plans exactly, and replays them on full robot models in MuJoCo.

A `Scenario` says what is to be planned, on a `Terrain`, by a `Robot`. `solve` plans it and `load` reads a plan; both return a `Plan`, which is
exact at any time, and which can be checked, replayed, exported and looked at. `sweep` plans many
scenarios, `atlas` maps where a robot can start, and `dataset` makes motions for training. `write_terrain` writes an array as a ground for scenarios.
`python -m warpgait` is the command `warpgait`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._native import BaseMotion, FeetMotion, Iterate
    from .errors import InputError
    from .ground import write_terrain
    from .plans import Check, Plan, Report, check, load, solve, sweep, validate
    from .plans import Plan as Trajectory
    from .scenario import Robot, Scenario
    from .schema import keys
    from .surface import Terrain
    from .sweeps.atlas import Atlas, atlas
    from .sweeps.dataset import Dataset, dataset
    from .sweeps.run import SweepResult

_PLACES = {
    "Atlas": "sweeps.atlas",
    "BaseMotion": "_native",
    "Check": "plans",
    "FeetMotion": "_native",
    "InputError": "errors",
    "Iterate": "_native",
    "Plan": "plans",
    "Report": "plans",
    "Robot": "scenario",
    "Scenario": "scenario",
    "SweepResult": "sweeps.run",
    "Terrain": "surface",
    "Trajectory": "plans",
    "Dataset": "sweeps.dataset",
    "atlas": "sweeps.atlas",
    "check": "plans",
    "dataset": "sweeps.dataset",
    "keys": "schema",
    "load": "plans",
    "solve": "plans",
    "sweep": "plans",
    "validate": "plans",
    "write_terrain": "ground",
}
"""The module of each name. They are imported when first used: SciPy takes half a second, which `warpgait --help` need not wait for."""

__all__ = [
    "Atlas",
    "BaseMotion",
    "Check",
    "Dataset",
    "FeetMotion",
    "InputError",
    "Iterate",
    "Plan",
    "Report",
    "Robot",
    "Scenario",
    "SweepResult",
    "Terrain",
    "Trajectory",
    "atlas",
    "check",
    "dataset",
    "keys",
    "load",
    "solve",
    "sweep",
    "validate",
    "write_terrain",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f".{_PLACES[name]}", __name__), "Plan" if name == "Trajectory" else name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
