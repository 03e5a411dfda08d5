"""Runs cases in processes of this machine: so many at once, each result written as soon as it is there."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..files import write_text
from .spec import Case, Sweep
from .worker import KILLED

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")  # one a case; the cases share the cores
_POLL = 0.05  # s
_GRACE = 4.0  # s, of a process that is asked to end
Tell = Callable[[Case, dict[str, Any]], None]


def case_file(folder: Path, case: Case) -> Path:
    """Where the result of a case is."""
    return folder / "cases" / f"{case.name}.json"


def plan_file(folder: Path, case: Case) -> Path:
    """Where the plan of a case is."""
    return folder / "plans" / f"{case.name}.plan.npz"


def result_of(folder: Path, case: Case) -> dict[str, Any] | None:
    """The result of a case that has one."""
    try:
        found = json.loads(case_file(folder, case).read_text())
        return found if isinstance(found, dict) and isinstance(found.get("status"), str) else None
    except (OSError, ValueError, RecursionError):
        return None


def limits(sweep: Sweep) -> dict[str, Any]:
    """The part of an order that is the same for all cases."""
    return {
        "memory_limit": sweep.memory_limit,
        "time_limit": sweep.time_limit,
        "replay": sweep.replay,
        "export": sweep.export,
    }


def keep(sweep: Sweep, folder: Path, case: Case, result: dict[str, Any]) -> dict[str, Any]:
    """Write the result of a case, with its values; returns it."""
    plan = plan_file(folder, case)
    kept = f"plans/{plan.name}" if sweep.keep_plans and plan.is_file() else None
    result = {"values": dict(case.values), "number": case.number, **result, "plan": kept}
    write_text(case_file(folder, case), json.dumps(result, indent=1) + "\n")
    return result


class Planner:
    """A process that plans one case after another; one that dies is replaced."""

    def __init__(self) -> None:
        """The process is started with the first case."""
        self._process: subprocess.Popen[str] | None = None

    def plan(self, order: dict[str, Any]) -> dict[str, Any]:
        """The result of an order."""
        if self._process is None or self._process.poll() is not None:
            environment = os.environ | dict.fromkeys(_THREADS, "1")
            command = [sys.executable, "-P", "-m", "warpgait.sweeps.worker"]
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(json.dumps(order) + "\n")
            process.stdin.flush()
            return dict(json.loads(process.stdout.readline()))
        except (OSError, ValueError):
            code = process.wait()
            return {"status": KILLED, "reason": f"the process that plans ended with exit code {code}", "wall_seconds": 0.0}

    def close(self) -> None:
        """End the process, and the case that it plans."""
        if self._process is not None:
            with suppress(OSError):
                self._process.stdin.close()  # type: ignore[union-attr]
            try:
                self._process.wait(_GRACE)
            except subprocess.TimeoutExpired:
                self._process.kill()  # its case ends with it
                self._process.wait()


def run(sweep: Sweep, folder: Path, cases: Iterable[Case], workers: int, tell: Tell) -> None:
    """Plan all cases; an exception, such as Ctrl-C, ends the processes and leaves the results that are there."""
    waiting: queue.SimpleQueue[Case] = queue.SimpleQueue()
    done: queue.SimpleQueue[tuple[Case, dict[str, Any]] | BaseException] = queue.SimpleQueue()
    count = 0
    for case in cases:
        waiting.put(case)
        count += 1
    planners = [Planner() for _ in range(min(workers, count))]
    stopping = threading.Event()

    def work(planner: Planner) -> None:
        try:
            while not stopping.is_set():
                case = waiting.get_nowait()
                plan = str(plan_file(folder, case)) if sweep.keep_plans else None
                done.put((case, planner.plan({**sweep.source, "values": dict(case.values), "plan": plan, **limits(sweep)})))
        except queue.Empty:
            pass
        except BaseException as error:
            done.put(error)

    threads = [threading.Thread(target=work, args=[planner], daemon=True) for planner in planners]
    try:
        for thread in threads:
            thread.start()
        for _ in range(count):
            found = done.get()
            if isinstance(found, BaseException):
                raise found
            tell(found[0], keep(sweep, folder, *found))
    finally:
        stopping.set()
        while any(thread.is_alive() for thread in threads):
            for planner in planners:  # again, for a thread that had just begun with a case
                planner.close()
            for thread in threads:
                thread.join(_POLL)
        for planner in planners:
            planner.close()
