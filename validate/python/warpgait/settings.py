"""How a plan is replayed, and how the simulated world differs from the planned one. Bad values are refused here, before any computing.

Error messages name the options of `warpgait validate`. This module does not import MuJoCo.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from typing import Any

from .errors import InputError

MUJOCO_VERSION = "3.17.0"
"""The version that the criteria were calibrated with; `pyproject.toml` requires the same."""

PHYSICS_RATES = (500.0, 1000.0)  # Hz, time steps of the simulation; a verdict holds with both
CELL = 0.025  # m: a coarser terrain is refined to this before MuJoCo cuts it into prisms
LOWEST_CONTROL_RATE = 50.0  # Hz, the least that is accepted
GREATEST_FRICTION = 10.0  # of a ground


def _refuse(name: str, value: float, expected: str) -> InputError:
    return InputError(f"--{name.replace('_', '-')} {value:g}: must be {expected}")


def _require_finite(settings: Any) -> None:
    """Refuse a number that is not finite in any field of a dataclass."""
    for each in fields(settings):
        value = getattr(settings, each.name)
        numbers = value if isinstance(value, tuple) else (value,)
        if any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
            raise InputError(f"--{each.name.replace('_', '-')}: every number must be finite")


@dataclass(frozen=True)
class Disturbance:
    """What differs from the plan's world. The controller does not know it."""

    friction: float | None = None  # of the ground, instead of the plan's
    mass_factor: float = 1.0  # on the mass of the base body
    body_factor: float = 1.0  # on the masses and inertias of all bodies
    com_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, of the robot's center of mass in the base's frame
    payload: tuple[float, float, float, float] | None = None  # kg, and where from the base's origin in its frame, m
    drives: tuple[float, float] = (0.0, 0.0)  # rotor inertia kg m² and friction N m that every joint has in addition
    terrain_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m
    terrain_tilt: tuple[float, float] = (0.0, 0.0)  # degrees, about x and y, around the robot's start
    push: tuple[float, float, float, float, float] | None = None  # start s, duration s, force on the base x, y, z N
    noise: float = 0.0  # multiplies the standard deviations of sensor noise in simulation.py
    delay: float = 0.0  # s, between measurement and control, beside the control step that the controller expects
    seed: int = 0  # of the noise

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        _require_finite(self)
        if self.friction is not None and not 0 < self.friction <= GREATEST_FRICTION:
            raise _refuse("friction", self.friction, f"in (0, {GREATEST_FRICTION:g}]")
        if not 0.1 <= self.mass_factor <= 10:
            raise _refuse("mass_factor", self.mass_factor, "in [0.1, 10]")
        if not 0.1 <= self.body_factor <= 10:
            raise _refuse("body_factor", self.body_factor, "in [0.1, 10]")
        if self.payload is not None and self.payload[0] < 0:
            raise InputError(f"--payload: the mass, {self.payload[0]:g} kg, must be zero or more")
        if min(self.drives) < 0:
            raise InputError("--drives: inertia and friction must be zero or more")
        if max(map(abs, self.terrain_tilt)) > 45:
            raise InputError("--terrain-tilt: angles must be in [-45, 45] degrees")
        if not 0 <= self.noise <= 100:
            raise _refuse("noise", self.noise, "in [0, 100]")
        if not 0 <= self.delay <= 0.2:
            raise _refuse("delay", self.delay, "in [0, 0.2] s")
        if self.seed < 0:
            raise _refuse("seed", self.seed, "zero or more")
        if self.push is not None and not self.push[1] > 0:
            raise InputError(f"--push: the duration, {self.push[1]:g} s, must be positive")


@dataclass(frozen=True)
class Settings:
    """How to validate."""

    model: str | None = None  # full model to replay on; default: the plan's robot
    rate: float = 250.0  # Hz, of the whole-body controller
    check: bool = True  # judge the plan's file by the laws of `warpgait check` first
    quick: bool = False  # leave out the replay with finer time steps, and those in other worlds
    robust: bool = True  # replay in worlds that differ from the plan's, unless `disturbance` is one
    raw: bool = True  # replay on the raw heightfield as well, if the plan has one
    disturbance: Disturbance = field(default_factory=Disturbance)

    @property
    def in_other_worlds(self) -> bool:
        """Whether to replay in worlds that differ from the plan's."""
        return self.robust and not self.quick and self.disturbance == Disturbance()

    def __post_init__(self) -> None:
        """Refuse a control rate that does not divide the physics rate."""
        _require_finite(self)
        in_range = LOWEST_CONTROL_RATE <= self.rate <= PHYSICS_RATES[0]
        if not in_range or abs(PHYSICS_RATES[0] / self.rate - round(PHYSICS_RATES[0] / self.rate)) > 1e-9:
            expected = f"{PHYSICS_RATES[0]:g} Hz divided by a whole number, and at least {LOWEST_CONTROL_RATE:g}"
            raise _refuse("rate", self.rate, expected)


@contextmanager
def without_opengl() -> Iterator[None]:
    """On import, MuJoCo loads the OpenGL that $MUJOCO_GL names, and fails if there is none. Only the rendering process needs it."""
    requested = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        yield
    finally:
        os.environ.pop("MUJOCO_GL")
        if requested is not None:
            os.environ["MUJOCO_GL"] = requested
