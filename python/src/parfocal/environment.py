"""Gymnasium environments: keep a patch in focus. The simulation runs in the program, not in Python."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import subprocess
import tempfile
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import IO, Any, Literal

import numpy as np
import numpy.typing as npt

from .errors import NoProgram, ParfocalError, ProgramEnded
from .program import find_program, last_words, starting

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError:
    raise ParfocalError("FocusEnv needs Gymnasium: pip install 'parfocal[env]'.") from None

Observation = dict[str, npt.NDArray[Any]]
Floats = npt.NDArray[np.float32]
Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
"""One path, or several."""
Reward = Callable[[Floats, Floats], npt.NDArray[Any]]
"""Makes rewards of focal powers and optimal ones, both arrays with a value for each environment."""

IN_FOCUS = 0.1
"""Largest error of the focal power that counts as in focus, as in the paper."""

_PROTOCOL = "parfocal-environment"
_VERSION = 1
_PIPE_BYTES = 1 << 20


def minus_error(focal_power: Floats, optimum: Floats) -> npt.NDArray[Any]:
    """Return the default reward: minus the absolute error of the focal power."""
    error: npt.NDArray[Any] = np.abs(focal_power - optimum)
    return -error


@dataclass
class _Seen:
    """What the program tells after a step, with a row or value for each environment."""

    patches: npt.NDArray[np.uint8]
    focal_powers: Floats
    optima: Floats
    ended: npt.NDArray[np.bool_]


class _Simulation:
    """The program with its environments, at the other end of two pipes."""

    def __init__(self, options: Sequence[str], count: int, program: str | os.PathLike[str] | None) -> None:
        command = [find_program(program), "environment", "--count", str(count), *options]
        with starting(command[0]), contextlib.ExitStack() as opened:
            self._log = opened.enter_context(tempfile.TemporaryFile(prefix="parfocal-log-"))
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, bufsize=0
            )
            opened.pop_all()
        self._finalizer = weakref.finalize(self, _end, self._process, self._log)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests = self._process.stdin
        self._answers = self._process.stdout
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            # It is only faster: an answer of many environments then fits into the pipe.
            with contextlib.suppress(OSError):
                fcntl.fcntl(self._answers.fileno(), fcntl.F_SETPIPE_SZ, _PIPE_BYTES)

        line = self._answers.readline()
        try:
            greeting = json.loads(line)
            known = greeting["protocol"] == _PROTOCOL and greeting["version"] == _VERSION
        except (ValueError, KeyError, TypeError):
            said = self._said()
            self.close()
            if said.startswith("error: invalid value"):
                # It names the option, which is called as the argument is.
                sentence = said.split("\n\n")[0].removeprefix("error: ")
                raise ValueError(" ".join(sentence.split())) from None
            raise NoProgram(f"The simulation did not start: {last_words(said)}") from None
        if not known:
            self.close()
            raise NoProgram(
                f"The program speaks {greeting['protocol']} {greeting['version']}, this package {_PROTOCOL} "
                f"{_VERSION}. Install the package of the program's version."
            )
        self.count = count
        self.shape = (int(greeting["patches"]), int(greeting["side"]), int(greeting["side"]))
        self._pixels = count * int(np.prod(self.shape))
        self._bytes = self._pixels + 9 * count

    def reset(self, kinds: npt.NDArray[np.uint8], seeds: npt.NDArray[np.uint64]) -> _Seen:
        """Begin scans: 0 none, 1 the next, 2 with the seed."""
        return self._ask(b"R" + kinds.tobytes() + seeds.astype("<u8").tobytes())

    def move(self, steps: npt.NDArray[np.int8]) -> _Seen:
        """Move each lens by this many of the paper's steps."""
        return self._ask(b"M" + steps.tobytes())

    def send(self, targets: npt.NDArray[np.float64]) -> _Seen:
        """Send each lens to a focal power."""
        return self._ask(b"T" + targets.astype("<f8").tobytes())

    def close(self) -> None:
        """End the program."""
        self._finalizer()

    def _ask(self, request: bytes) -> _Seen:
        if self._requests.closed:
            raise ParfocalError("The environment was closed. Make a new one.")
        # Each answer has memory of its own: the arrays that are given away are views of it.
        answer = bytearray(self._bytes)
        try:
            _write(self._requests, request)
            self._fill(answer)
        except OSError:
            self._has_ended()
        values = np.frombuffer(answer, dtype=np.uint8)
        powers, optima, ended = np.split(values[self._pixels :], [4 * self.count, 8 * self.count])
        return _Seen(
            values[: self._pixels].reshape(self.count, *self.shape),
            powers.view("<f4"),
            optima.view("<f4"),
            ended.astype(np.bool_),
        )

    def _fill(self, answer: bytearray) -> None:
        left = memoryview(answer)
        while left:
            read = self._answers.readinto(left)  # type: ignore[attr-defined]
            if not read:
                self._has_ended()
            left = left[read:]

    def _has_ended(self) -> None:
        code = self._process.wait()
        said = self._said()
        self.close()
        raise ProgramEnded(
            f"The simulation has ended with exit code {code}: {last_words(said)}. Make a new environment."
        )

    def _said(self) -> str:
        # It ends by itself when its pipe is closed.
        self._requests.close()
        self._process.wait()
        self._log.seek(0)
        return self._log.read().decode(errors="replace")


