"""Worlds that differ from the plan's, as real ones do: does the robot still walk it?

The differences are those of an ANYmal C, scaled by the robot's weight and size: its center of mass is off by 10 mm, and it carries 2 kg.
"""

from __future__ import annotations

import math
import os
import pickle
import queue
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from . import criteria
from .children import child
from .closedloop import ClosedLoop
from .criteria import Criterion, Metric
from .metrics import ROBUST
from .model import stand
from .settings import Disturbance

CENTER_SHIFT = 0.022  # of the robot's size
MASS_ERROR = 0.1  # of every mass and inertia
FRICTION_LOSS = 0.2  # of the planned friction
PAYLOAD = 0.04  # of the robot's mass
PAYLOAD_PLACE = 0.22  # of the robot's size, forward and to the side of the base's origin
DELAY = 0.004  # s, beside the control step that the controller expects: 8 ms in all, at 250 Hz
NOISE_SEED = 1
# Of the drives, seen from the joint. The rotors have half the inertia of an ANYmal's shank, about its knee.
ROTOR_INERTIA = 7e-4  # of mass times size²
DRIVE_FRICTION = 1.7e-3  # of weight times size


@dataclass(frozen=True)
class World:
    """A world, with what differs in it."""

    name: str
    disturbance: Disturbance


@dataclass(frozen=True)
class Attempt:
    """The replay in one world."""

    world: str
    metrics: list[Metric]

    @property
    def tracked(self) -> bool:
        """Whether no metric is beyond its wider limit, that of a marginal verdict."""
        return all(m.verdict is not criteria.Verdict.FAIL for m in self.metrics)

    @property
    def worst(self) -> Metric:
        """The metric that comes closest to its wider limit, or is farthest beyond it."""
        return max(self.metrics, key=lambda m: _use(m.criterion, m.value))


def _use(criterion: Criterion, value: float) -> float:
    """How much of its wider limit a metric uses: 1 is all of it."""
    if criterion.at_least:
        value, limit = 1 - value, 1 - criterion.marginal
    else:
        limit = criterion.marginal
    if math.isnan(value):
        return math.inf
    return value / limit if limit > 0 else math.inf * (value > 0) if value else 0.0


def size_of(model: Any) -> float:
    """The mean horizontal distance, m, of the feet from the center of mass in the nominal stance."""
    data = mujoco.MjData(model)
    stand(model, data)
    apart = data.site_xpos[:, :2] - data.subtree_com[model.body("base").id][:2]
    return float(np.linalg.norm(apart, axis=1).mean())


def worlds(model: Any, friction: float) -> list[World]:
    """The fixed set for a robot `model` and the planned `friction`."""
    size, mass = size_of(model), float(model.body_mass.sum())
    off, place, load = CENTER_SHIFT * size, PAYLOAD_PLACE * size, PAYLOAD * mass
    shift = f"{1e3 * off:.2g} mm"
    weight = mass * float(np.linalg.norm(model.opt.gravity))
    drives = ROTOR_INERTIA * mass * size**2, DRIVE_FRICTION * weight * size
    heavy, light = 1 + MASS_ERROR, 1 - MASS_ERROR
    return [
        World(f"center of mass {shift} forward", Disturbance(com_shift=(off, 0.0, 0.0))),
        World(f"center of mass {shift} backward", Disturbance(com_shift=(-off, 0.0, 0.0))),
        World(f"center of mass {shift} left", Disturbance(com_shift=(0.0, off, 0.0))),
        World(f"center of mass {shift} right", Disturbance(com_shift=(0.0, -off, 0.0))),
        World(f"masses × {heavy:g}", Disturbance(body_factor=heavy)),
        World(f"masses × {light:g}", Disturbance(body_factor=light)),
        World(f"friction × {1 - FRICTION_LOSS:g}", Disturbance(friction=(1 - FRICTION_LOSS) * friction)),
        World(f"{load:.2g} kg at the front left", Disturbance(payload=(load, place, place, 0.0))),
        World(f"{load:.2g} kg at the rear right", Disturbance(payload=(load, -place, -place, 0.0))),
        World(f"{1e3 * DELAY:g} ms more delay", Disturbance(delay=DELAY)),
        World("sensor noise", Disturbance(noise=1.0, seed=NOISE_SEED)),
        World("inertia and friction of the drives", Disturbance(drives=drives)),
    ]


class _Worker:
    """A process that replays in the worlds it is given. It ends when its standard input does."""

    def __init__(self, job: bytes) -> None:
        command, environment = child("warpgait.worker", "disable")
        pipe = subprocess.PIPE
        # In a session of its own, it does not get Ctrl-C; this process ends it.
        self._process = subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, start_new_session=True)
        self._send(job)

    def _send(self, data: bytes) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(data)
        self._process.stdin.flush()

    def replay(self, disturbance: Disturbance) -> list[Metric]:
        """The metrics in one world; raises what went wrong in the other process."""
        assert self._process.stdout is not None
        try:
            self._send(pickle.dumps(disturbance))
            result = pickle.load(self._process.stdout)
        except (EOFError, BrokenPipeError) as error:
            raise RuntimeError(f"a replay in another world ended with exit code {self._process.wait()}") from error
        if isinstance(result, str):
            raise RuntimeError(f"a replay in another world failed: {result}")
        metrics: list[Metric] = result
        return metrics

    def end(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.communicate()


def attempt_all(loop: ClosedLoop, model: str | None, say: Callable[[str], None]) -> list[Attempt]:
    """Replay in every world, in as many processes as there are processors. `say` gets the progress."""
    todo = worlds(loop.robot.model, loop.plan.robot.friction)
    job = pickle.dumps((loop.plan, model, loop.reference, loop.start))
    waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
    for i in range(len(todo)):
        waiting.put(i)
    found: queue.SimpleQueue[tuple[int, list[Metric] | Exception]] = queue.SimpleQueue()

    def work(worker: _Worker) -> None:
        while True:
            try:
                i = waiting.get_nowait()
                found.put((i, worker.replay(todo[i].disturbance)))
            except queue.Empty:
                return
            except Exception as error:
                found.put((0, error))
                return

    workers = [_Worker(job) for _ in range(min(os.cpu_count() or 1, len(todo)))]
    metrics: list[list[Metric]] = [[] for _ in todo]
    try:
        for worker in workers:
            threading.Thread(target=work, args=[worker], daemon=True).start()
        for done in range(len(todo)):
            say(f"other worlds: {done} of {len(todo)}")
            i, result = found.get()
            if isinstance(result, Exception):
                raise result
            metrics[i] = result
    finally:
        for worker in workers:
            worker.end()
    return [Attempt(world.name, each) for world, each in zip(todo, metrics, strict=True)]


def judge(attempts: list[Attempt]) -> Metric:
    """The percentage of worlds that are tracked."""
    tracked = sum(attempt.tracked for attempt in attempts)
    return Metric(ROBUST, criteria.WORLDS, 100.0 * tracked / len(attempts), what=_lost(attempts))


def _lost(attempts: list[Attempt]) -> str:
    """The worlds that are not tracked, in words."""
    lost = [attempt.world for attempt in attempts if not attempt.tracked]
    return f"worlds that are tracked (lost: {'; '.join(lost)})" if lost else ""
