"""Plans that tests share, made once per session."""

from pathlib import Path

import pytest

import crawl


@pytest.fixture(scope="session")
def ripple_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ANYmal C, four steps over a 5 cm ripple."""
    return crawl.make(tmp_path_factory.mktemp("plans") / "ripple.plan.npz", height=crawl.ripple)


@pytest.fixture(scope="session")
def standing_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ANYmal B, standing for one second on the flat."""
    return crawl.make(tmp_path_factory.mktemp("plans") / "stand.plan.npz", robot="anymal_b", steps=0)
