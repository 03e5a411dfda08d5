"""Plans gaits, evaluates plans exactly, and replays them on full robot models in MuJoCo.

A `Scenario` says what is to be planned, on a `Ground`, by a `Robot`. `solve` plans it and `load` reads a plan; both return a `Plan`, which is
exact at any time, and which can be checked, replayed, exported and looked at. `write_terrain` writes an array as a ground for scenarios.
`python -m warpgait.validate`, `.export` and `.view` are commands.
"""

from ._native import BaseMotion, FeetMotion, Terrain
from .errors import InputError
from .ground import write_terrain
from .plans import Check, Plan, Report, check, load, solve
from .scenario import Ground, Robot, Scenario

Trajectory = Plan
"""The name of `Plan` in version 0.1."""

__all__ = [
    "BaseMotion",
    "Check",
    "FeetMotion",
    "Ground",
    "InputError",
    "Plan",
    "Report",
    "Robot",
    "Scenario",
    "Terrain",
    "Trajectory",
    "check",
    "load",
    "solve",
    "write_terrain",
]
