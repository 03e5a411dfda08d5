"""Payloads and forces on the trunk: the model carries the one, and the other acts where the plan has it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from warpgait.conditions import forces_of, payload_of, wrench_of
from warpgait.model import composite, find_model, load_robot, stand
from warpgait.trunk import trunk_forces

GRAVITY = np.array([0.0, 0.0, -9.81])
SCENARIO = """time_step = 0.05
[payload]
mass = 6.0
position = [0.1, -0.05, 0.2]
[[force]]
vector = [30.0, -20.0, 10.0]
from = 1.0
until = 2.0
ramp = 0.2
point = [0.2, 0.1, -0.1]
"""


def planned(scenario: str = SCENARIO) -> Any:
    """As much of a plan as the conditions need: a robot that is turned by 90° to the left."""
    t = np.arange(61) * 0.05
    turned = np.tile([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], (len(t), 1))
    return SimpleNamespace(meta={"scenario": scenario}, t=t, base_quaternion_wxyz=turned, center_of_mass_shift=None)


def test_a_force_rises_stays_and_falls() -> None:
    (force,) = forces_of(planned())
    found = force.at(np.array([0.9, 1.1, 1.2, 1.8, 1.95, 2.1]))
    np.testing.assert_allclose(found, np.outer([0.0, 0.5, 1.0, 1.0, 0.25, 0.0], force.vector), atol=1e-9)
    assert forces_of(planned("horizon = 3.0")) == []
    assert payload_of(planned("horizon = 3.0")) is None


def test_the_wrench_is_about_the_center_of_mass_in_the_world_frame() -> None:
    plan = planned()
    wrench = wrench_of(plan)
    arm = np.array([-0.1, 0.2, -0.1])  # the point, turned by 90°
    force = np.array([30.0, -20.0, 10.0])
    np.testing.assert_allclose(wrench[30], np.r_[force, np.cross(arm, force)], atol=1e-9)
    assert not wrench[10].any()


def test_the_model_carries_the_payload_where_the_plan_has_it() -> None:
    plan = planned()
    payload = payload_of(plan)
    assert payload is not None
    path = find_model("anymal_c")
    bodies = []
    for carried in (None, payload):
        model = load_robot(path, GRAVITY, carried)
        data = mujoco.MjData(model)
        stand(model, data)
        bodies.append(composite(model, data))
    bare, loaded = bodies
    assert np.isclose(loaded.mass - bare.mass, 6.0)
    moved = 6.0 / loaded.mass * payload.position
    np.testing.assert_allclose(loaded.center_of_mass - bare.center_of_mass, moved, atol=1e-9)


def test_forces_act_at_their_point_however_the_trunk_is_turned() -> None:
    plan = planned()
    model = load_robot(find_model("anymal_c"), GRAVITY, payload_of(plan))
    forces = trunk_forces(plan, model, plan.t)
    assert forces is not None
    data = mujoco.MjData(model)
    stand(model, data)
    center = composite(model, data).center_of_mass
    data.qpos[3:7] = [0.8, 0.36, -0.48, 0.0]
    mujoco.mj_forward(model, data)
    base = model.body("base").id
    rotation = data.xmat[base].reshape(3, 3)
    point = data.xpos[base] + rotation @ (center + np.array([0.2, 0.1, -0.1]))
    expected = np.zeros(model.nv)
    mujoco.mj_applyFT(model, data, np.array([30.0, -20.0, 10.0]), np.zeros(3), point, base, expected)
    np.testing.assert_allclose(forces.generalized(30, rotation), expected[:6], atol=1e-9)
    np.testing.assert_allclose(expected[6:], 0.0, atol=1e-12)
    applied = np.zeros(model.nv)
    wrench = forces.about_center(30, data, base)
    mujoco.mj_applyFT(model, data, wrench[:3], wrench[3:], data.xipos[base], base, applied)
    np.testing.assert_allclose(applied, expected, atol=1e-9)
