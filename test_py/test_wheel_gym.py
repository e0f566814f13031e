"""Gymnasium environments of `virtual_axes_py.gym`: the checks of gymnasium, the bits of a simulation, autoreset."""

from __future__ import annotations

import copy
import pickle
import re
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import virtual_axes_py as va
from virtual_axes_py.gym import ENVIRONMENT, ContouringEnv, ContouringVectorEnv


@pytest.fixture(scope="module")
def machine() -> va.Machine:
    """Returns the default machine."""
    return va.Machine.load()


@pytest.mark.parametrize(
    "options",
    [
        {"motion": "corner-90"},
        {"motion": "five-axis"},
        {"motion": "ballbar", "feed": (2.0, 4.0), "action": "velocity"},
        {"motion": np.zeros((20, 5)), "axes": ["z"], "residual": [1e-4]},
    ],
)
def test_the_checks_of_gymnasium_pass_without_a_warning(options: dict) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(ENVIRONMENT, **options).unwrapped)


@pytest.mark.parametrize("controller", ["cascade", "gpc"])
@pytest.mark.parametrize("action", ["psec", "velocity"])
@pytest.mark.parametrize("motion", ["corner-90", "five-axis"])
def test_a_policy_of_zero_has_the_bits_of_a_simulation(
    motion: str, action: str, controller: str, machine: va.Machine
) -> None:
    machine = machine.with_({f"{axis}.position_loop.controller": controller for axis in machine.axes})
    psec = va.scenario(motion).psec(machine)
    run = machine.simulate(psec, figures="contour")
    one = ContouringEnv(machine=machine, motion=psec, action=action)
    many = ContouringVectorEnv(3, machine=machine, motion=psec, action=action)
    # Other machines of the vector environment do not change the bits: only the first one has a policy of zero.
    actions = np.zeros(many.action_space.shape, dtype=np.float32)
    actions[1:] = 1.0
    one.reset()
    many.reset()
    errors, ended, cycle = [], False, 0
    while not ended:
        cycle += 1
        _, reward, ended, truncated, info = one.step(actions[0])
        _, rewards, all_ended, _, infos = many.step(actions)
        assert np.array_equal(one.stepper.position, run.position[cycle])
        assert np.array_equal(many.stepper.position[0], run.position[cycle])
        assert not np.array_equal(many.stepper.position[1], run.position[cycle]) or cycle < 5
        assert (reward, ended, truncated) == (rewards[0], all_ended[0], False)
        assert info["contour_error"] == infos["contour_error"][0]
        assert reward == pytest.approx(-((info["contour_error"] / 1e-5) ** 2), rel=1e-12)
        errors.append(info["contour_error"])
    assert cycle == len(psec) + 50
    # The figure is the largest error of all ticks, those of the environment are at the ends of the cycles.
    assert 1e6 * max(errors) <= run.figures["contour_error_um"]["max"]
    if motion == "corner-90":
        tips = run.position[1 : cycle + 1, :3]
        assert errors == pytest.approx(distances(tips, psec[:, :3]), abs=1e-12)


