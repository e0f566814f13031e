"""The described interface and the running node are equal in both directions; the reference pages are up to date."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml
from control_msgs.action import FollowJointTrajectory
from rcl_interfaces.msg import ParameterType
from rclpy.action import graph
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from virtual_axes.msg import TrajectoryResult

from interface import Interface, ParameterRow, interfaces, parameters, printed
from node_process import DEFAULT_NODE, Node, node_binary
from virtual_axes_py.ros import AxesClient

ROOT = Path(__file__).resolve().parent.parent
CONFIG = ROOT / "config"
DEFAULT_MACHINE = CONFIG / "mikron_ucp710.yaml"
LINEAR_MOTORS = CONFIG / "linear_motor_center.yaml"

HIDDEN = "/_action/"
"""Part of the names of an action's topics and services."""
ACTION_SERVICES = ["cancel_goal", "get_result", "send_goal"]
ACTION_TOPICS = ["feedback", "status"]
STATUSES = {"ACCEPTED", "REJECTED", "COMPLETED", "PREEMPTED", "STOPPED", "ABORTED"}
"""Constants of the status of TrajectoryResult."""
QOS_POLICIES = ("reliability", "durability", "depth")
EVERY_NODE_HAS = {"/rosout", "/parameter_events"}
"""Interfaces that the start screen omits, in addition to the parameter services."""


@dataclass(frozen=True)
class Run:
    """Way to start the node, with the expected names."""

    name: str = DEFAULT_NODE
    settings: dict[str, str] = field(default_factory=dict)
    remaps: dict[str, str] = field(default_factory=dict)
    machine: Path | None = None

    @property
    def ros_args(self) -> list[str]:
        """Returns the node's ROS arguments."""
        namespace, name = self.name.rsplit("/", 1)
        rules = {"__ns": namespace or "/", "__node": name, **self.remaps} if self.name != DEFAULT_NODE else self.remaps
        args = [part for old, new in rules.items() for part in ("-r", f"{old}:={new}")]
        args += ["--params-file", str(self.machine)] if self.machine else []
        return args + [part for key, value in self.settings.items() for part in ("-p", f"{key}:={value}")]

    def expected(self, *directions: str) -> dict[str, Interface]:
        """Returns the described interfaces of these directions by name in the graph."""
        return {
            row.resolved(self.name, self.remaps): row
            for row in interfaces()
            if row.direction in directions and row.exists(self.settings)
        }


CONDITIONS = [("time", "fast"), ("use_sim_time", "true")]
"""Parameters that add interfaces; listed here, so that a condition missing from the description is found."""
RUNS = {
    "default": Run(),
    # Names of every kind, in another namespace, and interfaces that require a parameter.
    **{
        f"{key} {value}": Run("/cell/mill", {key: value}, {"joint_states": "/axes", "~/stop": "halt"})
        for key, value in CONDITIONS
    },
    "linear motors": Run(machine=LINEAR_MOTORS),
}
# A remapping rule's new name is relative to the node's namespace.
HALT = {"halt": "/cell/halt"}


@pytest.fixture(scope="module", params=RUNS)
def seen(request: pytest.FixtureRequest) -> Iterator[tuple[Run, AxesClient]]:
    """Yields a node started in one of these ways, after all described interfaces exist."""
    run = RUNS[request.param]
    with Node(run.ros_args, name=run.name) as process, AxesClient(process=process, connect=False) as drive:
        drive.wait_for(drive.is_in_graph, 10, "node in the graph")
        wanted = {HALT.get(name, name) for name in run.expected("in", "out", "service")}

        def there() -> bool:
            return wanted <= {name for what in ("publisher", "subscriber", "service") for name in by_node(drive, what)}

        deadline = time.monotonic() + 5
        # A timeout is not an error here: each test reports the missing interfaces.
        while not there() and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(0.3)
        yield run, drive


def by_node(drive: AxesClient, what: str) -> dict[str, list[str]]:
    """Returns names and types of the node's publishers, subscribers, services or clients."""
    namespace, name = drive.target.rsplit("/", 1)
    return dict(getattr(drive.node, f"get_{what}_names_and_types_by_node")(name, namespace or "/"))


