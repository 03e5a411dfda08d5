"""Plans cases one after another, each in a process of its own, forked from this one: an order a line on standard input, a result a line on
standard output, both JSON.

What takes time before a first plan, the start of Python and the imports, is done once. A case that goes wrong ends its own process, which
has its limits of time and memory, and harms no other.
"""

from __future__ import annotations

import json
import os
import resource
import select
import signal
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from .. import _native  # noqa: F401 (loaded before the forks)
from ..children import end_with
from ..errors import InputError
from ..files import stem_of
from ..plans import Plan
from ..scenario import Scenario
from ..settings import without_opengl

SOLVED, FAILED, REFUSED, TIMED_OUT, KILLED = "solved", "failed", "refused", "timed out", "killed"
_SPARE_SECONDS = 10.0  # of processor time beyond the limit, which is enforced by the clock
_GRACE = 2.0  # s between asking a process to end and ending it
_PATH_POINTS = 24  # of the picture of a motion


def _limit(order: dict[str, Any]) -> None:
    memory, seconds = int(order["memory_limit"] * 2**30), int(order["time_limit"] + _SPARE_SECONDS)
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _worst(checks: list[dict[str, Any]]) -> tuple[str | None, float | None]:
    """The law that comes nearest to its limit, and the fraction of the limit that it uses; what binds a plan."""
    uses = [(row["value"] / row["limit"], row["name"]) for row in checks if row["value"] is not None and row["limit"] > 0]
    return (max(uses)[1], max(uses)[0]) if uses else (None, None)


def _path(plan: Plan) -> list[list[float]]:
    """The base's way from above, m."""
    times = [plan.duration * k / (_PATH_POINTS - 1) for k in range(_PATH_POINTS)]
    return [[round(float(x), 3), round(float(y), 3)] for x, y, _ in plan.base(times).position]


def solve(order: dict[str, Any]) -> dict[str, Any]:
    """Plan the case; returns its result."""
    start = time.perf_counter()
    try:
        scenario = Scenario.read(order["scenario"]) if "scenario" in order else Scenario.from_text(order["text"])
        plan = scenario.set(order["values"]).solve()
    except InputError as error:
        return {"status": REFUSED, "reason": str(error), "seconds": time.perf_counter() - start}
    if order["plan"] is not None:
        try:
            Path(order["plan"]).parent.mkdir(parents=True, exist_ok=True)
            plan.save(order["plan"])
        except (InputError, OSError) as error:  # such as of a full disk: no fault of the case, which can be planned again
            return {"status": KILLED, "reason": f"the plan cannot be written: {error}", "seconds": time.perf_counter() - start}
    try:
        good = plan.solved and plan.passed
        beyond = _beyond(order, plan) if good else {}
    except InputError as error:
        return {"status": REFUSED, "reason": str(error), "seconds": time.perf_counter() - start}
    solver, checks = plan.meta["solver"], plan.meta["checks"]
    broken = [row["name"] for row in checks if not row["passed"]]
    worst, used = _worst(checks)
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
        "path": _path(plan),
        "warpgait_version": plan.meta["warpgait_version"],
        "warpgait_commit": plan.meta["warpgait_commit"],
        "laws": checks,
        **beyond,
    }


def _beyond(order: dict[str, Any], plan: Plan) -> dict[str, Any]:
    """Replay a good plan, and export it if it is tracked, as the order says."""
    found: dict[str, Any] = {}
    if order.get("replay"):
        from ..report import write_json
        from ..settings import Settings

        report = plan.validate(Settings(quick=True))
        write_json(report.validation, plan.path.with_name(f"{stem_of(plan.path)}.report.json"))
        found = {"verdict": report.verdict, "first_failure": report.first_failure}
        if not report.trackable:
            return found
    if order.get("export"):
        from ..commands.export import chosen, export

        target = chosen(order["export"])
        folder = plan.path.parent.parent / "motions"
        folder.mkdir(exist_ok=True)
        written, motion = export(plan.path, target, folder / f"{stem_of(plan.path)}{target.ending}")
        found |= {"motion": f"motions/{written[0].relative_to(folder).parts[0]}", "frames": len(motion.t), "rate": motion.rate}
        found["margins"] = motion.certificate["margins"]
    return found


def _prepare(order: dict[str, Any]) -> None:
    """Import what the order needs before the fork, once for all cases."""
    if order.get("replay") or order.get("export"):
        with without_opengl():
            from .. import motions, report, validation  # noqa: F401


def _child(order: dict[str, Any], output: int, errors: IO[bytes], parent: int) -> None:
    """Plan in this process, and write the result."""
    end_with(parent)
    os.dup2(os.open(os.devnull, os.O_RDWR), 0)
    os.dup2(0, 1)
    os.dup2(errors.fileno(), 2)
    _limit(order)
    content = json.dumps(solve(order), allow_nan=False).encode()
    while content:
        content = content[os.write(output, content) :]


def _end(process: int) -> int:
    """End a process, first by asking; returns how it ended."""
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGTERM)
        deadline = time.monotonic() + _GRACE
        while time.monotonic() < deadline:
            found, status = os.waitpid(process, os.WNOHANG)
            if found:
                return status
            time.sleep(0.02)
        os.kill(process, signal.SIGKILL)
    return os.waitpid(process, 0)[1]


def _killed(order: dict[str, Any], status: int, errors: IO[bytes]) -> dict[str, Any]:
    errors.seek(0)
    said = errors.read()[-4000:].decode(errors="replace").strip().splitlines()
    code = os.waitstatus_to_exitcode(status)
    how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    memory = f"its memory was limited to {order['memory_limit']:g} GiB"
    return {"status": KILLED, "reason": f"the process ended with {how}; {memory}{'; ' + said[-1] if said else ''}"}


def run(order: dict[str, Any]) -> dict[str, Any] | None:
    """The result of an order; none when whoever gave it is gone."""
    _prepare(order)
    started = time.monotonic()
    reading, writing = os.pipe()
    with tempfile.TemporaryFile() as errors:
        parent = os.getpid()
        process = os.fork()
        if process == 0:
            code = 1
            try:
                _child(order, writing, errors, parent)
                code = 0
            except Exception as error:
                os.write(2, f"{type(error).__name__}: {error}".encode(errors="replace"))
            finally:
                os._exit(code)
        os.close(writing)
        content = b""
        with open(reading, "rb", buffering=0) as result:
            while True:
                left = order["time_limit"] - (time.monotonic() - started)
                ready = select.select([result, sys.stdin], [], [], max(left, 0.0))[0]
                if not ready:
                    _end(process)
                    return {"status": TIMED_OUT, "reason": f"not done after {order['time_limit']:g} s"} | _since(started)
                if sys.stdin in ready:  # no order comes before the result of the last one: it was closed
                    _end(process)
                    return None
                part = result.read(1 << 16)
                if not part:
                    break
                content += part
        status = os.waitpid(process, 0)[1]
        if status == 0:
            return dict(json.loads(content)) | _since(started)
        return _killed(order, status, errors) | _since(started)


def _since(started: float) -> dict[str, float]:
    return {"wall_seconds": time.monotonic() - started}


def main() -> int:
    """Read orders, and print their results."""
    # Whoever started this process ends it; Ctrl-C is theirs.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while line := sys.stdin.readline():
        result = run(json.loads(line))
        if result is None:
            break
        print(json.dumps(result, allow_nan=False), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
