"""Datagrams of RTPS that no participant sends: forged ones with far numbers and large sizes, and mutated ones."""

from __future__ import annotations

import contextlib
import os
import random
import socket
import struct
import time
from collections.abc import Callable, Iterator

import pytest

from node_process import Node, resident_mb, status_of
from virtual_axes_py.ros import NANOSECONDS, TSP_NS, AxesClient, joint_trajectory

PREFIX = bytes(range(1, 13))
"""GUID prefix of the forged participant."""
PUBLICATIONS_WRITER, PUBLICATIONS_READER = bytes.fromhex("000003c2"), bytes.fromhex("000003c7")
MAX_MB = 500.0
FAR = 150_000_000
"""Number of samples that take 1.2 GB as a list of their numbers: enough for the test, without harm to the machine."""
MUTANTS = int(os.environ.get("VIRTUAL_AXES_MUTANTS", "100000"))
"""Number of mutated datagrams."""
SEED = int(os.environ.get("VIRTUAL_AXES_MUTANTS_SEED", "47"))


def message(*submessages: bytes, prefix: bytes = PREFIX) -> bytes:
    """Returns a message with the header of Fast DDS."""
    return b"RTPS\x02\x03\x01\x0f" + prefix + b"".join(submessages)


def submessage(kind: int, flags: int, content: bytes) -> bytes:
    return struct.pack("<BBH", kind, flags, len(content)) + content


def number(value: int) -> bytes:
    return struct.pack("<iI", value >> 32, value & 0xFFFFFFFF)


def announcement(port: int, host: str = "127.0.0.1", prefix: bytes = PREFIX) -> bytes:
    """Returns the announcement of a participant with all built-in endpoints at an address."""
    locator = struct.pack("<II", 1, port) + bytes(12) + socket.inet_aton(host)
    parameters = [
        (0x15, b"\x02\x03\0\0"),
        (0x16, b"\x01\x0f\0\0"),
        (0x50, prefix + bytes.fromhex("000001c1")),
        (0x32, locator),
        (0x31, locator),
        (0x02, struct.pack("<iI", 100, 0)),
        (0x58, struct.pack("<I", 0xC3F)),
        (0x01, b""),
    ]
    payload = b"\0\3\0\0" + b"".join(struct.pack("<HH", pid, len(value)) + value for pid, value in parameters)
    head = struct.pack("<HH", 0, 16) + bytes(4) + bytes.fromhex("000100c2") + number(1)
    return message(submessage(0x15, 0x05, head + payload), prefix=prefix)


def heartbeat(first: int, last: int, count: int) -> bytes:
    ids = PUBLICATIONS_READER + PUBLICATIONS_WRITER
    return message(submessage(0x07, 0x01, ids + number(first) + number(last) + struct.pack("<i", count)))


def gap(first: int, end: int) -> bytes:
    ids = PUBLICATIONS_READER + PUBLICATIONS_WRITER
    return message(submessage(0x08, 0x01, ids + number(first) + number(end) + bytes(4)))


def fragment(sample: int, size: int) -> bytes:
    """Returns the first fragment, of 1024 bytes, of a sample of `size` bytes."""
    head = struct.pack("<HH", 0, 28) + PUBLICATIONS_READER + PUBLICATIONS_WRITER + number(sample)
    return message(submessage(0x16, 0x01, head + struct.pack("<IHHI", 1, 1, 1024, size) + bytes(1024)))


