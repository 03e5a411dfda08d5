"""The regulator that brings the trunk back to the plan, on a robot of one rigid body."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from warpgait.arrays import Array, Bools
from warpgait.reference import Reference
from warpgait.regulator import Body, Regulator

G = 9.81
STEP = 0.004
BODY = Body(mass=30.0, inertia=np.diag([0.9, 1.8, 2.0]), foot_radius=0.03, gravity=G, lever=0.4, sagittal=False)
STIFFNESS, DAMPING = 100.0, 20.0
FEET = np.array([[0.3, 0.2, 0.0], [0.3, -0.2, 0.0], [-0.3, 0.2, 0.0], [-0.3, -0.2, 0.0]])


def reference_of(contact: Bools) -> Reference:
    """A robot that stands still 0.45 m above its feet, while those with `contact` (K, E) share its weight."""
    K, E = contact.shape
    zeros, up = np.zeros((K, 3)), np.tile([0.0, 0.0, 1.0], (K, E, 1))
    share = contact / np.maximum(contact.sum(1, keepdims=True), 1)
    return Reference(
        t=STEP * np.arange(K, dtype=float),
        com=np.tile([0.0, 0.0, 0.45], (K, 1)),
        com_velocity=zeros,
        com_acceleration=zeros,
        rotation=np.tile(np.eye(3), (K, 1, 1)),
        angular_velocity=zeros,
        angular_acceleration=zeros,
        foot=np.tile(FEET, (K, 1, 1)) + BODY.foot_radius * up,
        foot_velocity=np.zeros((K, E, 3)),
        foot_acceleration=np.zeros((K, E, 3)),
        normal=up,
        force=BODY.mass * G * share[..., None] * up,
        contact=contact,
    )


def trot(steps: int, period: float) -> Bools:
    """Contacts (K, E) of diagonal feet that stand in turn, `steps` times each pair, for `period` s."""
    first = np.repeat(np.arange(2 * steps) % 2 == 0, round(period / STEP))
    return np.stack([first, ~first, ~first, first], axis=1)


def cross(v: Array) -> Array:
    """The matrix of the cross product of v with another vector."""
    x, y, z = v
    matrix: Array = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return matrix


def worst_at_end(reference: Reference, asked: Callable[[int, Array], Array]) -> float:
    """Largest error of a rigid body's place and orientation in the last second, m and rad.

    It starts 1 cm and 2° off, and its feet give the accelerations `asked` for by step and errors, as nearly as they can.
    """
    errors = np.r_[0.01, -0.01, 0.0, 0.035, 0.035, 0.0, np.zeros(6)]
    found, turn = [], np.linalg.inv(BODY.inertia)
    gravity = np.r_[0.0, 0.0, -G, 0.0, 0.0, 0.0]
    for k in range(len(reference.t)):
        found.append(np.abs(errors[:6]).max())
        arms = [foot - reference.com[k] - errors[:3] for foot in FEET[reference.contact[k]]]
        effect = np.concatenate([np.concatenate([np.eye(3) / BODY.mass, turn @ cross(arm)]) for arm in arms], axis=1)
        forces = np.linalg.lstsq(effect, asked(k, errors) - gravity, rcond=1e-9)[0]
        acceleration = effect @ forces + gravity
        errors[:6] += STEP * errors[6:] + STEP**2 / 2 * acceleration
        errors[6:] += STEP * acceleration
    return float(np.max(found[-round(1 / STEP) :]))


def spring(_: int, errors: Array) -> Array:
    """Accelerations of a spring and damper, whatever the feet can do."""
    accelerations: Array = -STIFFNESS * errors[:6] - DAMPING * errors[6:]
    return accelerations


def test_on_four_feet_it_is_a_spring_and_damper() -> None:
    regulator = Regulator(reference_of(np.ones((500, 4), bool)), BODY, STIFFNESS, DAMPING)
    for axis in range(6):
        errors = np.zeros(12)
        errors[axis] = 1.0
        assert regulator.acceleration(100, errors)[axis] == pytest.approx(-STIFFNESS, rel=0.3)
        assert regulator.acceleration(100, np.roll(errors, 6))[axis] == pytest.approx(-DAMPING, rel=0.3)


def test_two_feet_at_a_time_bring_the_trunk_back() -> None:
    reference = reference_of(trot(10, 0.4))
    regulator = Regulator(reference, BODY, STIFFNESS, DAMPING)
    assert worst_at_end(reference, regulator.acceleration) < 1e-6
    assert worst_at_end(reference, spring) > 0.05  # it does not know what comes next


def test_in_flight_nothing_is_asked_for() -> None:
    contact = np.ones((500, 4), bool)
    contact[200:260] = False
    regulator = Regulator(reference_of(contact), BODY, STIFFNESS, DAMPING)
    assert regulator.acceleration(230, np.ones(12)) == pytest.approx(np.zeros(6), abs=1e-9)


def test_feet_that_bear_nothing_are_asked_for_little() -> None:
    reference = reference_of(np.ones((500, 4), bool))
    unloaded = replace(reference, force=0.05 * reference.force)
    tilted = np.zeros(12)
    tilted[3:5] = 0.05

    def asked(of: Reference) -> float:
        return float(np.abs(Regulator(of, BODY, STIFFNESS, DAMPING).acceleration(100, tilted)).sum())

    assert asked(unloaded) < asked(reference)


def test_contacts_hold_what_legs_of_two_joints_do_not_move() -> None:
    regulator = Regulator(reference_of(trot(10, 0.4)), replace(BODY, sagittal=True), STIFFNESS, DAMPING)
    errors = np.r_[0.0, 0.0, 0.0, 0.01, 0.0, 0.0, np.zeros(6)]
    assert regulator.acceleration(500, errors)[3] == pytest.approx(-0.01 * STIFFNESS, rel=0.15)
