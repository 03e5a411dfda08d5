"""Data sets of motions: walks over random ground, of which those are kept that obey every law and that the robot tracks, with a card."""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import _native
from ..errors import InputError
from ..files import write_text
from ..scenario import Robot, Scenario
from .run import Progress, SweepResult
from .run import run as run_sweep
from .spec import Sweep
from .worker import FAILED, SOLVED

_MOST_MOTIONS = 100_000
_WAVES = 5  # of a random ground
_WAVE_LENGTHS = (0.6, 2.5)  # m
_ROOM = 1.5  # m of ground around start and goal
_TRACKED = ("pass", "marginal")
_SPACING = 0.04  # m


@dataclass(frozen=True)
class Dataset:
    """What was made: motions, and how many attempts it took."""

    folder: Path
    rows: list[dict[str, Any]]  # of the motions: as in a sweep, and `sha256` of the plan
    attempts: SweepResult
    written: list[Path]
    complete: bool

    def __repr__(self) -> str:
        """How many motions there are."""
        return f"<warpgait.Dataset: {len(self.rows)} motions of {len(self.attempts.rows)} attempts in {self.folder}>"


def ground(random: np.random.Generator, roughness: float) -> str:
    """A random ground as a formula: waves in random directions, whose standard deviation is `roughness`, m."""
    low, high = (math.log(length) for length in _WAVE_LENGTHS)
    lengths = np.exp(random.uniform(low, high, _WAVES))
    heights = random.uniform(0.5, 1.0, _WAVES) * lengths  # longer waves are higher
    heights *= roughness * math.sqrt(2.0 / float((heights**2).sum()))
    terms = []
    for height, length in zip(heights, lengths, strict=True):
        angle, phase = random.uniform(0.0, 2 * math.pi, 2)
        kx, ky = 2 * math.pi / length * math.cos(angle), 2 * math.pi / length * math.sin(angle)
        terms.append(f"{height:.5f}*sin({kx:.4f}*x + {ky:.4f}*y + {phase:.4f})")
    return " + ".join(terms).replace("+ -", "- ")


def attempts(
    count: int, seed: int, gaits: Sequence[str], distance: tuple[float, float], roughness: tuple[float, float]
) -> list[dict[str, Any]]:
    """The values of this many cases; the first ones are the same whatever the count."""
    found = []
    for number in range(count):
        random = np.random.default_rng([seed, number])
        heading, far = random.uniform(-math.pi, math.pi), random.uniform(*distance)
        found.append(
            {
                "terrain.expression": ground(random, float(random.uniform(*roughness))),
                "start.yaw": round(float(heading), 4),
                "goal.position": [round(float(far * f(heading)), 4) for f in (math.cos, math.sin)],
                "gait.kind": gaits[int(random.integers(len(gaits)))],
            }
        )
    return found


def dataset(
    robot: str = "anymal_c",
    *,
    folder: str | Path,
    count: int = 10,
    export: str = "isaaclab",
    seed: int = 0,
    gaits: Sequence[str] = ("walk", "trot"),
    distance: tuple[float, float] = (0.4, 1.2),
    roughness: tuple[float, float] = (0.0, 0.04),
    horizon: float = 6.0,
    replay: bool = True,
    most_attempts: int | None = None,
    values: dict[str, Any] | None = None,
    time_limit: float = 300.0,
    memory_limit: float = 4.0,
    workers: int | None = None,
    scheduler: Any = None,
    begin: Callable[[int, int], object] | None = None,
    progress: Progress | None = None,
) -> Dataset:
    """Make `count` motions over random ground, in a format of `warpgait export`, and a card that says what they are.

    Heading, distance in m, gait, and ground are drawn at random; `roughness` is the ground's standard deviation, m. A motion is kept if every
    law of `warpgait check` holds and, with `replay`, if the robot tracks it in MuJoCo. It takes as many attempts as that needs, but at most
    `most_attempts`, by default three for each motion and ten more. What is there is not made again. Raises `InputError`.
    """
    if not 1 <= count <= _MOST_MOTIONS:
        raise InputError(f"--count {count}: expected from 1 to {_MOST_MOTIONS}")
    for name, (low, high) in (("distance", distance), ("roughness", roughness)):
        if not (math.isfinite(low) and math.isfinite(high) and 0.0 <= low <= high <= 100.0):
            raise InputError(f"--{name}: expected two numbers from 0 to 100, the lesser first, m")
    if not gaits:
        raise InputError("--gaits: expected at least one")
    from ..commands.export import chosen

    target = chosen(export)
    reach = round(distance[1] + _ROOM, 2)
    base = Scenario(
        robot=robot,
        horizon=horizon,
        terrain={"kind": "formula", "expression": "0*x", "extent": [-reach, reach, -reach, reach], "spacing": _SPACING},
        start=(0.0, 0.0),
        goal=(0.0, 0.0),
    ).set(values or {})
    _ = base.terrain  # refuses values that are wrong
    if (target.joints or replay) and robot not in Robot.with_joints():
        what = f"--to {export} needs joint angles" if target.joints else "a replay needs a full model"
        raise InputError(f"--robot {robot}: {what}; plan for one of {', '.join(Robot.with_joints())}")
    most = 3 * count + 10 if most_attempts is None else most_attempts
    sweep = Sweep(
        scenario=base, inputs=(), kind="listed", time_limit=time_limit, memory_limit=memory_limit, replay=replay, export=export
    )
    tried = min(count, most)
    while True:
        some = replace(sweep, listed=tuple(attempts(tried, seed, gaits, distance, roughness)))
        found = run_sweep(
            some, Path(folder), title="Attempts", workers=workers, scheduler=scheduler, begin=begin, progress=progress
        )
        good = [row for row in found.rows if row["motion"] and (not replay or row["verdict"] in _TRACKED)]
        missing = count - len(good)
        if missing <= 0 or tried >= most or found.interrupted:
            break
        # As many more as will do at the rate of success so far.
        rate = max(len(good) / tried, 0.1)
        tried = min(most, tried + max(math.ceil(missing / rate), 1))
    return _write(some, found, good[:count], count, _facts(locals()))


