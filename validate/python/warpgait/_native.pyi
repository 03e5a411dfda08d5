"""The part that is compiled from Rust (`validate/src`). World frame: x forward, y left, z up. SI units. E feet.

An argument `t` or `points` may be anything that NumPy converts to an array. Results are new arrays. Input that cannot be used raises
`InputError`, a `ValueError`. `RuntimeError` means an internal failure.
"""

from collections.abc import Callable
from os import PathLike
from typing import Any, final

import numpy as np
import numpy.typing as npt

COMMIT: str
"""The commit that the compiled part was built from, or `unknown`."""

@final
class BaseMotion:
    """The base at times of shape (…), in the world frame."""

    @property
    def position(self) -> npt.NDArray[np.float64]:
        """(…, 3) center of mass, m."""

    @property
    def quaternion_wxyz(self) -> npt.NDArray[np.float64]:
        """(…, 4) body to world, unit, with the same sign as the nearest sample of the plan."""

    @property
    def linear_velocity(self) -> npt.NDArray[np.float64]:
        """(…, 3) m/s."""

    @property
    def linear_acceleration(self) -> npt.NDArray[np.float64]:
        """(…, 3) m/s²."""

    @property
    def angular_velocity(self) -> npt.NDArray[np.float64]:
        """(…, 3) rad/s, world."""

    @property
    def angular_acceleration(self) -> npt.NDArray[np.float64]:
        """(…, 3) rad/s², world."""

@final
class FeetMotion:
    """All feet at times of shape (…), in the world frame, in the order of `Trajectory.foot_names`."""

    @property
    def position(self) -> npt.NDArray[np.float64]:
        """(…, E, 3) contact points, m."""

    @property
    def velocity(self) -> npt.NDArray[np.float64]:
        """(…, E, 3) m/s."""

    @property
    def acceleration(self) -> npt.NDArray[np.float64]:
        """(…, E, 3) m/s²."""

    @property
    def force(self) -> npt.NDArray[np.float64]:
        """(…, E, 3) of the ground on the robot, N."""

    @property
    def contact(self) -> npt.NDArray[np.bool_]:
        """(…, E) in stance; a foot that lifts off or touches down at exactly this time counts as in stance."""

    @property
    def normal(self) -> npt.NDArray[np.float64]:
        """(…, E, 3) unit normal of the terrain under the foot."""

