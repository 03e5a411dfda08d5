"""Sweeps on a Dask cluster: a scheduler and workers in processes of their own, some of which are killed."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import WALK

import warpgait
from warpgait import InputError
from warpgait.commands.sweep import main
from warpgait.sweeps import cluster

pytest.importorskip("distributed")


class Cluster:
    """A scheduler and workers on this machine."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.file = folder, folder / "scheduler.json"
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        deadline = time.monotonic() + 60
        while not self.file.is_file() and time.monotonic() < deadline:
            time.sleep(0.05)
        self.address = json.loads(self.file.read_text())["address"]
        self.workers = [self._start("worker", "--no-nanny", "--nthreads", "1", "--no-dashboard") for _ in range(2)]

    def _start(self, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-P", "-m", "dask", *words, "--scheduler-file", str(self.file)]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=self.folder)

    def close(self) -> None:
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.wait()


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Cluster]:
    (tmp_path / "cluster").mkdir()
    found = Cluster(tmp_path / "cluster")
    yield found
    found.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    # The ground is a file, which the workers do not see; they are in another folder.
    y, x = np.mgrid[-1.5:1.5:61j, -1.5:1.5:61j]
    warpgait.write_terrain(tmp_path / "ground.npz", 0.03 * np.sin(3 * x) * np.cos(2 * y), spacing=0.05, layout="y-up")
    ground = '[terrain]\nkind = "heightmap"\nfile = "ground.npz"\n'
    start, end = WALK.index("[terrain]"), WALK.index("[start]")
    (tmp_path / "walk.toml").write_text(WALK[:start].replace("horizon = 3.0", "horizon = 2.0") + ground + WALK[end:])
    yaws = "start.yaw = { from = -0.3, to = 0.3, count = 5 }"
    (tmp_path / "s.toml").write_text(f'scenario = "walk.toml"\n[values]\n{yaws}\ngoal.position = [[0.2, 0.0], [9.0, 0.0]]\n')
    return tmp_path


def test_a_worker_that_dies_loses_nothing_and_doubles_nothing(dask: Cluster, folder: Path) -> None:
    seen: list[int] = []

    def progress(finished: int, count: int, result: dict[str, Any]) -> None:
        assert count == 10 and finished == len(seen) + 1
        seen.append(result["number"])
        if len(seen) == 2:
            dask.workers[0].kill()

    found = warpgait.sweep(folder / "s.toml", scheduler=dask.address, progress=progress)
    assert sorted(seen) == list(range(10))
    assert found.counts == {"solved": 5, "refused": 5} and dask.workers[0].wait() < 0
    assert [row["number"] for row in found.rows] == list(range(10))
    plans = list(found.plans())
    assert len(plans) == 5 and all(plan.passed for _, plan in plans)
    assert {path.name for path in (folder / "s.sweep/plans").iterdir()} == {Path(row["plan"]).name for row, _ in plans}
    refused = next(row for row in found.rows if row["status"] == "refused")
    assert "outside the terrain" in refused["reason"] and "/tmp" not in refused["reason"]
    # What is there is not planned again, wherever it was planned.
    again = warpgait.sweep(folder / "s.toml", progress=progress)
    assert len(seen) == 10 and again.rows == found.rows


def test_a_lost_scheduler_is_told_and_the_sweep_goes_on_elsewhere(
    dask: Cluster, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def progress(finished: int, _count: int, _result: dict[str, Any]) -> None:
        if finished == 2:
            dask.scheduler.kill()

    with pytest.raises(InputError, match=r"scheduler tcp://.* is lost; the same command goes on"):
        warpgait.sweep(folder / "s.toml", scheduler=dask.address, progress=progress)
    assert main([str(folder / "s.toml"), "-q", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["outcomes"] == {"solved": 5, "refused": 5}


def test_no_scheduler_and_no_package_are_told(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT", 0.5)
    assert main([str(folder / "s.toml"), "-q", "--scheduler", "tcp://127.0.0.1:9"]) == 2
    said = capsys.readouterr().err
    assert "--scheduler tcp://127.0.0.1:9: no scheduler answers there" in said and said.count("\n") == 1
    assert main([str(folder / "s.toml"), "-q", "--scheduler", "nonsense:"]) == 2
    assert "no scheduler answers there" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main([str(folder / "s.toml"), "-q", "--scheduler", "tcp://127.0.0.1:9"]) == 2
    assert 'pip install "warpgait[cluster]"' in capsys.readouterr().err
