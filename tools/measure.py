#!/usr/bin/env python3
"""Measures the node in the graph: a subcommand for each figure that the documentation quotes.

    cargo build --release && source .build/env.sh
    tools/measure.py node --minutes 9               share of a core at rest and in motion, and memory
    tools/measure.py latency                        from a setpoint on psec_stream to the samples that show its effect
    tools/measure.py rate                           shortest position cycle without loss to a subscriber
    tools/measure.py publish-once --runs 200        trajectories of publishers that publish at the match and leave
    tools/measure.py restart                        times until participants that stay reach a restarted node
    tools/measure.py simultaneous-start --trials 200  processes that start at the same time as nodes
    tools/measure.py churn --minutes 60             memory that each participant costs which has come and gone

The share is the CPU time of all threads over wall-clock time, of one core. Latencies are in position cycles; the axis
moves after the pure delay of the simulated drive. The exit status is 1 if a trajectory or an endpoint was lost. No
packet leaves this machine.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from node_process import Node, own_mb, resident_mb  # noqa: E402
from participant import Participant  # noqa: E402
from simultaneous_start import Trial, expected_endpoints  # noqa: E402
from virtual_axes_py.ros import TSP_NS, AxesClient, ballbar, joint_trajectory  # noqa: E402

TSP = TSP_NS / 1e9
"""Position cycle, s."""
STARTED_S = 2.0
"""Time from the start of a node to complete discovery, with a margin, s."""
REAL = ("-p", "time:=real")
PERIODS_MS = (6, 3, 2, 1, 0.5, 0.25)
"""Position cycles down to the velocity cycle."""
KEPT = 64
"""Trajectories that the middleware stores: depth of psec."""
LOOK_S = 5.0
"""Interval between samples of the memory, s."""
STEP, MOVED = 2e-3, 1e-7
"""Step of a setpoint within reach in one cycle, and least motion of an axis that follows it, m."""
REST_S = 0.4
"""Time until the axis is at rest again, s."""
GAIN = "x.velocity_loop.gain"
FIRST_VISITS = 40
"""Participants before the first look at the memory, which fill the pools of the middleware."""
CHURN_STEP_MINUTES = 5
"""Time between two looks at the memory."""
LEASE_S = 25.0
"""Time in which killed participants are forgotten, with a margin, s."""


def cpu_seconds(process: Node) -> float:
    """Returns the CPU time of a process so far, s."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def lost(listener: Participant, first: int, period_ns: int) -> tuple[int, int]:
    """Returns the number of samples that a listener has received since its sample `first`, and that of missing ones."""
    stamps = listener.stamps()[first:]
    return len(stamps), int(np.rint(np.diff(stamps) / period_ns - 1).sum())


def move(drive: AxesClient, kind: str, seconds: float) -> None:
    """Repeats a ballbar, streams setpoints, or rests."""
    circle = ballbar()
    trajectory = joint_trajectory(["x", "y"], circle.time, np.column_stack([circle.x, circle.y]))
    begin = time.monotonic()
    while (passed := time.monotonic() - begin) < seconds:
        pause = seconds - passed
        if kind == "trajectory":
            drive.send(trajectory)
            pause = min(pause, circle.time[-1] + 0.1)
        elif kind == "stream":
            angle = np.pi * passed
            drive.stream(["x", "y"], [0.01 * np.sin(angle), 0.01 * (1 - np.cos(angle))])
            pause = TSP
        time.sleep(pause)


def node(args: argparse.Namespace) -> bool:
    """Prints shares of a core, and the memory during motion."""
    with Node(REAL) as process:
        time.sleep(STARTED_S)
        before = cpu_seconds(process)
        time.sleep(args.seconds)
        print(f"at rest, no subscriber: {(cpu_seconds(process) - before) / args.seconds:.2%}", flush=True)
        with (
            Participant(process.domain_id, "listen", "/joint_states", 100_000) as listener,
            AxesClient(process=process, keep_samples=False) as drive,
        ):
            for kind in ("rest", "trajectory", "stream"):
                first, before, start = len(listener.stamps()), cpu_seconds(process), time.monotonic()
                move(drive, kind, args.seconds)
                share = (cpu_seconds(process) - before) / (time.monotonic() - start)
                samples, missing = lost(listener, first, TSP_NS)
                print(
                    f"{kind}, a subscriber of joint_states: {share:.2%}, {missing} of {samples} samples lost",
                    flush=True,
                )
                drive.stop()
            if args.minutes > 0:
                for _ in range(KEPT):
                    drive.send(joint_trajectory(["x"], [0.05], [[0.0]]))
                    time.sleep(0.1)
                looks = []
                for _ in range(max(2, round(args.minutes * 60 / LOOK_S))):
                    move(drive, "trajectory", LOOK_S)
                    looks.append((resident_mb(process.pid), len(os.listdir(f"/proc/{process.pid}/fd"))))
                resident, files = np.array(looks).T
                print(
                    f"memory over {args.minutes:g} min: {resident.min():.1f} to {resident.max():.1f} MB, "
                    f"{resident[-1]:.1f} at last; open files: {files.min():.0f} to {files.max():.0f}"
                )
    return True


