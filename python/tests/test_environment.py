"""Environments: Gymnasium's own checks, what is seen, and what goes wrong."""

from __future__ import annotations

import os
import signal
import subprocess
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import parfocal
from parfocal import FocusEnv, FocusVectorEnv
from parfocal.program import find_program

# Drawing a scene takes a good part of a second.
FEW: dict[str, Any] = {"scenes": 2, "frames": 40}


@pytest.fixture
def env() -> Iterator[FocusEnv]:
    env = FocusEnv(**FEW)
    yield env
    env.close()


@pytest.mark.parametrize("options", [{}, {"observation": "view"}, {"actions": "continuous"}, {"history": 1}])
def test_gymnasiums_checker_has_nothing_to_say(options: dict[str, Any]) -> None:
    env = FocusEnv(render_mode="rgb_array", **FEW, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # It would make an environment with other arguments, which is not the one here.
        warnings.filterwarnings("ignore", message=".*render.*|.*spec.*")
        check_env(env, skip_render_check=True)
    picture = env.render()
    assert picture.shape == (256, 256, 3)
    env.close()


def test_gymnasium_makes_it_by_name() -> None:
    env = gymnasium.make("parfocal/Focus-v0", **FEW)
    observation, _ = env.reset(seed=3)
    assert env.observation_space.contains(observation)
    env.close()
    many = gymnasium.make_vec("parfocal/Focus-v0", num_envs=2, vectorization_mode="vector_entry_point", **FEW)
    assert many.num_envs == 2
    many.close()


def test_a_seed_gives_the_same_scan_again(env: FocusEnv) -> None:
    def run() -> list[float]:
        env.reset(seed=5)
        return [float(env.step(2)[4]["optimum"]) for _ in range(20)]

    assert run() == run()


def test_an_episode_is_a_scan(env: FocusEnv) -> None:
    env.reset(seed=1)
    ended = [env.step(1)[3] for _ in range(40)]
    assert ended == [False] * 39 + [True]


def test_the_papers_steps_move_the_lens_and_the_reward_is_the_error(env: FocusEnv) -> None:
    _, info = env.reset(seed=1)
    before = info["focal_power"]
    _, reward, terminated, _, info = env.step(2)
    assert info["focal_power"] == pytest.approx(min(before + 0.05, 1.0), abs=1e-6)
    assert reward == pytest.approx(-abs(info["focal_power"] - info["optimum"]), abs=1e-6)
    assert not terminated
    observation, _, _, _, info = env.step(0)
    assert info["focal_power"] == pytest.approx(before, abs=1e-6)
    assert observation["focal_powers"][-1] == info["focal_power"]
    assert observation["focal_powers"][0] == np.float32(before)


def test_the_patch_is_sharpest_at_the_optimum() -> None:
    env = FocusEnv(actions="continuous", history=1, frames=4000, scenes=2)
    env.reset(seed=2)
    sharp: list[float] = []
    blurred: list[float] = []
    optimum = 0.5
    for frame in range(200):
        target = optimum if frame % 2 == 0 else (optimum + 0.5) % 1.0
        observation, _, _, _, info = env.step(np.array([target], np.float32))
        optimum = float(info["optimum"])
        detail = float(np.abs(np.diff(observation["patches"][0].astype(float))).mean())
        (sharp if frame % 2 == 0 else blurred).append(detail)
    env.close()
    assert np.mean(sharp) > 1.5 * np.mean(blurred)


def test_the_vector_form_runs_on_after_a_scan() -> None:
    envs = FocusVectorEnv(3, scenes=2, frames=5)
    envs.reset(seed=1)
    for _ in range(5):
        _, rewards, _, truncated, _ = envs.step(np.array([1, 1, 1]))
        assert (rewards < 0).all()
    assert truncated.all()
    observation, rewards, _, truncated, _ = envs.step(np.array([0, 0, 0]))
    assert (rewards == 0).all()
    assert not truncated.any()
    # A new scan knows nothing of the last one.
    assert (observation["patches"] == observation["patches"][:, -1:]).all()
    envs.close()


def test_seeds_may_be_an_array() -> None:
    envs = FocusVectorEnv(2, **FEW)
    seeds: Any = np.array([5, 6])
    _, of_array = envs.reset(seed=seeds)
    _, of_list = envs.reset(seed=[5, 6])
    assert (of_array["optimum"] == of_list["optimum"]).all()
    envs.close()


def test_observations_that_were_given_away_do_not_change() -> None:
    envs = FocusVectorEnv(2, **FEW)
    first, _ = envs.reset(seed=1)
    copies = {name: value.copy() for name, value in first.items()}
    for _ in range(3):
        envs.step(np.array([2, 0]))
    for name, value in first.items():
        assert (value == copies[name]).all()
    envs.close()


def test_some_environments_are_reset_and_the_others_go_on() -> None:
    envs = FocusVectorEnv(2, **FEW)
    envs.reset(seed=1)
    before, *_ = envs.step(np.array([2, 2]))
    after, _ = envs.reset(options={"reset_mask": np.array([True, False])})
    assert (after["patches"][1] == before["patches"][1]).all()
    assert (after["patches"][0] == after["patches"][0, :1]).all()
    envs.close()


@pytest.mark.parametrize("actions", [np.array([3]), np.array([1, 1]), np.array([[1]])])
def test_actions_that_are_none_are_refused(actions: Any) -> None:
    envs = FocusVectorEnv(1, **FEW)
    envs.reset(seed=1)
    with pytest.raises(ValueError, match=r"0 \(down\), 1 \(stay\) or 2 \(up\)"):
        envs.step(actions)
    envs.close()


def test_a_kind_of_actions_that_there_is_not_is_refused() -> None:
    options: dict[str, Any] = {"actions": "discrete"}
    with pytest.raises(ValueError, match=r"'steps' or 'continuous', not 'discrete'"):
        FocusEnv(**options)


def test_a_target_that_is_not_a_number_is_refused() -> None:
    envs = FocusVectorEnv(1, actions="continuous", **FEW)
    envs.reset(seed=1)
    with pytest.raises(ValueError, match=r"finite focal powers"):
        envs.step(np.array([[np.nan]]))
    envs.close()


def test_a_program_that_ends_is_told_with_a_sentence(env: FocusEnv) -> None:
    env.reset(seed=1)
    os.kill(env._one._simulation._process.pid, signal.SIGKILL)
    env._one._simulation._process.wait()
    with pytest.raises(parfocal.ProgramEnded, match=r"has ended with exit code -9.*Make a new environment"):
        env.step(1)
    with pytest.raises(parfocal.ParfocalError, match=r"was closed"):
        env.step(1)


def test_what_the_program_refuses_is_its_own_sentence(tmp_path: Path) -> None:
    with pytest.raises(parfocal.NoProgram, match=r"did not start: .*there is no folder"):
        FocusEnv(tmp_path / "nowhere")
    with pytest.raises(ValueError, match=r"^invalid value 'Mono9' for '--raw <FORMAT>': .*choose from"):
        FocusEnv(raw="Mono9")
    with pytest.raises(ValueError, match=r"'--frames <N>'"):
        FocusEnv(frames=0)
    with pytest.raises(ValueError, match=r"'patches' for '--observation .*\[possible values: patch, view\]"):
        FocusEnv(observation="patches")
    with pytest.raises(parfocal.NoProgram, match=r"did not start: .*nothing.mp4"):
        FocusEnv(footage=tmp_path / "nothing.mp4")
    stranger = tmp_path / "parfocal"
    for then in ("exit", "cat >/dev/null"):
        stranger.write_text(f"#!/bin/sh\necho hello\n{then}\n")
        stranger.chmod(0o755)
        with pytest.raises(parfocal.NoProgram, match=r"did not start"):
            FocusEnv(program=stranger)
    stranger.write_bytes(b"\x7fELF")
    with pytest.raises(parfocal.NoProgram, match=r"parfocal cannot be started"):
        FocusEnv(program=stranger)


@pytest.mark.parametrize(
    ("sent", "sentence"),
    [
        (b"hello\n", "sent the byte 104 where a request (R, M or T) begins"),
        (b"M\x05", "sent 5 as the steps of environment 0, which must be -1, 0 or 1"),
        (b"T" + np.array([np.nan], "<f8").tobytes(), "which must be from 0 to 1"),
        (b"R\x07" + bytes(8), "sent 7 as the beginning of environment 0"),
        (b"R\x01", "the pipe to the training program failed"),
    ],
)
def test_something_that_is_no_request_ends_the_program_with_a_sentence(sent: bytes, sentence: str) -> None:
    command = [find_program(), "environment", "--scenes", "1"]
    done = subprocess.run(command, input=sent, capture_output=True, check=False)
    assert done.returncode == 1
    assert sentence in done.stderr.decode()


def test_a_forgotten_environment_ends_its_program() -> None:
    env = FocusEnv(**FEW)
    process = env._one._simulation._process
    del env
    for _ in range(200):
        if process.poll() is not None:
            break
        time.sleep(0.05)
    assert process.poll() is not None
