"""A plan in, evidence out: laws, open loop and closed loop, with two time steps, on planned and raw terrain."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import laws
from .arrays import Array
from .collision import SelfCollision
from .controllers import WholeBody
from .criteria import Metric, Verdict
from .errors import InputError
from .metrics import OPEN_LOOP, judge_closed_loop, judge_collisions, judge_open_loop
from .model import Indices, check_mujoco, find_model, indices, load_robot, load_spec, model_file
from .openloop import OpenLoop, analyze
from .plan import Heightfield, Plan
from .reference import Reference, sample
from .replay import Incident, Replay
from .scene import build_world
from .settings import PHYSICS_RATES, Settings
from .simulation import Simulation

ADHESION_FACTOR = 1.1  # strength of the simulated adhesion, as a multiple of the largest pull that the plan may use
NOTED_MASS_ERROR = 0.01  # fraction by which the masses of plan and model may differ without a note


@dataclass(frozen=True)
class Trial:
    """One simulated replay and its judgment."""

    name: str
    terrain: Heightfield
    reference: Reference
    replay: Replay
    metrics: list[Metric]
    incidents: list[Incident]

    @property
    def verdict(self) -> Verdict:
        """The worst of its metrics."""
        return max(m.verdict for m in self.metrics)


@dataclass(frozen=True)
class Validation:
    """Everything that was found."""

    plan: Plan
    model_path: Path
    index: Indices
    settings: Settings
    laws: laws.Laws  # none where `settings.check` is off
    analysis: OpenLoop
    metrics: list[Metric]  # of the open loop
    trials: list[Trial]
    notes: list[str]
    seconds: float

    @property
    def all_metrics(self) -> list[Metric]:
        """The metrics that decide the verdict: laws, open loop, and all trials."""
        return [*self.laws.metrics, *self.metrics, *(m for t in self.trials for m in t.metrics)]

    @property
    def verdict(self) -> Verdict:
        """The worst of all metrics."""
        return max(m.verdict for m in self.all_metrics)

    @property
    def trackable(self) -> bool:
        """Whether the robot walks the plan: passed, or marginal."""
        return self.verdict is not Verdict.FAIL

    @property
    def shown(self) -> Trial:
        """The trial that plots and pictures show: the first with the worst verdict."""
        return max(self.trials, key=lambda t: t.verdict)

    @property
    def first_failure(self) -> Incident | None:
        """The first metric that decides the verdict of a plan that does not pass: what is wrong, when and with which foot."""
        if self.verdict is Verdict.PASS:
            return None
        metric = next(m for m in self.all_metrics if m.verdict is self.verdict)
        return Incident(metric.time, metric.reason, metric.foot)


@dataclass(frozen=True)
class _Robot:
    """The full robot as the controllers see it, and how its feet stick."""

    path: Path
    model: Any  # without contacts
    index: Indices
    pull: Array  # (E,) N, how hard each foot may pull
    adhesive: tuple[str, ...]
    adhesion: float  # N, strength of the adhesion actuators

    @property
    def preload(self) -> Array:
        """Adhesion (E,) N that adds to the normal force in the friction law."""
        return self.pull * ADHESION_FACTOR


def _robot(plan: Plan, model: str | None) -> _Robot:
    """Load `model`, or the full model of the plan's robot."""
    path = model_file(model) if model else find_model(plan.robot.name)
    own = load_robot(path, plan.robot.gravity)
    limit = plan.pull_limit * plan.weight
    adhesive = tuple(f for f, sticks in zip(plan.foot_names, plan.foot_adhesive, strict=True) if sticks)
    pull = np.where(plan.foot_adhesive, limit, 0.0)
    return _Robot(path, own, indices(own, plan.foot_names), pull, adhesive, limit * ADHESION_FACTOR)


def _notes(plan: Plan, robot: _Robot) -> list[str]:
    """What a reader of the report should know first."""
    notes = []
    if not plan.solved:
        notes.append("According to the plan itself, it is not solved.")
    mass = float(robot.model.body_mass.sum())
    if abs(mass / plan.robot.mass - 1) > NOTED_MASS_ERROR:
        notes.append(
            f"Planned for {plan.robot.mass:.2f} kg ({plan.robot.name}), replayed with {mass:.2f} kg ({robot.path.stem})."
        )
    x_min, x_max, y_min, y_max = plan.terrain.extent
    x, y = plan.foot_position[..., 0], plan.foot_position[..., 1]
    if x.min() < x_min or x.max() > x_max or y.min() < y_min or y.max() > y_max:
        notes.append("Feet leave the plan's heightfield. Beyond it, the replay's terrain is level with the rim.")
    return notes


