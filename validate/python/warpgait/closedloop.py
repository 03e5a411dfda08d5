"""A plan, its full robot, and what the controller follows: everything that a simulated replay starts from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .adhesion import adhesion, greatest
from .arrays import Array
from .collision import SelfCollision
from .conditions import Payload, payload_of
from .controllers import WholeBody, usable
from .criteria import Metric
from .metrics import judge_closed_loop, judge_collisions
from .model import Indices, find_model, indices, load_robot, load_spec, model_file
from .plan import Heightfield, Plan
from .reference import Reference
from .replay import Incident, Replay
from .scene import build_world
from .settings import PHYSICS_RATES, Disturbance
from .simulation import Simulation
from .trunk import trunk_forces


@dataclass(frozen=True)
class Robot:
    """The full robot as the controller sees it, and which of its feet stick."""

    path: Path
    model: Any  # without contacts
    index: Indices
    adhesive: tuple[str, ...]
    payload: Payload | None = None


def robot_of(plan: Plan, model: str | None) -> Robot:
    """Load `model`, or the full model of the plan's robot."""
    path = model_file(model) if model else find_model(plan.robot.name)
    payload = payload_of(plan)
    own = load_robot(path, plan.robot.gravity, payload)
    adhesive = tuple(f for f, sticks in zip(plan.foot_names, plan.foot_adhesive, strict=True) if sticks)
    return Robot(path, own, indices(own, plan.foot_names), adhesive, payload)


def world_of(plan: Plan, robot: Robot, terrain: Heightfield, disturbance: Disturbance) -> Any:
    """The MuJoCo model of the robot on `terrain`, changed by the disturbance."""
    strength = greatest(plan.pull_limit * plan.weight, plan.weight)
    friction, gravity, start = plan.robot.friction, plan.robot.gravity, plan.foot_position[0].mean(0)
    return build_world(
        robot.path, terrain, friction, gravity, robot.adhesive, strength, disturbance, start, payload=robot.payload
    )


@dataclass(frozen=True)
class Outcome:
    """A simulated replay and its judgment."""

    replay: Replay
    metrics: list[Metric]
    incidents: list[Incident]


class ClosedLoop:
    """Replays one plan in worlds that may differ from it."""

    def __init__(self, plan: Plan, robot: Robot, reference: Reference, start: Array) -> None:
        """`start` (nq,) is the posture of the first sample."""
        self.plan, self.robot, self.reference, self.start = plan, robot, reference, start
        pull = plan.pull_limit * plan.weight
        self._adhesion = adhesion(reference, plan.foot_adhesive, usable(plan.robot.friction), pull, plan.weight)
        self._collision = SelfCollision(load_spec(robot.path), robot.index)

    def collisions(self, layer: str, t: Array, qpos: Array) -> Metric:
        """Whether the robot hits itself in postures `qpos` (K, nq) at times `t` (K,)."""
        return judge_collisions(layer, self._collision.find(t, qpos))

    def run(self, layer: str, world: Any, disturbance: Disturbance, rate: float = PHYSICS_RATES[0]) -> Outcome:
        """Replay in `world`, with time steps of 1/`rate` s, and judge as `layer`."""
        plan, robot, reference = self.plan, self.robot, self.reference
        world.opt.timestep = 1 / rate
        applied = trunk_forces(plan, robot.model, reference.t)
        controller = WholeBody(robot.model, robot.index, reference, plan.robot.friction, self._adhesion, applied=applied)
        index = indices(world, plan.foot_names)
        simulation = Simulation(
            world, robot.model, index, reference, controller, self._adhesion, self.start, disturbance, applied
        )
        replay = simulation.run()
        metrics, incidents = judge_closed_loop(layer, plan, replay, reference, index)
        if len(replay.t) > 1:
            metrics.append(self.collisions(layer, replay.t, replay.qpos[:, : robot.model.nq]))
        return Outcome(replay, metrics, incidents)
