"""Steps a MuJoCo environment along an exported motion, as a trainer of a policy that imitates it would; nothing is trained here.

    warpgait export hill.plan.npz --to mujoco
    python validate/examples/follow.py hill.scene.xml

Episodes start at random frames, on the motion. An action is what is added to the joint angles of the next frame, which motors with proportional
and derivative gains follow. The reward is 1 on the motion, and an episode ends when the base is 20 cm away from it, or at the last frame.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt

from warpgait.motions.mjcf import keyframes

Array = npt.NDArray[np.float64]
STIFFNESS, DAMPING = 200.0, 6.0  # N m/rad, N m s/rad
LOST = 0.2  # m: farther from the motion, an episode ends
SCALE = 0.1  # m, in the reward


class Follow:
    """An environment with `reset` and `step`, as gymnasium has them."""

    def __init__(self, scene: Path, seed: int = 0) -> None:
        """Load a scene that `warpgait export --to mujoco` wrote."""
        self.model = mujoco.MjModel.from_xml_path(str(scene))
        self.data = mujoco.MjData(self.model)
        self.t, self.qpos, self.qvel = keyframes(self.model)
        self.random = np.random.default_rng(seed)
        self.steps = max(1, round((self.t[1] - self.t[0]) / self.model.opt.timestep))  # of physics, to the next frame
        self.motors = self.model.jnt_dofadr[self.model.actuator_trnid[:, 0]]  # their places in qvel; one less in actions
        self.k = 0

    def reset(self, frame: int | None = None) -> Array:
        """Start on a frame of the motion, a random one by default; returns the observation."""
        self.k = int(self.random.integers(len(self.t) - 1)) if frame is None else frame
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self.qpos[self.k], self.qvel[self.k]
        mujoco.mj_forward(self.model, self.data)
        return self._observation()

    def step(self, action: Array) -> tuple[Array, float, bool]:
        """Go on by a frame; returns observation, reward, and whether the episode has ended."""
        self.k += 1
        target, speed = self.qpos[self.k, 7:] + action, self.qvel[self.k, 6:]
        for _ in range(self.steps):
            torque = STIFFNESS * (target - self.data.qpos[7:]) + DAMPING * (speed - self.data.qvel[6:])
            self.data.ctrl[:] = torque[self.motors - 6]
            mujoco.mj_step(self.model, self.data)
        away = float(np.linalg.norm(self.data.qpos[:3] - self.qpos[self.k, :3]))
        return self._observation(), float(np.exp(-((away / SCALE) ** 2))), away > LOST or self.k == len(self.t) - 1

    def _observation(self) -> Array:
        """State, and where the motion goes next."""
        following = min(self.k + 1, len(self.t) - 1)
        return np.concatenate([self.data.qpos[2:], self.data.qvel, self.qpos[following, 7:], self.qvel[following, :6]])


def run(scene: Path, episodes: int) -> tuple[float, float]:
    """Episodes without any action; returns their mean reward a frame, and the mean time in s until they ended."""
    world = Follow(scene)
    rewards, times = [], []
    for _ in range(episodes):
        world.reset()
        start, done = world.k, False
        while not done:
            _, reward, done = world.step(np.zeros(len(world.motors)))
            rewards.append(reward)
        times.append(world.t[world.k] - world.t[start])
    return float(np.mean(rewards)), float(np.mean(times))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, help="NAME.scene.xml")
    parser.add_argument("--episodes", type=int, default=20)
    options = parser.parse_args()
    reward, time = run(options.scene, options.episodes)
    print(f"{options.episodes} episodes without actions: reward {reward:.2f} a frame, {time:.2f} s long on average")
