#!/usr/bin/env python3
"""Soak test with random traffic: the node's memory, open files, threads and latency must not grow.

    cargo build --release && source .build/env.sh
    tools/soak.py --minutes 1                  # test of the tool; too short for a verdict on memory
    tools/soak.py --minutes 10                 # ten minutes in real time
    tools/soak.py --minutes 60 --speed 10      # an hour of wall time, ten hours of machine time

Traffic: valid and invalid trajectories, streams, loads, services, parameters, goals with and without cancellation, one
after the other as fast as the node responds, reproducible by --seed. By wall time, subscriptions are created and
destroyed, and processes join, leave and are killed: a subscription every 4 s, a process every 24 s, or --churn times as
many. With --speed the node follows a /clock of this tool. First, bounded histories are filled: floods, endpoints that
join and leave, participant announcements, and a subscriber that is killed, for which samples are kept until its lease
expires.

The latency is the ratio of a service call to the node and a call of the same idle client to an echo process,
alternating, so that other load on the machine slows both. The memory is the process's own (RssAnon), without files,
as the mean between two looks: the middleware cleans up its histories every 6 s, for each topic at another time, so that
the minimum depends on coincidence.

The exit status is 1 if a figure has grown by more than its limit in the second half, if the node died or stopped
responding, or if the fourth prober ended by itself.
"""

from __future__ import annotations

import gc
import math
import os
import random
import sys
import tempfile
import threading
import time
from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from control_msgs.msg import JointTrajectoryControllerState
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import DriveStates, MotorCurrents

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from action import Follow, goal  # noqa: E402
from node_process import Node, own_mb  # noqa: E402
from participant import NoResponse, Participant  # noqa: E402
from virtual_axes_py.ros import (  # noqa: E402
    NANOSECONDS,
    TSP_NS,
    AxesClient,
    ParameterRejected,
    joint_trajectory,
    status_values,
    to_time,
)

WEIGHTS = {
    "trajectory": 20,
    "invalid": 10,
    "long_trajectory": 1,
    "halt": 3,
    "stream": 8,
    "load": 5,
    "parameters": 8,
    "wrong_parameter": 4,
    "descriptions": 2,
    "reset": 1,
    "goal": 8,
}
"""Kinds of traffic with their relative frequency: methods of Traffic."""
COMING_S = {"listener": 4.0, "visitor": 30.0, "killed": 120.0}
"""Kinds of changing participants, with the mean wall time between them, s: methods of Traffic."""
JOINTS = {"x": 0.05, "y": 0.05, "z": 0.05, "a": 0.2, "c": 1.0}
"""Maximum distance of trajectories from home, m or rad."""
GAIN = "x.velocity_loop.gain"
ECHO = "/echo"
"""Service that only echoes."""
TICK_S = 0.003
"""Wall time between two messages of the clock, s."""
FILL = 12_000
"""Depth above the 8192 samples that the middleware keeps of a topic."""
CROWD = 4096
"""Announcements of publishers, of subscriptions, and of participants that the middleware keeps."""
AT_A_TIME = 512
"""Endpoints of the crowd in one participant: of more than 2048 events at once RustDDS reports only a part."""
LEASE_S = 20
"""Lease of a killed participant of Fast DDS, s."""
SHORT_LEASE_S = 2
"""Lease of the participants that are killed during the soak test, s."""
KEPT = 64
"""Trajectories that the middleware stores: depth of psec."""
LONG = 5_000
"""Points of the longest trajectories."""
SAMPLE_S = 0.25
"""Wall time between two samples of memory, s."""
KEPT_MB = 0.83e-3
"""Memory that the middleware keeps for an endpoint that has left, MB (docs/internals/middleware.md)."""
LOOKS = 60
LOOK_S = 12.0
"""Minimum interval of looks, s: twice the 6 s of the middleware's history cleanup."""
FEWEST = 3
"""Minimum number of looks in the second half for a verdict on growth."""
TOLD_EVERY = 6
"""Looks per printed row."""
PROBERS = 3
"""Maximum number of probers that end by themselves before the soak test fails."""
CALLS = 15
"""Calls per look; their median is the latency."""
MARKS = (0, 25, 50, 75, 100)
"""Percentiles for the table, %."""


