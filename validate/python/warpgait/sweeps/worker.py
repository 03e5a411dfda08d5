"""Plans one case, in a process of its own: a JSON object on standard input, its result on standard output.

The process limits its own memory and processor time, so that a case that goes wrong harms no other, even when nobody watches it any more.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path
from typing import Any

SOLVED, FAILED, REFUSED = "solved", "failed", "refused"
_SPARE_SECONDS = 10.0  # of processor time beyond the limit, which the pool enforces by the clock


def _limit(order: dict[str, Any]) -> None:
    memory, seconds = int(order["memory_limit"] * 2**30), int(order["time_limit"] + _SPARE_SECONDS)
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _worst(checks: list[dict[str, Any]]) -> tuple[str | None, float | None]:
    """The law that comes nearest to its limit, and the fraction of the limit that it uses; what binds a plan."""
    uses = [(row["value"] / row["limit"], row["name"]) for row in checks if row["value"] is not None and row["limit"] > 0]
    return (max(uses)[1], max(uses)[0]) if uses else (None, None)


def solve(order: dict[str, Any]) -> dict[str, Any]:
    """Plan the case; returns its result."""
    from ..errors import InputError
    from ..scenario import Scenario

    start = time.perf_counter()
    try:
        plan = Scenario.read(order["scenario"]).set(order["values"]).solve()
        if order["plan"] is not None:
            Path(order["plan"]).parent.mkdir(parents=True, exist_ok=True)
            plan.save(order["plan"])
    except InputError as error:
        return {"status": REFUSED, "reason": str(error), "seconds": time.perf_counter() - start}
    solver, checks = plan.meta["solver"], plan.meta["checks"]
    broken = [row["name"] for row in checks if not row["passed"]]
    worst, used = _worst(checks)
    good = plan.solved and not broken
    reason = "" if good else f"{solver['status']}; fails {', '.join(broken) or 'no check'}"
    return {
        "status": SOLVED if good else FAILED,
        "reason": reason,
        "solved": plan.solved,
        "broken_laws": " ".join(broken),
        "binding_law": worst,
        "binding_fraction": used,
        "iterations": solver["iterations"],
        "violation": solver["max_violation"],
        "solver_seconds": solver["seconds"]["total"],
        "seconds": time.perf_counter() - start,
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def main() -> int:
    """Read an order, and print its result."""
    order = json.load(sys.stdin)
    _limit(order)
    try:
        result = solve(order)
    except MemoryError:
        return 1
    print(json.dumps(result, allow_nan=False))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