def _facts(given: dict[str, Any]) -> dict[str, Any]:
    names = ("robot", "export", "seed", "gaits", "distance", "roughness", "horizon", "replay", "values")
    return {name: given[name] if not isinstance(given[name], tuple) else list(given[name]) for name in names}


def _why(row: dict[str, Any]) -> str:
    """Why an attempt is not in the data set, without its numbers."""
    if row["status"] == SOLVED:
        return f"not tracked: {str(row['first_failure']).split(':')[0].split(',')[0]}"
    if row["status"] == FAILED:
        return f"failed: {row['broken_laws'] or 'not solved'}"
    return f"{row['status']}: {str(row['reason']).split(': ')[-1][:80]}"


def _range(values: list[float]) -> str:
    return f"{min(values):.3g} to {max(values):.3g}, median {float(np.median(values)):.3g}" if values else "none"


def _write(sweep: Sweep, found: SweepResult, good: list[dict[str, Any]], wanted: int, facts: dict[str, Any]) -> Dataset:
    folder = found.folder
    results = {row["case"]: json.loads((folder / "cases" / f"{row['case']}.json").read_text(encoding="utf-8")) for row in good}
    for row in good:
        row["sha256"] = hashlib.sha256((folder / row["plan"]).read_bytes()).hexdigest()
    kept = {row["case"] for row in good}
    lost = Counter(_why(row) for row in found.rows if row["case"] not in kept and not (row["status"] == SOLVED and row["motion"]))
    spare = sum(row["status"] == SOLVED and bool(row["motion"]) and row["case"] not in kept for row in found.rows)
    seconds = [results[row["case"]]["frames"] / results[row["case"]]["rate"] for row in good]
    margins: dict[str, list[float]] = {}
    for row in good:
        for name, value in results[row["case"]].get("margins", {}).items():
            if value is not None:
                margins.setdefault(name, []).append(value)
    card = {
        "program": "warpgait",
        "commit": _native.COMMIT,
        **facts,
        "motions": len(good),
        "wanted": wanted,
        "attempts": len(found.rows),
        "spare": spare,
        "frames": sum(results[row["case"]]["frames"] for row in good),
        "seconds": sum(seconds),
        "rate_hz": results[good[0]["case"]]["rate"] if good else None,
        "gait_counts": dict(Counter(row["gait.kind"] for row in good)),
        "verdicts": dict(Counter(row["verdict"] for row in good if row["verdict"])),
        "failed": dict(lost.most_common()),
        "least_margins": {name: min(values) for name, values in margins.items()},
        "files": [
            {"motion": row["motion"], "plan": row["plan"], "plan_sha256": row["sha256"], "verdict": row["verdict"]}
            for row in good
        ],
        "scenario": sweep.scenario.text(),
    }
    written = [folder / "README.md", folder / "card.json"]
    write_text(written[1], json.dumps(card, indent=1) + "\n")
    write_text(written[0], _card(card, margins))
    return Dataset(folder, good, found, [*written, folder / "index.html"], len(good) == wanted)


def _card(card: dict[str, Any], margins: dict[str, list[float]]) -> str:
    """The card for people."""
    failed = "\n".join(f"| {reason.replace('|', '/')} | {count} |" for reason, count in card["failed"].items())
    tracked = (
        "that the robot tracks in a replay in MuJoCo (verdict pass or marginal)" if card["replay"] else "that were not replayed"
    )
    gaits = ", ".join(f"{count} {gait}" for gait, count in card["gait_counts"].items())
    left = "\n".join(f"| {name} | {_range(values)} |" for name, values in margins.items())
    return f"""# {card["motions"]} motions of {card["robot"]} over random ground

{card["motions"]} planned motions ({gaits or "none"}; {card["frames"]} frames at {card["rate_hz"]} Hz, {card["seconds"]:.0f} s) that obey every law of `warpgait check`, and {tracked}. `motions/` has them in the format `{card["export"]}`, each with its certificate and, beside it, its ground; `plans/` has the plans and the reports of their replays; `card.json` has all of this for programs.

## How they were made

By warpgait, commit {card["commit"]}, with seed {card["seed"]}. Each motion starts at rest at the origin of a ground of its own, a sum of {_WAVES} waves of {_WAVE_LENGTHS[0]:g} to {_WAVE_LENGTHS[1]:g} m with a standard deviation of {card["roughness"][0]:g} to {card["roughness"][1]:g} m, and goes {card["distance"][0]:g} to {card["distance"][1]:g} m straight ahead in a random direction, within {card["horizon"]:g} s, in one of the gaits {", ".join(card["gaits"])}.

## What was left out

{card["attempts"]} attempts were made for {card["wanted"]} motions; {card["spare"]} good ones were not needed.

| why | attempts |
| --- | --- |
{failed or "| nothing | 0 |"}

The data set has what the planner can plan and the controller of the replay can track: hard ground is rarer in it than in the draw.

## What the motions leave of the limits

| limit | what is left, by motion |
| --- | --- |
{left or "| unknown | |"}

Fractions of the limits of friction, torque and speed, and rad of the range of the joints.
"""
