"""Stable-Baselines3 trains on the environment: tried where it is installed, since it brings gigabytes of PyTorch."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
import pytest

from parfocal import FocusEnv

stable_baselines3 = pytest.importorskip("stable_baselines3")

HISTORY = 8
STEPS = 30_000
SCANS = 20


class Sharpness(gymnasium.ObservationWrapper[npt.NDArray[np.float32], Any, Any]):
    """Shows of each patch its mean gradient magnitude, as a logarithm, beside its focal power.

    As for the paper's MGM-learned policy, both are told by how far they are from the latest frame's.
    """

    def __init__(self, env: FocusEnv) -> None:
        super().__init__(env)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2 * HISTORY,), np.float32)

    def observation(self, observation: dict[str, npt.NDArray[Any]]) -> npt.NDArray[np.float32]:
        """Return sharpness and focal powers, the latest last."""
        patches = observation["patches"].astype(np.float32)
        down, across = np.gradient(patches, axis=(-2, -1))
        sharpness = np.log(np.hypot(down, across).mean(axis=(-2, -1)) + 1e-3)
        powers = observation["focal_powers"]
        since = np.concatenate([sharpness - sharpness[-1], (powers - powers[-1]) * 5.0])
        since[-1] = powers[-1]
        shown: npt.NDArray[np.float32] = since.astype(np.float32)
        return shown


def mean_error(env: gymnasium.Env[Any, Any], action: Any) -> float:
    """Return the mean error of focal power over scans of scenes that no training has seen."""
    errors = []
    for seed in range(SCANS):
        seen, _ = env.reset(seed=seed)
        ended = False
        while not ended:
            seen, reward, _, ended, _ = env.step(action(seen))
            errors.append(-float(reward))
    return float(np.mean(errors))


def test_its_dqn_learns_to_focus_in_a_minute() -> None:
    training = Sharpness(FocusEnv(history=HISTORY))
    model = stable_baselines3.DQN(
        "MlpPolicy",
        training,
        learning_rate=1e-3,
        gamma=0.9,
        learning_starts=1000,
        target_update_interval=500,
        exploration_fraction=0.3,
        seed=1,
    )
    model.learn(STEPS)
    training.close()

    unseen = Sharpness(FocusEnv(history=HISTORY, split="test"))
    learned = mean_error(unseen, lambda seen: int(model.predict(seen, deterministic=True)[0]))
    fixed = mean_error(unseen, lambda _: 1)
    unseen.close()
    assert learned < 0.6 * fixed, f"DQN {learned:.3f}, fixed {fixed:.3f}"