def types_of(expected: dict[str, Interface]) -> dict[str, list[str]]:
    """Returns names and types in the form of the graph."""
    return {HALT.get(name, name): [row.type] for name, row in expected.items()}


def visible(found: dict[str, list[str]]) -> dict[str, list[str]]:
    """Returns the interfaces without the parts of actions."""
    return {name: types for name, types in found.items() if HIDDEN not in name}


def test_the_tested_conditions_are_the_described_ones():
    """A node runs with each described condition."""
    assert sorted({condition for row in interfaces() for condition in row.conditions}) == CONDITIONS


@pytest.mark.parametrize(
    ("direction", "what"), [("out", "publisher"), ("in", "subscriber"), ("service", "service")], ids=lambda value: value
)
def test_names_and_types(seen: tuple[Run, AxesClient], direction: str, what: str):
    """Documented names and types equal those of the graph."""
    run, drive = seen
    assert visible(by_node(drive, what)) == types_of(run.expected(direction))


def test_actions(seen: tuple[Run, AxesClient]):
    """Actions have their types; hidden topics and services are only theirs."""
    run, drive = seen
    namespace, name = run.name.rsplit("/", 1)
    actions = types_of(run.expected("action"))
    assert dict(graph.get_action_server_names_and_types_by_node(drive.node, name, namespace or "/")) == actions
    for what, parts in (("service", ACTION_SERVICES), ("publisher", ACTION_TOPICS), ("subscriber", [])):
        hidden = {name for name in by_node(drive, what) if HIDDEN in name}
        assert hidden == {f"{action}{HIDDEN}{part}" for action in actions for part in parts}, what


def test_the_node_has_no_service_client(seen: tuple[Run, AxesClient]):
    """The node has no service client."""
    _, drive = seen
    assert by_node(drive, "client") == {}


def test_quality_of_service_and_node_name_of_every_endpoint(seen: tuple[Run, AxesClient]):
    """Reliability and durability are as documented; every endpoint has its node's name."""
    run, drive = seen
    infos: dict[str, Callable[[str], Any]] = {
        "out": drive.node.get_publishers_info_by_topic,
        "in": drive.node.get_subscriptions_info_by_topic,
    }
    known = {run.name, f"/{drive.name}"}
    for direction, ask in infos.items():
        for topic, row in run.expected(direction).items():
            found = {(f"{info.node_namespace.rstrip('/')}/{info.node_name}", quality(info)) for info in ask(topic)}
            assert {node for node, _ in found} <= known, topic
            assert row.qos is not None
            reliability = ReliabilityPolicy[row.qos["reliability"].upper()]
            durability = DurabilityPolicy[row.qos["durability"].upper()]
            assert (run.name, (reliability, durability)) in found, topic


def quality(info: Any) -> tuple[ReliabilityPolicy, DurabilityPolicy]:
    """Returns the part of an endpoint's profile that discovery transports, which excludes the depth."""
    return info.qos_profile.reliability, info.qos_profile.durability


def test_policies_are_those_of_the_parameters(seen: tuple[Run, AxesClient]):
    """Described profiles equal the parameters that set them."""
    run, drive = seen
    profiles = [row.qos for row in run.expected("in", "out").values() if row.qos and row.qos["parameters"]]
    documented = {f"{qos['parameters']}.{policy}": qos[policy] for qos in profiles for policy in QOS_POLICIES}
    assert len(documented) >= 3 * 12
    assert drive.get_parameters(list(documented)) == documented


