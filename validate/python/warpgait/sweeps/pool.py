"""Runs cases in processes: so many at once, each within its limits, each result written as soon as it is there."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..files import write_text
from .spec import Case, Sweep

TIMED_OUT, KILLED = "timed out", "killed"
_POLL = 0.02  # s
_GRACE = 2.0  # s between asking a process to end and ending it
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")  # one a case; the cases share the cores


@dataclass
class _Running:
    case: Case
    process: subprocess.Popen[bytes]  # what it says fits into a pipe
    started: float


def case_file(folder: Path, case: Case) -> Path:
    """Where the result of a case is."""
    return folder / "cases" / f"{case.name}.json"


def result_of(folder: Path, case: Case) -> dict[str, Any] | None:
    """The result of a case that has one."""
    try:
        found = json.loads(case_file(folder, case).read_text())
        return found if isinstance(found, dict) and isinstance(found.get("status"), str) else None
    except (OSError, ValueError, RecursionError):
        return None


def _start(sweep: Sweep, folder: Path, case: Case) -> _Running:
    plan = folder / "plans" / f"{case.name}.plan.npz" if sweep.keep_plans else None
    order = {
        "scenario": str(sweep.scenario),
        "values": dict(case.values),
        "plan": None if plan is None else str(plan),
        "memory_limit": sweep.memory_limit,
        "time_limit": sweep.time_limit,
    }
    environment = os.environ | dict.fromkeys(_THREADS, "1")
    command = [sys.executable, "-P", "-m", "warpgait.sweeps.worker"]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment)
    assert process.stdin is not None
    with suppress(BrokenPipeError), process.stdin as order_pipe:  # a broken one: it has ended, as its exit code will tell
        order_pipe.write(json.dumps(order).encode())
    process.stdin = None
    return _Running(case, process, time.monotonic())


def _ended(running: _Running, sweep: Sweep) -> dict[str, Any]:
    """The result of a process that has ended by itself."""
    output, errors = running.process.communicate()
    try:
        found = json.loads(output)
        if isinstance(found, dict) and running.process.returncode == 0:
            return found
    except (ValueError, RecursionError):
        pass
    said = errors[-4000:].decode(errors="replace").strip().splitlines()
    code = running.process.returncode
    how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    memory = f"its memory was limited to {sweep.memory_limit:g} GiB"
    return {"status": KILLED, "reason": f"the process ended with {how}; {memory}{'; ' + said[-1] if said else ''}"}


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(_GRACE)
    except subprocess.TimeoutExpired:
        process.kill()
    process.communicate()


def run(sweep: Sweep, folder: Path, cases: Iterable[Case], workers: int, tell: Callable[[Case, dict[str, Any]], None]) -> None:
    """Plan all cases; an exception, such as Ctrl-C, ends the processes and leaves the results that are there."""
    waiting = list(cases)[::-1]
    active: list[_Running] = []
    try:
        while waiting or active:
            while waiting and len(active) < workers:
                active.append(_start(sweep, folder, waiting.pop()))
            for running in list(active):
                seconds = time.monotonic() - running.started
                if running.process.poll() is not None:
                    result = _ended(running, sweep)
                elif seconds > sweep.time_limit:
                    _stop(running.process)
                    result = {"status": TIMED_OUT, "reason": f"not done after {sweep.time_limit:g} s"}
                else:
                    continue
                active.remove(running)
                plan = folder / "plans" / f"{running.case.name}.plan.npz"
                result["plan"] = f"plans/{plan.name}" if sweep.keep_plans and plan.is_file() else None
                result = {"values": dict(running.case.values), "number": running.case.number, "wall_seconds": seconds, **result}
                write_text(case_file(folder, running.case), json.dumps(result, indent=2) + "\n")
                tell(running.case, result)
            time.sleep(_POLL)
    finally:
        for running in active:
            _stop(running.process)