class _Trials:
    """The simulations of one plan."""

    def __init__(self, plan: Plan, robot: _Robot, world: Any, analysis: OpenLoop, settings: Settings) -> None:
        """`world` has the planned terrain."""
        self.plan, self.robot, self.world, self.analysis, self.settings = plan, robot, world, analysis, settings
        self.collision = SelfCollision(load_spec(robot.path), robot.index)
        self.reference = sample(plan, settings.rate, robot.index.radius, analysis.rolling)

    def run(self, say: Callable[[str], None]) -> list[Trial]:
        """The closed loop on the planned terrain with both time steps, and on the raw terrain if asked for."""
        plan, settings = self.plan, self.settings
        trials = []
        for rate in PHYSICS_RATES[:1] if settings.quick else PHYSICS_RATES:
            name = "closed loop" if rate == PHYSICS_RATES[0] else f"closed loop, steps of {1e3 / rate:g} ms"
            say(name)
            self.world.opt.timestep = 1 / rate
            trials.append(self._trial(name, plan.terrain, self.world))
        if settings.raw and plan.terrain_raw is not None:
            name = "closed loop, raw terrain"
            say(name)
            raw = _world_of(plan, self.robot, plan.terrain_raw, settings)
            trials.append(self._trial(name, plan.terrain_raw, raw))
        return trials

    def _trial(self, name: str, terrain: Heightfield, world: Any) -> Trial:
        robot, reference = self.robot, self.reference
        controller = WholeBody(robot.model, robot.index, reference, self.plan.robot.friction, robot.pull, robot.preload)
        index, start = indices(world, self.plan.foot_names), self.analysis.qpos[0]
        disturbance = self.settings.disturbance
        replay = Simulation(world, robot.model, index, reference, controller, start, disturbance).run()
        metrics, incidents = judge_closed_loop(name, self.plan, replay, reference, index)
        if len(replay.t) > 1:
            metrics.append(judge_collisions(name, self.collision.find(replay.t, replay.qpos)))
        return Trial(name, terrain, reference, replay, metrics, incidents)


def _world_of(plan: Plan, robot: _Robot, terrain: Heightfield, settings: Settings) -> Any:
    """The MuJoCo model of the robot on `terrain`."""
    friction, gravity = plan.robot.friction, plan.robot.gravity
    return build_world(robot.path, terrain, friction, gravity, robot.adhesive, robot.adhesion, settings.disturbance)


def validate(plan: Plan, settings: Settings | None = None, say: Callable[[str], None] = lambda _: None) -> Validation:
    """Judge `plan` on its full robot. `say` gets the name of each stage as it begins.

    With `settings.check`, the laws of `warpgait check` are judged in the file `plan.path` first.
    """
    started = time.perf_counter()
    settings = settings or Settings()
    check_mujoco()
    found = laws.Laws()
    if settings.check:
        say("check")
        found = laws.check(plan.path)
    # What breaks laws may overflow anywhere, of which NumPy would warn.
    quiet: Any = "ignore" if found.broken else None
    try:
        with np.errstate(all=quiet):
            robot = _robot(plan, settings.model)
            say("open loop")
            world = _world_of(plan, robot, plan.terrain, settings)
            index = indices(world, plan.foot_names)
            analysis = analyze(plan, robot.model, world, index)
            metrics = judge_open_loop(plan, analysis, robot.index)
            simulations = _Trials(plan, robot, world, analysis, settings)
            metrics.append(judge_collisions(OPEN_LOOP, simulations.collision.find(plan.t, analysis.qpos)))
            trials = simulations.run(say)
    except InputError:
        raise
    except Exception as error:
        if not found.broken:
            raise
        # A plan that breaks laws may be anything; there is nothing to report about the replay.
        broken = ", ".join(found.broken)
        raise InputError(f"{plan.path}: cannot be replayed, and fails checks: {broken}; see `warpgait check`") from error
    notes = _notes(plan, robot) + [f"{remark}." for remark in found.remarks]
    if settings.quick:
        notes.append("Quick: the replay with steps of 1 ms was left out.")
    seconds = time.perf_counter() - started
    return Validation(plan, robot.path, index, settings, found, analysis, metrics, trials, notes, seconds)
