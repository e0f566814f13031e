"""Responses larger than one network packet: all arrive at every client."""

from __future__ import annotations

import re
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message

from node_process import own_mb, status_of
from virtual_axes_py.ros import SETTLE_S, AxesClient

TIMES = 20
MANY = 300
"""Number of responses, 40 kB or more each."""
LONG, LONG_BYTES = 10, 30_000_000
"""Number of requests that are too long, and length of the name in each."""
CLEANING_S = 7
"""Period of the middleware's history cleanup, s."""


def describe_all(drive: AxesClient, times: int) -> int:
    """Requests all parameter descriptions, checks them, and returns the number of octets."""
    names = drive.list_parameters()
    octets = 0
    for _ in range(times):
        answer = drive.call(
            DescribeParameters, "describe_parameters", DescribeParameters.Request(names=names), timeout=3
        )
        octets += len(serialize_message(answer))
        assert [descriptor.name for descriptor in answer.descriptors] == names
    return octets


def test_many_in_a_row(real: AxesClient):
    """Each response takes milliseconds, without retransmission."""
    describe_all(real, TIMES)


def test_every_value_at_once(real: AxesClient):
    """The request of `ros2 param dump`."""
    names = real.list_parameters()
    for _ in range(TIMES):
        assert len(real.get_parameters(names)) == len(names)


def test_two_clients_at_once(real: AxesClient):
    """The responses to one client are samples that the other client must account for."""
    with AxesClient(process=real.process) as other, ThreadPoolExecutor() as pool:
        for done in [pool.submit(describe_all, drive, TIMES) for drive in (real, other)]:
            done.result()
        # And an idle client that had matched earlier.
        describe_all(other, 1)
        assert len(real.describe(["max_points"])) == 1


def test_a_hundred_requests_at_a_time(real: AxesClient):
    """A hundred responses in transit at a time, to a client with a sufficient history depth."""
    names = real.list_parameters()
    client = real.node.create_client(
        DescribeParameters, f"{real.target}/describe_parameters", qos_profile=QoSProfile(depth=1000)
    )
    try:
        real.wait_for(client.service_is_ready, 5, "service")
        time.sleep(SETTLE_S)
        futures = [client.call_async(DescribeParameters.Request(names=names)) for _ in range(100)]
        real.wait_for(lambda: all(future.done() for future in futures), 10, "a hundred responses")
    finally:
        real.in_executor(lambda: real.node.destroy_client(client))
    assert all(len(future.result().descriptors) == len(names) for future in futures)


def test_a_response_that_is_too_long_is_logged(real: AxesClient):
    """A datagram holds 65 500 octets; the log names the service, and the next response is sent."""
    names = (real.list_parameters() * 4)[:1000]
    with pytest.raises(TimeoutError):
        real.call(DescribeParameters, "describe_parameters", DescribeParameters.Request(names=names), timeout=1)
    assert "no response of describe_parameters is sent" in real.process.output()
    assert len(real.describe(["max_points"])) == 1


def test_long_requests_are_ignored_and_later_ones_are_answered(real: AxesClient):
    """Ten requests of 30 MB; the middleware would keep a thousand. The client does not repeat them."""
    assert real.process is not None
    client = real.node.create_client(GetParameters, f"{real.target}/get_parameters")
    try:
        real.wait_for(client.service_is_ready, 5, "service")
        time.sleep(SETTLE_S)
        # Resets the largest resident set size, which earlier tests may have raised (proc(5)).
        Path(f"/proc/{real.process.pid}/clear_refs").write_text("5", encoding="ascii")
        before = status_of(real.process.pid, "VmRSS")
        for _ in range(LONG):
            client.call_async(GetParameters.Request(names=["x" * LONG_BYTES]))
        later = client.call_async(GetParameters.Request(names=["max_points"]))
        real.wait_for(later.done, 60, "response to a short request after the long ones")
        assert later.result().values[0].integer_value == 20_000
        grown = (status_of(real.process.pid, "VmHWM") - before) * 1.024e-3
    finally:
        real.in_executor(lambda: real.node.destroy_client(client))
    ignored = len(re.findall(rf"request of {LONG_BYTES // 1000}\d+ bytes ignored", real.process.output()))
    print(f"at most {grown:.1f} MB more for {LONG} requests of {LONG_BYTES / 1e6:.0f} MB; {ignored} warnings")
    assert grown < LONG_BYTES / 1e6
    assert ignored >= LONG


def test_responses_that_were_taken_are_forgotten(real: AxesClient):
    """Hundreds of long responses do not stay in the node's memory.

    The last 1000 requests do, which are some 10 kB each, with what came in between.
    """
    assert real.process is not None
    describe_all(real, MANY)
    time.sleep(CLEANING_S)
    before = own_mb(real.process.pid)
    sent_mb = describe_all(real, MANY) / 1e6
    time.sleep(CLEANING_S)
    grown = own_mb(real.process.pid) - before
    print(f"{grown:.1f} MB more for {sent_mb:.1f} MB of responses")
    assert grown < sent_mb / 2
