"""A plan in, evidence out: both layers, both controllers, smoothed and raw terrain."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from .controllers import JointPD, WholeBody
from .errors import InputError
from .metrics import Metric, Verdict, closed_loop, open_loop
from .model import Indices, check_mujoco, find_model, indices, load_spec
from .openloop import OpenLoop, analyse
from .plan import Array, Heightfield, Plan
from .reference import Reference, sample
from .replay import Incident, Replay, run
from .scene import Disturbance, build

PD_RATE = 500.0  # Hz
ADHESION_RESERVE = 1.1  # strength of the adhesion over the pull that the plan may use


@dataclass(frozen=True)
class Settings:
    """How to validate."""

    model: str | None = None  # full model to replay on; default: the plan's robot
    rate: float = 250.0  # Hz, of the whole-body controller
    second_opinion: bool = True  # joint PD as well
    raw: bool = True  # the raw heightfield as well, if the plan has one
    disturbance: Disturbance = field(default_factory=Disturbance)


@dataclass(frozen=True)
class Trial:
    """One simulated replay and its judgement."""

    name: str
    counts: bool  # towards the verdict
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
    world: Any  # MuJoCo model with the planned terrain
    index: Indices
    settings: Settings
    analysis: OpenLoop
    metrics: list[Metric]  # of the open loop
    incidents: list[Incident]  # of the open loop
    trials: list[Trial]
    notes: list[str]
    seconds: float

    @property
    def verdict(self) -> Verdict:
        """The worst of the open loop and of the trials that count."""
        return max([m.verdict for m in self.metrics] + [t.verdict for t in self.trials if t.counts])

    @property
    def shown(self) -> Trial:
        """The replay to look at: of those that count, the first with the worst verdict."""
        return max((t for t in self.trials if t.counts), key=lambda t: t.verdict)

    @property
    def first_failure(self) -> Incident | None:
        """The earliest incident, of a plan that does not pass; at the same time, the open loop's, which needs no simulation to be true."""
        if self.verdict is Verdict.PASS:
            return None
        found = self.incidents + [i for t in self.trials if t.counts for i in t.incidents]
        return min(found, key=lambda i: i.time, default=None)


def _notes(plan: Plan, own: Any, path: Path, index: Indices) -> list[str]:
    """What a reader of the report should know first."""
    notes = []
    if not plan.solved:
        notes.append("The plan itself says that it is not solved.")
    mass = float(own.body_mass.sum())
    if abs(mass / plan.robot.mass - 1) > 0.01:
        notes.append(f"Planned for {plan.robot.mass:.2f} kg ({plan.robot.name}), replayed with {mass:.2f} kg ({path.stem}).")
    x_min, x_max, y_min, y_max = plan.terrain.extent
    x, y = plan.foot_position[..., 0], plan.foot_position[..., 1]
    if x.min() < x_min or x.max() > x_max or y.min() < y_min or y.max() > y_max:
        notes.append("Feet leave the plan's heightfield; beyond it the replay's terrain is level with the rim.")
    return notes


def _adhesion(plan: Plan) -> tuple[Array, Array, float]:
    """How hard each foot may pull (E,) N, the preload that friction may count on (E,) N, and the actuators' strength N."""
    limit = plan.pull_limit * plan.weight
    pull = np.where(plan.foot_adhesive, limit, 0.0)
    return pull, pull * ADHESION_RESERVE, limit * ADHESION_RESERVE


def validate(plan: Plan, settings: Settings | None = None, say: Callable[[str], None] = lambda _: None) -> Validation:
    """Judge `plan` on its full robot; `say` gets one line a stage."""
    started = time.perf_counter()
    settings = settings or Settings()
    check_mujoco()
    path = find_model(settings.model or plan.robot.name)
    spec = load_spec(path)
    spec.option.gravity = plan.robot.gravity
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    own = spec.compile()
    index = indices(own, plan.foot_names)
    if not 50 <= settings.rate <= 500 or abs(500 / settings.rate - round(500 / settings.rate)) > 1e-9:
        raise InputError(f"--rate {settings.rate:g}: the control rate must be 500 Hz divided by a whole number, and at least 50")

    pull, preload, strength = _adhesion(plan)
    adhesive = tuple(f for f, sticks in zip(plan.foot_names, plan.foot_adhesive, strict=True) if sticks)

    def world_on(terrain: Heightfield) -> Any:
        return build(path, terrain, plan.robot.friction, plan.robot.gravity, adhesive, strength, settings.disturbance)

    say("open loop")
    world = world_on(plan.terrain)
    world_index = indices(world, plan.foot_names)
    analysis = analyse(plan, own, world, world_index)
    metrics, incidents = open_loop(plan, analysis, index)
    fine = sample(plan, PD_RATE, index.radius, analysis.rolling)
    coarse = sample(plan, settings.rate, index.radius, analysis.rolling)

    def whole_body() -> WholeBody:
        return WholeBody(own, index, coarse, plan.robot.friction, pull, preload)

    todo: list[tuple[str, bool, Heightfield, Any, Reference, Any]] = [
        ("closed loop", True, plan.terrain, world, coarse, whole_body())
    ]
    if settings.raw and plan.terrain_raw is not None:
        raw = plan.terrain_raw
        todo.append(("closed loop, raw terrain", True, raw, world_on(raw), coarse, whole_body()))
    if settings.second_opinion:
        joints = analysis.qpos[:, index.qpos]
        todo.append(("second opinion: joint PD", False, plan.terrain, world, fine, JointPD(own, index, fine, plan.t, joints)))
    trials = []
    for name, counts, terrain, model, reference, controller in todo:
        say(name)
        replay = run(model, own, world_index, reference, controller, analysis.qpos[0], settings.disturbance)
        trials.append(Trial(name, counts, terrain, reference, replay, *closed_loop(plan, replay, reference, index, name)))
    notes = _notes(plan, own, path, index)
    seconds = time.perf_counter() - started
    return Validation(plan, path, world, world_index, settings, analysis, metrics, incidents, trials, notes, seconds)
