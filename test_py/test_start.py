"""Start of the node: ROS arguments, machine files, environment."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from node_process import DomainId, Node, node_binary
from virtual_axes_py.ros import AxesClient, joint_trajectory

CONFIG = Path(__file__).resolve().parent.parent / "config"


def rejection(*ros_args: str, **env: str) -> str:
    """Starts a node that must exit: returns its output of one line, with status 2."""
    domain = DomainId()
    try:
        process = Node(ros_args, domain_id=domain.value, env=env)
        process.start()
        assert process.wait(10) == 2, process.output()
        return process.output()
    finally:
        domain.release()


def test_names_prefix_and_remapping(start: Callable[..., AxesClient]):
    """Namespace, node name, joint prefix and a remapped topic, all at once."""
    drive = start("-r", "__ns:=/cell", "-r", "__node:=mill", "-p", "joint_prefix:=mill_", name="/cell/mill")
    assert list(drive.latest("position")) == ["mill_x", "mill_y", "mill_z", "mill_a", "mill_c"]
    assert drive.run(joint_trajectory(["mill_x"], [0.0, 0.6], [[0.0], [0.01]])).result.name == ["mill_x"]
    topics = dict(drive.node.get_topic_names_and_types())
    assert "/cell/mill/motor_currents" in topics and "/cell/joint_states" in topics


def test_a_topic_under_another_name(start: Callable[..., AxesClient]):
    """The first matching rule applies, and the old name does not exist."""
    drive = start("-r", "joint_states:=/axes", "-r", "/axes:=/nothing", connect=False)
    drive.wait_for(lambda: drive.node.count_publishers("/axes") > 0, 10, "publisher of /axes")
    assert drive.node.count_publishers("/joint_states") == 0


def test_an_integer_is_accepted_for_a_double(start: Callable[..., AxesClient]):
    """The later of two values applies."""
    drive = start("-p", "x.velocity_loop.gain:=3.5", "-p", "x.velocity_loop.gain:=4")
    assert drive.get_parameters(["x.velocity_loop.gain"]) == {"x.velocity_loop.gain": 4.0}


def test_parameters_of_other_nodes_are_ignored(start: Callable[..., AxesClient], tmp_path: Path):
    """As in rclcpp; a parameter in the section of this node must exist."""
    shared = tmp_path / "shared.yaml"
    shared.write_text("/**:\n  ros__parameters: {cell_name: hall_3, x.velocity_loop.gain: 4.0}\n")
    of_rclcpp = ["start_type_description_service:=false", "qos_overrides./joint_states.publisher.depth:=5"]
    foreign = [word for value in ("foreign:=1", *of_rclcpp) for word in ("-p", value)]
    drive = start("--params-file", str(shared), *foreign)
    assert drive.get_parameters(["x.velocity_loop.gain"]) == {"x.velocity_loop.gain": 4.0}
    warnings = [line for line in drive.process.output().splitlines() if "WARN" in line]
    for name in ("cell_name", "foreign"):
        assert len([line for line in warnings if name in line and "ignored" in line]) == 1, warnings
    shared.write_text("virtual_axes:\n  ros__parameters: {cell_name: hall_3}\n")
    assert "unknown parameter cell_name" in rejection("--params-file", str(shared))


@pytest.mark.parametrize(
    ("text", "gain", "warnings"),
    [
        ("", 3.0, ["contains no parameters"]),
        ("{}\n", 3.0, ["contains no parameters"]),
        (
            "/**: {ros__parameters: {cell: 1}}\n/**: {ros__parameters: {x.velocity_loop.gain: 4.0}}\n",
            4.0,
            ["parameter cell;"],
        ),
        ("\ufeff/**:\r\n  ros__parameters:\r\n    x.velocity_loop.gain: 4.0\r\n", 4.0, []),
        (
            "/**:\n  ros__parameters:\n    x.velocity_loop.gain: 5.0\n    x: {velocity_loop: {gain: 4.0}}\n",
            4.0,
            ["duplicate parameter x.velocity_loop.gain"],
        ),
        (
            "/**:\n  ros__parameters: {arr: [1, two], joints: [elbow], use_sim_time: no, cell: ~}\n",
            3.0,
            ["arr: found a list", "joints = [elbow]"],
        ),
        ("/**:\n  ros__parameters: {use_sim_time: true}\n", 3.0, ["use_sim_time = true"]),
        (
            "/*:\n  virtual_axes:\n    ros__parameters: {x.velocity_loop.gain: 5.0}\n"
            "/**/virtual_axes:\n  ros__parameters: &own {x.velocity_loop.gain: 4.0}\n"
            "other:\n  ros__parameters: *own\n",
            4.0,
            [],
        ),
    ],
    ids=["empty", "empty_mapping", "two_sections", "bom_crlf", "nested_twice", "values_of_others", "clock", "patterns"],
)
def test_files_that_ros_reads_are_accepted(
    start: Callable[..., AxesClient], tmp_path: Path, text: str, gain: float, warnings: list[str]
):
    """A node in `fast`, which publishes the clock, with files that were written for all nodes."""
    shared = tmp_path / "shared.yaml"
    shared.write_bytes(text.encode())
    names = ["-p", "cell_name:=hall", "-p", "gain:=2", "-p", "frame_id:=base", "-p", "publish_rate:=null"]
    drive = start("-p", "x.velocity_loop.gain:=3.0", "--params-file", str(shared), "-p", "time:=fast", *names)
    assert drive.get_parameters(["x.velocity_loop.gain"]) == {"x.velocity_loop.gain": gain}
    found = [line for line in drive.process.output().splitlines() if "WARN" in line]
    for word in [*warnings, "cell_name", "unknown parameter gain", "frame_id"]:
        assert len([line for line in found if word in line]) == 1, (word, found)
    assert len(found) == len(warnings) + 3, found


def test_the_linear_motor_machine_moves(start: Callable[..., AxesClient]):
    """Another machine file: other drives, another position cycle."""
    file = CONFIG / "linear_motor_center.yaml"
    drive = start("--params-file", str(file), "-p", "time:=fast")
    drive.run(joint_trajectory(["x", "y"], [0.0, 1.0], [[0.0, 0.0], [0.1, -0.05]]), settle=0.5)
    position = drive.latest("position")
    assert position["x"] == pytest.approx(0.1, abs=2e-6)
    assert position["y"] == pytest.approx(-0.05, abs=2e-6)


def test_quality_of_service_by_parameter(start: Callable[..., AxesClient]):
    """The graph shows the set values; others stay as documented."""
    drive = start("-p", "qos.drive_states.reliability:=best_effort", "-p", "qos.psec.depth:=5", connect=False)

    def offered(topic: str) -> tuple[ReliabilityPolicy, DurabilityPolicy] | None:
        found = drive.node.get_publishers_info_by_topic(topic)
        return (found[0].qos_profile.reliability, found[0].qos_profile.durability) if found else None

    topics = {
        "/virtual_axes/drive_states": (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
        "/virtual_axes/trajectory_result": (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL),
        "/joint_states": (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE),
    }
    for topic, wanted in topics.items():
        assert drive.wait_for(lambda: offered(topic), 10, f"publisher of {topic}") == wanted


def test_publish_rate_decimates_the_grid(start: Callable[..., AxesClient]):
    """At 1/12 ms every second instant is published."""
    drive = start("-p", f"publish_rate:={1 / 0.012}", "-p", "time:=fast")
    recording = drive.run(joint_trajectory(["x"], [0.0, 0.6], [[0.0], [0.01]]))
    stamps = recording.joints.stamp
    assert set(stamps[1:] - stamps[:-1]) == {12_000_000}


@pytest.mark.parametrize(
    ("variable", "value", "remedy"),
    [
        ("ROS_DISCOVERY_SERVER", "127.0.0.1:11811", "ROS_STATIC_PEERS"),
        ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp", "rmw_fastrtps_cpp"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "LARGE_DATA", "UDPv4"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "SHM", "UDPv4"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv6", "UDPv4"),
    ],
)
def test_a_transport_that_the_node_does_not_have_causes_a_warning(
    start: Callable[..., AxesClient], variable: str, value: str, remedy: str
):
    """One line, with the variable and what works instead."""
    drive = start(env={variable: value})
    [line] = [line for line in drive.process.output().splitlines() if variable in line]
    assert "[WARN]" in line and f"{variable}={value} has no effect here" in line and remedy in line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-p", "x.motor.inertia_kg_m2:=-0.028"], ["x.motor.inertia_kg_m2", "-0.028", "kg·m²"]),
        (["-p", "x.motor.inertia_kgm2:=0.028"], ["x.motor.inertia_kgm2", "x.motor.inertia_kg_m2"]),
        (["-p", "x.velocity_loop.gain:=high"], ["x.velocity_loop.gain", "high"]),
        (["--params-file", "/nowhere/machine.yaml"], ["/nowhere/machine.yaml"]),
        (["-r", "psec"], ["-r psec"]),
        (
            ["-r", "psec:=/joint_states"],
            ["/joint_states", "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"],
        ),
        (["-r", "psec:=/rosout"], ["/rosout", "rcl_interfaces/msg/Log", "psec"]),
        (["-r", "~/reset:=~/stop"], ["~/reset", "~/stop", "/virtual_axes/stop"]),
        (["--log-level", "loud"], ["--log-level", "loud"]),
        (["--frobnicate"], ["--frobnicate"]),
    ],
)
def test_wrong_arguments_are_rejected_by_name(arguments: list[str], words: list[str]):
    """One message that names the wrong input, and status 2."""
    text = rejection(*arguments)
    assert [word for word in words if word not in text] == [], text


def test_arguments_are_escaped_and_shortened_in_errors():
    """A line end, a control sequence, and thousands of characters."""
    long = "n" * 5000
    for arguments in (
        ["a\nb\x1b[31m"],
        ["--params-file", "a\nb\x1b[31m"],
        ["-p", "a\nb\x1b[31m:=1"],
        ["--log-level", long],
    ):
        text = rejection(*arguments)
        assert text.count("\n") == 1 and "\x1b" not in text and len(text) < 1200, text
        assert long in arguments or "a\\nb\\u{1b}[31m" in text, text


def test_help_that_cannot_be_printed_is_an_error():
    with Path("/dev/full").open("w") as full:
        status = subprocess.run([str(node_binary()), "--help"], stdout=full, stderr=subprocess.PIPE, check=False)
    assert status.returncode == 2 and b"standard output: No space left" in status.stderr


def test_a_wrong_domain_is_rejected():
    """The environment is validated like an argument."""
    status = subprocess.run(
        [str(node_binary())], env={"ROS_DOMAIN_ID": "233"}, capture_output=True, text=True, timeout=10, check=False
    )
    assert status.returncode == 2
    assert "ROS_DOMAIN_ID" in status.stderr and "233" in status.stderr
