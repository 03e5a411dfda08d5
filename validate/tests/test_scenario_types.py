"""The types of scenarios are those of the schema."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from warpgait import scenario_types
from warpgait.schema import keys, schema

ROOT = Path(__file__).parents[2]


def test_the_file_is_what_the_schema_says() -> None:
    made = subprocess.run(
        [sys.executable, "scripts/scenario_types.py", "--check"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stderr


def test_every_key_has_a_type() -> None:
    assert scenario_types.ScenarioTables.__annotations__.keys() == schema()["properties"].keys()
    assert scenario_types.GaitSpec.__annotations__.keys() == {key.name.split(".")[1] for key in keys("gait")}
    assert "from" in scenario_types.ForceSpec.__annotations__ and "trot" in str(scenario_types.GaitKind)


@pytest.mark.parametrize(
    ("line", "error"), [('gait={"kind": "trott"}', "GaitSpec"), ("horizont=3.0", "horizont"), ('gait="trot"', "")]
)
def test_a_type_checker_finds_a_wrong_key(line: str, error: str, tmp_path: Path) -> None:
    pytest.importorskip("mypy", reason="pip install mypy")
    code = f"from warpgait import Scenario, Terrain\nScenario(terrain=Terrain.shape('flat'), start=(0, 0), goal=[1, 0], {line})\n"
    (tmp_path / "use.py").write_text(code)
    words = [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml", str(tmp_path / "use.py")]
    found = subprocess.run(words, cwd=ROOT / "validate", capture_output=True, text=True, check=False)
    assert (found.returncode == 0) == (not error) and error in found.stdout, found.stdout + found.stderr
