"""Runs cases on a cluster of Dask workers. Nothing has to be shared: scenarios, grounds and plans travel with the cases.

A case whose worker dies is planned again on another. A result is written once, here, when it has arrived.
"""

from __future__ import annotations

import hashlib
import logging
import tempfile
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import write_bytes
from ..scenario import Scenario
from .pool import Planner, Tell, keep, limits, plan_file
from .spec import Case, Sweep
from .worker import KILLED, REFUSED

_CONNECT = 10.0  # s
_AHEAD = 3  # cases for each thread of the workers that are handed over at once
_FILES = ("terrain", "robot")  # tables whose `file` travels
_MOST_FILE = 512 << 20  # bytes
_local = threading.local()


def _packed(scenario: Scenario, files: dict[str, bytes]) -> str:
    """The scenario as text, in which files are called by their digests; their contents go to `files`."""
    values = scenario.to_dict()
    for name in _FILES:
        table = values.get(name)
        if not isinstance(table, dict) or not isinstance(table.get("file"), str):
            continue
        path = Path(table["file"])
        try:
            if path.stat().st_size > _MOST_FILE:
                raise InputError(f"{path}: is too large to be sent to a cluster")
            content = path.read_bytes()
        except OSError:  # refused where it is planned, with the reason
            continue
        table["file"] = f"{hashlib.sha256(content).hexdigest()[:16]}-{path.name}"
        files[table["file"]] = content
    return Scenario.from_dict(values).text()


def plan_case(order: dict[str, Any], files: dict[str, bytes]) -> tuple[dict[str, Any], dict[str, bytes]]:
    """On a worker: the result of an order, and the files that were written. Each thread has a process that plans."""
    if not hasattr(_local, "planner"):
        _local.planner = Planner()
    with tempfile.TemporaryDirectory(prefix="warpgait-") as place:
        for name, content in files.items():
            (Path(place) / name).write_bytes(content)
        scenario, output = Path(place) / "scenario.toml", Path(place) / "output"
        scenario.write_text(order["text"], encoding="utf-8")
        here: dict[str, Any] = {
            "scenario": str(scenario),
            "values": {},
            "plan": str(output / order["plan"]) if order["plan"] else None,
        }
        result = _local.planner.plan({**order, **here})
        if isinstance(result.get("reason"), str):
            result["reason"] = result["reason"].replace(f"{place}/", "")
        written = [path for path in output.rglob("*") if path.is_file()]
        return result, {str(path.relative_to(output)): path.read_bytes() for path in written}


def run(sweep: Sweep, folder: Path, cases: Iterable[Case], scheduler: Any, tell: Tell) -> None:
    """Plan all cases on the workers of a scheduler, an address or a `distributed.Client`; raises `InputError` if it is lost."""
    try:
        import distributed
    except ImportError as error:
        raise InputError('a cluster needs the package distributed: pip install "warpgait[cluster]"') from error
    if isinstance(scheduler, distributed.Client):
        _run(distributed, scheduler, sweep, folder, list(cases), tell)
        return
    for name in ("distributed", "distributed.client", "distributed.core", "distributed.comm"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what is lost is told below, in one line
    try:
        client = distributed.Client(scheduler, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"--scheduler {scheduler}: no scheduler answers there ({type(error).__name__}: {error})") from error
    try:
        _run(distributed, client, sweep, folder, list(cases), tell)
    finally:
        client.close(timeout=2)


def _run(distributed: Any, client: Any, sweep: Sweep, folder: Path, cases: list[Case], tell: Tell) -> None:
    lost = InputError(f"the scheduler {client.scheduler.address} is lost; the same command goes on from here")
    waiting = cases[::-1]
    running: dict[Any, Case] = {}
    sent: dict[str, Any] = {}  # contents of files that the workers have
    completed = distributed.as_completed(loop=client.loop)

    def submit() -> None:
        case = waiting.pop()
        files: dict[str, bytes] = {}
        order: dict[str, Any] = {"text": _packed(sweep.scenario.set(case.values), files), "plan": None, **limits(sweep)}
        if sweep.keep_plans:
            order["plan"] = str(plan_file(Path(), case))
        for name, content in files.items():
            if name not in sent:
                sent[name] = client.scatter(content, broadcast=True, hash=False)
        future = client.submit(plan_case, order, {name: sent[name] for name in files}, pure=False)
        running[future] = case
        completed.add(future)

    def refill() -> None:
        while waiting and len(running) < _AHEAD * max(sum(client.nthreads().values()), 1):
            submit()

    try:
        client.wait_for_workers(1)
        refill()
        while running:
            future = next(completed)
            case = running.pop(future)
            result, written = _outcome(distributed, client, future, lost)
            for name, content in written.items():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                write_bytes(folder / name, content)
            tell(case, keep(sweep, folder, case, result))
            future.release()
            refill()
    except (distributed.comm.CommClosedError, distributed.CancelledError, TimeoutError) as error:
        raise lost from error
    finally:
        if client.status == "running":
            client.cancel(list(running), force=True)


def _outcome(distributed: Any, client: Any, future: Any, lost: InputError) -> tuple[dict[str, Any], dict[str, bytes]]:
    if future.status == "finished":
        return future.result()  # type: ignore[no-any-return]
    if future.status != "error" or client.status != "running":
        raise lost
    error = future.exception()
    if isinstance(error, distributed.KilledWorker):
        return {"status": KILLED, "reason": f"its workers died: {error}".splitlines()[0], "wall_seconds": 0.0}, {}
    reason = f"the worker refused it: {type(error).__name__}: {error}"
    return {"status": REFUSED if isinstance(error, InputError) else KILLED, "reason": reason, "wall_seconds": 0.0}, {}
