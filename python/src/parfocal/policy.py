"""A policy of your own, in a process that the program starts.

    import parfocal.policy

    def step(picture, focal_power):
        return 0.05 if picture.std() < 20 else 0.0

    parfocal.policy.serve(step)

Saved as ``mine.py``, the program takes it as ``--policy 'exec:python3 mine.py'``.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import os
import socket
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from .errors import ParfocalError

# docs/policies.md describes the framing.
_MAGIC = b"PFPO"
_VERSION = 1
_QUESTION = struct.Struct("<4sHHQdQIIIIIId")
_ANSWER = struct.Struct("<4sHHQddII")
_READY, _RESET, _FRAME = 1, 2, 3
_TARGET, _STEP = 2, 3
_BELIEF_AT, _MOST_BELIEF = 16_384, 4096

Picture = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Move:
    """What a policy decides, with more than a number: a step, or the focal power to go to.

    ``metric`` is the focus metric that it computed, ``belief`` the probabilities of the optimum at equally
    spaced focal powers from 0 to 1. Both are shown, and change nothing.
    """

    step: float | None = None
    target: float | None = None
    metric: float | None = None
    belief: Sequence[float] | npt.NDArray[Any] | None = None

    def __post_init__(self) -> None:
        if (self.step is None) == (self.target is None):
            raise ValueError("give either a step or a target")
        if self.belief is not None and len(self.belief) > _MOST_BELIEF:
            raise ValueError(f"a belief has {_MOST_BELIEF} values at most")


def serve(
    step: Callable[[Picture, float], float | Move],
    *,
    view: Literal["patch", "view"] = "patch",
    reset: Callable[[], object] | None = None,
) -> None:
    """Answer the program's questions with ``step`` until the program ends.

    ``step(picture, focal_power)`` gets the patch, 32x32 gray levels from 0 to 255, and the focal power at which
    it was taken. It returns the change of focal power, or a `Move`. With ``view="view"`` the picture is
    3x32x32: the patch and the two coarser ones around it. ``reset()`` is called before the first frame of each
    setting or scan. The picture is read-only and changes with the next frame: copy what you keep.
    """
    channel, memory = _connect()
    # The memory goes with the last array that looks into it, also when `step` raises.
    with channel:
        pictures = 1 if view == "patch" else 3
        channel.send(_ANSWER.pack(_MAGIC, _VERSION, _READY, 0, math.nan, math.nan, pictures, 0))
        shared = np.frombuffer(memory, np.float32)
        seen = shared[: pictures * 32 * 32].reshape((pictures, 32, 32) if pictures > 1 else (32, 32))
        seen.flags.writeable = False
        belief = shared[_BELIEF_AT // 4 : _BELIEF_AT // 4 + _MOST_BELIEF]

        with contextlib.suppress(ConnectionError, KeyboardInterrupt):
            while message := channel.recv(_QUESTION.size + 1):
                kind, sequence, focal_power = _read(message)
                if kind == _RESET:
                    if reset is not None:
                        reset()
                elif kind == _FRAME:
                    channel.send(_answer(step(seen, focal_power), sequence, belief))


def _connect() -> tuple[socket.socket, mmap.mmap]:
    try:
        numbers = [int(os.environ[f"PARFOCAL_POLICY_{name}"]) for name in ("SOCKET", "MEMORY")]
        channel = socket.socket(fileno=numbers[0])
        memory = mmap.mmap(numbers[1], 0)
    except (KeyError, ValueError, OSError) as error:
        raise ParfocalError(
            "This is a policy for the program parfocal, which must start it: "
            "parfocal evaluate --policies 'exec:python3 FILE'"
        ) from error
    return channel, memory


def _read(message: bytes) -> tuple[int, int, float]:
    if len(message) != _QUESTION.size or message[:4] != _MAGIC:
        raise ParfocalError("The program sent something that is not a question; do its versions match?")
    _, version, kind, sequence, focal_power, *_ = _QUESTION.unpack(message)
    if version != _VERSION:
        raise ParfocalError(f"The program asks in version {version} of the framing, not {_VERSION}.")
    return kind, sequence, focal_power


def _answer(decided: float | Move, sequence: int, belief: Picture) -> bytes:
    move = decided if isinstance(decided, Move) else Move(step=float(decided))
    kind, value = (_STEP, move.step) if move.target is None else (_TARGET, move.target)
    count = 0
    if move.belief is not None:
        count = len(move.belief)
        belief[:count] = np.asarray(move.belief, np.float32)
    metric = math.nan if move.metric is None else float(move.metric)
    return _ANSWER.pack(_MAGIC, _VERSION, kind, sequence, float(value or 0.0), metric, count, 0)