@dataclass
class Look:
    """Figures of the process at one time."""

    minutes: float
    memory_mb: float
    """Mean since the previous look."""
    least_mb: float
    """Minimum since the previous look."""
    peak_mb: float
    """Maximum since the previous look."""
    files: float
    threads: float
    latency_ms: float
    """Latency of the node's service, ms."""
    echo_ms: float
    """Latency of the echo process, ms."""
    load: float
    """Load average of the machine over a minute."""
    endpoints: int
    """Remote endpoints discovered since the start."""

    @property
    def latency_ratio(self) -> float:
        """Returns the ratio of the node's latency to the echo's."""
        return self.latency_ms / self.echo_ms


MAY_GROW = {"memory_mb": (3.0, 0.02), "files": (2.5, 0.0), "threads": (1.5, 0.0), "latency_ratio": (0.0, 0.5)}
"""Limits of growth over the second half: an absolute amount, and a share of the median there."""


class SoakClock:
    """Publisher of `/clock` at a multiple of real time."""

    def __init__(self, drive: AxesClient, speed: float):
        """Starts the clock."""
        self._publisher = drive.node.create_publisher(Clock, "/clock", 10)
        self._speed, self._end = speed, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        begin = time.monotonic()
        while not self._end.wait(TICK_S):
            now = NANOSECONDS + int((time.monotonic() - begin) * self._speed * NANOSECONDS)
            self._publisher.publish(Clock(clock=to_time(now)))

    def close(self) -> None:
        """Stops the clock."""
        self._end.set()
        self._thread.join(timeout=5)