def test_the_screen_at_the_start(seen: tuple[Run, AxesClient]):
    """The start screen lists the same topics, services and actions."""
    run, drive = seen
    lines = drive.wait_for(lambda: drive.process.output(), 5, "screen").splitlines()
    listed: dict[str, set[str]] = {}
    label = ""
    for line in lines[1:]:
        if not line.startswith("  ") or line.startswith("  and "):
            break
        label = line[2:13].strip() or label
        listed.setdefault(label, set()).add(line[13:].strip())
    assert listed.pop("subscribes") == set(types_of(run.expected("in")))
    assert listed.pop("publishes") == set(types_of(run.expected("out"))) - EVERY_NODE_HAS
    served = {name for name in types_of(run.expected("service", "action")) if "parameter" not in name}
    assert set().union(*listed.values()) == served


# ------------------------------------------------------------------------------------- parameters


@dataclass(frozen=True)
class Machine:
    """Expected parameters of a node."""

    rows: dict[str, ParameterRow]
    """Definition by parameter."""
    given: dict[str, Any]
    """Values that the machine file or the arguments set."""


@pytest.fixture(scope="module")
def machine(seen: tuple[Run, AxesClient]) -> Machine:
    """Returns the parameters of the started node, from the description and from the file that it read."""
    run, drive = seen
    file = yaml.safe_load((run.machine or DEFAULT_MACHINE).read_text(encoding="utf-8"))
    settings = {key: yaml.safe_load(value) for key, value in run.settings.items()}
    given = {**flat(file["/**"]["ros__parameters"]), **settings}
    joints = {joint: kinds_of(joint, given) for joint in given["joints"]}
    rows = [(name, row) for row in parameters() for name in row.names(joints)]
    assert len(dict(rows)) == len(rows), "a parameter has two definitions"
    return Machine(dict(rows), given)