def distances(points: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Returns the shortest distances of points from a polyline, m."""
    start, step = path[:-1], np.diff(path, axis=0)
    square = np.maximum((step**2).sum(axis=1), 1e-30)
    offset = points[:, None] - start
    along = ((offset * step).sum(axis=2) / square).clip(0, 1)
    return np.linalg.norm(offset - along[:, :, None] * step, axis=2).min(axis=1)


def test_machines_are_reset_one_by_one_in_the_step_after_their_end() -> None:
    options = {"motion": "corner-90", "feed": (1.0, 6.0), "settling": 20}
    many = ContouringVectorEnv(3, **options)
    singles = [ContouringEnv(**options) for _ in range(3)]
    assert many.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.NEXT_STEP
    seen = many.reset(seed=7)[0]
    assert np.array_equal(seen, [one.reset(seed=7 + index)[0] for index, one in enumerate(singles)])
    random, ended, ends = np.random.default_rng(1), [False] * 3, [0] * 3
    for _ in range(1500):
        actions = random.uniform(-1, 1, many.action_space.shape).astype(np.float32)
        found = many.step(actions)
        for index, one in enumerate(singles):
            if ended[index]:
                expected = (one.reset()[0], 0.0, False)
                ends[index] += 1
            else:
                expected = one.step(actions[index])[:3]
            assert np.array_equal(found[0][index], expected[0])
            assert (found[1][index], found[2][index]) == expected[1:]
            ended[index] = expected[2]
    assert min(ends) >= 2 and len(set(ends)) > 1, ends


def test_the_seed_draws_the_motion() -> None:
    env = ContouringEnv(motion="ballbar", feed=(2.0, 6.0))
    lengths = [len_of(env, seed) for seed in (3, 3, 4)]
    assert lengths[0] == lengths[1] != lengths[2]


def len_of(env: ContouringEnv, seed: int) -> int:
    """Returns the number of steps of an episode."""
    env.reset(seed=seed)
    steps, ended = 0, False
    while not ended:
        ended = env.step(np.zeros(2, dtype=np.float32))[2]
        steps += 1
    return steps


@pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"]
)
@pytest.mark.parametrize("cycles", [0, 1, 200, 700])
def test_a_copy_goes_on_with_the_same_bits(copied: Callable, cycles: int) -> None:
    options = {"motion": "corner-90", "feed": (2.0, 6.0), "randomize": {"x.friction.a": (1.0, 3.0)}, "settling": 20}
    for env, shape in (
        (gymnasium.make(ENVIRONMENT, **options).unwrapped, (2,)),
        (ContouringVectorEnv(3, **options), (3, 2)),
    ):
        assert copied(env).reset(seed=3)[0].shape == env.reset(seed=3)[0].shape
        random = np.random.default_rng(0)
        for _ in range(cycles):
            ended = env.step(random.uniform(-1, 1, shape))[2]
            if shape == (2,) and ended:
                env.reset()
        other = copied(env)
        for _ in range(300):
            action = random.uniform(-1, 1, shape)
            one, two = env.step(action), other.step(action)
            assert np.array_equal(one[0], two[0]) and np.array_equal(one[1], two[1])
            assert np.array_equal(one[4]["contour_error"], two[4]["contour_error"])
            if shape == (2,) and one[2]:
                assert np.array_equal(env.reset()[0], other.reset()[0])


def test_parameters_are_drawn_for_each_machine_at_each_reset(machine: va.Machine) -> None:
    psec = va.scenario("corner-90").psec(machine)
    drawn: list[dict] = []

    def draw(random: np.random.Generator) -> dict:
        drawn.append({"x.position_loop.gain": float(random.uniform(1.0, 2.0)), "y.friction.a": 2.0})
        return drawn[-1]

    envs = ContouringVectorEnv(4, machine=machine, motion=psec, randomize=draw, settling=0)
    envs.reset(seed=5)
    assert len(drawn) == 4 and len({one["x.position_loop.gain"] for one in drawn}) == 4
    expected = [machine.with_(one).simulate(psec, figures="axes").position for one in drawn]
    for cycle in range(len(psec)):
        _, _, ended, _, _ = envs.step(np.zeros((4, 2)))
        for index in range(4):
            assert np.array_equal(envs.stepper.position[index], expected[index][cycle + 1])
    assert ended.all()
    envs.step(np.zeros((4, 2)))
    assert len(drawn) == 8
    by_bounds = [ContouringVectorEnv(2, randomize={"x.position_loop.gain": (1.0, 2.0)}) for _ in range(2)]
    seen = [env.reset(seed=1)[0] for env in by_bounds] + [env.step(np.zeros((2, 2)))[0] for env in by_bounds]
    assert np.array_equal(seen[0], seen[1]) and np.array_equal(seen[2], seen[3])


def test_the_vector_environment_is_at_least_5_times_as_fast_per_machine() -> None:
    one, many = ContouringEnv(), ContouringVectorEnv(64)
    one.reset()
    many.reset()

    def seconds(env: ContouringEnv | ContouringVectorEnv) -> float:
        action = np.zeros(env.action_space.shape or (), dtype=np.float32)
        start = time.perf_counter()
        for _ in range(300):
            env.step(action)
        return time.perf_counter() - start

    # In turns, so that other load on the machine strikes both alike.
    ratios = [64 * seconds(one) / seconds(many) for _ in range(5)]
    assert np.median(ratios) >= 5, ratios


def test_an_offset_of_the_velocity_setpoint_moves_an_axis_at_rest_by_its_gain(machine: va.Machine) -> None:
    stepper = va.Stepper(machine)
    stepper.set_velocity_offset([0.5, 0, 0, 0, 0])
    for _ in range(1000):
        position = stepper.step(np.zeros(5))
    # At rest Ω* = −K θ + offset = 0, with K = 1.5 m/min/mm = 25 1/s, and 20 mm per revolution.
    assert position[0] == pytest.approx(0.5 / 25 * 0.020 / (2 * np.pi), rel=1e-3)
    assert np.abs(position[1:]).max() < 1e-12
    stepper.reset()
    assert np.abs([stepper.step(np.zeros(5)) for _ in range(50)]).max() < 1e-12


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"action": "torque"}, 'action \'torque\': must be "psec" or "velocity"'),
        ({"axes": ["w"]}, "must be some of x, y, z, a, c"),
        ({"axes": ["x", "x"]}, "each once"),
        ({"axes": "xy"}, "must be some of x, y, z, a, c"),
        ({"motion": np.zeros((5, 5))}, "no axis moves"),
        ({"motion": None}, "motion None: must be an array"),
        ({"motion": lambda random: None}, "motion None: must be an array"),
        ({"residual": 0.0}, "residual 0.0"),
        ({"motion": np.zeros((5, 2)), "axes": ["x"]}, "shape"),
        ({"motion": "nowhere"}, "nowhere"),
        ({"motion": np.zeros((5, 5)), "feed": (1.0, 2.0)}, "feed"),
        ({"preview": 0}, "preview 0"),
        ({"preview": "a"}, "preview 'a': must be an integer"),
        ({"settling": -1}, "settling -1: must be from 0"),
        ({"error_scale": "a"}, "error_scale is 'a'; it must be a real number"),
        ({"residual": "a"}, "residual is 'a'; it must have numbers"),
        ({"feed": (1.0,)}, "must be two positive numbers"),
        ({"randomize": {"x.gain": (1.0, 2.0)}}, "unknown parameter x.gain"),
        ({"randomize": {"x.position_loop.gain": (-1.0, 2.0)}}, "x.position_loop.gain = -1"),
        ({"randomize": {"x.position_loop.gain": (2.0, 1.0)}}, "the lower one first"),
    ],
)
def test_an_option_out_of_range_is_named(options: dict, text: str) -> None:
    with pytest.raises((TypeError, ValueError), match=text):
        ContouringEnv(**options).reset()


def test_a_step_without_a_reset_or_with_a_wrong_action_is_named(machine: va.Machine) -> None:
    env = ContouringEnv(machine=machine)
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset first"):
        env.step(np.zeros(2))
    env.reset(seed=1)
    with pytest.raises(gymnasium.error.InvalidAction, match=r"shape \(3,\); it needs \(2,\)"):
        env.step(np.zeros(3))
    for value in (1.5, -3.0, np.nan):
        with pytest.raises(gymnasium.error.InvalidAction, match=rf"value {value:g}; it must be within ±1"):
            env.step(np.array([0.0, value]))


def test_a_machine_that_has_ended_ignores_its_action(machine: va.Machine) -> None:
    envs = ContouringVectorEnv(2, machine=machine, motion=np.zeros((3, 5)), axes=["x"], settling=0)
    with pytest.raises(ValueError, match="1 seeds for 2 machines"):
        envs.reset(seed=[1])
    envs.reset(seed=[1, 2])
    for _ in range(3):
        _, _, ended, _, _ = envs.step(np.zeros((2, 1)))
    assert ended.all()
    _, rewards, ended, _, _ = envs.step(np.full((2, 1), np.nan))
    assert not ended.any() and (rewards == 0).all()


def test_the_programs_of_the_documentation_run() -> None:
    page = (Path(__file__).resolve().parent.parent / "docs/how-to/learning.md").read_text(encoding="utf-8")
    programs = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    assert len(programs) == 2
    names: dict = {}
    for program in programs:
        exec(compile(program, "learning.md", "exec"), names)
    assert names["ended"].shape == (64,)
