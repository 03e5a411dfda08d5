"""`warpgait atlas`: places, headings and gaits on a ground, and their map."""

from __future__ import annotations

import csv
import json
import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpgait
from warpgait import InputError, Scenario, Terrain
from warpgait.commands.atlas import main
from warpgait.sweeps import pool
from warpgait.sweeps.atlas import listed, places


def options(folder: Path, *words: str) -> list[str]:
    ground = folder / "ground.npz"
    if not ground.exists():
        y, x = np.mgrid[-1.2:1.2:49j, -1.6:1.6:65j]
        warpgait.write_terrain(ground, 3.0 * np.maximum(x - 0.4, 0.0) + 0 * y, spacing=0.05, layout="y-up")
    values = ["--set", "formulation=direct", "--set", "solver.effort=feasible", "--set", "robot.name=anymal_towr"]
    return [str(ground), *values, "--step", "1.0", "--headings", "2", "--distance", "0.2", "--horizon", "2.0", "-q", *words]


def test_the_places_cover_the_ground() -> None:
    ground = Terrain.formula("0*x", extent=(-1.0, 1.0, -0.5, 0.5), spacing=0.1)
    assert places(ground, 1.0) == [(-0.5, 0.0), (0.5, 0.0)]
    assert places(ground, 5.0) == [(0.0, 0.0)]
    cases = list(listed([(1.0, 2.0)], 4, ("walk", "trot"), 0.5))
    assert (
        len(cases) == 8
        and [case["start.yaw"] for case in cases[::2]] == pytest.approx([0.0, math.pi / 2, math.pi, -math.pi / 2], abs=1e-5)
    ) or abs(cases[4]["start.yaw"]) == pytest.approx(math.pi, abs=1e-5)
    for case in cases:
        ahead = np.array(case["goal.position"]) - [1.0, 2.0]
        np.testing.assert_allclose(ahead, 0.5 * np.array([math.cos(case["start.yaw"]), math.sin(case["start.yaw"])]), atol=2e-6)


def test_a_map_says_where_the_robot_can_start(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(options(tmp_path, "--json")) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["cases"] == 12 and sum(told["outcomes"].values()) == 12
    folder = tmp_path / "ground.atlas"
    with (folder / "atlas.csv").open() as file:
        rows = list(csv.DictReader(file))
    solved = {(float(row["x"]), float(row["y"])) for row in rows if row["status"] == "solved"}
    assert solved and all(x < 0.5 for x, _ in solved)  # not on the slope
    assert all(row["reason"] for row in rows if row["status"] != "solved")
    drawing = ElementTree.fromstring((folder / "atlas.svg").read_text())
    names = {element.tag.rpartition("}")[2] for element in drawing.iter()}
    assert {"image", "path", "text"} <= names
    said = " ".join(drawing.itertext())
    assert "walk: verdict" in said and "law that binds" in said and "solved" in said
    page = (folder / "index.html").read_text()
    assert "<h2>Map</h2>" in page and "data:image/png" in page
    # What is there is not planned again.
    before = {path: path.stat().st_mtime_ns for path in (folder / "cases").iterdir()}
    assert main(options(tmp_path, "--json")) == 0
    assert {path: path.stat().st_mtime_ns for path in (folder / "cases").iterdir()} == before and len(before) == 12


def test_the_function_takes_a_scenario(tmp_path: Path) -> None:
    flat = Terrain.formula("0*x", extent=(-1.2, 1.2, -1.2, 1.2), spacing=0.05)
    base = Scenario(terrain=flat, formulation="direct", robot="anymal_towr", horizon=2.0, start=(0, 0), goal=(0, 0))
    order: list[Any] = []
    found = warpgait.atlas(
        base,
        folder=tmp_path / "a",
        step=2.4,
        headings=1,
        gaits=("walk", "trot"),
        distance=0.2,
        progress=lambda *at: order.append(at[0]),
    )
    assert order == [1, 2] and found.fraction() == 1.0
    assert Counter(row["gait"] for row in found.rows) == {"walk": 1, "trot": 1}
    assert "2 solved" in repr(found) and found._repr_html_().count("<svg") == 4


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--step", "0"], "--step 0.0: expected at least"),
        (["--step", "0.001"], "--step 0.001: expected at least"),
        (["--step", "0.02", "--headings", "360"], "are more than 200000 cases"),
        (["--headings", "0"], "--headings 0"),
        (["--distance", "nan"], "--distance nan"),
        (["--set", "gait"], "--set gait: expected KEY=VALUE"),
        (["--robot", "cow"], "robot.name"),
        (["--workers", "0"], "--workers 0"),
    ],
)
def test_bad_input_is_one_line(tmp_path: Path, words: list[str], what: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(options(tmp_path, *words)) == 2
    said = capsys.readouterr()
    assert what in said.err and said.err.count("\n") == 1 and said.out == ""


def test_a_ground_that_is_not_there_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none.png"), "--spacing", "0.1", "--height-scale", "1"]) == 2
    assert "none.png" in capsys.readouterr().err
    with pytest.raises(InputError):
        warpgait.atlas(Terrain.file(tmp_path / "none.png"), folder=tmp_path / "a")


def test_the_map_is_built_once_before_the_other_cases_begin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache = tmp_path / "cache"
    monkeypatch.setenv("WARPGAIT_CACHE", str(cache))
    seen: list[int] = []

    def progress(finished: int, _count: int, _case: Any, _result: dict[str, Any]) -> None:
        seen.append(len(list(cache.glob("*"))))

    hill = Terrain.formula("0.1*sin(2*x)*cos(y)", extent=(-1.2, 1.2, -1.2, 1.2), spacing=0.05)
    base = Scenario(
        terrain=hill,
        formulation="warped",
        robot="anymal_towr",
        horizon=2.0,
        start=(0, 0),
        goal=(0, 0),
        map={"cells": [10, 10, 6]},
    )
    base = base.set("solver.effort", "feasible")
    started: list[tuple[int, int]] = []
    run = pool.run

    def recorded(sweep: Any, folder: Path, cases: list[Any], workers: int, tell: Any) -> None:
        started.append((len(cases), workers))
        run(sweep, folder, cases, workers, tell)

    monkeypatch.setattr(pool, "run", recorded)
    found = warpgait.atlas(base, folder=tmp_path / "a", step=2.4, headings=3, distance=0.2, workers=2, progress=progress)
    assert started == [(1, 1), (2, 2)] and seen == [1, 1, 1] and found.fraction() == 1.0