def latency(args: argparse.Namespace) -> bool:
    """Prints the latencies of single setpoints at random phases of the position cycle."""
    chance = random.Random(1)
    found: dict[str, list[float]] = {"commanded": [], "axis has moved": []}
    with Node(REAL) as process, AxesClient(process=process) as drive:
        for number in range(args.messages):
            target = 0.0 if number % 2 else STEP
            time.sleep(REST_S + chance.random() * TSP)
            before = drive.latest()["x"]
            sent = time.monotonic()
            drive.stream(["x"], [target])
            drive.wait_for(lambda target=target: drive.latest("psec")["x"] == target, 2, "the setpoint")
            found["commanded"].append(time.monotonic() - sent)
            drive.wait_for(lambda before=before: abs(drive.latest()["x"] - before) > MOVED, 2, "motion")
            found["axis has moved"].append(time.monotonic() - sent)
            drive.drop_samples()
    print(f"{args.messages} setpoints, {os.cpu_count()} cores; in position cycles of {TSP * 1e3:g} ms:")
    for name, seconds in found.items():
        low, median, high = np.percentile(np.array(seconds) / TSP, [5, 50, 95])
        print(f"  {name:<15} p5 {low:.2f}, median {median:.2f}, p95 {high:.2f}")
    return True


def rate(args: argparse.Namespace) -> bool:
    """Prints losses and shares of a core at shorter and shorter position cycles, to rclpy with a depth of 100."""
    for period_ms in PERIODS_MS:
        with (
            Node([*REAL, "-p", f"periods.position_ms:={period_ms}"]) as process,
            Participant(process.domain_id, "listen", "/joint_states", 100) as listener,
        ):
            time.sleep(STARTED_S)
            first, before, start = len(listener.stamps()), cpu_seconds(process), time.monotonic()
            time.sleep(args.seconds)
            share = (cpu_seconds(process) - before) / (time.monotonic() - start)
            samples, missing = lost(listener, first, round(period_ms * 1e6))
            multiple = TSP * 1e3 / period_ms
            print(
                f"{multiple:g} times the default rate: {samples} samples, {missing} lost, {share:.1%} of a core",
                flush=True,
            )
    return True


def publish_once(args: argparse.Namespace) -> bool:
    """Prints the number of trajectories that arrived.

    Each publisher names a nonexistent joint: the rejections identify what arrived.
    """
    burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(args.load)]
    try:
        with Node(REAL) as process, AxesClient(process=process) as drive:
            names = [f"once_{number}" for number in range(args.runs)]
            for name in names:
                words = ("once", name, args.durability, args.poll, args.keep_alive)
                with Participant(process.domain_id, *words) as publisher:
                    publisher.wait()
            time.sleep(3.0)
            arrivals = Counter(result.joint for result in drive.results())
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()
    missing = [name for name in names if not arrivals[name]]
    repeated = [name for name in names if arrivals[name] > 1]
    print(f"{args.runs - len(missing)} of {args.runs} arrived, {len(repeated)} more than once")
    return not missing and not repeated


def restart(args: argparse.Namespace) -> bool:
    """Prints the times of restarts by SIGINT, while an rclpy process stays."""
    found: dict[str, list[float]] = {"first sample": [], "first trajectory": [], "first call": []}
    motion = joint_trajectory(["x"], [1.0], [[0.001]])
    with Node() as process, AxesClient(process=process) as drive:
        drive.accept(motion)
        drive.get_parameters([GAIN])
        for _ in range(args.runs):
            drive.process = None
            process.stop()
            last = drive.now()
            instants = [time.monotonic()]
            process.start()
            drive.process = process
            for step in (
                lambda last=last: drive.wait_for(lambda: drive.now() > last, 30, "samples of the new node"),
                lambda: drive.accept(motion, timeout=30),
                lambda: drive.get_parameters([GAIN]),
            ):
                step()
                instants.append(time.monotonic())
            for name, (begin, end) in zip(found, pairwise(instants), strict=True):
                found[name].append(end - begin)
    print("| time, s | median | maximum |\n|---|---|---|")
    for name, seconds in found.items():
        print(f"| {name} | {np.median(seconds):.3f} | {max(seconds):.3f} |")
    return True


