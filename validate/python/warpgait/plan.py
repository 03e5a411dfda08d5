"""Plan files, schema 1: one self-contained NumPy archive `NAME.plan.npz`.

World frame: x forward, y left, z up. SI units. N samples, E feet. Quaternions are scalar-first.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .archive import Archive
from .arrays import Array, Bools, runs
from .errors import InputError
from .geometry import smootherstep
from .settings import CELL, GREATEST_FRICTION
from .text import is_name

SCHEMA = 1

# Tolerances of a reader; a writer keeps double precision.
_UNIFORM = 1e-6  # of the mean step, by which the steps of `t` may differ
_START = 1e-9  # s, of the first time
_SHORTEST, LONGEST = 0.1, 600.0  # s, what a plan may last, as in a scenario
_MOST_CELLS = 2e7  # of the ground as it is replayed: cells of 2.5 cm over 110 m by 110 m
LARGEST = 1e9  # in SI units, of any number in a member, as for the law `magnitude` of the check
_UNIT = 1e-6  # of the length of a unit vector or quaternion

# Shape of every member that a replay needs: N samples, E feet, R rows along y, C columns along x.
_FLOATS: dict[str, tuple[str | int, ...]] = {
    "t": ("N",),
    "base_position": ("N", 3),
    "base_quaternion_wxyz": ("N", 4),
    "base_linear_velocity": ("N", 3),
    "base_linear_acceleration": ("N", 3),
    "base_angular_velocity": ("N", 3),
    "base_angular_acceleration": ("N", 3),
    "foot_position": ("N", "E", 3),
    "foot_velocity": ("N", "E", 3),
    "foot_acceleration": ("N", "E", 3),
    "foot_force": ("N", "E", 3),
    "foot_normal": ("N", "E", 3),
    "heightfield": ("R", "C"),
    "heightfield_origin": (2,),
    "heightfield_spacing": (2,),
}
# The same for members that only plans have whose legs have mass.
_LEGS: dict[str, tuple[str | int, ...]] = {"center_of_mass_shift": ("N", 3), "angular_momentum": ("N", 3)}
# The same, but plans of older versions do not have them.
_JOINTS: dict[str, tuple[str | int, ...]] = {"joint_position": ("N", "E", "J"), "joint_torque": ("N", "E", "J")}
_BOOLS: dict[str, tuple[str | int, ...]] = {"foot_contact": ("N", "E"), "foot_adhesive": ("E",)}


@dataclass(frozen=True)
class Heightfield:
    """Terrain heights on a grid."""

    heights: Array  # (rows along y, columns along x) m
    origin: Array  # (2,) x, y of element [0, 0], m
    spacing: Array  # (2,) along x and y, m

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x_min, x_max, y_min, y_max, m."""
        rows, columns = self.heights.shape
        x, y = self.origin
        return (x, x + (columns - 1) * self.spacing[0], y, y + (rows - 1) * self.spacing[1])


@dataclass(frozen=True)
class PlannedRobot:
    """The rigid body of the plan."""

    name: str
    mass: float  # kg
    inertia: Array  # (3, 3) about the center of mass, base frame, kg m²
    friction: float
    gravity: Array  # (3,) m/s²


@dataclass(frozen=True)
class Plan:
    """A plan as read from its file."""

    path: Path
    sha256: str  # of the file
    t: Array  # (N,) s, uniform from 0
    base_position: Array  # (N, 3) center of mass
    base_quaternion_wxyz: Array  # (N, 4) body to world
    base_linear_velocity: Array  # (N, 3)
    base_linear_acceleration: Array  # (N, 3)
    base_angular_velocity: Array  # (N, 3) world
    base_angular_acceleration: Array  # (N, 3) world
    foot_position: Array  # (N, E, 3) contact points
    foot_velocity: Array  # (N, E, 3)
    foot_acceleration: Array  # (N, E, 3)
    foot_force: Array  # (N, E, 3) ground on robot, N
    foot_contact: Bools  # (N, E) stance
    foot_normal: Array  # (N, E, 3) of the terrain under the foot
    foot_names: tuple[str, ...]  # E
    foot_adhesive: Bools  # (E,)
    center_of_mass_shift: (
        Array | None
    )  # (N, 3) from where it is in the trunk at the nominal stance, base frame; None: massless legs
    angular_momentum: Array | None  # (N, 3) of trunk and legs about the center of mass, world, kg m²/s; None: massless legs
    joint_position: Array | None  # (N, E, J) from the base down, rad; None: massless legs, or a plan of an older version
    joint_torque: Array | None  # (N, E, J) of the motors, N m; None likewise
    terrain: Heightfield
    terrain_raw: Heightfield | None  # before smoothing, where the input was a raster and the plan is for the smoothed ground
    robot: PlannedRobot
    pull_limit: float  # largest pull of an adhesive foot, fraction of m g; 0 if no foot is adhesive
    solved: bool  # every constraint of the NLP holds
    meta: Mapping[str, Any] = field(repr=False)
    cycles: int = 1  # how often the file's motion is repeated (`cycles.repeated`)

    @property
    def duration(self) -> float:
        """The horizon, s."""
        return float(self.t[-1])

    @cached_property
    def center_direction(self) -> Array:
        """(N, E, 3) unit vectors from the contact points to the feet's centers.

        In stance this is the terrain's normal. In a swing it turns smoothly from the normal at lift-off to that at touch-down; the normal of
        the terrain below would shake the foot at every stone that it passes.
        """
        direction = self.foot_normal.copy()
        for e in range(direction.shape[1]):
            for first, end in runs(~self.foot_contact[:, e]):
                if first == 0 or end == len(direction):
                    continue  # a swing without a stance on both sides
                before, after = first - 1, end
                fraction = smootherstep(np.arange(1, after - before)[:, None] / (after - before))
                between = (1 - fraction) * self.foot_normal[before, e] + fraction * self.foot_normal[after, e]
                direction[first:end, e] = between / np.linalg.norm(between, axis=-1, keepdims=True)
        return direction

    @property
    def weight(self) -> float:
        """m g of the planned robot, N."""
        return self.robot.mass * float(np.linalg.norm(self.robot.gravity))


