"""The node and an rclpy process on two hosts, with lost datagrams, without multicast, and with a link that is down."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from node_process import DomainId, Node
from test_hostile_datagrams import DISCOVERY_PORT, START_SCREEN_END, announcement
from two_hosts import CLIENT_ADDRESS, NODE_ADDRESS, Link, reason_to_skip

SKIP = reason_to_skip()
pytestmark = [
    pytest.mark.extended,
    pytest.mark.skipif(SKIP is not None, reason=f"two hosts need network namespaces: {SKIP}"),
]

POINTS = 100_000
WATCH_S = 5.0


@contextmanager
def node_behind(link: Link, **env: str) -> Iterator[Node]:
    """Yields a node on the first host."""
    domain = DomainId()
    try:
        env = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", **env}
        with Node(domain_id=domain.value, env=env, prefix=link.node_prefix) as node:
            yield node
    finally:
        domain.release()


def steps(link: Link, count: int, *words: object, node_env: dict[str, str] | None = None, **env: str) -> list[Any]:
    """Runs a client on the second host; returns the results of its steps."""
    with node_behind(link, **(node_env or {})) as node:
        with link.client(node.domain_id, node.name, *words, env=env) as client:
            results = [json.loads(client.read_line()) for _ in range(count)]
        print(f"\nloss {link.loss:.0%}: {results}")
        return results


@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2])
def test_trajectories_arrive_and_no_sample_is_missing(loss: float):
    """A short trajectory is executed; one of 100 000 points arrives in fragments and is accepted."""
    with Link(loss=loss) as link:
        _, short, long = steps(link, 3, "move", POINTS)
        assert short == {"position": pytest.approx(0.01, abs=1e-4), "gaps": 0}
        assert long["seconds"] > 0
        _, watched = steps(link, 2, "watch", WATCH_S)
        assert watched["missing"] == 0 and watched["received"] > 100


@pytest.mark.parametrize("side", ["node", "client"])
def test_a_static_peer_of_one_side_replaces_multicast(side: str):
    """An entry in the ROS_STATIC_PEERS of one side is sufficient."""
    peers = {"node": CLIENT_ADDRESS, "client": NODE_ADDRESS}
    env = {name: {"ROS_STATIC_PEERS": peers[name]} if name == side else {} for name in peers}
    with Link(multicast=False) as link:
        _, watched = steps(link, 2, "watch", WATCH_S, node_env=env["node"], **env["client"])
        assert watched["missing"] == 0 and watched["received"] > 100


def test_a_static_peer_without_address_causes_a_warning():
    """A list with the separator of other systems, and an address of IPv6."""
    peers = ["192.0.2.1,192.0.2.2", "::1"]
    with Link() as link, node_behind(link, ROS_STATIC_PEERS=";".join([*peers, CLIENT_ADDRESS])) as node:
        end = time.monotonic() + 20.0
        while node.output().count("has no IPv4 address") < len(peers):
            assert time.monotonic() < end, node.output()
            time.sleep(0.1)
        for peer in peers:
            assert f"ROS_STATIC_PEERS: {peer} has no IPv4 address" in node.output()
        assert f"{CLIENT_ADDRESS} has no" not in node.output()


def test_samples_arrive_again_after_the_link_was_down():
    """The link is down for 30 s, longer than the lease of Fast DDS."""
    with (
        Link() as link,
        node_behind(link) as node,
        link.client(node.domain_id, node.name, "silence", WATCH_S) as client,
    ):
        client.read_line()
        assert json.loads(client.read_line())["missing"] == 0
        link.set_up(False)
        time.sleep(30.0)
        link.set_up(True)
        client.go_on()
        after = json.loads(client.read_line())
        print(f"\n{after}")
        assert after["missing"] == 0 and after["received"] > 100


LOOPBACK = "127.0.0.1"
PORT, COUNT_S = 9999, 20.0
"""Port that an announcement names; time for which the datagrams to it are counted, s."""
COUNT = """
import socket, sys, time
receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
receiver.bind((sys.argv[1], int(sys.argv[2])))
print("ready", flush=True)
count, end = 0, time.monotonic() + float(sys.argv[3])
while (rest := end - time.monotonic()) > 0:
    receiver.settimeout(rest)
    try:
        count += receiver.recv(65535).startswith(b"RTPS")
    except TimeoutError:
        break
print(count)
"""
SEND = """
import socket, sys
sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sender.sendto(bytes.fromhex(sys.argv[3]), (sys.argv[1], int(sys.argv[2])))
"""


def datagrams_to_announced_host(
    link: Link, node: Node, from_host: int, to_address: str, announced_address: str = CLIENT_ADDRESS
) -> int:
    """Sends an announcement to the node; returns the number of datagrams at the announced address.

    It is one of the second host, or the node's own loopback address.
    """
    prefixes = [["ip", "netns", "exec", name, sys.executable, "-c"] for name in link.names]
    announced = announcement(PORT, announced_address).hex()
    counting_host = 0 if announced_address == LOOPBACK else 1
    counting = [*prefixes[counting_host], COUNT, announced_address, str(PORT), str(COUNT_S)]
    with subprocess.Popen(counting, stdout=subprocess.PIPE, text=True) as counter:
        assert counter.stdout.readline() == "ready\n"
        while START_SCREEN_END not in node.output():
            time.sleep(0.1)
        port = 7400 + 250 * node.domain_id + DISCOVERY_PORT
        subprocess.run([*prefixes[from_host], SEND, to_address, str(port), announced], check=True)
        count = int(counter.stdout.readline())
    print(f"\n{count} datagrams in {COUNT_S:.0f} s")
    return count


def test_a_node_of_this_host_only_discards_datagrams_of_others_and_sends_them_none():
    """With LOCALHOST, neither an announcement of the other host nor one with its address is answered there."""
    with Link() as link, node_behind(link, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST") as node:
        assert datagrams_to_announced_host(link, node, 1, NODE_ADDRESS) == 0
        assert datagrams_to_announced_host(link, node, 0, LOOPBACK) == 0


def test_a_node_of_this_host_only_does_not_receive_from_others():
    """An announcement that names the node's own loopback address is answered, unless it comes from the other host."""
    with Link() as link, node_behind(link, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST") as node:
        assert datagrams_to_announced_host(link, node, 1, NODE_ADDRESS, LOOPBACK) == 0
        assert datagrams_to_announced_host(link, node, 0, LOOPBACK, LOOPBACK) > 0


def test_an_announced_address_that_sends_nothing_gets_few_datagrams():
    """Any host can announce the address of a third host: the node sends it 100 datagrams and one per second."""
    with Link() as link, node_behind(link) as node:
        assert 0 < datagrams_to_announced_host(link, node, 0, LOOPBACK) <= 100 + COUNT_S