def simultaneous_start(args: argparse.Namespace) -> bool:
    """Prints the trials in which a process did not discover all endpoints of two or four nodes."""
    expected = expected_endpoints()
    print(f"{expected} endpoints of a node", flush=True)

    def run(number: int) -> bool:
        # The golden ratio spreads the delays evenly from 0 to 60 ms, also over the trials of the same number of nodes.
        trial = Trial(2 + 2 * (number % 2), 0.06 * (number * 0.618034 % 1), expected)
        faults = trial.faults(trial.run())
        if faults:
            print(f"{trial.nodes} nodes, {trial.delay * 1e3:.1f} ms: {'; '.join(faults)}", flush=True)
        return not faults

    with ThreadPoolExecutor(3) as pool:
        complete = sum(pool.map(run, range(args.trials)))
    print(f"{args.trials - complete} of {args.trials} trials incomplete")
    return complete == args.trials


def visit(domain_id: int) -> None:
    """Runs a participant with a subscription and a publisher for half a second."""
    context = Context()
    rclpy.init(context=context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
    visitor = rclpy.create_node("visitor", context=context)
    visitor.create_subscription(JointState, "/joint_states", lambda _: None, 10)
    visitor.create_publisher(JointState, "/load", 10)
    time.sleep(0.5)
    visitor.destroy_node()
    rclpy.shutdown(context=context)


def resources(process: Node) -> tuple[float, int, int]:
    """Returns the mean private memory over 10 s, MB, and the number of open files and of threads."""
    memory = []
    for _ in range(40):
        memory.append(own_mb(process.pid))
        time.sleep(0.25)
    folder = Path(f"/proc/{process.pid}")
    return float(np.mean(memory)), len(os.listdir(folder / "fd")), len(os.listdir(folder / "task"))


def churn(args: argparse.Namespace) -> bool:
    """Prints the memory that participants cost which come and go; every tenth is killed."""
    with Node(REAL) as process, AxesClient(process=process, keep_samples=False) as drive:
        for _ in range(FIRST_VISITS):
            visit(process.domain_id)
        count, rows = 0, []
        step = min(CHURN_STEP_MINUTES, args.minutes)
        for minute in range(0, args.minutes + 1, step):
            deadline = time.monotonic() + 60 * step * (minute > 0)
            while time.monotonic() < deadline:
                if count % 10 == 9:
                    with Participant(process.domain_id, "sink", 10) as killed:
                        killed.kill()
                else:
                    visit(process.domain_id)
                count += 1
                time.sleep(2.0)
            time.sleep(LEASE_S)
            endpoints = int(drive.next_status()["endpoints_discovered"])
            rows.append((count, endpoints, *resources(process)))
            print("{} participants, {} endpoints: {:.2f} MB, {} files, {} threads".format(*rows[-1]), flush=True)
    (first, before, start_mb, *start), (last, after, end_mb, *end) = rows[0], rows[-1]
    print(
        f"{1e3 * (end_mb - start_mb) / max(last - first, 1):.1f} kB for each participant, "
        f"{1e3 * (end_mb - start_mb) / max(after - before, 1):.2f} kB for each endpoint"
    )
    return start == end


def main() -> int:
    """Runs a measurement; returns the exit status."""
    parser = options.parser(__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(function, *arguments: tuple[str, object, object]) -> argparse.ArgumentParser:
        command = commands.add_parser(function.__name__.replace("_", "-"), help=function.__doc__.splitlines()[0])
        command.set_defaults(function=function)
        for name, kind, default in arguments:
            command.add_argument(name, type=kind, default=default, help=f"({default})")
        return command

    add(node, ("--seconds", options.positive, 20), ("--minutes", options.from_zero, 0))
    add(latency, ("--messages", options.whole, 300))
    add(rate, ("--seconds", options.positive, 5))
    once = add(
        publish_once,
        ("--runs", options.whole, 100),
        ("--poll", options.from_zero, 0.001),
        ("--keep-alive", options.from_zero, 0.1),
        ("--load", options.whole_from_zero, 0),
    )
    once.add_argument("--durability", choices=["transient_local", "volatile"], default="transient_local")
    add(restart, ("--runs", options.whole, 10))
    add(simultaneous_start, ("--trials", options.whole, 42))
    add(churn, ("--minutes", options.whole, 60))
    args = parser.parse_args()
    return int(not args.function(args))


if __name__ == "__main__":
    sys.exit(main())
