"""Plans are read, or refused with file, member and reason; and they are sampled at the control rate."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crawl import altered
from warpgait import InputError
from warpgait.plan import read_plan
from warpgait.reference import sample


def test_a_plan_is_read(standing_plan: Path) -> None:
    plan = read_plan(standing_plan)
    assert plan.foot_names == ("LF", "RF", "LH", "RH")
    assert plan.duration == pytest.approx(1.0)
    assert plan.robot.name == "anymal_b"
    assert plan.foot_force[:, :, 2].sum(1) == pytest.approx(plan.weight, rel=1e-3)
    assert plan.pull_limit == 0.0  # no foot is adhesive


def adhesive(**meta_changes: Any) -> Callable[[dict[str, Any]], None]:
    """All feet become adhesive, and keys of meta change."""

    def change(a: dict[str, Any]) -> None:
        a["foot_adhesive"] = np.ones(4, bool)
        a["meta"] = meta(**meta_changes)(a["meta"])

    return change


def test_the_pull_limit_is_the_plans(standing_plan: Path, tmp_path: Path) -> None:
    plan = altered(standing_plan, tmp_path / "sticky.plan.npz", adhesive(limits={"pull_limit": 0.9}))
    assert read_plan(plan).pull_limit == 0.9


def poke(member: str, value: Any) -> Callable[[dict[str, Any]], None]:
    return lambda a: a.__setitem__(member, value(a[member]))


def with_nan(array: Any) -> Any:
    array = array.copy()
    array.flat[7] = np.nan
    return array


def robot(**changes: Any) -> Callable[[Any], Any]:
    def change(text: Any) -> Any:
        found = json.loads(str(text))
        return np.array(json.dumps(found | {"robot": found["robot"] | changes}))

    return change


def meta(**changes: Any) -> Callable[[Any], Any]:
    return lambda text: np.array(json.dumps(json.loads(str(text)) | changes))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a: a.pop("foot_force"), ["foot_force", "missing"]),
        (poke("foot_force", with_nan), ["foot_force", "not finite", "[0, 2, 1]"]),
        (poke("heightfield", lambda x: x + 1e300), ["heightfield", "beyond 1e+09"]),
        (poke("base_position", lambda x: x[:-1]), ["base_position", "shape"]),
        (poke("base_position", lambda x: x.astype(np.float32)), ["base_position", "float32"]),
        (poke("foot_contact", lambda x: x.astype(float)), ["foot_contact", "bool"]),
        (poke("base_quaternion_wxyz", lambda x: 2 * x), ["base_quaternion_wxyz", "unit"]),
        (poke("t", lambda x: x**2), ["member t", "uniform"]),
        (poke("heightfield", lambda x: x[:1]), ["heightfield", "two rows"]),
        (poke("meta", lambda x: np.array("{")), ["meta", "JSON"]),
        (poke("meta", meta(schema=2)), ["schema 2", "update"]),
        (poke("meta", meta(schema="one")), ["schema"]),
        (poke("meta", meta(robot={"name": "anymal_b"})), ["robot", "mass"]),
        (poke("meta", meta(robot=[])), ["robot"]),
        (poke("meta", robot(friction=1e300)), ["robot", "friction is 1e+300", "at most 10"]),
        (adhesive(limits={}), ["meta", "limits.pull_limit", "solve it again"]),
        (adhesive(limits={"pull_limit": "strong"}), ["limits.pull_limit", "strong"]),
    ],
)
def test_a_damaged_plan_is_refused(standing_plan: Path, tmp_path: Path, change: Any, words: list[str]) -> None:
    bad = altered(standing_plan, tmp_path / "bad.plan.npz", change)
    with pytest.raises(InputError) as caught:
        read_plan(bad)
    for word in ["bad.plan.npz", *words]:
        assert word in str(caught.value)


def corners(change: Callable[[Any], Any]) -> Callable[[dict[str, Any]], None]:
    """Patches for two stances of each foot, the second of the last one missing, changed."""
    patches = np.zeros((4, 2, 4, 3)) + np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    patches[3, 1] = np.nan
    return lambda a: a.__setitem__("patch_corners", change(patches))


def test_patches_are_four_corners_each(standing_plan: Path, tmp_path: Path) -> None:
    assert read_plan(altered(standing_plan, tmp_path / "good.plan.npz", corners(lambda p: p))).terrain_raw is None
    for change in (with_nan, lambda p: p[..., :2], lambda p: p.astype(np.float32), lambda p: p[:, ::-1], lambda p: p[:, :0]):
        plan = altered(standing_plan, tmp_path / "bad.plan.npz", corners(change))
        with pytest.raises(InputError, match="patch_corners"):
            read_plan(plan)


def test_files_that_are_not_plans_are_refused(standing_plan: Path, tmp_path: Path) -> None:
    whole = standing_plan.read_bytes()
    for name, content, words in (
        ("half", whole[: len(whole) // 2], "truncated"),
        ("empty", b"", "an empty file"),
        ("text", b"hello", "not an .npz archive; a plan is a"),
        ("rot", whole[:2000] + b"x" * 500 + whole[2500:], "damaged"),
    ):
        path = tmp_path / f"{name}.plan.npz"
        path.write_bytes(content)
        with pytest.raises(InputError, match=f"{name}.*{words}"):
            read_plan(path)
    with pytest.raises(InputError, match="a folder"):
        read_plan(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        read_plan(tmp_path / "missing.plan.npz")
    np.save(tmp_path / "array.npy", np.zeros(3))
    with pytest.raises(InputError, match="single NumPy array"):
        read_plan(tmp_path / "array.npy")


def test_the_reference_goes_through_the_samples(ripple_plan: Path) -> None:
    plan = read_plan(ripple_plan)
    reference = sample(plan, 1.0 / plan.t[1], 0.03)
    assert np.allclose(reference.com, plan.base_position)
    assert np.allclose(reference.foot, plan.foot_position + 0.03 * plan.center_direction)
    assert (reference.contact == plan.foot_contact).all()
    between = sample(plan, 500.0, 0.03)
    # Between the plan's samples too, its velocities are those of its positions.
    moved = np.gradient(between.foot, between.t, axis=0)
    assert np.abs(moved - between.foot_velocity)[2:-2].max() < 0.02
    assert between.t[-1] == pytest.approx(plan.duration)


def test_swinging_feet_ignore_the_normals_of_the_ground_below(ripple_plan: Path) -> None:
    plan = read_plan(ripple_plan)
    rng = np.random.default_rng(0)
    shaken = np.where(plan.foot_contact[..., None], plan.foot_normal, rng.normal(size=plan.foot_normal.shape))
    direction = replace(plan, foot_normal=shaken).center_direction
    assert np.array_equal(direction[plan.foot_contact], plan.foot_normal[plan.foot_contact])
    assert np.abs(np.linalg.norm(direction, axis=-1) - 1).max() < 1e-12
    jump = np.abs(np.diff(direction, axis=0)).max()
    assert (~plan.foot_contact).any() and jump < 0.05, jump