def flat(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Returns nested keys joined by dots."""
    found: dict[str, Any] = {}
    for key, value in tree.items():
        # YAML reads a bare y as a boolean.
        key = prefix + {True: "y"}.get(key, key) if not isinstance(key, str) else prefix + key
        found |= flat(value, key + ".") if isinstance(value, dict) else {key: value}
    return found


def kinds_of(joint: str, given: dict[str, Any]) -> set[str]:
    """Returns the possible contents of the column "for" of a joint."""
    axis = given[f"{joint}.type"]
    linear_motor = axis == "linear" and given.get(f"{joint}.transmission.direct") is True
    return {"axis", f"{axis} axis", "linear motor" if linear_motor else "rotary motor"}


def test_parameter_names(seen: tuple[Run, AxesClient], machine: Machine):
    """Documented parameters with a value are those that the node declares."""
    drive, names = seen[1], list(machine.rows)
    batches = [names[start : start + 100] for start in range(0, len(names), 100)]
    values = {name: value for batch in batches for name, value in drive.get_parameters(batch).items()}
    assert sorted(drive.list_parameters()) == sorted(name for name in names if values[name] is not None)


PARAMETER_TYPES = {
    "bool": ParameterType.PARAMETER_BOOL,
    "integer": ParameterType.PARAMETER_INTEGER,
    "double": ParameterType.PARAMETER_DOUBLE,
    "string": ParameterType.PARAMETER_STRING,
    "string_array": ParameterType.PARAMETER_STRING_ARRAY,
    "double_array": ParameterType.PARAMETER_DOUBLE_ARRAY,
}


def test_parameter_descriptions(seen: tuple[Run, AxesClient], machine: Machine):
    """Text, unit, type, range, choices, and whether the parameter is read-only."""
    names = list(machine.rows)
    batches = [names[start : start + 100] for start in range(0, len(names), 100)]
    for descriptor in (descriptor for batch in batches for descriptor in seen[1].describe(batch)):
        row = machine.rows[descriptor.name]
        assert descriptor.description == row.description + (f" Unit: {row.unit}." if row.unit else ""), descriptor.name
        assert descriptor.read_only != row.live, descriptor.name
        assert descriptor.additional_constraints == row.constraint, descriptor.name
        ranges = [(r.from_value, r.to_value) for r in (*descriptor.floating_point_range, *descriptor.integer_range)]
        assert ranges == ([row.bounds] if row.bounds else []), descriptor.name
        assert descriptor.type == PARAMETER_TYPES[row.type], descriptor.name


def test_all_parameters_are_described_at_once(seen: tuple[Run, AxesClient], machine: Machine):
    """In a response of limited length, with descriptions that can be shortened."""
    for descriptor in seen[1].describe(list(machine.rows)):
        row = machine.rows[descriptor.name]
        text = row.description + (f" Unit: {row.unit}." if row.unit else "")
        kept, shortened, _ = descriptor.description.partition("…")
        assert text.startswith(kept) if shortened else kept == text, descriptor.name
        assert descriptor.type == PARAMETER_TYPES[row.type], descriptor.name


def test_parameter_values(seen: tuple[Run, AxesClient], machine: Machine):
    """Values of the machine file, and documented defaults of all other parameters."""
    values = seen[1].get_parameters(list(machine.rows))
    for name, value in values.items():
        row = machine.rows[name]
        if name in machine.given:
            assert value == machine.given[name], name
        else:
            assert not row.required, name
            assert value == row.default, name


# ---------------------------------------------------------------------------- codes and the pages


def test_rejection_codes_are_the_constants_of_the_message():
    """Names and numbers of the described codes equal those of TrajectoryResult."""
    constants = {
        name: value for name, value in vars(type(TrajectoryResult)).items() if name.isupper() and name[0] != "_"
    }
    others = {"NONE", *(name for name in constants if name.startswith("SOURCE_")), *STATUSES}
    described = {row["name"]: row["code"] for row in printed("interface")["rejection_codes"]}
    found = {name: getattr(TrajectoryResult, name) for name in constants if name not in others}
    assert described == found


def test_error_codes_are_the_constants_of_the_action():
    """Names and numbers of the described codes equal those of the result of FollowJointTrajectory."""
    described = {row["name"]: row["code"] for row in printed("interface")["action_error_codes"]}
    names = [name for name in vars(type(FollowJointTrajectory.Result)) if name.isupper() and name[0] != "_"]
    assert described == {name: getattr(FollowJointTrajectory.Result, name) for name in names}


def test_the_page_of_the_environment_has_every_variable_and_no_other():
    """Names of variables in the sources of the node equal those of the page."""
    folders = (ROOT / "src", ROOT / "crates" / "dds" / "src")
    sources = "".join(path.read_text(encoding="utf-8") for folder in folders for path in folder.rglob("*.rs"))
    page = (ROOT / "docs" / "reference" / "environment.md").read_text(encoding="utf-8")
    variable = r"(?:ROS|RMW|RCUTILS|RUST)_[A-Z_]+"
    read = set(re.findall(rf'"({variable})"', sources))
    assert read == set(re.findall(rf"^\| `({variable})` \|", page, re.MULTILINE))


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Returns a copy of what tools/reference.py reads and writes."""
    for folder in ("docs/reference", "launch", "msg", "tools", "crates/py/python"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    return tmp_path


def generate(checkout: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Returns the finished tools/reference.py of a checkout, with the programs of this one."""
    environment = {**os.environ, "CARGO_TARGET_DIR": str(node_binary().parent.parent)}
    command = [sys.executable, checkout / "tools" / "reference.py", *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)


def test_the_stored_pages_are_the_generated_ones(checkout: Path):
    """The check succeeds, and writing changes nothing."""
    result = generate(checkout)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("page", ["topics.md", "parameters/qos.md", "command-line.md"])
def test_a_changed_missing_or_surplus_page_is_reported(checkout: Path, page: str):
    """Each fault has exit status 1 and names the page; writing repairs the first two."""
    path = checkout / "docs" / "reference" / page
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("reliab", "probab").replace("help", "hulp"), encoding="utf-8")
    result = generate(checkout)
    assert (result.returncode, page in result.stderr) == (1, True), result.stderr
    path.unlink()
    assert generate(checkout).returncode == 1
    assert generate(checkout, "--write").returncode == 0
    assert path.read_text(encoding="utf-8") == text
    (checkout / "docs" / "reference" / "old.md").write_text(text, encoding="utf-8")
    result = generate(checkout)
    assert (result.returncode, "old.md" in result.stderr) == (1, True), result.stderr
