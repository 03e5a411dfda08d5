"""The examples run, and their results are as documented."""

import runpy
from pathlib import Path

import numpy as np
import pytest


def test_the_data_set_holds_joint_trajectories_that_lead_to_the_goals(tmp_path: Path) -> None:
    example = runpy.run_path(str(Path(__file__).parents[1] / "examples/dataset.py"))
    target = tmp_path / "new/walks.npz"
    assert example["make"](target, 2) == 2
    with np.load(target) as walks:
        M, K = 2, 3 * 250 + 1
        assert walks["q"].shape == walks["qd"].shape == walks["tau"].shape == (M, K, 12)
        assert walks["joint_names"].tolist()[:4] == ["LF_HAA", "LF_HFE", "LF_KFE", "RF_HAA"]
        assert walks["foot_contact"].shape == (M, K, 4) and not walks["foot_contact"].all()
        speed = np.gradient(walks["q"], 1 / 250, axis=1)
        assert np.sqrt(np.mean((speed - walks["qd"]) ** 2)) < 0.1  # rad/s
        way = walks["base_position"][:, -1, :2] - walks["base_position"][:, 0, :2]
        assert way == pytest.approx(walks["goal"], abs=0.06)  # of the trunk; goals are for the center of mass
