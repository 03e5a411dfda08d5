"""A process that replays one plan in the worlds it is asked for: `robust.py` starts it.

It reads pickles from standard input: the plan, the model's name, the reference and the start, then one `Disturbance` after another until the
input ends. For each it writes a pickle to standard output: the list of metrics, or the text of an error.
"""

from __future__ import annotations

import os
import pickle
import sys
from typing import Any

import numpy as np

from .children import end_with_parent
from .closedloop import ClosedLoop, robot_of, world_of
from .metrics import ROBUST
from .settings import Disturbance


def main() -> int:
    """Serve until standard input ends."""
    end_with_parent()
    # What libraries print must not get between the answers.
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)
        plan, model, reference, start = pickle.load(sys.stdin.buffer)
        robot = robot_of(plan, model)
        loop = ClosedLoop(plan, robot, reference, start)

        def attempt(disturbance: Disturbance) -> Any:
            world = world_of(plan, robot, plan.terrain, disturbance)
            try:
                return loop.run(ROBUST, world, disturbance).metrics
            except Exception as error:  # any; the other process decides what it means
                return f"{type(error).__name__}: {error}"

        with np.errstate(all="ignore"):
            while True:
                try:
                    disturbance = pickle.load(sys.stdin.buffer)
                except EOFError:
                    return 0
                pickle.dump(attempt(disturbance), answers)
                answers.flush()


if __name__ == "__main__":
    raise SystemExit(main())
