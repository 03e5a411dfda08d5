"""Plans gaits, evaluates plans exactly, and replays them on full robot models in MuJoCo.

`solve` plans the motion of a scenario, `load` reads a plan; both give a `Trajectory`. The replay is `python -m warpgait.validate`.
"""

from ._native import BaseMotion, FeetMotion, Terrain, Trajectory, load, solve
from .errors import InputError

__all__ = ["BaseMotion", "FeetMotion", "InputError", "Terrain", "Trajectory", "load", "solve"]
