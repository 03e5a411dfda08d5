"""Joint speeds and torques that the planner limits, computed again with MuJoCo's kinematics of the full model."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import warpgait
from warpgait.geometry import rotation_from_wxyz
from warpgait.kinematics import legs
from warpgait.model import composite, find_model, indices, load_robot, load_spec, stand
from warpgait.openloop import inverse_dynamics, joint_motion, postures
from warpgait.plan import read_plan
from warpgait.rolling import no_rolling

# Fast and up a slope, so that both limits are active.
SCENARIO = """
schema = 1
formulation = "direct"
horizon = 4.0
[robot]
name = "anymal_c"
[terrain]
kind = "formula"
expression = "0.35*x"
extent = [-2.0, 2.0, -2.0, 2.0]
[start]
position = [-0.4, 0.0]
[goal]
position = [0.2, 0.0]
"""


@pytest.mark.parametrize("known", [True, False])
def test_planned_joints_keep_their_limits_in_mujoco(known: bool, tmp_path: object) -> None:
    robot = find_model("anymal_c").with_suffix(".toml").read_text()
    if not known:  # the same robot without data on its legs
        robot = without_legs(robot)
    folder = str(tmp_path)
    with open(f"{folder}/robot.toml", "w") as file:
        file.write(robot)
    scenario = SCENARIO.replace('name = "anymal_c"', 'file = "robot.toml"')
    with open(f"{folder}/slope.toml", "w") as file:
        file.write(scenario)
    plan = warpgait.solve(f"{folder}/slope.toml")
    assert plan.solved
    speed, torque = peak_fractions(plan)
    if known:
        assert speed < 0.9 and torque < 0.9, (speed, torque)
        assert speed > 0.3 and torque > 0.3, (speed, torque)  # the legs do work
    else:
        assert max(speed, torque) > 0.9, (speed, torque)  # without the constraints, a limit is exceeded


def test_joints_of_the_plan_are_those_of_the_full_model(walk_plan: Path) -> None:
    plan = read_plan(walk_plan)
    assert plan.joint_position is not None and plan.joint_torque is not None
    model = load_robot(find_model(plan.robot.name), plan.robot.gravity)
    index = indices(model, plan.foot_names)
    found = postures(plan, model, index, no_rolling(plan))
    velocity, acceleration = joint_motion(plan, model, found.qpos)
    _, torque = inverse_dynamics(plan, model, index, found.qpos, velocity, acceleration)
    # The posture's fixed-point iteration leaves 0.2 mm.
    assert np.abs(found.qpos[:, index.qpos] - plan.joint_position).max() < 5e-3
    off = np.abs(torque - plan.joint_torque)[1:-1] / index.torque_limit
    assert off.max() < 0.005, off.max()
    assert (np.abs(torque) / index.torque_limit).max() > 0.3  # the legs do work


def without_legs(robot: str) -> str:
    """The text of a robot file without the tables of its legs."""
    head, *feet = robot.split("[[feet]]")
    return "[[feet]]".join([head, *(foot.split("[feet.leg]")[0] for foot in feet)])


def peak_fractions(plan: warpgait.Trajectory) -> tuple[float, float]:
    """Largest joint speed, and largest torque of a massless leg in stance, as fractions of their limits."""
    model = load_spec(find_model("anymal_c")).compile()
    data = mujoco.MjData(model)
    index = indices(model, plan.foot_names)
    stand(model, data)
    center = composite(model, data).center_of_mass
    t = np.arange(0.0, plan.duration, 0.005)
    base, feet = plan.base(t), plan.feet(t)
    rotation = rotation_from_wxyz(base.quaternion_wxyz).as_matrix()
    local = np.einsum("nji,nej->nei", rotation, feet.position - base.position[:, None]) + center + [0, 0, index.radius]
    q = np.stack([leg.inverse(local[:, e])[0] for e, leg in enumerate(legs(model, index.feet))], 1)
    torque = np.zeros(q.shape)
    J = np.zeros((3, model.nv))
    for k in range(len(t)):
        data.qpos[:3] = base.position[k] - rotation[k] @ center
        data.qpos[3:7] = base.quaternion_wxyz[k]
        data.qpos[index.qpos] = q[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for e in range(len(index.feet)):
            mujoco.mj_jac(model, data, J, None, feet.position[k, e], index.body[e])
            torque[k, e] = -J[:, index.qvel[e]].T @ feet.force[k, e]
    speed = np.abs(np.gradient(q, t, axis=0)) / index.speed_limit
    return float(speed.max()), float((np.abs(torque) / index.torque_limit).max())
