"""Tells how many steps a second the environments make, by their number: docs/speed.md.

PYTHONPATH=src python3 tools/benchmark_environment.py
"""

from __future__ import annotations

import time

import numpy as np

from parfocal import FocusVectorEnv

COUNTS = (1, 16, 64, 256)
SECONDS = 5.0


def rate(count: int, history: int) -> float:
    """Return steps a second of all environments together, with actions drawn beforehand."""
    env = FocusVectorEnv(count, history=history)
    env.reset(seed=1)
    actions = np.random.default_rng(1).integers(0, 3, (256, count))
    for warm in actions[:50]:
        env.step(warm)
    began, steps = time.perf_counter(), 0
    while time.perf_counter() - began < SECONDS:
        env.step(actions[steps % len(actions)])
        steps += 1
    taken = time.perf_counter() - began
    env.close()
    return steps * count / taken


def main() -> None:
    """Print a table."""
    print("environments, steps a second with a history of 8, with a history of 1")
    for count in COUNTS:
        print(f"{count:12}, {rate(count, 8):10.0f}, {rate(count, 1):10.0f}")


if __name__ == "__main__":
    main()
