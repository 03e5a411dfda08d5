"""A plan in, evidence out: laws, open loop and closed loop, with two time steps, on planned and raw terrain, and in other worlds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import laws, robust
from .closedloop import ClosedLoop, Robot, robot_of, world_of
from .criteria import Metric, Verdict
from .errors import InputError
from .figures import Figure, figures
from .metrics import OPEN_LOOP, judge_open_loop
from .model import Indices, check_mujoco
from .openloop import OpenLoop, analyze
from .plan import Heightfield, Plan
from .reference import Reference, sample
from .replay import Incident, Replay
from .robust import Attempt, attempt_all
from .settings import PHYSICS_RATES, Settings

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
    attempts: list[Attempt]  # in worlds that differ from the plan's; none where they were left out
    notes: list[str]
    seconds: float

    @property
    def all_metrics(self) -> list[Metric]:
        """The metrics that decide the verdict: laws, open loop, all trials, and the worlds that are tracked."""
        return [*self.laws.metrics, *self.metrics, *(m for t in self.trials for m in t.metrics), *self.robust_metrics]

    @property
    def robust_metrics(self) -> list[Metric]:
        """How many of the worlds that differ from the plan's are tracked; empty where they were left out."""
        return [robust.judge(self.attempts)] if self.attempts else []

    @property
    def verdict(self) -> Verdict:
        """The worst of all metrics."""
        return max(m.verdict for m in self.all_metrics)

    @property
    def trackable(self) -> bool:
        """Whether the robot walks the plan: passed, or marginal."""
        return self.verdict is not Verdict.FAIL

    @property
    def figures(self) -> list[Figure]:
        """Figures of the first trial, by which walks are compared. They do not decide the verdict."""
        first = self.trials[0]
        return figures(self.plan, first.replay, first.reference, self.index)

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


def _notes(plan: Plan, robot: Robot) -> list[str]:
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


def _left_out(settings: Settings) -> list[str]:
    """What was not done, for a reader of the report."""
    if settings.quick:
        return ["Quick: the replay with steps of 1 ms and those in worlds that differ from the plan's were left out."]
    if not settings.robust:
        return ["The replays in worlds that differ from the plan's were left out."]
    if not settings.in_other_worlds:
        return ["This world was asked for; the replays in others that differ from the plan's were left out."]
    return []


def _trials(plan: Plan, loop: ClosedLoop, world: Any, settings: Settings, say: Callable[[str], None]) -> list[Trial]:
    """The closed loop on the planned terrain, in `world`, with both time steps, and on the raw terrain if asked for."""
    trials = []

    def add(name: str, terrain: Heightfield, world: Any, rate: float) -> None:
        say(name)
        found = loop.run(name, world, settings.disturbance, rate)
        trials.append(Trial(name, terrain, loop.reference, found.replay, found.metrics, found.incidents))

    for rate in PHYSICS_RATES[:1] if settings.quick else PHYSICS_RATES:
        name = "closed loop" if rate == PHYSICS_RATES[0] else f"closed loop, steps of {1e3 / rate:g} ms"
        add(name, plan.terrain, world, rate)
    if settings.raw and plan.terrain_raw is not None:
        raw = world_of(plan, loop.robot, plan.terrain_raw, settings.disturbance)
        add("closed loop, raw terrain", plan.terrain_raw, raw, PHYSICS_RATES[0])
    return trials


def _attempts(loop: ClosedLoop, settings: Settings, say: Callable[[str], None]) -> list[Attempt]:
    """The closed loop in worlds that differ from the plan's, if asked for."""
    return attempt_all(loop, settings.model, say) if settings.in_other_worlds else []


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
            robot = robot_of(plan, settings.model)
            say("open loop")
            world = world_of(plan, robot, plan.terrain, settings.disturbance)
            analysis = analyze(plan, robot.model, world, robot.index)
            metrics = judge_open_loop(plan, analysis, robot.index)
            posture = analysis.qpos[:, robot.index.qpos] if robot.index.is_redundant else None
            reference = sample(plan, settings.rate, robot.index.radius, analysis.rolling, posture)
            loop = ClosedLoop(plan, robot, reference, analysis.qpos[0])
            metrics.append(loop.collisions(OPEN_LOOP, plan.t, analysis.qpos))
            trials = _trials(plan, loop, world, settings, say)
            attempts = _attempts(loop, settings, say)
    except InputError:
        raise
    except Exception as error:
        if not found.broken:
            raise
        # A plan that breaks laws may be anything; there is nothing to report about the replay.
        broken = ", ".join(found.broken)
        raise InputError(f"{plan.path}: cannot be replayed, and fails checks: {broken}; see `warpgait check`") from error
    notes = _notes(plan, robot) + [f"{remark}." for remark in found.remarks]
    notes += _left_out(settings)
    seconds = time.perf_counter() - started
    return Validation(plan, robot.path, robot.index, settings, found, analysis, metrics, trials, attempts, notes, seconds)
