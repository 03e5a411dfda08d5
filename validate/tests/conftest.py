"""Plans that tests share, made once per session."""

from pathlib import Path

import pytest

import crawl
import warpgait

WALK = """
formulation = "direct"
horizon = 3.0
[robot]
name = "anymal_c"
[terrain]
kind = "formula"
expression = "0.04*sin(5*x)*cos(4*y)"
extent = [-1.5, 1.5, -1.5, 1.5]
spacing = 0.02
[start]
position = [0.0, 0.0]
[goal]
position = [0.3, 0.0]
"""


@pytest.fixture(scope="session")
def ripple_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ANYmal C, four steps over a 5 cm ripple."""
    return crawl.make(tmp_path_factory.mktemp("plans") / "ripple.plan.npz", height=crawl.ripple)


@pytest.fixture(scope="session")
def standing_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ANYmal B, standing for one second on the flat."""
    return crawl.make(tmp_path_factory.mktemp("plans") / "stand.plan.npz", robot="anymal_b", steps=0)


@pytest.fixture(scope="session")
def walk_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plan of `warpgait solve`, which passes every check: ANYmal C walks 30 cm."""
    path = tmp_path_factory.mktemp("plans") / "walk.plan.npz"
    warpgait.solve(WALK).save(path)
    return path