def _write(pipe: Any, data: bytes) -> None:
    left = memoryview(data)
    while left:
        left = left[pipe.write(left) :]


def _end(process: subprocess.Popen[bytes], log: IO[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()
    try:
        # It ends by itself when its pipe is closed.
        process.wait(timeout=10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    log.close()


def _several(paths: Paths) -> Sequence[str | os.PathLike[str]]:
    """Return one path as a list of it, and several as they are."""
    return [paths] if isinstance(paths, (str, os.PathLike)) else paths


class FocusVectorEnv(VectorEnv[Observation, npt.NDArray[Any], npt.NDArray[Any]]):
    """Many environments side by side, stepped together in one program: see `FocusEnv`.

    A scan that has ended begins anew at the next step (`AutoresetMode.NEXT_STEP`).
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        scans: Paths = "simulated",
        *,
        observation: Literal["patch", "view"] = "patch",
        actions: Literal["steps", "continuous"] = "steps",
        history: int = 8,
        frames: int = 250,
        variety: float = 0.0,
        split: Literal["training", "validation", "test"] = "training",
        scenes: int = 32,
        footage: Paths = (),
        raw: str | None = None,
        reward: Reward = minus_error,
        program: str | os.PathLike[str] | None = None,
    ) -> None:
        if history < 1:
            raise ValueError("history must be 1 or more: an observation holds at least the frame itself")
        if num_envs < 1:
            raise ValueError("num_envs must be 1 or more")
        if actions not in ("steps", "continuous"):
            raise ValueError(f"actions must be 'steps' or 'continuous', not {actions!r}")
        options = ["--observation", observation, "--frames", str(frames), "--variety", str(variety)]
        options += ["--split", split, "--scenes", str(scenes)]
        # Without a seed from the caller, two runs should differ.
        options += ["--seed", str(np.random.SeedSequence().generate_state(1)[0])]
        for path in _several(footage):
            options += ["--footage", os.fspath(path)]
        if raw is not None:
            options += ["--raw", raw]
        options += ["--scans", *(os.fspath(one) for one in _several(scans))]

        self.num_envs = num_envs
        self.reward = reward
        self.actions = actions
        self.history = history
        self._simulation = _Simulation(options, num_envs, program)
        patches = self._simulation.shape if observation == "view" else self._simulation.shape[1:]
        self._shape = patches
        self.single_observation_space = spaces.Dict(
            {
                "patches": spaces.Box(0, 255, (history, *patches), np.uint8),
                "focal_powers": spaces.Box(0.0, 1.0, (history,), np.float32),
            }
        )
        self.single_action_space = (
            spaces.Discrete(3) if actions == "steps" else spaces.Box(0.0, 1.0, (1,), np.float32)
        )
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._patches = np.zeros((num_envs, history, *patches), np.uint8)
        self._powers = np.zeros((num_envs, history), np.float32)
        self._ended = np.ones(num_envs, np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin new scans: of all environments, or of those in ``options["reset_mask"]``."""
        mask = np.ones(self.num_envs, np.bool_)
        if options and options.get("reset_mask") is not None:
            mask = np.asarray(options["reset_mask"], np.bool_)
        if seed is None:
            seeds: Sequence[int | None] = [None] * self.num_envs
        elif isinstance(seed, (int, np.integer)):
            seeds = [int(seed) + index for index in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs or mask.shape != (self.num_envs,):
            raise ValueError(
                f"there are {self.num_envs} environments; give as many seeds and marks to reset by"
            )

        kinds = np.array(
            [0 if not on else 1 if one is None else 2 for on, one in zip(mask, seeds, strict=True)]
        )
        # NumPy's own integers know no 2^64.
        numbers = np.array([int(one or 0) % (1 << 64) for one in seeds], np.uint64)
        seen = self._simulation.reset(kinds.astype(np.uint8), numbers)
        self._fill(seen, mask)
        self._ended = seen.ended
        return self._observation(), self._info(seen)

    def step(
        self, actions: npt.NDArray[Any]
    ) -> tuple[Observation, npt.NDArray[Any], npt.NDArray[np.bool_], npt.NDArray[np.bool_], dict[str, Any]]:
        """Move each lens, and advance by a frame."""
        chosen = np.asarray(actions)
        if self.actions == "steps":
            if chosen.shape != (self.num_envs,) or not np.isin(chosen, (0, 1, 2)).all():
                raise ValueError(
                    f"expected {self.num_envs} actions of 0 (down), 1 (stay) or 2 (up), not {actions!r}"
                )
            seen = self._simulation.move((chosen - 1).astype(np.int8))
        else:
            targets = chosen.astype(np.float64).reshape(self.num_envs)
            if not np.isfinite(targets).all():
                raise ValueError(f"expected {self.num_envs} finite focal powers, not {actions!r}")
            seen = self._simulation.send(np.clip(targets, 0.0, 1.0))

        begun = self._ended
        rewards = np.where(begun, 0.0, self.reward(seen.focal_powers, seen.optima))
        self._patches = np.roll(self._patches, -1, axis=1)
        self._powers = np.roll(self._powers, -1, axis=1)
        self._patches[:, -1] = seen.patches.reshape(self.num_envs, *self._shape)
        self._powers[:, -1] = seen.focal_powers
        if begun.any():
            self._fill(seen, begun)
        self._ended = seen.ended
        never = np.zeros(self.num_envs, np.bool_)
        return self._observation(), rewards, never, seen.ended.copy(), self._info(seen)

    def close_extras(self, **_: Any) -> None:
        """End the program."""
        self._simulation.close()

    def _fill(self, seen: _Seen, begun: npt.NDArray[np.bool_]) -> None:
        """Give the scans that have just begun their first frame in all places of the history."""
        newest = seen.patches.reshape(self.num_envs, 1, *self._shape)
        self._patches = np.where(
            begun.reshape(-1, *(1 for _ in self._patches.shape[1:])), newest, self._patches
        )
        self._powers = np.where(begun[:, None], seen.focal_powers[:, None], self._powers)

    def _observation(self) -> Observation:
        return {"patches": self._patches, "focal_powers": self._powers}

    def _info(self, seen: _Seen) -> dict[str, Any]:
        in_focus = np.abs(seen.focal_powers - seen.optima) < IN_FOCUS
        return {"focal_power": seen.focal_powers, "optimum": seen.optima, "in_focus": in_focus}


class FocusEnv(gymnasium.Env[Observation, Any]):
    """Keep a patch in focus while the scene moves.

    ``scans``: ``"simulated"``, ``"relief"``, folders of recorded scans or focal stacks, or several of them.
    ``observation``: the latest ``history`` patches of 32x32 gray levels (or with ``"view"`` also the two
    coarser ones around each), and the focal powers at which they were taken. ``actions``: ``"steps"``, the
    paper's three (0 down, 1 stay, 2 up), or ``"continuous"``, the focal power to move to. The reward is
    minus the error of the focal power, or ``reward(focal_power, optimum)`` over arrays. An episode is a scan
    of ``frames`` frames; it is truncated, never terminated. ``raw``: the format of raw mosaics in focal
    stacks where their length does not tell it, such as ``"Mono12"``.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012

    def __init__(
        self,
        scans: Paths = "simulated",
        *,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        self.render_mode = render_mode
        self._one = FocusVectorEnv(1, scans, **options)
        self.observation_space = self._one.single_observation_space
        self.action_space = self._one.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a new scan."""
        super().reset(seed=seed)
        observation, info = self._one.reset(seed=seed)
        return _first(observation), _first(info)

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Move the lens, and advance by a frame."""
        observation, rewards, _, ended, info = self._one.step(np.asarray(action)[None])
        return _first(observation), float(rewards[0]), False, bool(ended[0]), _first(info)

    def render(self) -> Any:
        """Return the patch as a picture, eight pixels for each of its own."""
        if self.render_mode != "rgb_array":
            return None
        patch = self._one._patches[0, -1]
        gray = patch if patch.ndim == 2 else patch[0]
        return np.repeat(np.kron(gray, np.ones((8, 8), np.uint8))[..., None], 3, axis=2)

    def close(self) -> None:
        """End the program."""
        self._one.close()


def _first(values: dict[str, Any]) -> dict[str, Any]:
    return {name: value[0] for name, value in values.items()}


def _register() -> None:
    """Make the environments known to ``gymnasium.make`` and ``gymnasium.make_vec``."""
    if "parfocal/Focus-v0" not in gymnasium.registry:
        home = f"{__name__}:"
        gymnasium.register(
            "parfocal/Focus-v0", entry_point=f"{home}FocusEnv", vector_entry_point=f"{home}FocusVectorEnv"
        )


_register()