@final
class Iterate:
    """The motion at an iteration, at N equally spaced times: 25 a second, but at most 500. E feet. World frame, SI units."""

    @property
    def stage(self) -> str:
        """What is being solved, in words."""

    @property
    def iteration(self) -> int:
        """Counted over all stages."""

    @property
    def violation(self) -> float:
        """How far the constraints are violated at most."""

    @property
    def objective(self) -> float:
        """The objective."""

    @property
    def t(self) -> npt.NDArray[np.float64]:
        """(N,) s."""

    @property
    def base_position(self) -> npt.NDArray[np.float64]:
        """(N, 3) center of mass, m."""

    @property
    def base_quaternion_wxyz(self) -> npt.NDArray[np.float64]:
        """(N, 4) body to world."""

    @property
    def foot_position(self) -> npt.NDArray[np.float64]:
        """(N, E, 3) contact points, m."""

    @property
    def foot_force(self) -> npt.NDArray[np.float64]:
        """(N, E, 3) of the ground on the robot, N."""

    @property
    def foot_contact(self) -> npt.NDArray[np.bool_]:
        """(N, E) in stance."""

    @property
    def warped_base(self) -> npt.NDArray[np.float64] | None:
        """(N, 6) x, y, z, roll, pitch, yaw of the base in the warped space, m and rad, if it is planned there."""

    @property
    def warped_foot_position(self) -> npt.NDArray[np.float64] | None:
        """(N, E, 3) contact points in the warped space, m, if they are planned there."""

    @property
    def warped_foot_force(self) -> npt.NDArray[np.float64] | None:
        """(N, E, 3) forces in the warped space, N, if they are planned there."""

    @property
    def terrain(self) -> Terrain:
        """The ground of this stage, which a continuation raises step by step."""

    @property
    def foot_names(self) -> tuple[str, ...]:
        """The E feet in order."""

    @property
    def robot(self) -> str:
        """The robot, as JSON; `meta["robot"]` of the plan."""

    @property
    def warped_box(self) -> tuple[list[float], list[float]] | None:
        """The corners of the map's box in the warped space, each (3,) m; none without a map."""

    def ambient(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Points (…, 3) m of the warped space in ambient space. Without a map they are the same."""

@final
class Terrain:
    """The ground of a plan or a scenario: a C² spline through the heights, extended beyond their rectangle."""

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x_min, x_max, y_min, y_max, m."""

    def height(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """h, m, (…), at points (…, 2), x and y in m."""

    def gradient(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """∂h/∂x and ∂h/∂y, (…, 2), at points (…, 2)."""

    def normal(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """The upward unit normal, (…, 3), at points (…, 2)."""

@final
class Trajectory:
    """A plan as the optimized splines: exact at any time, not interpolated between samples."""

    @property
    def duration(self) -> float:
        """The horizon, s."""

    @property
    def t(self) -> npt.NDArray[np.float64]:
        """(N,) times of the plan's own samples, s."""

    @property
    def foot_names(self) -> tuple[str, ...]:
        """The E feet in order."""

    @property
    def terrain(self) -> Terrain:
        """The ground that the plan was made for."""

    @property
    def solved(self) -> bool:
        """Every constraint of the nonlinear program holds."""

    @property
    def passed(self) -> bool:
        """Every check in the plan holds. The checks compute each law again from the samples alone."""

    @property
    def meta(self) -> dict[str, Any]:
        """The plan's member `meta`: scenario, robot, limits, solver, checks, inputs."""

    def base(self, t: npt.ArrayLike) -> BaseMotion:
        """The base at times t in s, of any shape (…); a time outside 0…`duration` is refused."""

    def feet(self, t: npt.ArrayLike) -> FeetMotion:
        """The feet and their forces at times t in s, of any shape (…)."""

    def save(self, path: str | PathLike[str]) -> None:
        """Write the plan file, `NAME.plan.npz`."""

def check_plan(path: str | PathLike[str]) -> str:
    """Recompute every law of a plan from its file, as `warpgait check` does.

    Returns JSON: `checks` [{`name`, `value` (null where it is not a number), `unit`, `limit`, `passed`, `time`, `foot`}], `figures` (the
    same without a limit), `remarks` (where the plan states something else than its scenario asks for, in sentences), `passed`.
    A damaged file is refused with file, member and reason.
    """

def load(path: str | PathLike[str]) -> Trajectory:
    """Read a plan file. A damaged file, or one without splines, is refused with file, member and reason."""

def run_command(arguments: list[str], python: str | PathLike[str], file: str | PathLike[str]) -> int:
    """Run the command line with these arguments, the first of which is its name; returns the exit code.

    It writes to the standard output and error of the process, not to `sys.stdout`, and handles Ctrl-C itself. Processes of its own are run
    with the interpreter `python`; `file` is the compiled module.
    """

def schema() -> str:
    """The JSON Schema of scenario files, as `warpgait schema` prints it."""

def terrain(scenario: str | PathLike[str], *, overrides: dict[str, Any] | None = None) -> Terrain:
    """The ground of a scenario, as it is planned on. `scenario` and `overrides` are those of `solve`."""

def solve(
    scenario: str | PathLike[str],
    *,
    overrides: dict[str, Any] | None = None,
    progress: Callable[[int, float, float], object] | None = None,
    watch: Callable[[Iterate], object] | None = None,
) -> Trajectory:
    """Plan the motion of a scenario and check it, as `warpgait solve` does.

    `scenario` is a file, or the text of one: a `str` with a line break (its relative paths are relative to the working folder).
    `overrides` sets values by dotted key, `{"gait.kind": "trot"}`. `progress(iteration, violation, objective)` is called at every
    iteration of the nonlinear program, and `watch(iterate)` at most ten times a second with an `Iterate`, the motion so far. An exception that
    they raise ends the solve and is raised here, and so is Ctrl-C; after `StopIteration`, the motion so far is returned, with its check.
    Other threads run meanwhile. One solve runs at a time in a process. A
    solve that does not converge is not an error: see `solved` and `passed`.
    """
