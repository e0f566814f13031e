"""DDS Security: nodes without the plugins, and access control of nodes with them (docs/internals/security.md).

Who takes part needs a node that is built with the cargo feature `security`: VIRTUAL_AXES_SECURE_NODE names it.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from node_process import DomainId, Node

KEYSTORE = Path(__file__).resolve().parent.parent / "tools" / "keystore.py"
SECURE = os.environ.get("VIRTUAL_AXES_SECURE_NODE")
needs_secure_node = pytest.mark.skipif(
    not SECURE,
    reason="DDS Security is a cargo feature that needs OpenSSL's headers and is not built by default; build the node "
    "with --features security and name it in VIRTUAL_AXES_SECURE_NODE (docs/internals/security.md)",
)
HEARD, UNHEARD = 500, 100
"""Messages in the recording of a node that receives its clock (a thousand a second), and of another."""
PATIENCE_S = 60


def keystore(folder: Path, domain: int, *enclaves: str) -> Path:
    """Creates a keystore."""
    words = [sys.executable, str(KEYSTORE), str(folder), "--domain", str(domain), *enclaves]
    subprocess.run(words, check=True, capture_output=True, timeout=30)
    return folder


def secured(folder: Path | None, strategy: str = "Enforce") -> dict[str, str]:
    """Returns the environment of a node with this keystore."""
    words = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": strategy}
    return words if folder is None else {**words, "ROS_SECURITY_KEYSTORE": str(folder)}


def test_an_insecure_node_does_not_start_with_enforced_security():
    """One line, status 2, nothing on the network; without enforcement it runs unsecured and logs a warning."""
    with Node(env=secured(None)) as node:
        assert node.wait(20) == 2
        assert node.output().startswith("virtual_axes_node: ROS_SECURITY_ENABLE is true, but ")
        assert node.output().count("\n") == 1
    with Node(env=secured(None, "Permissive")) as node:
        deadline = time.monotonic() + 20
        while "subscribes" not in node.output() and time.monotonic() < deadline:
            time.sleep(0.05)
        assert "communication of this node is not protected: ROS_SECURITY_ENABLE" in node.output()
        assert node.poll() is None


def test_the_wheels_of_rclpy_have_no_dds_security(tmp_path: Path):
    """Minimal case: a correct keystore and a node of rclpy. Fails when the wheels contain DDS Security."""
    domain = DomainId()
    try:
        store = keystore(tmp_path / "store", domain.value, "/peer")
        program = "import rclpy; rclpy.init(args=['--ros-args', '--enclave', '/peer']); rclpy.create_node('peer')"
        env = {**os.environ, **secured(store), "ROS_DOMAIN_ID": str(domain.value)}
        done = subprocess.run([sys.executable, "-c", program], env=env, capture_output=True, text=True, timeout=60)
    finally:
        domain.release()
    assert done.returncode == 1
    assert "This Fast DDS version doesn't have the security libraries" in done.stderr


@needs_secure_node
def test_only_authorized_participants_receive_from_a_secured_node(tmp_path: Path):
    """One node publishes the clock; a peer of its keystore moves on, the others receive no clock."""
    domain = DomainId()
    with ExitStack() as stack:
        stack.callback(domain.release)
        store = keystore(tmp_path / "store", domain.value, "/mill", "/peer")
        other = keystore(tmp_path / "other", domain.value, "/mill", "/peer")

        def node(name: str, enclave: str, env: dict[str, str], *args: str) -> Node:
            words = ["--enclave", enclave, "-r", f"__ns:=/{name}", *args]
            return stack.enter_context(Node(words, domain_id=domain.value, env=env, binary=Path(str(SECURE))))

        def follower(name: str, env: dict[str, str]) -> Node:
            return node(name, "/peer", env, "-p", "use_sim_time:=true", "-p", f"record:={tmp_path / name}.mcap")

        node("mill", "/mill", secured(store), "-p", "time:=fast")
        peer = follower("peer", secured(store))
        strangers = [follower("stranger", secured(other)), follower("open", {"ROS_SECURITY_ENABLE": "false"})]
        deadline = time.monotonic() + PATIENCE_S
        recording = tmp_path / "peer.mcap"
        while time.monotonic() < deadline and not (recording.exists() and recording.stat().st_size > 1_000_000):
            time.sleep(0.2)

        def messages(participant: Node) -> int:
            assert participant.stop(timeout=20) == 0, participant.output()
            found = re.search(r"\.mcap: (\d+) messages", participant.output())
            assert found, participant.output()
            return int(found[1])

        assert messages(peer) > HEARD
        assert [messages(participant) < UNHEARD for participant in strangers] == [True, True]


@needs_secure_node
def test_a_node_with_a_denied_topic_does_not_start(tmp_path: Path):
    """Permissions are checked for each endpoint."""
    domain = DomainId()
    with ExitStack() as stack:
        stack.callback(domain.release)
        store = keystore(tmp_path / "store", domain.value, "/watcher:-rt/psec")
        words = ["--enclave", "/watcher"]
        node = Node(words, domain_id=domain.value, env=secured(store), binary=Path(str(SECURE)))
        stack.enter_context(node)
        assert node.wait(PATIENCE_S) == 1
        assert "topic psec cannot be created" in node.output()
