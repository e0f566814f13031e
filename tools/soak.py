#!/usr/bin/env python3
"""Soak test with random traffic: the node's memory, open files and threads must not grow.

    cargo build --release && source .build/env.sh
    tools/soak.py --minutes 1                  # test of the tool; too short for a verdict on memory
    tools/soak.py --minutes 10                 # ten minutes in real time
    tools/soak.py --minutes 60 --speed 10      # an hour of wall time, ten hours of machine time

Traffic: valid and invalid trajectories, streams, loads, services, parameters, goals with and without cancellation, one
after the other as fast as the node responds, reproducible by --seed. By wall time, subscriptions are created and
destroyed, and processes join, leave and are killed, --churn times as often as by default. With --speed the node follows
a /clock of this tool. First, bounded histories are filled: floods, endpoints that join and leave, participant
announcements, and a subscriber that is killed, for which samples are kept until its lease expires.

The memory is the process's own (RssAnon), without files, as the mean between two looks: the middleware cleans up its
histories every 6 s, for each topic at another time. The exit status is 1 if a figure has grown by more than its limit
in the second half (Theil-Sen slope), or if the node died or stopped responding.
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
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from control_msgs.msg import JointTrajectoryControllerState
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from virtual_axes.msg import DriveStates, MotorCurrents

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from action import Follow, goal  # noqa: E402
from node_process import Node, own_mb, status_of  # noqa: E402
from participant import Participant  # noqa: E402
from virtual_axes_py.ros import NANOSECONDS, AxesClient, ParameterRejected, joint_trajectory, to_time  # noqa: E402

WEIGHTS = {"trajectory": 20, "invalid": 10, "long_trajectory": 1, "halt": 3, "stream": 8, "load": 5}
WEIGHTS |= {"parameters": 8, "wrong_parameter": 4, "descriptions": 2, "reset": 1, "goal": 8}
"""Kinds of traffic with their relative frequency: methods of Traffic."""
COMING_S = {"listener": 4.0, "visitor": 30.0, "killed": 120.0}
"""Kinds of changing participants, with the mean wall time between them, s: methods of Traffic."""
JOINTS = {"x": 0.05, "y": 0.05, "z": 0.05, "a": 0.2, "c": 1.0}
"""Maximum distance of trajectories from home, m or rad."""
TOPICS = [
    (JointState, "/joint_states"),
    (MotorCurrents, "/virtual_axes/motor_currents"),
    (DriveStates, "/virtual_axes/drive_states"),
]
GAIN = "x.velocity_loop.gain"
TICK_S = 0.003
"""Wall time between two messages of the clock, s."""
FILL = 12_000
"""Depth above the 8192 samples that the middleware keeps of a topic."""
CROWD = 4096
"""Announcements of publishers, of subscriptions, and of participants that the middleware keeps."""
AT_A_TIME = 512
"""Endpoints of the crowd in one participant: of more than 2048 events at once RustDDS reports only a part."""
IN_A_CALL = 32
"""Of these, those that are created in one call of the executor, which is bounded in time."""
LEASE_S, SHORT_LEASE_S = 20, 2
"""Lease of a participant of Fast DDS, and that of the participants that are killed during the soak test, s."""
KEPT = 64
"""Trajectories that the middleware stores: depth of psec."""
LONG = 5_000
"""Points of the longest trajectories."""
SAMPLE_S = 0.25
"""Minimum wall time between two samples of memory, s."""
LOOKS, LOOK_S = 60, 12.0
"""Looks in a run, and their minimum interval, s: twice the 6 s of the middleware's history cleanup."""
FEWEST = 3
"""Minimum number of looks in the second half for a verdict on growth."""
KEPT_MB = 0.83e-3
"""Memory that the middleware keeps for an endpoint that has left, MB."""
MAY_GROW = {"memory_mb": (3.0, 0.02), "files": (2.5, 0.0), "threads": (1.5, 0.0)}
"""Limits of growth over the second half: an absolute amount, and a share of the median there."""


class Look(NamedTuple):
    """Figures of the process at one time; memory as the mean since the previous look."""

    minutes: float
    memory_mb: float
    files: float
    threads: float
    endpoints: int
    """Remote endpoints discovered since the start."""


def run_clock(drive: AxesClient, speed: float, end: threading.Event) -> None:
    """Publishes `/clock` at a multiple of real time in a thread until `end`."""
    publisher = drive.node.create_publisher(Clock, "/clock", 10)

    def run() -> None:
        begin = time.monotonic()
        while not end.wait(TICK_S):
            now = NANOSECONDS + int((time.monotonic() - begin) * speed * NANOSECONDS)
            publisher.publish(Clock(clock=to_time(now)))

    threading.Thread(target=run, daemon=True).start()