class Traffic:
    """Random sequential traffic to the node."""

    def __init__(self, drive: AxesClient, follow: Follow, seed: int, kinds: set[str], churn: float, folder: Path):
        """Creates traffic of these kinds, with `churn` times the participants; files go to `folder`."""
        self.drive, self.follow = drive, follow
        self.chance = random.Random(seed)
        # Separate generator: the timed participants do not change the traffic.
        self._comings = random.Random(seed + 1)
        self.count: Counter[str] = Counter()
        self._folder = folder
        self._participants: list[Participant] = []
        self._listening: list[Any] = []
        self._kinds = {kind: weight for kind, weight in WEIGHTS.items() if kind in kinds}
        now = time.monotonic()
        self._every = {kind: every / churn for kind, every in COMING_S.items() if kind in kinds and churn > 0}
        self._due = {kind: now + self._comings.expovariate(1 / every) for kind, every in self._every.items()}

    def step(self) -> None:
        """Runs the next due participant change, or else one random kind of traffic."""
        now = time.monotonic()
        due = next((kind for kind, at in self._due.items() if at <= now), None)
        if due is not None:
            self._due[due] += self._comings.expovariate(1 / self._every[due])
            self._do(due)
        elif self._kinds:
            [kind] = self.chance.choices(list(self._kinds), list(self._kinds.values()))
            self._do(kind)
            time.sleep(self.chance.expovariate(20))
        else:
            time.sleep(0.05)

    def _do(self, kind: str) -> None:
        try:
            getattr(self, kind)()
            self.count[kind] += 1
        except TimeoutError:
            self.count["timeouts"] += 1
        except (ChildProcessError, BrokenPipeError) as ended:
            if self.drive.process is None or self.drive.process.poll() is not None:
                raise
            # Error of a participant: the soak test evaluates the node.
            self.count["participants_ended"] += 1
            print(f"{kind}: {ended}", flush=True)

    def _way(self) -> tuple[list[str], list[float], float]:
        names = self.chance.sample(list(JOINTS), self.chance.randint(1, len(JOINTS)))
        return names, [self.chance.uniform(-1, 1) * JOINTS[name] for name in names], self.chance.uniform(1.5, 4)

    def _send(self, trajectory: JointTrajectory) -> None:
        self.drive.send(trajectory)

    def trajectory(self) -> None:
        """Sends a trajectory from the present position to a random one."""
        names, to, duration = self._way()
        self._send(joint_trajectory(names, [duration], [to], [[0.0] * len(names)]))

    def invalid(self) -> None:
        """Sends an invalid trajectory of a random kind."""
        names, to, duration = self._way()
        bad = self.chance.choice(["joint", "nan", "size", "times", "travel", "past"])
        rows, times, stamp = [to, to], [duration, duration + 1], None
        if bad == "joint":
            names = [f"q{self.chance.randrange(1000)}", *names[1:]]
        elif bad == "nan":
            rows = [to, [math.nan] * len(to)]
        elif bad == "times":
            times = [2.0, 1.0]
        elif bad == "travel":
            names, rows = ["x"], [[9.0], [9.0]]
        elif bad == "past":
            stamp = 1
        message = joint_trajectory(names, times, rows, stamp=stamp)
        if bad == "size":
            message.points[1].positions = [0.0] * (len(names) + 1)
        self._send(message)

    def long_trajectory(self) -> None:
        """Sends a trajectory with many points without waiting for its end."""
        self._send(long_trajectory())

    def halt(self) -> None:
        """Sends a controlled stop, by the topic or the service."""
        if self.chance.random() < 0.5:
            self._send(JointTrajectory())
        else:
            self.drive.stop()

    def stream(self) -> None:
        """Sends a burst of setpoints, within reach or not."""
        at = self.drive.latest("psec")["y"]
        for k in range(50):
            far = 1.0 if self.chance.random() < 0.05 else 0.0
            self.drive.stream(["y"], [at + 1e-5 * k + far])
            time.sleep(0.004)

    def load(self) -> None:
        """Sends a burst of forces."""
        for _ in range(10):
            self.drive.load({"x": self.chance.uniform(-300, 300), "q" if self.chance.random() < 0.1 else "y": 1.0})

    def parameters(self) -> None:
        """Sets a valid parameter."""
        self.drive.set_parameters({GAIN: self.chance.uniform(4.5, 5.0)})

    def wrong_parameter(self) -> None:
        """Sets an invalid parameter."""
        wrong: Any = self.chance.choice([(GAIN, -1.0), ("no.such", 1), ("time", "fast"), (GAIN, "text")])
        try:
            self.drive.set_parameters(dict([wrong]))
        except ParameterRejected:
            return
        raise SystemExit(f"{wrong} was accepted")

    def descriptions(self) -> None:
        """Requests long responses."""
        self.drive.describe(self.drive.list_parameters()[:60])

    def reset(self) -> None:
        """Resets the axes."""
        self.drive.reset()

    def goal(self) -> None:
        """Sends a goal and sometimes cancels it."""
        names, to, duration = self._way()
        cancels = self.chance.random() < 0.5
        sent = self.follow.send(goal(joint_trajectory(names, [duration], [to], [[0.0] * len(names)])))
        if cancels and sent.handle.accepted:
            sent.cancel()
        self.follow.feedback.clear()
        self.follow.statuses.clear()

    def listener(self) -> None:
        """Creates a subscription and destroys the oldest one above a limit."""
        kind, topic = self._comings.choice(
            [(JointState, "/joint_states"), (MotorCurrents, "/virtual_axes/motor_currents"),
             (DriveStates, "/virtual_axes/drive_states")]
        )  # fmt: skip
        profile = QoSProfile(depth=self._comings.choice([1, 10, 1000]))
        node = self.drive.node

        def change() -> None:
            self._listening.append(node.create_subscription(kind, topic, lambda _: None, profile, raw=True))
            if len(self._listening) > 5:
                node.destroy_subscription(self._listening.pop(0))

        self.drive.in_executor(change)

    def visitor(self) -> None:
        """Starts a participant that joins and leaves."""
        assert self.drive.process is not None
        with Participant(self.drive.process.domain_id, "sink", 10) as participant:
            participant.leave()

    def killed(self) -> None:
        """Starts a subscribing process and kills an earlier one."""
        assert self.drive.process is not None
        # With /clock the node waits for a subscriber until its lease expires.
        domain = self.drive.process.domain_id
        participant = Participant(domain, "sink", 10, lease=SHORT_LEASE_S, folder=self._folder)
        self._participants.append(participant.__enter__())
        if len(self._participants) > 2:
            self._participants.pop(0).kill()

    def forget(self) -> None:
        """Drops the messages that this process has kept."""
        self.drive.drop_samples()
        with self.drive._changed:
            self.drive._results.clear()
            self.drive._diagnostics.clear()
        gc.collect()

    def close(self) -> None:
        """Ends the participants."""
        for participant in self._participants:
            participant.kill()


