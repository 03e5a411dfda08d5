#!/usr/bin/env python3
"""Generates random errands on gentle ground by seed, and can plan them: robots, gaits, ways and grounds that nobody chose by hand.

Grounds are flat, ripples, a tilted plane, or sums of waves with slopes up to about 0.25, for a robot of ANYmal's size; for others they go by
size, as all lengths do. Ways are straight, over one to three way-points (some with a time or a heading), sideways or backward, on the spot,
or around a circle. The speed is 0.1 to 0.2 m/s for walks and 0.15 to 0.35 m/s for trots. All else is default.

    .venv/bin/python scenarios/data/make_errands.py OUT --seeds 0 200            # errand-SEED.toml in OUT
    .venv/bin/python scenarios/data/make_errands.py OUT --seeds 0 40 --run       # solves and checks them, too
    .venv/bin/python scenarios/data/make_errands.py OUT --seeds 0 40 --run --replay
"""

import argparse
import json
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np

ROBOTS = {  # size in ANYmals
    "anymal_b": 1.0,
    "anymal_c": 1.0,
    "a1": 0.65,
    "go1": 0.65,
    "go2": 0.65,
    "b1": 1.0,
    "hyq": 1.35,
    "solo12": 0.55,
}
WAYS = ["straight", "points", "points", "timed", "aside", "backward", "turn", "circle"]


def ground(random: np.random.Generator, size: float) -> str:
    """The table [terrain]."""
    half = 4.0 * size
    extent = f"extent = [{-half:.3f}, {half:.3f}, {-half:.3f}, {half:.3f}]\n"
    kind = random.choice(["flat", "ripples", "plane", "waves"])
    if kind == "flat":
        return f'kind = "flat"\n{extent}'
    if kind == "ripples":
        terms = [f"{0.06 * size:.4f}*sin({2.6 / size:.4f}*x)*sin({2.6 / size:.4f}*y)"]
    elif kind == "plane":
        slope, direction = random.uniform(0.05, 0.25), random.uniform(-np.pi, np.pi)
        terms = [
            f"{slope * np.cos(direction):.4f}*x",
            f"{slope * np.sin(direction):.4f}*y",
        ]
    else:
        terms = []
        for _ in range(3):
            wave, direction = (
                random.uniform(1.0, 3.0) / size,
                random.uniform(-np.pi, np.pi),
            )
            height = random.uniform(0.03, 0.12) / wave
            terms.append(
                f"{height:.4f}*sin({wave * np.cos(direction):.4f}*x + {wave * np.sin(direction):.4f}*y"
                f" + {random.uniform(0, 6.3):.4f})"
            )
    return f'kind = "formula"\nexpression = "{" + ".join(terms)}"\n{extent}'


