#!/usr/bin/env python3
"""Measures the memory that one datagram allocates in a node: a fragment that announces a long message.

    tools/measure_fragments.py [MB]     announced length of one message on psec

Needs the environment of .build/env.sh. No packet leaves this machine.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
import time
from pathlib import Path

import options

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test_py"))

from trajectory_msgs.msg import JointTrajectory

from node_process import Node, resident_mb
from virtual_axes_py.ros import PSEC_QOS, AxesClient

FRAGMENT = 1024
"""Octets of the only fragment that is sent."""
LONGEST = 2**32 - 1
"""Maximum octets of a message: its length has 32 bits."""
PROTOCOL, VENDOR = bytes((2, 3)), bytes((1, 15))
DATA_FRAG, LITTLE_ENDIAN = 0x16, 0x01
TO_INLINE_QOS = 28
PARTICIPANTS = 10
"""Participant ids of this machine that may be the node."""


def fragment(writer: bytes, number: int, length: int) -> bytes:
    """Returns the first fragment of a message of `length` octets, with a writer's GUID (RTPS 2.5, 9.4.5.5)."""
    body = struct.pack("<HH4s4siIIHHI", 0, TO_INLINE_QOS, bytes(4), writer[12:], 0, number, 1, 1, FRAGMENT, length)
    body += bytes(FRAGMENT)
    return b"RTPS" + PROTOCOL + VENDOR + writer[:12] + struct.pack("<BBH", DATA_FRAG, LITTLE_ENDIAN, len(body)) + body


def main() -> None:
    """Runs the measurement."""
    parser = options.parser(__doc__)
    parser.add_argument("megabytes", type=options.positive, nargs="?", default=256, help="announced length in MB (256)")
    length = round(parser.parse_args().megabytes * 1_000_000)
    if not FRAGMENT < length <= LONGEST:
        parser.error(f"a message of {length} octets: must be longer than a fragment, {FRAGMENT}, up to {LONGEST}")
    with Node(["-p", "time:=real"]) as process, AxesClient(process=process) as drive:
        drive.node.create_publisher(JointTrajectory, "/psec", PSEC_QOS)
        time.sleep(1.0)
        own = [info for info in drive.node.get_publishers_info_by_topic("/psec")]
        before = resident_mb(process.pid)
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        for info in own:
            writer = bytes(info.endpoint_gid)[:16]
            for participant in range(PARTICIPANTS):
                port = 7400 + 250 * process.domain_id + 11 + 2 * participant
                link.sendto(fragment(writer, 1, length), ("127.0.0.1", port))
        for wait in (1, 5, 10, 10):
            time.sleep(wait)
            print(f"{resident_mb(process.pid) - before:+.0f} MB after {wait} s")


if __name__ == "__main__":
    main()