def long_trajectory() -> JointTrajectory:
    """Returns more than ten seconds of C at 2 ms, after an approach of one second."""
    times = 1 + np.arange(LONG) / 500
    return joint_trajectory(["c"], times, 0.2 * np.sin(times - 1))


def crowd(drive: AxesClient) -> None:
    """Creates publishers and subscriptions that leave with their participants, with long names and types."""
    assert drive.process is not None
    kind, name = JointTrajectoryControllerState, "/crowd/of_those_who_leave_together"

    def count() -> int:
        return int(drive.next_status()["endpoints_discovered"])

    for _ in range(CROWD // AT_A_TIME):
        before = count()
        with AxesClient(process=drive.process, keep_samples=False) as other:

            def come() -> None:
                for _ in range(AT_A_TIME):
                    # On different topics: otherwise each would match all others.
                    other.node.create_subscription(kind, f"{name}/in", lambda _: None, 1)
                    other.node.create_publisher(kind, f"{name}/out", 1)

            other.in_executor(come)
            drive.wait_for(lambda: count() >= before + 2 * AT_A_TIME, 60, "the crowd")


def announce(drive: AxesClient, folder: Path) -> None:
    """Runs a participant that announces itself frequently."""
    assert drive.process is not None
    with Participant(drive.process.domain_id, "sink", 10, lease=LEASE_S, announces_s=0.005, folder=folder):
        time.sleep(CROWD * 0.005 * 1.5)


def kill_listener(drive: AxesClient) -> None:
    """Kills a subscriber whose samples are kept until its lease expires."""
    assert drive.process is not None
    with Participant(drive.process.domain_id, "sink", 10) as participant:
        participant.kill()
    time.sleep(LEASE_S + 5)


def fill(drive: AxesClient, folder: Path) -> None:
    """Fills histories and queues to their bounds."""
    kill_listener(drive)
    drive.drop_samples()
    crowd(drive)
    drive.drop_samples()
    announce(drive, folder)
    drive.drop_samples()
    raw = serialize_message(joint_trajectory(["q"], [0.0], [[0.0]]))
    deadline = time.monotonic() + 60
    while len(drive.results()) < FILL and time.monotonic() < deadline:
        for _ in range(50):
            drive._psec.publish(raw)
            drive._sent += 1
        time.sleep(0.02)
    if len(drive.results()) < FILL:
        print(f"only {len(drive.results())} of {FILL} trajectories got a result within a minute", flush=True)
    for _ in range(KEPT + 16):
        drive.send(long_trajectory())
        time.sleep(0.05)
    time.sleep(7)  # Period of the middleware's history cleanup: 6 s.


class Memory:
    """Continuous sampling of a process's own memory."""

    def __init__(self, pid: int):
        """Starts sampling."""
        self._pid = pid
        self._found_mb: list[float] = []
        self._end = threading.Event()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while not self._end.wait(SAMPLE_S):
            try:
                self._found_mb.append(own_mb(self._pid))
            except OSError:
                return

    def since_mb(self) -> tuple[float, float, float]:
        """Returns mean, minimum and maximum since the previous call."""
        found, self._found_mb = [*self._found_mb, own_mb(self._pid)], []
        return sum(found) / len(found), min(found), max(found)

    def close(self) -> None:
        """Stops sampling."""
        self._end.set()


class Prober:
    """Two participants: one echoes, the other calls the echo and the node alternately."""

    def __init__(self, process: Node):
        """Starts both participants."""
        self.failed = 0
        """Number of restarts."""
        self._process = process
        self._participants = ExitStack()
        self._begin()

    def _begin(self) -> None:
        domain = self._process.domain_id
        self._participants.enter_context(Participant(domain, "echo", ECHO))
        names = (f"{self._process.name}/get_parameters", ECHO)
        self._caller = self._participants.enter_context(Participant(domain, "probe", *names))

    def __enter__(self) -> Prober:
        """Returns itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ends both participants."""
        self._participants.close()

    def begin_anew(self) -> None:
        """Restarts both participants."""
        self.failed += 1
        self._participants.close()
        self._begin()

    def latencies_ms(self) -> list[float]:
        """Returns the latencies of the node and of the echo; raises ChildProcessError if a participant has failed."""
        try:
            return self._caller.latencies_ms(CALLS)
        except NoResponse as no_response:
            if no_response.service != ECHO:
                raise
            raise ChildProcessError("the echo process does not respond") from None


def look(drive: AxesClient, prober: Prober, memory: Memory, began: float) -> Look:
    """Returns the present figures of the process."""
    assert drive.process is not None
    pid = drive.process.pid
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    latency, echo = prober.latencies_ms()
    average, least, most = memory.since_mb()
    drive.wait_for(drive.diagnostics, 20, "diagnostics")
    return Look(
        minutes=(time.monotonic() - began) / 60,
        memory_mb=average,
        least_mb=least,
        peak_mb=most,
        files=len(os.listdir(f"/proc/{pid}/fd")),
        threads=int(status["Threads"]),
        latency_ms=latency,
        echo_ms=echo,
        load=os.getloadavg()[0],
        endpoints=int(status_values(drive.diagnostics()[-1].status[0])["endpoints_discovered"]),
    )


def table(looks: list[Look]) -> str:
    """Returns some looks as a Markdown table."""
    rows = [
        "| time | memory, MB | at least | at most | files | threads | service, ms | echo, ms | ratio | load |",
        "|" + "---|" * 10,
    ]
    for mark in MARKS:
        at = looks[round(mark / 100 * (len(looks) - 1))]
        rows.append(
            f"| {mark} % | {at.memory_mb:.1f} | {at.least_mb:.1f} | {at.peak_mb:.1f} "
            f"| {at.files:.0f} | {at.threads:.0f} "
            f"| {at.latency_ms:.1f} | {at.echo_ms:.1f} | {at.latency_ratio:.2f} | {at.load:.1f} |"
        )
    return "\n".join(rows)


def slope(minutes: np.ndarray, values: np.ndarray) -> float:
    """Returns the Theil-Sen slope: the median of the slopes of all pairs, per minute."""
    first, second = np.triu_indices(len(minutes), 1)
    return float(np.median((values[second] - values[first]) / (minutes[second] - minutes[first])))


def verdict(looks: list[Look]) -> bool:
    """Prints the course of each figure; returns true if none has grown."""
    half = looks[len(looks) // 2 :]
    if len(half) < FEWEST:
        print(f"{len(looks)} looks are too few for a verdict")
        return True
    minutes = np.array([found.minutes for found in half])
    grew = False
    print(f"\n{table(looks)}\n\n{len(looks)} looks in {looks[-1].minutes:.1f} minutes; over the second half:")
    for name, (at_least, share) in MAY_GROW.items():
        values = np.array([getattr(found, name) for found in half])
        rate = slope(minutes, values)
        growth, most = rate * (minutes[-1] - minutes[0]), at_least + share * float(np.median(values))
        bad = growth > most
        grew |= bad
        print(
            f"  {name:<14}{values.min():9.2f} to {values.max():9.2f}, {rate:+9.4f} per minute, "
            f"{growth:+7.2f} in total, limit {most:.2f}: {'GROWS' if bad else 'flat'}"
        )
    came = half[-1].endpoints - half[0].endpoints
    print(f"  {came} remote endpoints discovered, for which the middleware keeps up to {came * KEPT_MB:.2f} MB")
    return grew


def run(drive: AxesClient, prober: Prober, traffic: Traffic, seconds: float) -> tuple[list[Look], dict[str, str]]:
    """Runs traffic for a duration; returns the looks and the node's final diagnostics, if the run was not aborted."""
    process = drive.process
    assert process is not None
    memory = Memory(process.pid)
    looks: list[Look] = []
    between_s = max(seconds / LOOKS, LOOK_S)
    began = time.monotonic()
    try:
        first_period = int(drive.next_status()["position_periods"])
        while (passed := time.monotonic() - began) < seconds:
            traffic.step()
            if process.poll() is not None:
                raise ChildProcessError("the node ended")
            if passed < len(looks) * between_s:
                continue
            try:
                looks.append(look(drive, prober, memory, began))
            except (ChildProcessError, BrokenPipeError) as ended:
                # A prober process has failed: the soak test evaluates the node.
                print(f"a prober ended: {ended}", flush=True)
                if prober.failed >= PROBERS or process.poll() is not None:
                    raise
                prober.begin_anew()
                continue
            traffic.forget()
            if len(looks) % TOLD_EVERY == 0:
                print(looks[-1], flush=True)
        reported = drive.next_status()
        lived_s = (int(reported["position_periods"]) - first_period) * TSP_NS / NANOSECONDS
        print(f"\n{lived_s:.0f} s of machine time in {time.monotonic() - began:.0f} s")
        return looks, reported
    except OSError as failed:  # Includes timeouts and processes that have ended.
        print(f"aborted after {time.monotonic() - began:.0f} s: {failed}", flush=True)
        return looks, {}
    finally:
        memory.close()
        traffic.close()


def main() -> int:
    """Runs the soak test and its evaluation."""
    parser = options.parser(__doc__)
    parser.add_argument("--minutes", type=options.positive, default=1, help="wall time, min (1)")
    parser.add_argument("--speed", type=options.positive, default=1, help="ratio of the node's clock to wall time (1)")
    parser.add_argument("--seed", type=int, default=1, help="random seed of the traffic (1)")
    parser.add_argument(
        "--churn", type=options.from_zero, default=1, help="multiple of the default number of changing participants (1)"
    )
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("--only", metavar="KIND,...", help="only these kinds of traffic")
    kinds.add_argument("--without", metavar="KIND,...", help="all kinds of traffic except these")
    args = parser.parse_args()
    known = {**WEIGHTS, **COMING_S}
    named = set(filter(None, (args.only or args.without or "").split(",")))
    if not named <= set(known):
        parser.error(f"unknown traffic: {', '.join(sorted(named - set(known)))}; available: {', '.join(known)}")
    chosen = named if args.only else set(known) - named
    real = args.speed == 1
    mode = ["-p", "time:=real"] if real else ["-p", "use_sim_time:=true"]
    with Node([*mode, "-p", "max_points:=20000"]) as process, AxesClient(process=process, connect=False) as drive:
        clock = None if real else SoakClock(drive, args.speed)
        drive.connect(30)
        with tempfile.TemporaryDirectory() as folder:
            fill(drive, Path(folder))
            with Follow(drive) as follow, Prober(process) as prober:
                traffic = Traffic(drive, follow, args.seed, chosen, args.churn, Path(folder))
                looks, reported = run(drive, prober, traffic, args.minutes * 60)
        if clock is not None:
            clock.close()
        drive.process = None
        died = process.poll() is not None or process.stop() != 0 or "panicked" in process.output()
        if died:
            print(f"the node died; its output ends:\n{process.output()[-3000:]}")
        grew = verdict(looks)
        print("traffic:", ", ".join(f"{name} {number}" for name, number in sorted(traffic.count.items())))
        keys = ("position_periods", "missed_periods", "unpublished_periods", "dropped_samples", "max_lateness_ms")
        print("diagnostics:", ", ".join(f"{key} {reported.get(key)}" for key in keys))
    return int(grew or died or not reported)


if __name__ == "__main__":
    sys.exit(main())
