#!/usr/bin/env python3
"""Measures a renewal of the DDS participant: memory before and after, gaps of joint_states, and the graph meanwhile.

    cargo build --release && source .build/env.sh
    tools/measure_renewal.py                                  # 10 000 endpoints that join and leave, one renewal
    tools/measure_renewal.py --endpoints 100000 --renewals 3

Participants with 512 publishers and 512 subscriptions join and leave until the given number of endpoints has departed;
the node is at rest and then renews its participant. A separate process subscribes to joint_states. Gaps are those
between successive stamps, and between successive arrivals, from the start of the first participant to 5 s after the
last renewal.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from sensor_msgs.msg import JointState  # noqa: E402

from node_process import Node, die_with_parent, own_mb  # noqa: E402
from virtual_axes_py.ros import DEEP_QOS, TSP_NS, AxesClient, stamp_of  # noqa: E402

AT_A_TIME = 512
"""Number of publishers, and of subscriptions, of each participant."""
DISCOVERY_S = 120
RENEWAL_S = 180
"""Timeout of a renewal, s."""
AFTER_S = 20
"""Time after a renewal before memory is measured, s."""
READ = "read"
"""Argument that makes this file the process that reads joint_states."""


def read() -> None:
    """Reads joint_states until standard input ends, then writes stamps and arrivals, ns, as JSON."""
    stamps: list[tuple[int, int]] = []
    with AxesClient(keep_samples=False, connect=False) as drive:

        def keep(sample: bytes) -> None:
            stamps.append((stamp_of(sample), time.monotonic_ns()))

        drive.node.create_subscription(JointState, "/joint_states", keep, DEEP_QOS, raw=True)
        drive.wait_for(lambda: stamps, 20, "sample of joint_states")
        print("ready", flush=True)
        sys.stdin.read()
    print(json.dumps(stamps))


class Graph:
    """Polling of the graph in a thread: number of times the node was absent, and listed more than once."""

    def __init__(self, drive: AxesClient):
        """Starts the thread."""
        self.polls = self.absent = self.twice = 0
        self._drive = drive
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.wait(0.02):
            names = self._drive.node.get_node_names_and_namespaces()
            count = names.count((self._drive.target.lstrip("/"), "/"))
            self.polls += 1
            self.absent += count == 0
            self.twice += count > 1

    def stop(self) -> None:
        """Ends the thread."""
        self._end.set()
        self._thread.join()


def leave(drive: AxesClient, endpoints: int) -> None:
    """Lets participants join and leave until the node has discovered the given number of endpoints."""
    assert drive.process is not None

    def count() -> int:
        return int(drive.next_status()["endpoints_discovered"])

    until = count() + endpoints
    while (before := count()) < until:
        with AxesClient(process=drive.process, keep_samples=False) as other:

            def join() -> None:
                for number in range(AT_A_TIME):
                    # On different topics: otherwise each would match all others.
                    other.node.create_subscription(JointState, f"/departing_{number}/in", lambda _: None, 1)
                    other.node.create_publisher(JointState, f"/departing_{number}/out", 1)

            other.in_executor(join)
            drive.wait_for(lambda: count() >= before + 2 * AT_A_TIME, DISCOVERY_S, "discovery of the endpoints")
        with drive._changed:
            drive._diagnostics.clear()


def memory(process: Node) -> float:
    """Returns the private memory of the node, MB, the mean over 3 s."""
    found = []
    for _ in range(30):
        found.append(own_mb(process.pid))
        time.sleep(0.1)
    return float(np.mean(found))


def wait_for_log(process: Node, text: str, count: int) -> int:
    """Waits until the node has logged `text` this number of times; returns the time, ns."""
    deadline = time.monotonic() + RENEWAL_S
    while process.output().count(text) < count:
        if time.monotonic() > deadline:
            sys.exit(f"no line '{text}' within {RENEWAL_S} s\n{process.output()}")
        time.sleep(0.02)
    return time.monotonic_ns()


def arguments() -> argparse.Namespace:
    """Returns the parsed command line."""
    parser = options.parser(__doc__)
    parser.add_argument("--endpoints", type=options.whole, default=10_000, help="departing endpoints (10000)")
    parser.add_argument("--renewals", type=options.whole, default=1, help="number of renewals (1)")
    return parser.parse_args()


def main() -> None:
    """Runs the measurement and prints it."""
    if sys.argv[1:] == [READ]:
        read()
        return
    args = arguments()
    with (
        Node(["-p", f"renewal_endpoints:={args.endpoints}"]) as process,
        AxesClient(process=process, keep_samples=False) as drive,
        subprocess.Popen(
            [sys.executable, __file__, READ],
            env={**os.environ, "ROS_DOMAIN_ID": str(process.domain_id)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=die_with_parent,
        ) as reader,
    ):
        assert reader.stdin is not None and reader.stdout is not None
        assert reader.stdout.readline() == "ready\n", "the reader receives nothing"
        graph = Graph(drive)
        print(f"at the start: {memory(process):.1f} MB")
        renewals: list[tuple[int, int]] = []
        for number in range(1, args.renewals + 1):
            leave(drive, args.endpoints)
            print(f"{args.endpoints} endpoints departed: {memory(process):.1f} MB")
            begin = wait_for_log(process, "renewing the DDS participant", number)
            wait_for_log(process, "participant is renewed", number)
            time.sleep(AFTER_S)
            renewals.append((begin, time.monotonic_ns()))
            print(f"renewal {number}: {memory(process):.1f} MB")
        graph.stop()
        output, _ = reader.communicate(timeout=60)
        stamps, arrivals = np.array(json.loads(output), dtype=np.int64).T
        gaps = np.diff(stamps)
        missing = int(gaps.sum()) // TSP_NS - len(gaps)
        status = drive.next_status()
    waits, before = np.diff(arrivals), arrivals[:-1]
    during = [waits[(before >= begin) & (before <= end)].max() * 1e-6 for begin, end in renewals]
    print(
        f"joint_states: {len(stamps)} samples, largest gap of stamps {gaps.max() * 1e-6:.0f} ms, {missing} missing, "
        f"{(gaps <= 0).sum()} repeated; largest gap of arrivals {waits.max() * 1e-6:.0f} ms, "
        f"{max(during):.0f} ms during a renewal\n"
        f"node: {status['missed_periods']} position cycles late, by {status['max_lateness_ms']} ms at most\n"
        f"graph: the node was absent in {graph.absent} of {graph.polls} polls, listed twice in {graph.twice}"
    )


if __name__ == "__main__":
    main()
