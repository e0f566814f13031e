#!/usr/bin/env python3
"""Measures how often an rclpy process that starts at the same time as nodes does not discover all their endpoints.

    cargo build --release && source .build/env.sh
    tools/measure_simultaneous_start.py --trials 200

In each trial the participant of the process is created between 0 and 60 ms after that of the first node, evenly spread
over the trials; the numbers of nodes take turns. The exit status is 1 if a trial fails.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from simultaneous_start import TIMEOUT_S, Trial, expected_endpoints  # noqa: E402


def main() -> int:
    """Runs the trials and prints the failed ones."""
    parser = options.parser(__doc__)
    parser.add_argument("--trials", type=options.whole, default=42, help="number of trials (42)")
    parser.add_argument("--at-once", type=options.whole, default=3, help="trials side by side (3)")
    parser.add_argument("--nodes", type=options.whole, nargs="+", default=[2, 4], help="nodes of a trial (2 4)")
    parser.add_argument(
        "--delay", type=options.from_zero, nargs=2, default=[0.0, 60.0], help="range of the delay, ms (0 60)"
    )
    parser.add_argument("--timeout", type=options.positive, default=TIMEOUT_S, help=f"of a trial, s ({TIMEOUT_S:g})")
    args = parser.parse_args()
    expected = expected_endpoints()
    print(f"{expected} endpoints of a node", flush=True)
    failed: list[int] = []
    slowest = 0.0

    def run(number: int) -> None:
        nonlocal slowest
        # The golden ratio spreads the delays evenly, also over the trials with the same number of nodes.
        least, most = args.delay
        delay = 1e-3 * (least + (most - least) * (number * 0.618034 % 1))
        trial = Trial(args.nodes[number % len(args.nodes)], delay, expected, args.timeout)
        found = trial.run()
        if faults := trial.faults(found):
            failed.append(number)
            print(f"{trial.nodes} nodes, {delay * 1e3:4.1f} ms: {'; '.join(faults)}", flush=True)
        else:
            slowest = max(slowest, found.seconds)

    with ThreadPoolExecutor(args.at_once) as pool:
        list(pool.map(run, range(args.trials)))
    print(f"{len(failed)} of {args.trials} trials incomplete; slowest complete one {slowest:.1f} s")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