@contextlib.contextmanager
def sender(domain_id: int, offset: int) -> Iterator[Callable[[bytes], int]]:
    """Yields a function that sends to a port of the first participant of the domain on this machine."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.connect(("127.0.0.1", 7400 + 250 * domain_id + offset))
        yield out.send


DISCOVERY_PORT, DATA_PORT = 10, 11
"""Offsets of the ports of the first participant of a domain."""
START_SCREEN_END = "stop with Ctrl-C"


def peak_mb(pid: int) -> float:
    """Returns the largest resident set size of a process so far, MB."""
    return status_of(pid, "VmHWM") * 1.024e-3


@contextlib.contextmanager
def first_participant() -> Iterator[Node]:
    """Yields a node in real time that has the ports of the first participant of its domain."""
    with Node(["-p", "time:=real"]) as node:
        end = time.monotonic() + 60
        while START_SCREEN_END not in node.output():
            assert node.poll() is None and time.monotonic() < end, node.output()
            time.sleep(0.05)
        yield node


@contextlib.contextmanager
def matched_sender(domain_id: int) -> Iterator[Callable[[bytes], None]]:
    """Yields a function that sends datagrams of a forged participant whose endpoints the node has matched."""
    with (
        sender(domain_id, DISCOVERY_PORT) as send,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as forged,
    ):
        forged.bind(("127.0.0.1", 0))
        forged.settimeout(20.0)
        send(announcement(port=forged.getsockname()[1]))
        # The node sends to the announced address when it has matched the endpoints.
        assert forged.recv(1 << 16).startswith(b"RTPS")
        time.sleep(0.5)
        yield send


def assert_rate_is_kept(drive: AxesClient, start: int, seconds: float) -> None:
    end = start + round(seconds * NANOSECONDS)
    drive.wait_until(end, seconds + 10)
    stamps = drive.record(start, end).joints.stamp
    assert round((stamps[-1] - stamps[0]) / TSP_NS) + 1 == len(stamps) > 0.9 * seconds * NANOSECONDS / TSP_NS


@pytest.mark.parametrize(
    "hostile",
    [
        pytest.param([heartbeat(1, FAR, 1)], id="heartbeat"),
        pytest.param([gap(1000, FAR // 3)], id="gap"),
        pytest.param([fragment(sample, 200 << 20) for sample in range(1, 7)], id="fragments"),
    ],
)
def test_two_datagrams_take_no_memory(hostile: list[bytes]) -> None:
    """The node survives them within a bound, and others are served at the full rate."""
    with first_participant() as node, AxesClient(process=node) as drive:
        before = resident_mb(node.pid)
        began = drive.now()
        with matched_sender(node.domain_id) as send:
            for datagram in hostile:
                send(datagram)
        assert_rate_is_kept(drive, began, 3.0)
        drive.accept(joint_trajectory(["x"], [0.0, 1.0], [[0.0], [0.01]]), 10)
        print(f"\n{before:.0f} MB before, at most {peak_mb(node.pid):.0f} MB")
        assert peak_mb(node.pid) < MAX_MB


PARTICIPANTS = 20_000
"""Number of forged participants."""
SENDING_S = 10.0


@pytest.mark.extended
def test_forged_participants_do_not_stop_the_axes() -> None:
    """No position cycle is lost and services respond; a participant that joins afterwards is served."""
    speed = 0.05 / 60.0
    with first_participant() as node, AxesClient(process=node) as drive:
        drive.accept(joint_trajectory(["x"], [0.0, 60.0], [[0.0], [60.0 * speed]]), 10)
        before, began, begin = resident_mb(node.pid), drive.now(), time.monotonic()
        with sender(node.domain_id, DISCOVERY_PORT) as send, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sink:
            sink.bind(("127.0.0.1", 0))
            port = sink.getsockname()[1]
            for index in range(PARTICIPANTS):
                send(announcement(port, prefix=b"\x01\x0f" + struct.pack(">HQ", 0, index)))
                time.sleep(max(0.0, begin + SENDING_S * (index + 1) / PARTICIPANTS - time.monotonic()))
        sent = time.monotonic()
        end = began + round((sent - begin) * NANOSECONDS)
        drive.wait_until(end, 30.0)
        late = time.monotonic() - sent
        drive.get_parameters(["x.position_loop.gain"])
        responds = time.monotonic() - sent
        print(f"\nlate: samples {late:.1f} s, services {responds:.1f} s; {before:.0f} to {peak_mb(node.pid):.0f} MB")
        joints = drive.record(began, end).joints
        stamps = joints.stamp
        assert len(stamps) == round((stamps[-1] - stamps[0]) / TSP_NS) + 1
        assert stamps[0] == began and stamps[-1] > end - TSP_NS
        # At constant speed, the axis is at each stamp as far as the trajectory.
        steady = stamps > began + NANOSECONDS
        stamp, position = stamps[steady], joints["position", "x"][steady]
        advance = (position - position[0]) - speed * (stamp - stamp[0]) / NANOSECONDS
        assert abs(advance).max() < 0.1 * speed * TSP_NS / NANOSECONDS
        assert peak_mb(node.pid) < MAX_MB
        assert "new participants" in node.output()
        drive.stop(30.0)


def mutated(datagram: bytes, choice: random.Random) -> bytes:
    """Returns a datagram with some octets, words or lengths changed."""
    octets = bytearray(datagram)
    for _ in range(choice.randint(1, 4)):
        at = choice.randrange(20, len(octets))
        kind = choice.randrange(4)
        if kind == 0:
            octets[at] = choice.randrange(256)
        elif kind == 1 and at + 4 <= len(octets):
            extreme = choice.choice([0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << choice.randrange(32)])
            octets[at : at + 4] = struct.pack("<I", extreme)
        elif kind == 2:
            del octets[at:]
            break
        else:
            octets[at:at] = octets[20:at]
    return bytes(octets[:65_000]) if len(octets) > 24 else datagram


def recorded(domain_id: int, seconds: float, work: Callable[[], object]) -> list[bytes]:
    """Returns the datagrams to the first participant of the domain on the loopback interface during some work."""
    ports = {7400 + 250 * domain_id + offset for offset in (0, DISCOVERY_PORT, DATA_PORT)}
    try:
        capture = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(0x0800))
    except PermissionError as error:
        pytest.skip(f"datagrams cannot be recorded: {error}")
    found, end = set(), time.monotonic() + seconds
    with capture:
        capture.bind(("lo", 0x0800))
        capture.settimeout(0.2)
        work()
        while time.monotonic() < end:
            with contextlib.suppress(TimeoutError):
                packet = capture.recv(1 << 16)
                header = (packet[0] & 15) * 4
                payload = packet[header + 8 :]
                port = int.from_bytes(packet[header + 2 : header + 4], "big")
                if packet[9] == socket.IPPROTO_UDP and port in ports and payload.startswith(b"RTPS"):
                    found.add(payload)
    return sorted(found)


@pytest.mark.extended
def test_mutated_datagrams_do_not_stop_the_node() -> None:
    """The axes move meanwhile, and a participant whose datagrams are not mutated receives every sample.

    Afterwards another one is discovered and served at the full rate.
    """
    with first_participant() as node:
        with AxesClient(process=node) as drive:
            trajectory = joint_trajectory(["x"], [0.0, 60.0], [[0.0], [0.05]])
            datagrams = recorded(node.domain_id, 5.0, lambda: drive.accept(trajectory, 10))
        assert len(datagrams) > 20
        choice = random.Random(SEED)
        with (
            AxesClient(process=node) as witness,
            sender(node.domain_id, DISCOVERY_PORT) as discovery,
            sender(node.domain_id, DATA_PORT) as data,
        ):
            start, began = witness.now(), time.monotonic()
            for index in range(MUTANTS):
                (discovery, data)[index % 2](mutated(choice.choice(datagrams), choice))
                if index % 100 == 99:
                    time.sleep(0.01)
            assert_rate_is_kept(witness, start, time.monotonic() - began)
        print(f"\n{len(datagrams)} recorded; {time.monotonic() - began:.0f} s; at most {peak_mb(node.pid):.0f} MB")
        assert node.poll() is None
        assert peak_mb(node.pid) < MAX_MB
        with AxesClient(process=node) as other:
            assert_rate_is_kept(other, other.now(), 3.0)
            assert 0.005 < other.latest()["x"] < 0.05
            other.stop(10.0)
