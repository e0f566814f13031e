#!/usr/bin/env python3
"""Measures the machine-steps per second of the Gymnasium environments.

    tools/measure_gym.py                        # 64 machines on the ballbar, with the Python of .venv
    tools/measure_gym.py --machines 256

Both environments run in turns with actions of 0; the medians are printed.
"""

from __future__ import annotations

import time
from statistics import median

import numpy as np

import options
from virtual_axes_py.gym import ContouringEnv, ContouringVectorEnv


def single_rate(env: ContouringEnv, steps: int) -> float:
    """Returns the steps per second of one machine."""
    action = np.zeros(env.action_space.shape or (), dtype=np.float32)
    env.reset(seed=0)
    start = time.perf_counter()
    for _ in range(steps):
        if env.step(action)[2]:
            env.reset()
    return steps / (time.perf_counter() - start)


def vector_rate(env: ContouringVectorEnv, steps: int) -> float:
    """Returns the machine-steps per second of all machines."""
    action = np.zeros(env.action_space.shape or (), dtype=np.float32)
    env.reset(seed=0)
    start = time.perf_counter()
    for _ in range(steps):
        env.step(action)
    return env.num_envs * steps / (time.perf_counter() - start)


def main() -> None:
    parser = options.parser(__doc__)
    parser.add_argument("--machines", type=options.whole, default=64)
    parser.add_argument("--motion", default="ballbar")
    parser.add_argument("--steps", type=options.whole, default=3000)
    parser.add_argument("--rounds", type=options.whole, default=5)
    arguments = parser.parse_args()
    one = ContouringEnv(motion=arguments.motion)
    many = ContouringVectorEnv(arguments.machines, motion=arguments.motion)
    rates = [(single_rate(one, arguments.steps), vector_rate(many, arguments.steps)) for _ in range(arguments.rounds)]
    single, vector = (median(column) for column in zip(*rates))
    print(f"one machine: {single:.0f} steps per second")
    print(f"{arguments.machines} machines: {vector:.0f} machine-steps per second")
    print(f"ratio: {median(right / left for left, right in rates):.1f}")


if __name__ == "__main__":
    main()
