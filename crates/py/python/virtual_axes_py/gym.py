"""Gymnasium environments: a policy that adds to the setpoints of the position cycles (needs gymnasium).

    import gymnasium
    import virtual_axes_py.gym

    env = gymnasium.make("VirtualAxes/Contouring-v0", motion="ballbar")
    envs = gymnasium.make_vec("VirtualAxes/Contouring-v0", num_envs=64, motion="ballbar")

The import registers `VirtualAxes/Contouring-v0`. `make_vec` creates `ContouringVectorEnv`, whose machines are lanes of
one `Stepper`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from .arguments import to_floats, to_list, to_real, to_whole
from .machine import Machine
from .stepper import Stepper
from .study import draw, random_variants
from .tables import columns_of

try:
    import gymnasium
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as error:
    raise ImportError("virtual_axes_py.gym needs gymnasium: pip install 'virtual_axes_py[gym]'") from error

__all__ = ["ENVIRONMENT", "ContouringEnv", "ContouringVectorEnv"]

ENVIRONMENT = "VirtualAxes/Contouring-v0"
"""Registered name of the environment."""

Array = NDArray[np.float64]
Observation = NDArray[np.float32]
Motion = (
    str | os.PathLike[str] | _native.Scenario | _native.PartProgram | Array | Callable[[np.random.Generator], Array]
)
Randomization = Mapping[str, tuple[float, float]] | Callable[[np.random.Generator], Mapping[str, Any]]
"""Bounds of parameters by key, or a function that draws changed parameters."""

LARGEST = 100.0
"""Bound of the observations, in their units."""
ROUNDING = 1e-6
"""Excess of an action beyond ±1 that counts as rounding."""


class _Fleet:
    """Equal machines on motions of their own, and the error of each to its path."""

    def __init__(
        self,
        machines: int,
        *,
        machine: Machine | str | os.PathLike[str] | None = None,
        motion: Motion = "ballbar",
        feed: tuple[float, float] | None = None,
        axes: Sequence[str] | None = None,
        action: str = "psec",
        residual: float | Sequence[float] | None = None,
        preview: int = 8,
        settling: int = 50,
        error_scale: float = 1e-5,
        randomize: Randomization | None = None,
    ) -> None:
        """Checks the options, which `ContouringEnv` documents."""
        self.machine = machine if isinstance(machine, Machine) else Machine.load(machine)
        if action not in ("psec", "velocity"):
            raise ValueError(f'action {action!r}: must be "psec" or "velocity"')
        preview, settling = to_whole("preview", preview, 1, 1000), to_whole("settling", settling, 0, 1_000_000)
        if not to_real("error_scale", error_scale) > 0:
            raise ValueError(f"error_scale {error_scale}: must be above 0 m")
        names = self.machine.axes
        self._motion, self._randomize = (motion, feed), self._checked_ranges(randomize)
        self._plan = self._planner(motion, feed)
        self._action, self._preview, self._settling, self._scale = action, preview, settling, error_scale
        self.stepper = Stepper(self.machine, machines)
        self._trackers = _native.ContourTrackers(self.machine.native, machines)
        self._shape = (machines, len(names))
        self._ahead = max(preview, self.stepper.preview_length, self._trackers.horizon)
        self._rows = np.arange(machines)[:, None]
        self._psec = np.zeros((machines, 0, len(names)))
        self._ends = np.zeros(machines, dtype=np.int64)
        self.cycle = np.zeros(machines, dtype=np.int64)
        if axes is None:
            chosen = self._moving(self._drawn(np.random.default_rng(0)))
            if not chosen:
                raise ValueError("motion: no axis moves; name the axes of action and observation (axes)")
        else:
            chosen = [axes] if isinstance(axes, str) else list(axes)
        if not chosen or len(set(chosen)) < len(chosen) or any(name not in names for name in chosen):
            raise ValueError(f"axes {chosen}: must be some of {', '.join(names)}, each once")
        self._columns = np.array([names.index(name) for name in chosen])
        default = 1e-5 if action == "psec" else 0.1
        size = to_floats("residual", default if residual is None else residual)
        if size.shape not in ((), (len(chosen),)) or not np.all(size > 0):
            raise ValueError(f"residual {residual}: must be above 0, one number or one for each of {', '.join(chosen)}")
        self._residual = size
        parameters, units = self.machine.parameters, self.machine.units
        keys = [("m_min", 1 / 60) if unit == "m" else ("rpm", 2 * np.pi / 60) for unit in units]
        speeds = [parameters[f"{name}.limits.velocity_{unit}"] * factor for name, (unit, factor) in zip(names, keys)]
        currents = [parameters[f"{name}.motor.max_current_a"] for name in names]
        self._speed, self._current = (np.array(values)[self._columns] for values in (speeds, currents))
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (len(chosen),), np.float32)
        width = len(chosen) * (3 + preview)
        self.observation_space = gymnasium.spaces.Box(-LARGEST, LARGEST, (width,), np.float32)

    def _planner(self, motion: Motion, feed: tuple[float, float] | None) -> Callable[[np.random.Generator], Array]:
        """Returns a function that draws a motion, (setpoints, axes)."""
        if feed is not None:
            if not isinstance(motion, str | os.PathLike):
                raise ValueError("feed: needs the name or path of a scenario as motion")
            name, bounds = os.fspath(motion), to_list("feed", feed)
            low, high = bounds if len(bounds) == 2 else (np.nan, np.nan)
            if not 0 < low <= high < np.inf:
                raise ValueError(f"feed {feed}: must be two positive numbers, the lower one first")
            return lambda random: _native.Scenario.load(name, float(random.uniform(low, high))).psec(self.machine)
        if callable(motion):
            return motion
        given = _native.Scenario.load(os.fspath(motion)) if isinstance(motion, str | os.PathLike) else motion
        if isinstance(given, _native.Scenario | _native.PartProgram):
            given = given.psec(self.machine)
        elif columns_of("motion", given) is not None:
            given = np.asarray(self.machine.setpoints(given))
        rows = given
        return lambda random: rows

    def _drawn(self, random: np.random.Generator) -> Array:
        """Returns a motion drawn by a generator; raises `ValueError` if it is no finite array (setpoints, axes)."""
        drawn = self._plan(random)
        if drawn is None or np.ndim(drawn) != 2:
            raise ValueError(f"motion {drawn!r}: must be an array (setpoints, axes)")
        psec = np.ascontiguousarray(drawn, np.float64)
        if psec.shape[1] != self._shape[1] or not len(psec) or not np.isfinite(psec).all():
            raise ValueError(f"motion of the shape {psec.shape}: must be finite, (setpoints, {self._shape[1]})")
        return psec

    def _checked_ranges(self, randomize: Randomization | None) -> Randomization | None:
        """Returns the randomization; raises `ValueError` for an unknown parameter or bounds out of its range."""
        if randomize is None or callable(randomize):
            return randomize
        for key, bounds in random_variants(0, 0, randomize).bounds.items():
            for bound in bounds:
                self.machine.with_({key: bound})
        return dict(randomize)

    def _variant(self, random: np.random.Generator) -> Machine:
        """Returns the machine with parameters drawn by a generator."""
        if callable(self._randomize):
            return self.machine.with_(dict(self._randomize(random)))
        bounds = dict(self._randomize or {})
        return self.machine.with_({key: draw(random, low, high) for key, (low, high) in bounds.items()})

    def __getstate__(self) -> dict[str, Any]:
        """Returns the state without plan and search of the nearest points, which are made again."""
        kept = {name: value for name, value in self.__dict__.items() if name not in ("_plan", "_trackers")}
        return {**kept, "_segments": self._trackers.segments()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restores a state: the copy goes on with the same bits."""
        segments = state.pop("_segments")
        self.__dict__.update(state)
        self._plan = self._planner(*self._motion)
        self._trackers = _native.ContourTrackers(self.machine.native, self._shape[0])
        if self._psec.shape[1]:
            for index, segment in enumerate(segments):
                known = self.cycle[index] + self._trackers.horizon + 1
                self._trackers.start(index, self._psec[index, :known], segment)

    def _moving(self, psec: Array) -> list[str]:
        """Returns the axes that move."""
        return [name for name, column in zip(self.machine.axes, psec.T) if np.ptp(column) > 0]

    def reset(self, random: Sequence[np.random.Generator], only: NDArray[np.int64]) -> None:
        """Puts the machines `only` at the start of a motion, drawn by the generator of each."""
        motions = [self._drawn(random[index]) for index in only]
        # After the last setpoint the setpoints hold.
        rows = max(len(psec) for psec in motions) + self._settling + self._ahead + 1
        if rows > self._psec.shape[1]:
            missing = ((0, 0), (0, rows - self._psec.shape[1]), (0, 0))
            self._psec = np.pad(self._psec, missing, "edge" if self._psec.shape[1] else "constant")
        for index, psec in zip(only, motions):
            self._psec[index, : len(psec)], self._psec[index, len(psec) :] = psec, psec[-1]
            self._ends[index] = len(psec) + self._settling
        self.cycle[only] = 0
        if self._randomize is not None:
            self.stepper._set_machines([self._variant(random[index]) for index in only], only.tolist())
        start = self._psec[:, 0]
        self.stepper.reset(start if self._shape[0] > 1 else start[0], only=only.tolist())
        for index in only:
            self._trackers.start(int(index), self._psec[index, : self._trackers.horizon + 1], 0)

    def step(self, actions: NDArray[np.float32]) -> tuple[Array, NDArray[np.bool_]]:
        """Advances by one position cycle; returns contour errors, m, and true for each motion that has ended."""
        if not self._psec.shape[1]:
            raise gymnasium.error.ResetNeeded("the environment has no motion yet; call reset first")
        shape = (self._shape[0], len(self._columns))
        if (found := np.shape(actions)) != shape:
            # Of one machine without the dimension that the environment has added.
            first = 1 if found[:1] == (1,) and shape[0] == 1 else 0
            raise gymnasium.error.InvalidAction(f"the action has the shape {found[first:]}; it needs {shape[first:]}")
        if not np.all(np.abs(actions) <= 1 + ROUNDING):
            worst = float(np.asarray(actions).flat[int(np.argmax(np.abs(actions)))])
            raise gymnasium.error.InvalidAction(
                f"the action has the value {worst:g}; it must be within ±1 (gymnasium.wrappers.ClipAction clips it)"
            )
        psec = self._psec[self._rows[:, 0], self.cycle]
        offsets = np.zeros(self._shape)
        offsets[:, self._columns] = self._residual * actions
        if self._action == "psec":
            psec = psec + offsets
        else:
            self.stepper.set_velocity_offset(offsets)
        ahead = self.stepper.preview_length
        preview = None
        if ahead:
            known = self._psec[self._rows, self.cycle[:, None] + np.arange(1, ahead + 1)]
            preview = known.transpose(0, 2, 1).reshape(-1, ahead)
        position = self.stepper.step(psec, preview).reshape(self._shape)
        # A machine whose motion has ended is reset before its next cycle.
        self.cycle = np.minimum(self.cycle + 1, self._ends)
        self._trackers.push(self._psec[self._rows[:, 0], self.cycle + self._trackers.horizon])
        return self._trackers.distances(position), self.cycle >= self._ends

    def observe(self) -> Observation:
        """Returns the observations, (machines, observation)."""
        stepper, columns, count = self.stepper, self._columns, self._shape[0]
        known = self._psec[self._rows, self.cycle[:, None] + np.arange(self._preview + 1)][..., columns]
        position, velocity, current = (
            values.reshape(self._shape)[:, columns] for values in (stepper.position, stepper.velocity, stepper.current)
        )
        steps = (known[:, 1:] - known[:, :-1]) / (self.machine.position_period * self._speed)
        found = (
            (known[:, 0] - position) / 1e-3,
            velocity / self._speed,
            current / self._current,
            steps.reshape(count, -1),
        )
        return np.concatenate(found, axis=1).clip(-LARGEST, LARGEST).astype(np.float32)

    def rewards(self, contour_error: Array) -> Array:
        """Returns the rewards of contour errors."""
        return -np.square(contour_error / self._scale)


class ContouringEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Machine on a motion; a policy adds to the position setpoints or to the velocity setpoints.

    Action: a value within ±1 per axis, times `residual`. Zero leaves the machine as it is, bit for bit.

    Observation, per axis at the start of a position cycle: following errors (PSEC of the cycle − position), mm or mrad;
    velocities and currents, in parts of their limits; then the planned velocities of the next `preview` cycles, in
    parts of the limit, cycle by cycle.

    Reward: −(contour error / `error_scale`)² at the end of the cycle. The contour error is the distance of the tool
    from the polyline through the setpoints in the workpiece frame, also in `info["contour_error"]`, m.

    An episode terminates `settling` cycles after the last setpoint.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, **options: Any) -> None:
        """Creates the environment.

        - `machine`: a `Machine`, or name or path as for `Machine.load`.
        - `motion`: scenario or its name or path, part program, array (setpoints, axes) in m or rad, or a function that
          draws such an array by a `numpy.random.Generator` at each reset.
        - `feed`: bounds of a feed that is drawn at each reset, in the unit of the scenario that `motion` names.
        - `axes`: names of the axes of action and observation; by default those that move.
        - `action`: `psec`, an offset of PSEC, or `velocity`, an offset of Ω*, the output of the position controller.
        - `residual`: size of an action of 1, one number or one per axis: m or rad (default 1e-5), with `velocity` rad/s
          of the motor (default 0.1).
        - `preview`, `settling`: numbers of position cycles (default 8 and 50).
        - `error_scale`: contour error with the reward −1, m (default 1e-5).
        - `randomize`: parameters that are drawn at each reset, for each machine by itself: bounds `(low, high)` by key,
          as of `Machine.with_`, or a function that draws changed parameters by a `numpy.random.Generator`. Periods
          and axes must stay; observations have the limits of `machine`.

        Raises `ValueError` for an option out of range, `TypeError` for an unknown one.
        """
        self._fleet = _Fleet(1, **options)
        self._all = np.arange(1)
        self.action_space = self._fleet.action_space
        self.observation_space = self._fleet.observation_space

    @property
    def stepper(self) -> Stepper:
        """Simulation of the machine."""
        return self._fleet.stepper

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Puts the machine at rest at the start of a motion."""
        super().reset(seed=seed)
        self._fleet.reset([self.np_random], self._all)
        return self._fleet.observe()[0], {"contour_error": 0.0}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advances by one position cycle."""
        error, ended = self._fleet.step(np.asarray(action)[None])
        reward = float(self._fleet.rewards(error)[0])
        return self._fleet.observe()[0], reward, bool(ended[0]), False, {"contour_error": float(error[0])}