class Traffic:
    """Random sequential traffic to the node."""

    def __init__(self, drive: AxesClient, follow: Follow, seed: int, churn: float, folder: Path):
        """Creates traffic with `churn` times the participants; files go to `folder`."""
        self.drive, self.follow = drive, follow
        self.chance = random.Random(seed)
        # Separate generator: the timed participants do not change the traffic.
        self._comings = random.Random(seed + 1)
        self.count: Counter[str] = Counter()
        self._folder = folder
        self._participants: list[Participant] = []
        self._listening: list[Any] = []
        now = time.monotonic()
        self._every = {kind: every / churn for kind, every in COMING_S.items() if churn > 0}
        self._due = {kind: now + self._comings.expovariate(1 / every) for kind, every in self._every.items()}

    def step(self) -> None:
        """Runs the next due participant change, or else one random kind of traffic."""
        now = time.monotonic()
        due = next((kind for kind, at in self._due.items() if at <= now), None)
        if due is not None:
            self._due[due] += self._comings.expovariate(1 / self._every[due])
        else:
            time.sleep(self.chance.expovariate(20))
        [kind] = [due] if due else self.chance.choices(list(WEIGHTS), list(WEIGHTS.values()))
        try:
            getattr(self, kind)()
            self.count[kind] += 1
        except TimeoutError:
            self.count["timeouts"] += 1
        except (ChildProcessError, BrokenPipeError) as ended:
            if self.drive.process.poll() is not None:
                raise
            # Error of a participant: the soak test evaluates the node.
            print(f"{kind}: {ended}", flush=True)

    def _way(self) -> tuple[list[str], list[float], float]:
        names = self.chance.sample(list(JOINTS), self.chance.randint(1, len(JOINTS)))
        return names, [self.chance.uniform(-1, 1) * JOINTS[name] for name in names], self.chance.uniform(1.5, 4)

    def trajectory(self) -> None:
        """Sends a trajectory from the present position to a random one."""
        names, to, duration = self._way()
        self.drive.send(joint_trajectory(names, [duration], [to], [[0.0] * len(names)]))

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
        self.drive.send(message)

    def long_trajectory(self) -> None:
        """Sends more than ten seconds of C at 2 ms, after an approach of one second, without waiting for the end."""
        times = 1 + np.arange(LONG) / 500
        self.drive.send(joint_trajectory(["c"], times, 0.2 * np.sin(times - 1)))

    def halt(self) -> None:
        """Sends a controlled stop, by the topic or the service."""
        if self.chance.random() < 0.5:
            self.drive.send(JointTrajectory())
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
        kind, topic = self._comings.choice(TOPICS)
        profile = QoSProfile(depth=self._comings.choice([1, 10, 1000]))
        node = self.drive.node

        def change() -> None:
            self._listening.append(node.create_subscription(kind, topic, lambda _: None, profile, raw=True))
            if len(self._listening) > 5:
                node.destroy_subscription(self._listening.pop(0))

        self.drive.in_executor(change)

    def visitor(self) -> None:
        """Starts a participant that joins and leaves."""
        with Participant(self.drive.process.domain_id, "sink", 10) as participant:
            participant.leave()

    def killed(self) -> None:
        """Starts a subscribing process and kills an earlier one."""
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


