"""Plans gaits, evaluates plans exactly, and replays them on full robot models in MuJoCo.

`solve` plans the motion of a scenario, and `load` reads a plan. Both return a `Trajectory`. `write_terrain` writes an array as a ground for
scenarios. `python -m warpgait.validate` replays a plan.
"""

from ._native import BaseMotion, FeetMotion, Terrain, Trajectory, load, solve
from .errors import InputError
from .ground import write_terrain

__all__ = ["BaseMotion", "FeetMotion", "InputError", "Terrain", "Trajectory", "load", "solve", "write_terrain"]