def errand(seed: int) -> str:
    """A scenario."""
    random = np.random.default_rng([seed, 16])
    robot = str(random.choice(list(ROBOTS)))
    size = ROBOTS[robot]
    gait = str(random.choice(["walk", "walk", "trot"]))
    way = str(random.choice(WAYS))
    heading = random.uniform(-np.pi, np.pi)
    start = random.uniform(-0.8, 0.8, 2) * size

    def ahead(place: np.ndarray, direction: float, length: float) -> np.ndarray:
        return place + length * size * np.array([np.cos(direction), np.sin(direction)])

    def words(place: np.ndarray) -> str:
        return f"[{place[0]:.3f}, {place[1]:.3f}]"

    speed = random.uniform(0.1, 0.2) if gait == "walk" else random.uniform(0.15, 0.35)
    lines = [f"speed = {speed * size:.3f}"]
    points: list[str] = []
    yaw = ""
    goal = ahead(start, heading, random.uniform(0.6, 1.6))
    if way in ("points", "timed"):
        places, direction = [start], heading
        for _ in range(int(random.integers(2, 5))):
            places.append(ahead(places[-1], direction, random.uniform(0.5, 1.0)))
            direction += random.uniform(-1.2, 1.2)
        goal = places[-1]
        for place in places[1:-1]:
            point = f"\n[[goal.waypoints]]\nposition = {words(place)}\n"
            if random.random() < 0.3:
                point += (
                    f"yaw = {np.arctan2(np.sin(direction), np.cos(direction)):.3f}\n"
                )
            points.append(point)
        if way == "timed":
            length = sum(float(np.hypot(*(b - a))) for a, b in pairwise(places))
            half = float(np.hypot(*(places[1] - places[0])))
            horizon = length / (speed * size) + 2.0
            time = 0.05 * round((1.0 + half / length * (horizon - 2.0)) / 0.05)
            points[0] += f"time = {time:.2f}\n"
            lines = []
            return scenario(
                robot,
                random,
                size,
                gait,
                f"horizon = {0.05 * round(horizon / 0.05):.2f}\n",
                start,
                yaw,
                goal,
                lines,
                points,
            )
    elif way in ("aside", "backward"):
        turned = (
            np.pi
            if way == "backward"
            else random.choice([-1.0, 1.0]) * random.uniform(0.8, 1.57)
        )
        yaw = f"yaw = {np.arctan2(np.sin(heading + turned), np.cos(heading + turned)):.3f}\n"
        lines[0] = f"speed = {0.6 * speed * size:.3f}"
    elif way == "turn":
        goal = start
        yaw = f"yaw = {heading:.3f}\n"
        turn = random.choice([-1.0, 1.0]) * random.uniform(1.0, 5.0)
        end = np.arctan2(np.sin(heading + turn), np.cos(heading + turn))
        short = np.arctan2(np.sin(turn), np.cos(turn))
        lines += [f"yaw = {end:.3f}", f"turns = {round((turn - short) / (2 * np.pi))}"]
        lines[0] = f"speed = {0.6 * speed * size:.3f}"
    elif way == "circle":
        center = ahead(start, heading, random.uniform(0.6, 1.2))
        turns = random.choice([-1.0, 1.0]) * random.uniform(0.25, 1.0)
        arm, angle = start - center, 2 * np.pi * turns
        goal = (
            center
            + np.array(
                [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            )
            @ arm
        )
        lines.append(f"circle = {{ center = {words(center)}, turns = {turns:.3f} }}")
    return scenario(robot, random, size, gait, "", start, yaw, goal, lines, points)


def scenario(
    robot: str,
    random: np.random.Generator,
    size: float,
    gait: str,
    first: str,
    start: np.ndarray,
    yaw: str,
    goal: np.ndarray,
    lines: list[str],
    points: list[str],
) -> str:
    more = "".join(f"{line}\n" for line in lines)
    return (
        f'{first}[robot]\nname = "{robot}"\n\n[terrain]\n{ground(random, size)}\n'
        f'[gait]\nkind = "{gait}"\n\n[start]\nposition = [{start[0]:.3f}, {start[1]:.3f}]\n{yaw}\n'
        f"[goal]\nposition = [{goal[0]:.3f}, {goal[1]:.3f}]\n{more}{''.join(points)}"
    )


def attempt(file: Path, program: str, replay: bool) -> str:
    """Solves and checks one errand; returns how it ended."""
    plan = file.with_suffix(".plan.npz")
    solve = [program, "solve", str(file), "-o", str(plan), "--no-plot", "--json"]
    solved = subprocess.run(solve, capture_output=True, text=True, check=False)
    if solved.returncode == 2:
        return f"refused: {solved.stderr.strip().splitlines()[-1]}"
    result = json.loads(solved.stdout)
    if not result["solved"]:
        return f"not solved: {result['solver']['status']}"
    if solved.returncode != 0:
        failed = [
            f"{row['name']} {row['value']:.3g}"
            for row in result["checks"]
            if not row["passed"]
        ]
        return f"checks fail: {', '.join(failed)}"
    if not replay:
        return "solved"
    validate = [program, "validate", str(plan), "--no-files", "--json", "--quick"]
    replayed = subprocess.run(validate, capture_output=True, text=True, check=False)
    if replayed.returncode > 1:
        return f"not replayed: {replayed.stderr.strip().splitlines()[-1]}"
    report = json.loads(replayed.stdout)
    return f"replay {report['verdict']}: {report['first_failure']}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument(
        "--seeds", type=int, nargs=2, default=[0, 200], metavar=("FIRST", "END")
    )
    parser.add_argument("--run", action="store_true", help="solve and check")
    parser.add_argument("--replay", action="store_true", help="with --run, also replay")
    parser.add_argument("--program", default="target/release/warpgait", help="warpgait")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    counts: dict[str, int] = {}
    for seed in range(*options.seeds):
        file = options.out / f"errand-{seed}.toml"
        file.write_text(errand(seed))
        if options.run:
            ended = attempt(file, options.program, options.replay)
            print(f"{file.stem}: {ended}", flush=True)
            counts[ended.split(":")[0]] = counts.get(ended.split(":")[0], 0) + 1
    if options.run:
        print(", ".join(f"{count} {ended}" for ended, count in sorted(counts.items())))


if __name__ == "__main__":
    main()
