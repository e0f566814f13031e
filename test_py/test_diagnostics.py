"""Content of /diagnostics, once a second."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import JointState

from interface import printed
from motion import go_home, start_swing
from node_process import own_mb
from virtual_axes_py.ros import NANOSECONDS, RECORDING_KEYS, AxesClient, joint_trajectory, status_values, to_ns


def text_of(array: DiagnosticArray) -> str:
    """Returns all texts of an array, in lower case."""
    words = []
    for status in array.status:
        words += [status.name, status.message, *(f"{value.key} {value.value}" for value in status.values)]
    return " ".join(words).lower()


def worst(array: DiagnosticArray) -> int:
    """Returns the worst level in an array."""
    return max((int.from_bytes(status.level, "little") for status in array.status), default=-1)


WARN = int.from_bytes(DiagnosticStatus.WARN, "little")


def test_once_a_second_by_the_nodes_clock(real: AxesClient):
    """REP-107 requires 1 Hz."""
    seen = len(real.diagnostics())
    arrays = real.wait_for(lambda: real.diagnostics()[seen:][3:] and real.diagnostics()[seen:], 8, "four diagnostics")
    stamps = [to_ns(array.header.stamp) for array in arrays[:4]]
    assert [round((b - a) / NANOSECONDS) for a, b in zip(stamps, stamps[1:])] == [1, 1, 1]


def test_at_rest_and_moving(real: AxesClient):
    """States holding and running; at rest all levels are OK except for late releases on a busy computer."""
    go_home(real)
    at_rest = real.next_diagnostics()
    assert "holding" in text_of(at_rest)
    messages = {status.message for status in at_rest.status if status.level != DiagnosticStatus.OK}
    assert all("released late" in message and ";" not in message for message in messages), messages
    start_swing(real, duration=6.0)
    assert "running" in text_of(real.next_diagnostics())
    real.stop()


def test_friction_law_beyond_its_range_is_a_warning(real: AxesClient):
    """The friction law is fitted up to 20 m/min; the motion reaches 24 m/min."""
    go_home(real)
    real.accept(joint_trajectory(["x"], [0.0, 0.4, 1.0, 1.4], [[0.0], [0.08], [0.32], [0.34]]))
    seen = len(real.diagnostics())

    def warned() -> bool:
        return any(worst(a) >= WARN and "friction" in text_of(a) for a in real.diagnostics()[seen:])

    real.wait_for(warned, 5, "warning about the friction law")
    go_home(real)


def test_an_axis_that_leaves_its_travel_limits_is_logged(real: AxesClient):
    """Nearly full speed close to a travel limit, so that the axis cannot stop before it."""
    assert real.process is not None
    go_home(real)
    seen = len(real.diagnostics())
    real.accept(joint_trajectory(["x"], [0.0, 0.72], [[0.0], [0.355]]))
    real.wait_for(
        lambda: [a for a in real.diagnostics()[seen:] if "outside its travel limits" in text_of(a)], 8, "a warning"
    )
    process = real.process
    real.wait_for(lambda: "x has left its travel limits" in process.output(), 5, "a line of the log")


def test_the_description_has_every_key_and_no_other(real: AxesClient):
    """Keys by status, in their order; test_record.py has the status of a recording."""
    described = {kind["status"]: [row["key"] for row in kind["keys"]] for kind in printed("interface")["diagnostics"]}
    assert described.pop("NODE: recording") == RECORDING_KEYS
    for status in real.next_diagnostics().status:
        joint = status.name.rsplit(": ", 1)[1]
        kind = "NODE: axes" if joint == "axes" else "NODE: JOINT"
        assert list(status_values(status)) == described[kind], status.name
    assert set(described) == {"NODE: axes", "NODE: JOINT"}


def test_endpoints_are_counted_and_memory_is_reported(real: AxesClient):
    """Each remote endpoint counts once, also after it has left; memory equals Linux's figure of the process."""

    def count() -> int:
        return int(real.next_status()["endpoints_discovered"])

    before = count()

    def come_and_go() -> None:
        for _ in range(20):
            subscription = real.node.create_subscription(JointState, "joint_states", lambda _: None, 1)
            real.node.destroy_subscription(subscription)
        for _ in range(5):
            real.node.destroy_publisher(real.node.create_publisher(JointState, "joint_states", 1))

    real.in_executor(come_and_go)
    real.wait_for(lambda: count() >= before + 25, 20, "20 subscriptions and 5 publishers counted")
    after = real.next_status()
    assert int(after["endpoints_discovered"]) == before + 25
    real.wait_for(lambda: int(real.next_status()["endpoints_departed"]) >= 25, 20, "25 departed endpoints counted")
    assert abs(float(after["memory_mb"]) - own_mb(real.process.pid)) < 5.0