class _Checker:
    """Reads the members of one archive and checks their shapes and types."""

    def __init__(self, path: Path, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        self.path, self.arrays = path, arrays
        self.sizes: dict[str, int] = {}

    def fail(self, member: str, what: str) -> InputError:
        return InputError(f"{self.path}: member {member}: {what}")

    def take(self, member: str) -> npt.NDArray[Any]:
        if member not in self.arrays:
            raise self.fail(member, "is missing")
        return self.arrays[member]

    def shaped(self, member: str, shape: tuple[str | int, ...]) -> npt.NDArray[Any]:
        array = self.take(member)
        if array.ndim == len(shape):
            for axis, symbol in enumerate(shape):
                if isinstance(symbol, str):
                    self.sizes.setdefault(symbol, array.shape[axis])
        expected = tuple(self.sizes.get(s, -1) if isinstance(s, str) else s for s in shape)
        if array.shape != expected:
            names = ", ".join(str(s) for s in shape)
            raise self.fail(member, f"has shape {array.shape}, expected ({names}) = {expected}".replace("-1", "?"))
        return array

    def floats(self, member: str, shape: tuple[str | int, ...]) -> Array:
        array = self.shaped(member, shape)
        if array.dtype.kind != "f" or array.dtype.itemsize != 8:
            raise self.fail(member, f"has type {array.dtype}, expected float64")
        bad = np.argwhere(~np.isfinite(array))
        if len(bad):
            raise self.fail(member, f"has a value that is not finite at {bad[0].tolist()}")
        bad = np.argwhere(abs(array) > LARGEST)
        if len(bad):
            raise self.fail(member, f"has a value at {bad[0].tolist()} beyond {LARGEST:g}, which no motion has")
        return array.astype(np.float64)

    def bools(self, member: str, shape: tuple[str | int, ...]) -> Bools:
        array = self.shaped(member, shape)
        if array.dtype != np.bool_:
            raise self.fail(member, f"has type {array.dtype}, expected bool")
        return array

    def meta(self) -> dict[str, Any]:
        array = self.take("meta")
        if array.dtype.kind != "U" or array.ndim != 0:
            raise self.fail("meta", "expected a string without dimensions")
        try:
            meta = json.loads(str(array))
        except (ValueError, RecursionError) as error:
            raise self.fail("meta", f"is not JSON: {error}") from error
        if not isinstance(meta, dict):
            raise self.fail("meta", "is not a JSON object")
        schema = meta.get("schema")
        if not isinstance(schema, int) or isinstance(schema, bool) or schema < 1:
            raise self.fail("meta", f"schema must be a positive whole number (found {schema!r})")
        if schema > SCHEMA:
            raise self.fail("meta", f"has schema {schema}; this version reads schemas up to {SCHEMA}: update warpgait")
        return meta


def _robot(check: _Checker, meta: dict[str, Any]) -> PlannedRobot:
    robot = meta.get("robot")
    if not isinstance(robot, dict):
        raise check.fail("meta", "has no object `robot`")
    try:
        result = PlannedRobot(
            name=str(robot["name"]),
            mass=float(robot["mass"]),
            inertia=np.array(robot["inertia"], dtype=float),
            friction=float(robot["friction"]),
            gravity=np.array(robot["gravity"], dtype=float),
        )
    except KeyError as error:
        raise check.fail("meta", f"robot has no key {error}") from error
    except (TypeError, ValueError) as error:
        raise check.fail("meta", f"robot: {error}") from error
    numbers = np.concatenate([[result.mass, result.friction], result.inertia.ravel(), result.gravity.ravel()])
    if not is_name(result.name):
        raise check.fail("meta", f"robot.name is {result.name!r}, expected a name, not a path")
    if result.inertia.shape != (3, 3) or result.gravity.shape != (3,) or not np.isfinite(numbers).all():
        raise check.fail("meta", "robot: inertia must be 3x3 and gravity a vector of 3, all finite")
    if result.mass <= 0 or result.friction <= 0 or not result.gravity.any():
        raise check.fail("meta", "robot: mass and friction must be positive, and gravity must not be zero")
    if result.friction > GREATEST_FRICTION:
        raise check.fail("meta", f"robot: friction is {result.friction:g}, allowed: at most {GREATEST_FRICTION:g}")
    return result


def _pull_limit(check: _Checker, meta: dict[str, Any], adhesive: Bools) -> float:
    """`limits.pull_limit`, which a plan without adhesive feet does not need."""
    if not adhesive.any():
        return 0.0
    limits = meta.get("limits")
    if not isinstance(limits, dict) or "pull_limit" not in limits:
        what = (
            "has no limits.pull_limit, the largest pull of the adhesive feet: an older warpgait wrote this plan; solve it again"
        )
        raise check.fail("meta", what)
    limit = limits["pull_limit"]
    if not isinstance(limit, int | float) or not np.isfinite(limit) or limit < 0:
        raise check.fail("meta", f"limits.pull_limit must be a fraction of m g, zero or more (found {limit!r})")
    return float(limit)


def _check_patches(check: _Checker) -> None:
    """Refuse corners that are not numbers, or padding before the end of a foot's stances."""
    corners = check.shaped("patch_corners", ("E", "S", 4, 3))
    if corners.dtype != np.float64:
        raise check.fail("patch_corners", f"has type {corners.dtype}, expected float64")
    if corners.shape[1] == 0:
        raise check.fail("patch_corners", "has no stance")
    padding = np.isnan(corners).all(axis=(2, 3))  # (E, S)
    bad = ~np.isfinite(corners).all(axis=(2, 3)) & ~padding
    bad[:, 1:] |= padding[:, :-1] & ~padding[:, 1:]
    bad[:, :1] |= padding[:, :1]
    if bad.any():
        raise check.fail("patch_corners", f"is not four corners at {np.argwhere(bad)[0].tolist()}")


def read_plan(path: str | Path) -> Plan:
    """Read a plan file; raises `InputError` with file, member and reason if it cannot be used."""
    path = Path(path)
    check = _Checker(path, Archive(path))
    meta = check.meta()
    names = check.take("foot_names")
    if names.dtype.kind != "U" or names.ndim != 1 or len(names) == 0:
        raise check.fail("foot_names", "expected a list of strings")
    check.sizes["E"] = len(names)
    values: dict[str, Any] = {m: check.floats(m, s) for m, s in _FLOATS.items()}
    values |= {m: check.bools(m, s) for m, s in _BOOLS.items()}
    massive = any(m in check.arrays for m in _LEGS)
    values |= {m: check.floats(m, s) if massive else None for m, s in _LEGS.items()}
    jointed = any(m in check.arrays for m in _JOINTS)
    values |= {m: check.floats(m, s) if jointed else None for m, s in _JOINTS.items()}

    t = values["t"]
    if len(t) < 3 or abs(t[0]) > _START or t[-1] <= 0 or np.ptp(np.diff(t)) > _UNIFORM * t[-1] / (len(t) - 1):
        raise check.fail("t", "expected at least three uniform times that begin at 0")
    if not _SHORTEST <= t[-1] <= LONGEST:
        raise check.fail("t", f"lasts {t[-1]:.3g} s; a plan lasts between {_SHORTEST:g} and {LONGEST:g} s")
    for member in ("base_quaternion_wxyz", "foot_normal"):
        worst = np.abs(np.linalg.norm(values[member], axis=-1) - 1.0).max()
        if worst > _UNIT:
            raise check.fail(member, f"is not of unit length (off by {worst:.2g})")
    heights = values.pop("heightfield")
    origin, spacing = values.pop("heightfield_origin"), values.pop("heightfield_spacing")
    if min(heights.shape) < 2 or (spacing <= 0).any():
        raise check.fail("heightfield", "needs two rows, two columns and positive spacing")
    size = spacing * (np.array(heights.shape)[::-1] - 1)
    cells = float(np.prod(np.maximum(size / CELL, np.array(heights.shape)[::-1])))
    if cells > _MOST_CELLS:
        what = f"makes a ground of {size[0]:.3g} m by {size[1]:.3g} m, which is {cells:.2g} cells of the replay; it can hold {_MOST_CELLS:.0e}"
        raise check.fail("heightfield_spacing", what)
    raw = check.floats("heightfield_raw", ("R", "C")) if "heightfield_raw" in check.arrays else None
    if "patch_corners" in check.arrays:  # planned for the raw ground
        _check_patches(check)
        heights, raw = heights if raw is None else raw, None

    solver = meta.get("solver")
    return Plan(
        path=path,
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        **values,
        foot_names=tuple(str(n) for n in names),
        terrain=Heightfield(heights, origin, spacing),
        terrain_raw=None if raw is None else Heightfield(raw, origin, spacing),
        robot=_robot(check, meta),
        pull_limit=_pull_limit(check, meta, values["foot_adhesive"]),
        solved=bool(solver.get("success", False)) if isinstance(solver, dict) else False,
        meta=meta,
    )
