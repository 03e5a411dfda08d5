"""`warpgait sweep`: cases, limits, resuming, shards, results."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import WALK

import warpgait
from warpgait import InputError
from warpgait.commands.sweep import main
from warpgait.sweeps import spec

GRID = """
scenario = "walk.toml"
time_limit = 60.0
[values]
gait.kind = ["walk", "trot"]
goal.position = [[0.3, 0.0], [9.0, 0.0]]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "walk.toml").write_text(WALK.replace("horizon = 3.0", "horizon = 2.0"))
    (tmp_path / "s.toml").write_text(GRID)
    return tmp_path


def sweep(folder: Path, *words: str) -> int:
    return main([str(folder / "s.toml"), *words])


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "s.sweep/results.csv").open() as file:
        return list(csv.DictReader(file))


def test_every_case_has_a_row_with_its_reason(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sweep(folder, "--json", "-q") == 0
    assert json.loads(capsys.readouterr().out)["outcomes"] == {"solved": 2, "refused": 2}
    found = rows(folder)
    assert [(row["gait.kind"], row["goal.position"]) for row in found] == [
        (kind, goal) for kind in ("walk", "trot") for goal in ("[0.3, 0.0]", "[9.0, 0.0]")
    ]
    for row in found:
        if row["status"] == "solved":
            assert 0 < float(row["binding_fraction"]) < 1 and row["binding_law"] and float(row["memory_mb"]) > 20
            plan = warpgait.load(folder / "s.sweep" / row["plan"])
            assert plan.solved and f'kind = "{row["gait.kind"]}"' in plan.meta["scenario"]
        else:
            assert row["status"] == "refused" and "outside the terrain" in row["reason"] and not row["plan"]
    page = (folder / "s.sweep/index.html").read_text()
    assert "2 solved, 2 refused" in page and "1 of 2" in page and "http" not in page


def test_a_parquet_file_has_the_same_rows(folder: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    assert sweep(folder, "-q") == 0
    table = parquet.read_table(folder / "s.sweep/results.parquet").to_pylist()
    assert [row["status"] for row in table] == [row["status"] for row in rows(folder)]
    assert isinstance(table[0]["iterations"], int) and table[1]["iterations"] is None


def test_it_resumes_and_plans_nothing_twice(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sweep(folder, "--shard", "2/2", "-q") == 0
    assert capsys.readouterr().out.startswith("2 cases: 2 refused")
    before = {path: path.stat().st_mtime_ns for path in (folder / "s.sweep/cases").iterdir()}
    assert len(before) == 2
    assert sweep(folder) == 0
    said = capsys.readouterr()
    assert "2 of 4 cases have results" in said.err and "3 of 4: solved" in said.err and said.out.startswith("4 cases: ")
    assert all(path.stat().st_mtime_ns == at for path, at in before.items())
    # Another scenario makes other cases; what is half written is planned again.
    (folder / "walk.toml").write_text(WALK.replace("horizon = 3.0", "horizon = 2.2"))
    assert sweep(folder, "--list") == 0
    listed = capsys.readouterr().out.splitlines()
    assert len(listed) == 4 and not {line.split()[1] for line in listed} & {
        path.stem for path in (folder / "s.sweep/cases").iterdir()
    }
    torn = next(iter(before))
    torn.write_text("{")
    (folder / "walk.toml").write_text(WALK.replace("horizon = 3.0", "horizon = 2.0"))
    assert sweep(folder, "-q") == 0
    assert json.loads(torn.read_text())["status"] == "refused"


def test_time_and_memory_are_limited(folder: Path) -> None:
    (folder / "s.toml").write_text(
        'scenario = "walk.toml"\ntime_limit = 1.0\n[values]\nhorizon = [60.0]\nsolver.tolerance = [1e-9]\n'
    )
    assert sweep(folder, "-q") == 0
    assert rows(folder)[0]["status"] == "timed out" and rows(folder)[0]["reason"] == "not done after 1 s"
    (folder / "s.toml").write_text('scenario = "walk.toml"\nmemory_limit = 0.1\n[values]\nhorizon = [30.0]\n')
    assert sweep(folder, "-q") == 0
    assert rows(folder)[0]["status"] == "killed" and "memory was limited to 0.1 GiB" in rows(folder)[0]["reason"]
    (folder / "s.toml").write_text('scenario = "walk.toml"\nmemory_limit = 3.0\n[values]\nhorizon = [30.0]\n')
    assert sweep(folder, "-q") == 0 and rows(folder)[0]["status"] == "killed"  # as before
    assert sweep(folder, "-q", "--again") == 0 and rows(folder)[0]["status"] == "solved"


def test_an_interruption_ends_the_processes_and_keeps_what_is_done(folder: Path) -> None:
    (folder / "s.toml").write_text('scenario = "walk.toml"\n[values]\nhorizon = [2.0, 200.0, 201.0, 202.0]\n')
    command = [sys.executable, "-P", "-m", "warpgait.commands.sweep", str(folder / "s.toml"), "--workers", "2"]
    # Where these tests run in the background of a shell, interruptions are ignored, which a process inherits.
    heed: Any = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, **heed)
    deadline = time.monotonic() + 60
    while not list((folder / "s.sweep/cases").glob("*.json")) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.kill(run.pid, signal.SIGINT)
    out, err = run.communicate(timeout=30)
    assert run.returncode == 130, err
    assert "goes on from here" in err and "1 solved" in out
    assert [row["status"] for row in rows(folder)] == ["solved"]
    # Its processes are in its session, and none is left.
    left = [path for path in Path("/proc").glob("[0-9]*/stat") if _session(path) == run.pid]
    assert left == []


def _session(stat: Path) -> int:
    try:
        return int(stat.read_text().rpartition(")")[2].split()[3])
    except OSError:
        return 0


def test_random_values_are_the_same_every_time(folder: Path) -> None:
    text = 'scenario = "walk.toml"\nkind = "random"\ncount = 50\nseed = 3\n[values]\nstart.yaw = { from = -1.0, to = 1.0 }\ngait.kind = ["walk", "trot"]\n'
    (folder / "s.toml").write_text(text)
    cases = spec.read(folder / "s.toml").cases()
    assert cases == spec.read(folder / "s.toml").cases() and len({case.name for case in cases}) == 50
    yaws = np.array([case.values["start.yaw"] for case in cases])
    assert yaws.min() < -0.7 and yaws.max() > 0.7 and np.abs(yaws).max() <= 1.0
    assert {case.values["gait.kind"] for case in cases} == {"walk", "trot"}
    (folder / "s.toml").write_text(text.replace("seed = 3", "seed = 4"))
    assert [case.values for case in spec.read(folder / "s.toml").cases()] != [case.values for case in cases]


def test_a_range_in_a_grid_is_evenly_spaced(folder: Path) -> None:
    (folder / "s.toml").write_text(
        'scenario = "walk.toml"\n[values]\nhorizon = { from = 2, to = 4, count = 5 }\ngait.duty = [0.7, 0.8]\n'
    )
    cases = spec.read(folder / "s.toml").cases()
    assert [case.values["horizon"] for case in cases[::2]] == [2.0, 2.5, 3.0, 3.5, 4.0] and len(cases) == 10


BAD: list[tuple[str, str]] = [
    ("[values]\nhorizon = [1.0]\n", "scenario: expected the name"),
    ('scenario = "walk.toml"\n', "values: expected a table"),
    ('scenario = "walk.toml"\n[values]\n', "values: expected a table"),
    ('scenario = "none.toml"\n[values]\nhorizon = [1.0]\n', "none.toml: there is no such file"),
    ('scenario = "walk.toml"\nworkers = 2\n[values]\nhorizon = [1.0]\n', "workers: unknown key; allowed here: scenario"),
    ('scenario = "walk.toml"\nkind = "all"\n[values]\nhorizon = [1.0]\n', "kind: 'all': expected grid or random"),
    ('scenario = "walk.toml"\nkind = "random"\n[values]\nhorizon = [1.0]\n', "count: is missing"),
    ('scenario = "walk.toml"\ntime_limit = 0\n[values]\nhorizon = [1.0]\n', "time_limit: 0: expected a number from 1"),
    ('scenario = "walk.toml"\nmemory_limit = nan\n[values]\nhorizon = [1.0]\n', "memory_limit: nan"),
    ('scenario = "walk.toml"\nkeep_plans = 1\n[values]\nhorizon = [1.0]\n', "keep_plans: 1: expected true or false"),
    ('scenario = "walk.toml"\n[values]\nhorizon = []\n', "values.horizon: has no value"),
    ('scenario = "walk.toml"\n[values]\nhorizon = 2.0\n', "values.horizon: 2.0: expected a list"),
    ('scenario = "walk.toml"\n[values]\nhorizon = { from = 1.0, to = 2.0 }\n', "values.horizon: count: in a grid"),
    ('scenario = "walk.toml"\n[values]\nhorizon = { from = 1.0, till = 2.0 }\n', "values.horizon: a range has numbers"),
    ('scenario = "walk.toml"\n[values]\nhorizon = [1.0\n', "cannot be read as a sweep"),
    (
        'scenario = "walk.toml"\n[values]\na = { from = 0, to = 1, count = 2000 }\nb = { from = 0, to = 1, count = 2000 }\n',
        "more than 1000000 combinations",
    ),
]


@pytest.mark.parametrize(("text", "words"), BAD)
def test_bad_input_is_one_line_and_writes_nothing(
    folder: Path, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "s.toml").write_text(text)
    assert sweep(folder) == 2
    said = capsys.readouterr()
    assert words in said.err and said.err.count("\n") == 1 and said.out == ""
    assert not (folder / "s.sweep").exists()


def test_bad_options_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--shard", "3/2"], ["--shard", "0/2"], ["--shard", "a"], ["--workers", "0"]):
        assert sweep(folder, *words) == 2
        assert words[0] in capsys.readouterr().err
    (folder / "s.sweep").write_text("")
    assert sweep(folder) == 2 and "cannot make this folder" in capsys.readouterr().err


def test_text_in_values_is_only_shown(folder: Path) -> None:
    (folder / "s.toml").write_text(
        'scenario = "walk.toml"\n[values]\nterrain.expression = ["0*x", "<script>alert(1)</script>"]\n'
    )
    assert sweep(folder, "-q") == 0
    found: Any = (folder / "s.sweep/index.html").read_text()
    assert "<script" not in found and "&lt;script&gt;" in found
    assert [row["status"] for row in rows(folder)] == ["solved", "refused"]


def test_the_function_sweeps_scenarios(folder: Path) -> None:
    told: list[tuple[int, int]] = []
    found = warpgait.sweep(
        warpgait.Scenario.read(folder / "walk.toml"),
        {"gait.kind": ["walk", "trot"], "goal.position": [(0.3, 0.0)]},
        folder=folder / "out",
        workers=2,
        progress=lambda finished, count, _: told.append((finished, count)),
    )
    assert found.counts == {"solved": 2} and told == [(1, 2), (2, 2)] and found.folder == folder / "out"
    assert [row["gait.kind"] for row in found.rows] == ["walk", "trot"]
    assert [plan.passed for _, plan in found.plans()] == [True, True]
    assert "2 solved" in repr(found) and "<iframe" in found._repr_html_()
    # A file that says the same has the same cases, which have results.
    again = warpgait.sweep(
        folder / "walk.toml", {"gait.kind": ["walk", "trot"], "goal.position": [[0.3, 0.0]]}, folder=folder / "out"
    )
    assert again.rows == found.rows
    with pytest.raises(InputError, match="folder: is missing"):
        warpgait.sweep(warpgait.Scenario.read(folder / "walk.toml"), {"horizon": [2.0]})
    with pytest.raises(InputError, match="values: are missing"):
        warpgait.sweep(warpgait.Scenario())
    with pytest.raises(InputError, match="count: is missing"):
        warpgait.sweep(folder / "walk.toml", {"horizon": [2.0]}, kind="random")
    with pytest.raises(InputError, match="kinds: unknown key"):
        warpgait.sweep(folder / "walk.toml", {"horizon": [2.0]}, kinds="random")


def test_every_case_has_a_process_of_its_own_and_those_share_the_start(folder: Path) -> None:
    (folder / "s.toml").write_text('scenario = "walk.toml"\n[values]\nsolver.max_iterations = [1, 2, 3, 4, 5, 6]\n')
    assert sweep(folder, "-q", "--workers", "1") == 0
    results = [json.loads(path.read_text()) for path in (folder / "s.sweep/cases").iterdir()]
    assert [result["status"] for result in results] == ["failed"] * 6
    assert all(result["laws"] and len(result["path"]) == 24 and result["warpgait_commit"] for result in results)
    assert all(float(row["memory_mb"]) < 300 for row in rows(folder))


def test_a_plan_that_cannot_be_written_is_planned_again_on_request(folder: Path) -> None:
    (folder / "s.toml").write_text('scenario = "walk.toml"\n[values]\nhorizon = [2.0]\n')
    (case,) = spec.read(folder / "s.toml").cases()
    in_the_way = folder / "s.sweep" / "plans" / f"{case.name}.plan.npz"
    in_the_way.mkdir(parents=True)
    assert sweep(folder, "-q") == 0
    assert rows(folder)[0]["status"] == "killed" and "the plan cannot be written: " in rows(folder)[0]["reason"]
    in_the_way.rmdir()
    assert sweep(folder, "-q") == 0 and rows(folder)[0]["status"] == "killed"  # as before
    assert sweep(folder, "-q", "--again") == 0 and rows(folder)[0]["status"] == "solved"
