"""Plans the cases of a sweep that have no result yet, here or on a cluster, and writes tables and a page."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..files import ensure_outputs
from ..text import escape
from . import cluster, pool, results
from .spec import Case, Sweep
from .worker import KILLED, TIMED_OUT

if TYPE_CHECKING:
    from ..plans import Plan

MOST_WORKERS = 1024
Progress = Callable[[int, int, Case, dict[str, Any]], object]


@dataclass(frozen=True)
class SweepResult:
    """How the cases of a sweep ended."""

    folder: Path
    rows: list[dict[str, Any]]  # by case: number, case, the values, and the columns of results.csv
    total: int  # cases, with those that have no result yet
    written: list[Path]
    interrupted: bool = False

    @property
    def counts(self) -> dict[str, int]:
        """How many cases ended in which way: solved, failed, refused, timed out or killed."""
        return dict(Counter(row["status"] for row in self.rows).most_common())

    def plans(self) -> Iterator[tuple[dict[str, Any], Plan]]:
        """The rows that are solved and whose plans were kept, with the plans."""
        from ..plans import load

        for row in self.rows:
            if row["status"] == "solved" and row["plan"]:
                yield row, load(self.folder / row["plan"])

    def __repr__(self) -> str:
        """How many cases ended in which way."""
        told = ", ".join(f"{count} {status}" for status, count in self.counts.items()) or "none has a result"
        return f"<warpgait.SweepResult: {self.total} cases: {told}>"

    def _repr_html_(self) -> str:
        """The page for notebooks, in a frame."""
        page = (self.folder / "index.html").read_text(encoding="utf-8")
        return f'<iframe srcdoc="{escape(page)}" width="100%" height="720" style="border:0"></iframe>'


def run(
    sweep: Sweep,
    folder: Path,
    *,
    title: str = "A sweep",
    workers: int | None = None,
    scheduler: Any = None,
    shard: tuple[int, int] = (0, 1),
    again: bool = False,
    one_first: bool = False,
    begin: Callable[[int, int], object] | None = None,
    progress: Progress | None = None,
) -> SweepResult:
    """Plan the cases, or the part `shard` = (which, of how many), that have no result in `folder`; with `again` also those that timed out.

    With `one_first`, the others wait for the first case, in which what they share is built: the map. `begin` is told how many cases have results, of how many; `progress` the same after each, with the case and its result. Ctrl-C is no
    exception here: the result says so, and has what was done. Raises `InputError`, also when a scheduler is lost.
    """
    workers = (os.cpu_count() or 1) if workers is None else workers
    if not 1 <= workers <= MOST_WORKERS:
        raise InputError(f"--workers {workers}: must be from 1 to {MOST_WORKERS}")
    cases = sweep.cases()
    mine = [case for case in cases if case.number % shard[1] == shard[0]]
    try:
        (folder / "cases").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot make this folder ({error.strerror}); name another with --output") from error
    ensure_outputs([folder / name for name in results.FILES], list(sweep.inputs))
    done = {case.name: pool.result_of(folder, case) for case in mine}
    unlucky = (TIMED_OUT, KILLED)
    left = [case for case in mine if (found := done[case.name]) is None or (again and found["status"] in unlucky)]
    finished = len(mine) - len(left)

    def tell(case: Case, result: dict[str, Any]) -> None:
        nonlocal finished
        finished += 1
        if progress is not None:
            progress(finished, len(mine), case, result)

    if begin is not None:
        begin(finished, len(mine))
    interrupted = False
    try:
        if scheduler is None:
            first = 1 if one_first and workers > 1 else 0
            pool.run(sweep, folder, left[:first], 1, tell)
            pool.run(sweep, folder, left[first:], workers, tell)
        elif left:
            cluster.run(sweep, folder, left, scheduler, tell)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        written = results.write(folder, title, cases, sweep.keys)
    return SweepResult(folder, results.rows_of(folder, mine), len(mine), written, interrupted)