class ContouringVectorEnv(VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """`ContouringEnv` on many machines at once, with the options of `ContouringEnv`.

    Machine i draws its motions by `seed + i`. Autoreset is that of the next step: after an episode has ended, the next
    step ignores the action of that machine, puts it at the start of a motion and returns the reward 0.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int = 1, **options: Any) -> None:
        """Creates `num_envs` machines."""
        self._fleet = _Fleet(num_envs, **options)
        self.num_envs = num_envs
        self.single_action_space, self.single_observation_space = (
            self._fleet.action_space,
            self._fleet.observation_space,
        )
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._random = [seeding.np_random()[0] for _ in range(num_envs)]
        self._ended = np.zeros(num_envs, dtype=np.bool_)

    @property
    def stepper(self) -> Stepper:
        """Simulation of the machines."""
        return self._fleet.stepper

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Puts all machines at rest at the start of a motion; `seed` may be one seed per machine."""
        if isinstance(seed, int | np.integer):
            super().reset(seed=int(seed))
            seed = [int(seed) + index for index in range(self.num_envs)]
        if seed is not None and len(seed) != self.num_envs:
            raise ValueError(f"seed: {len(seed)} seeds for {self.num_envs} machines; one for each is required")
        for index, one in enumerate(seed if seed is not None else ()):
            if one is not None:
                self._random[index] = seeding.np_random(one)[0]
        self._fleet.reset(self._random, np.arange(self.num_envs))
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        return self._fleet.observe(), self._info(np.zeros(self.num_envs))

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observation, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Advances all machines by one position cycle."""
        before = self._ended
        if np.ndim(actions) == 2:
            actions = np.where(before[: len(actions), None], 0, actions)
        error, ended = self._fleet.step(actions)
        if before.any():
            self._fleet.reset(self._random, np.flatnonzero(before))
            error, ended = np.where(before, 0.0, error), ended & ~before
        self._ended = ended
        rewards = self._fleet.rewards(error)
        return self._fleet.observe(), rewards, ended, np.zeros_like(ended), self._info(error)

    def _info(self, error: Array) -> dict[str, Any]:
        """Returns the contour errors in the form of vector environments."""
        return {"contour_error": error, "_contour_error": np.ones(self.num_envs, dtype=np.bool_)}


if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(ENVIRONMENT, entry_point=ContouringEnv, vector_entry_point=ContouringVectorEnv)


def __dir__() -> list[str]:
    """Returns the public names, without those of imported modules."""
    return sorted({*__all__, "__doc__", "__file__", "__name__"})