def run_crowd(drive: AxesClient) -> None:
    """Creates publishers and subscriptions that leave with their participants, with long names and types."""
    kind, name = JointTrajectoryControllerState, "/crowd/of_those_who_leave_together"

    def count() -> int:
        return int(drive.next_status()["endpoints_discovered"])

    for _ in range(CROWD // AT_A_TIME):
        before = count()
        with AxesClient(process=drive.process, keep_samples=False) as other:

            def come() -> None:
                for _ in range(IN_A_CALL):
                    # On different topics: otherwise each would match all others.
                    other.node.create_subscription(kind, f"{name}/in", lambda _: None, 1)
                    other.node.create_publisher(kind, f"{name}/out", 1)

            for _ in range(AT_A_TIME // IN_A_CALL):
                other.in_executor(come)
            drive.wait_for(lambda: count() >= before + 2 * AT_A_TIME, 120, "the crowd")


def fill(drive: AxesClient, traffic: Traffic, folder: Path) -> None:
    """Fills histories and queues to their bounds."""
    domain = drive.process.domain_id
    with Participant(domain, "sink", 10) as participant:
        participant.kill()
    time.sleep(LEASE_S + 5)
    drive.drop_samples()
    run_crowd(drive)
    with Participant(domain, "sink", 10, lease=LEASE_S, announces_s=0.005, folder=folder):
        time.sleep(CROWD * 0.005 * 1.5)
    drive.drop_samples()
    rejected = joint_trajectory(["q"], [0.0], [[0.0]])
    deadline = time.monotonic() + 60
    while len(drive.results()) < FILL and time.monotonic() < deadline:
        for _ in range(50):
            drive.send(rejected)
        time.sleep(0.02)
    for _ in range(KEPT + 16):
        traffic.long_trajectory()
        time.sleep(0.05)
    time.sleep(7)  # Period of the middleware's history cleanup: 6 s.


def look(drive: AxesClient, memory_mb: float, began: float) -> Look:
    """Returns the present figures of the process."""
    pid = drive.process.pid
    return Look(
        minutes=(time.monotonic() - began) / 60,
        memory_mb=memory_mb,
        files=len(os.listdir(f"/proc/{pid}/fd")),
        threads=status_of(pid, "Threads"),
        endpoints=int(drive.next_status()["endpoints_discovered"]),
    )


def has_grown(looks: list[Look]) -> bool:
    """Prints the course of each figure over the second half; returns true if one has grown."""
    half = looks[len(looks) // 2 :]
    if len(half) < FEWEST:
        print(f"{len(looks)} looks are too few for a verdict")
        return True
    minutes = np.array([found.minutes for found in half])
    first, second = np.triu_indices(len(half), 1)
    grew = False
    print(f"\n{len(looks)} looks in {looks[-1].minutes:.1f} minutes; over the second half:")
    for name, (at_least, share) in MAY_GROW.items():
        values = np.array([getattr(found, name) for found in half])
        slopes = (values[second] - values[first]) / (minutes[second] - minutes[first])
        growth = float(np.median(slopes)) * (minutes[-1] - minutes[0])
        most = at_least + share * float(np.median(values))
        grew |= growth > most
        print(
            f"  {name:<10}{values.min():9.2f} to {values.max():9.2f}, {growth:+7.2f} in total, limit {most:.2f}: "
            f"{'GROWS' if growth > most else 'flat'}"
        )
    came = half[-1].endpoints - half[0].endpoints
    print(f"  {came} remote endpoints discovered, for which the middleware keeps up to {came * KEPT_MB:.2f} MB")
    return grew


def run(drive: AxesClient, traffic: Traffic, seconds: float) -> tuple[list[Look], dict[str, str]]:
    """Runs traffic for a duration; returns the looks and the node's final diagnostics, if the run was not aborted."""
    looks: list[Look] = []
    samples = [own_mb(drive.process.pid)]
    between_s = max(seconds / LOOKS, LOOK_S)
    began = sampled = time.monotonic()
    try:
        while (passed := time.monotonic() - began) < seconds:
            traffic.step()
            if time.monotonic() > sampled + SAMPLE_S:
                sampled = time.monotonic()
                samples.append(own_mb(drive.process.pid))
            if passed >= (len(looks) + 1) * between_s:
                looks.append(look(drive, float(np.mean(samples)), began))
                samples = samples[-1:]
                traffic.forget()
                print(looks[-1], flush=True)
        return looks, drive.next_status()
    except OSError as failed:  # Includes timeouts and processes that have ended.
        print(f"aborted after {time.monotonic() - began:.0f} s: {failed}", flush=True)
        return looks, {}
    finally:
        traffic.close()


def main() -> int:
    """Runs the soak test and its evaluation."""
    parser = options.parser(__doc__)
    parser.add_argument("--minutes", type=options.positive, default=1, help="wall time, min (1)")
    parser.add_argument("--speed", type=options.positive, default=1, help="ratio of the node's clock to wall time (1)")
    parser.add_argument("--seed", type=int, default=1, help="random seed of the traffic (1)")
    parser.add_argument("--churn", type=options.from_zero, default=1, help="multiple of changing participants (1)")
    args = parser.parse_args()
    real = args.speed == 1
    mode = ["-p", "time:=real"] if real else ["-p", "use_sim_time:=true"]
    end = threading.Event()
    with Node([*mode, "-p", "max_points:=20000"]) as process, AxesClient(process=process, connect=False) as drive:
        if not real:
            run_clock(drive, args.speed, end)
        drive.connect(30)
        with tempfile.TemporaryDirectory() as folder:
            with Follow(drive) as follow:
                traffic = Traffic(drive, follow, args.seed, args.churn, Path(folder))
                fill(drive, traffic, Path(folder))
                looks, reported = run(drive, traffic, args.minutes * 60)
        end.set()
        drive.process = None
        died = process.poll() is not None or process.stop() != 0 or "panicked" in process.output()
        if died:
            print(f"the node died; its output ends:\n{process.output()[-3000:]}")
        grew = has_grown(looks)
        print("traffic:", ", ".join(f"{name} {number}" for name, number in sorted(traffic.count.items())))
        participants = traffic.count["visitor"] + traffic.count["killed"]
        if looks and participants:
            grown = looks[-1].memory_mb - looks[0].memory_mb
            print(f"{participants} participants came and left: {grown / participants * 1e3:.1f} kB more for each")
        keys = ("position_periods", "missed_periods", "unpublished_periods", "dropped_samples", "max_lateness_ms")
        print("diagnostics:", ", ".join(f"{key} {reported.get(key)}" for key in keys))
    return int(grew or died or not reported)


if __name__ == "__main__":
    sys.exit(main())
