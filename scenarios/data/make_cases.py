#!/usr/bin/env python3
"""Generates grounds with edges by seed, and can plan and replay on each of them.

Kinds: stairs-up and stairs-down (10 to 18 cm by 26 to 36 cm, some with a landing), step (up or down by 10 to 30 cm), curb (8 to
16 cm, at up to 60 degrees), gap (10 to 30 cm), stones (25 to 35 cm long, up to 15 cm apart, uneven by 3 cm), hurdle (5 to 15 cm high),
blocks (random heights up to 12 cm). Stairs, gaps and hurdles are turned by up to 20 degrees. Cells of 2 cm; all else is default.

    .venv/bin/python scenarios/data/make_cases.py OUT --seeds 10 20                    # KIND-SEED.toml and .npy in OUT
    .venv/bin/python scenarios/data/make_cases.py OUT --seeds 10 20 --run              # solves, checks and replays them, too
    .venv/bin/python scenarios/data/make_cases.py OUT --kinds gap,step --robot anymal_b --run --formulation direct
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

CELL = 0.02  # m
KINDS = ["stairs-up", "stairs-down", "step", "curb", "gap", "stones", "hurdle", "blocks"]
NAMES = {"stairs-up": "stairsup", "stairs-down": "stairsdn", "curb": "kerb"}  # seeds of the random numbers
DEEP = -0.5  # m, between stones


def turned(x: np.ndarray, y: np.ndarray, angle: float) -> np.ndarray:
    """The coordinate along a direction."""
    return np.cos(angle) * x + np.sin(angle) * y


def ground(kind: str, seed: int, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Heights, m, and the x of the goal."""
    random = np.random.default_rng([seed, sum(map(ord, NAMES.get(kind, kind)))])
    along = turned(x, y, np.radians(random.uniform(-20, 20)))
    if kind.startswith("stairs"):
        rise, run, count = random.uniform(0.10, 0.18), random.uniform(0.26, 0.36), int(random.integers(3, 6))
        landing = 0.5 if random.random() < 0.3 else 0.0
        edges = [0.6 + run * k + (landing if k >= count // 2 else 0.0) for k in range(count)]
        heights = sum((along > edge).astype(float) for edge in edges) * rise
        return heights if kind == "stairs-up" else -heights, min(edges[-1] + 0.55, 3.1)
    if kind == "step":
        return np.where(along > 0.8, random.uniform(0.1, 0.3) * random.choice([-1, 1]), 0.0), 1.9
    if kind == "curb":
        along = turned(x - 0.8, y, np.radians(random.uniform(-60, 60)))
        return np.where(along > 0, random.uniform(0.08, 0.16), 0.0), 1.9
    if kind == "gap":
        width = random.uniform(0.1, 0.3)
        return np.where((along > 0.8) & (along < 0.8 + width), -random.choice([0.15, 0.4, 1.0]), 0.0), 2.0
    if kind == "stones":
        length, apart = random.uniform(0.25, 0.35), random.uniform(0.05, 0.15)
        pitch = length + apart
        random.uniform()
        tops = random.uniform(-0.03, 0.03, (60, 60))
        column, row = np.floor((x - 0.3) / pitch).astype(int), np.floor((y + 1.5) / pitch).astype(int)
        on_stone = (np.mod(x - 0.3, pitch) < length) & (np.mod(y + 1.5, pitch) < length)
        heights = np.where(on_stone, tops[column % 60, row % 60], DEEP)
        return np.where((x < 0.3) | (x > 2.3), 0.0, heights), 2.6
    if kind == "hurdle":
        height, width = random.uniform(0.05, 0.15), random.uniform(0.04, 0.2)
        return np.where((along > 0.8) & (along < 0.8 + width), height, 0.0), 2.0
    size = random.uniform(0.25, 0.5)
    tops = random.uniform(0, 0.12, (60, 60))
    heights = tops[np.floor((x + 1.3) / size).astype(int), np.floor((y + 1.5) / size).astype(int)]
    return np.where((x < 0.2) | (x > 2.4), 0.0, heights), 2.6


def write(folder: Path, kind: str, seed: int, robot: str) -> Path:
    """The scenario and its heights; returns the scenario's file."""
    x, y = np.meshgrid(np.arange(266) * CELL - 1.3, np.arange(151) * CELL - 1.5)
    heights, goal = ground(kind, seed, x, y)
    name = f"{kind}-{seed}"
    np.save(folder / f"{name}.npy", heights[::-1].astype(np.float64))  # the first row has the largest y
    center = [(x.min() + x.max()) / 2, (y.min() + y.max()) / 2]
    file = folder / f"{name}.toml"
    file.write_text(
        f'[robot]\nname = "{robot}"\n\n'
        f'[terrain]\nkind = "heightmap"\nfile = "{name}.npy"\nspacing = {CELL}\n'
        f"origin = [{center[0]:.6f}, {center[1]:.6f}]\n\n"
        f"[start]\nposition = [-0.4, 0.0]\n\n[goal]\nposition = [{goal}, 0.0]\n"
    )
    return file


def attempt(file: Path, program: str, formulation: str, replay_options: list[str]) -> str:
    """Solves, checks and replays one scenario; returns pass, marginal, fail, or what went wrong before the replay."""
    plan = file.with_suffix(".plan.npz")
    solve = [program, "solve", str(file), "-o", str(plan), "--formulation", formulation, "--no-plot", "--json"]
    solved = subprocess.run(solve, capture_output=True, text=True, check=False)
    if solved.returncode == 2:
        return f"refused: {solved.stderr.strip().splitlines()[-1]}"
    if solved.returncode != 0:
        return "not solved, or a check fails"
    replay = [sys.executable, "-m", "warpgait.commands.validate", str(plan), "--no-files", "--json", *replay_options]
    return str(json.loads(subprocess.run(replay, capture_output=True, text=True, check=False).stdout)["verdict"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--kinds", default=",".join(KINDS), help="separated by commas")
    parser.add_argument("--seeds", type=int, nargs=2, default=[0, 10], metavar=("FIRST", "END"))
    parser.add_argument("--robot", default="anymal_c")
    parser.add_argument("--formulation", default="hybrid")
    parser.add_argument("--run", action="store_true", help="solve, check and replay")
    parser.add_argument("--no-robust", action="store_true", help="replay without the worlds that differ from the plan's")
    parser.add_argument("--program", default="target/release/warpgait", help="warpgait")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    counts: dict[str, int] = {}
    for kind in options.kinds.split(","):
        if kind not in KINDS:
            parser.error(f"unknown kind {kind!r}; allowed: {', '.join(KINDS)}")
        for seed in range(*options.seeds):
            file = write(options.out, kind, seed, options.robot)
            if options.run:
                ended = attempt(file, options.program, options.formulation, ["--no-robust"] * options.no_robust)
                print(f"{file.stem}: {ended}", flush=True)
                counts[ended.split(":")[0]] = counts.get(ended.split(":")[0], 0) + 1
    if options.run:
        print(", ".join(f"{count} {ended}" for ended, count in sorted(counts.items())))


if __name__ == "__main__":
    main()
