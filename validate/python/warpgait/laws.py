"""The laws of `warpgait check`, which come before any replay: what breaks one of them fails."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ._native import check_plan
from .criteria import Criterion, Metric
from .errors import InputError

CHECK = "check"


@dataclass(frozen=True)
class Laws:
    """What the check found."""

    metrics: tuple[Metric, ...] = ()  # one for each law
    remarks: tuple[str, ...] = ()  # where the plan states something else than its scenario asks for

    @property
    def broken(self) -> list[str]:
        """Names of the laws that do not hold."""
        return [m.name for m in self.metrics if m.verdict.value]


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """A plan that breaks laws may be anything, and whatever goes wrong with it is then an `InputError` that names these laws.

    What goes wrong with a plan that obeys them is a mistake of this program, and is raised as it is. Overflows are no warnings.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except InputError:
        raise
    except Exception as error:
        broken = ", ".join(check(path).broken)
        if not broken:
            raise
        raise InputError(f"{path}: cannot be used, and fails checks: {broken}; see `warpgait check`") from error


def check(path: Path) -> Laws:
    """Check the plan in a file; raises `InputError` for one that cannot be read."""
    found = json.loads(check_plan(path))
    metrics = []
    for row in found["checks"]:
        value = math.nan if row["value"] is None else float(row["value"])
        unit = "" if row["unit"] == "1" else row["unit"]
        criterion = Criterion(row["name"], unit, row["limit"], row["limit"])
        metrics.append(Metric(CHECK, criterion, value, row.get("time"), row.get("foot")))
    return Laws(tuple(metrics), tuple(found["remarks"]))
