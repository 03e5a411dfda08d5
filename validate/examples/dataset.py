"""Makes a small data set of reference motions: walks to several goals, planned, checked, and replayed on the full robot.

    .venv/bin/python validate/examples/dataset.py walks.npz

It keeps the joint trajectories of the walks that the robot can track, M motions of K samples at 250 Hz:
`q`, `qd`, `tau` (M, K, 12) rad, rad/s, N m in the order of `joint_names`; `base_position` (M, K, 3) m, `base_quaternion_wxyz` (M, K, 4);
`foot_contact` (M, K, 4); `goal` (M, 2) m. The plans and the reports of their replays are beside the data set.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import warpgait
from warpgait.commands.validate import main as validate

SCENARIO = """
schema = 1
formulation = "direct"              # fast; "warped" for rough ground
horizon = 3.0                       # s

[robot]
name = "anymal_c"                   # a robot with a full model

[terrain]
kind = "formula"
expression = "0.04*sin(5*x)*cos(4*y)"
extent = [-1.5, 1.5, -1.5, 1.5]     # m

[start]
position = [0.0, 0.0]               # m

[goal]
position = [0.3, 0.0]               # m, replaced below
"""
MEMBERS = ("q", "qd", "tau", "base_position", "base_quaternion_wxyz", "foot_contact")


def make(target: Path, count: int) -> int:
    """Plan and replay walks to `count` goals on a circle; returns how many were written to `target`."""
    target.parent.mkdir(parents=True, exist_ok=True)
    motions: list[dict[str, Any]] = []
    for i, angle in enumerate(np.linspace(0.0, np.pi, count)):
        goal = [round(0.3 * np.cos(angle), 6), round(0.3 * np.sin(angle), 6)]
        trajectory = warpgait.solve(SCENARIO, overrides={"goal.position": goal})
        if not trajectory.passed:
            print(f"{goal}: no plan that passes every check")
            continue
        plan = target.with_name(f"{target.stem}-{i}.plan.npz")
        trajectory.save(plan)
        # As on the command line; 0 means that the robot tracks the plan. Writes NAME.report.json, NAME.report.html and NAME.replay.npz.
        if validate([str(plan), "--no-pictures", "--quiet"]) != 0:
            print(f"{goal}: not trackable, see {target.stem}-{i}.report.html")
            continue
        with np.load(target.with_name(f"{target.stem}-{i}.replay.npz")) as replay:
            motions.append({name: replay[name] for name in MEMBERS} | {"goal": np.array(goal)})
            joint_names = replay["joint_names"]
    if motions:
        stacked: dict[str, Any] = {name: np.stack([motion[name] for motion in motions]) for name in (*MEMBERS, "goal")}
        np.savez_compressed(target, joint_names=joint_names, **stacked)
    return len(motions)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("target", type=Path, metavar="WALKS.npz")
    parser.add_argument("--count", type=int, default=5)
    options = parser.parse_args()
    print(f"{make(options.target, options.count)} of {options.count} motions in {options.target}")
