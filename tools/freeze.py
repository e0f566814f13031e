#!/usr/bin/env python3
"""Records the behavior that a refactoring must not change, and compares two such recordings.

    cargo build --release && source .build/env.sh
    tools/freeze.py --bin target/release --out before.json --node
    tools/freeze.py --compare before.json after.json --renames renames.tsv

DIR of `--bin` holds the programs `virtual_axes`, `virtual_axes_node` and, where the build has it,
`virtual_axes_stress`; without the latter the subcommand `virtual_axes stress` takes its place, under the same keys of
the recording. Sections of a recording:

    stress      figures and digest of `stress --count N --json`
    runs        each scenario, controller and machine, and a PI controller as polynomials: exit status, errors, figures,
                columns, number of rows and SHA-256 of the rows of the trace (without its header, which is `columns`)
    json        figures of the other commands that have `--json`
    keys        key paths of each `--json` output with the kinds of their values
    help        `--help` of the programs and of all subcommands
    texts       `parameters`, `check`, `urdf`, and built-in files, without comments
    refusals    exit status and output of bad invocations
    node        with `--node`: topics, QoS, services, actions, message types and parameters of the node, as seen from
                rclpy, for several command lines; exit status and output of command lines that the node rejects

`--compare` prints each difference on one line; the exit status is 1 if there is any. Numbers are compared exactly.
Texts are compared line by line, with runs of spaces and dashes shortened, since they align tables. Each line
OLD<TAB>NEW of `--renames` replaces OLD by NEW in the texts and keys of the first recording, where OLD stands as a whole
word.

Not recorded, since it differs from run to run: durations, time stamps and process ids of the node's log, names of
folders, gids, and the history depth of endpoints, which discovery does not transport.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import difflib
import hashlib
import importlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PROGRAM, STRESS, NODE = "virtual_axes", "virtual_axes_stress", "virtual_axes_node"
CONTROLLERS = ["cascade", "cascade-noff", "gpc", "rst"]
STRESS_COUNT = 200_000
WORKERS = 2
TIMEOUT_S = 600.0
"""Limit of one command's duration."""
STRESS_TIMEOUT_S = 3600.0
NODE_TIMEOUT_S = 30.0
"""Limit of each wait for the node."""
STABLE_S = 3.0
"""Duration without change after which discovery is taken to be complete."""
LONGEST = 160
"""Characters of a value in a line of `--compare`."""

FINE = ("five-axis", "125us")
"""Scenario that is traced more densely, too, and the trace period."""
POLYNOMIALS = "design pi --gain 0.5 --integral-time-ms 400"
"""Controllers for `rst`, whose polynomials the built-in machines do not have."""

FILES = {
    "nan.csv": "time,x\n0,0\n0.006,NaN\n",
    "far.csv": "time,x\n0,0\n10,2.5\n",
    "fast.csv": "time,x\n0,0\n0.1,0.3\n",
    "endless.csv": "time,x\n0,0\n1e300,0\n",
    "joint.csv": "time,q\n0,0\n",
    "columns.csv": "time,x,y\n0,0,0\n0.006,0\n",
    "no_time.csv": "x,y\n0,0\n",
    "back.csv": "time,x\n0,0\n0.1,0\n0.05,0\n",
    "empty.csv": "",
    "good.csv": "time,x,y\n0,0,0\n1,0.05,0.02\n2,0.05,0.02\n",
    "no_points.yaml": "joint_names: [x]\npoints: []\n",
    "typo.yaml": "description: d\nfed_m_min: 10\nmoves:\n  - line: {x_mm: 10}\n",
    "no_moves.yaml": "description: d\nmoves: []\n",
    "machine.yaml": "/**:\n  ros__parameters:\n    machine: Incomplete\n    joints: [x]\n",
    "broken.yaml": "/**:\n  ros__parameters: [\n",
}
"""Inputs of the commands below, by name."""

JSON_COMMANDS = [
    "machines --json",
    "scenarios --json",
    "run x-constant --controller cascade,cascade-noff,gpc --json",
    "run ballbar-both --compare x.position_loop.gain=3,x.feedforward.velocity=0 --feed 10 --json",
    "run corner-90 --set x.deviation.inertia=1.2 --json",
    "run good.csv --json",
    "design gpc --json",
    "design gpc --axis x --n1 1 --n2 8 --nu 6 --lambda-rel 1e-3 --machine linear_motor_center --json",
    "design p --gain 1.5 --json",
    "design pi --gain 1.5 --integral-time-ms 400 --json",
    "design pid --gain 1 --integral-time-ms 400 --derivative-time-ms 5 --json",
    "design poles --bandwidth 40 --integrator --json",
    "design p --gain 100 --axis x --force --json",
    "tune x-constant --controller gpc --designs 100 --json",
    "tune corner-90 --controller cascade --json",
    "tune x-constant --controller gpc --contrast --also corner-90 --json",
    "robustness corner-90 --json",
    "robustness bspline-5x --controller gpc --by 0.2 --machine linear_motor_center --json",
    "pose --joints x=0.1,a=0.5 --json",
    "pose --joints x=5,y=0.1,z=9 --set kinematics.tool_length_mm=150 --json",
    "psec campaign --axis x --out whole.csv --json",
    "psec campaign --axis c --part off --range=-100,100 --max-feed 10 --out part.csv --json",
]
"""Commands that need no preparation; their figures and key paths are recorded."""

OFF = "--set x.feedforward.velocity=0 --set x.feedforward.torque_kg_m2=0"
IDENTIFY = "identify off.csv velocity.csv both.csv --axis x --feedforward off,velocity,both"
WRONG = "--set x.motor.inertia_kg_m2=0.02 --set x.delays.alpha_ms=20"
PREPARATION = [
    *(f"psec campaign --axis x --part {part} --out psec-{part}.csv" for part in ("off", "velocity", "both")),
    f"run psec-off.csv {OFF} --trace off.csv",
    "run psec-velocity.csv --set x.feedforward.torque_kg_m2=0 --trace velocity.csv",
    "run psec-both.csv --trace both.csv",
    "psec corner-90 --out corner.csv",
    "psec corner-90 --out corner.mcap",
    "psec x-constant --out constant.yaml",
    "psec bspline-5x --out spline.csv",
]
"""Commands that make recordings of a campaign and setpoints."""
PREPARED_COMMANDS = [
    "run corner.csv --json",
    "run corner.mcap --json",
    "run constant.yaml --json",
    f"{IDENTIFY} {WRONG} --json",
    f"{IDENTIFY} {WRONG} --free-i0 --refine inertia,friction --validate velocity.csv "
    "--validate-feedforward velocity --json",
    f"{IDENTIFY} --no-refine --json",
    "identify both.csv --axis x --feedforward both --column current=#5[A] --json",
]

REFUSALS = [
    "",
    "frobnicate",
    "run",
    "run balbar",
    "run missing.csv",
    *(f"run {name}" for name in FILES if name not in ("good.csv", "machine.yaml", "broken.yaml")),
    "run corner-90 --frobnicate",
    "run corner-90 --set x.velocity_loop.gain=high",
    "run corner-90 --set x.velocity_loop.gain=nan",
    "run corner-90 --set x.velocity_loop.gian=4",
    "run corner-90 --set x.motor.inertia_kg_m2=-1",
    "run corner-90 --set x.velocity_loop.gain",
    "run corner-90 --feed nan",
    "run corner-90 --feed=-5",
    "run c-two-speeds --feed 5",
    "run corner-90 --controller pid",
    "run corner-90 --machine mikron",
    "run corner-90 --machine machine.yaml",
    "run corner-90 --machine broken.yaml",
    "run corner-90 --trace trace.txt",
    "run corner-90 --trace no/such/folder/trace.csv",
    "run corner-90 --trace trace.csv --trace-period 130us",
    "run corner-90 --trace trace.csv --trace-period 130",
    "run corner-90 --trace trace.csv --controller cascade,gpc",
    "run corner-90 --trace same.csv --report same.csv",
    "run good.csv --trace good.csv",
    "run good.csv --topic /psec",
    "psec corner-90 --out setpoints.txt",
    "psec campaign --axis q --out campaign.csv",
    "psec campaign --axis x --range=100,-100 --out campaign.csv",
    "design gpc --n1 5 --n2 2",
    "design pi --gain 1",
    "design p --gain 100 --axis x",
    "design p --gain nan",
    "design poles --pole 1.5",
    "design gpc --axis q",
    "tune corner-90 --cost contur",
    "tune corner-90 --modulus-margin 2",
    "tune corner-90 --contrast",
    "robustness corner-90 --by 2",
    "identify missing.csv --axis x",
    "identify good.csv --axis q",
    "identify good.csv --axis x",
    "identify good.csv --axis x --column speed=#1",
    "identify nan.csv --axis x --feedforward off",
    "check corner-91",
    "check machine.yaml",
    "check broken.yaml",
    "check typo.yaml",
    "check fast.csv --machine linear_motor_center",
    "machines --show mikron",
    "scenarios --show balbar",
    "pose",
    "pose --joints x=1e300",
    "pose --joints q=1",
    "urdf --machine mikron",
    "completions tcsh",
    "stress --count 0",
    "stress --threads 0",
    "stress --seed=-1",
    "stress --first 18446744073709551615",
    "stress --machine mikron",
]

NODE_STARTS = {
    "default": "",
    "fast": "-p time:=fast -p publish_rate:=50.0",
    "named": "-r __ns:=/cell -r __node:=mill -r joint_states:=/axes -p joint_prefix:=mill_",
}
"""Command lines of the node behind `--ros-args`."""
NODE_REFUSALS = [
    "--frobnicate",
    "--ros-args --frobnicate",
    "--ros-args -p x.motor.inertia_kg_m2:=-0.028",
    "--ros-args -p x.motor.inertia_kgm2:=0.028",
    "--ros-args -p x.velocity_loop.gain:=high",
    "--ros-args -p x.velocity_loop.gain:=.nan",
    "--ros-args -p time:=slow",
    "--ros-args --params-file missing.yaml",
    "--ros-args --params-file machine.yaml",
    "--ros-args --params-file broken.yaml",
    "--ros-args -r psec",
    "--ros-args -r psec:=/joint_states",
    "--ros-args -r ~/reset:=~/stop",
    "--ros-args --log-level loud",
    "--ros-args -p record:=no/such/folder/run.mcap",
]


# ---- programs


@dataclass(frozen=True)
class Outcome:
    """Exit status and output of one command."""

    status: int
    stdout: str
    stderr: str

    def record(self) -> dict[str, Any]:
        """Returns status and lines of output, without what is empty."""
        lines = {"stdout": self.stdout.splitlines(), "stderr": self.stderr.splitlines()}
        return {"status": self.status} | {name: text for name, text in lines.items() if text}


@dataclass(frozen=True)
class Programs:
    """The programs of one build, and the folder that they work in."""

    bin: Path
    folder: Path

    def command(self, words: Sequence[str]) -> list[str]:
        """Returns program and arguments of a command such as `stress --json`."""
        if words and words[0] == "stress" and (self.bin / STRESS).is_file():
            return [str(self.bin / STRESS), *words[1:]]
        return [str(self.bin / PROGRAM), *words]

    def run(self, command: str | Sequence[str], timeout: float = TIMEOUT_S) -> Outcome:
        """Runs a command to its end."""
        return self.execute(self.command(command.split() if isinstance(command, str) else command), timeout)

    def execute(self, command: Sequence[str], timeout: float, env: dict[str, str] | None = None) -> Outcome:
        """Runs a program to its end; names of folders are taken out of its output."""
        try:
            ended = subprocess.run(
                command,
                cwd=self.folder,
                env={**clean_environment(), **(env or {})},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=timeout,
            )
        except subprocess.TimeoutExpired:
            raise Failure(f"{' '.join(command)}: no end after {timeout:g} s") from None
        return Outcome(ended.returncode, self.masked(ended.stdout), self.masked(ended.stderr))

    def masked(self, output: bytes) -> str:
        """Returns text without names of folders and without the log's time stamps and process ids."""
        text = output.decode(errors="replace")
        for path, name in ((self.folder, "FOLDER"), (self.bin, "BIN")):
            text = text.replace(str(path), name)
        text = re.sub(r"\[\d+\.\d+\]", "[TIME]", text)
        return re.sub(r"\b(pid|process) \d+", r"\1 PID", text)

    def json(self, command: str, timeout: float = TIMEOUT_S) -> Any:
        """Runs a command that must succeed and returns the JSON that it prints."""
        outcome = self.run(command, timeout)
        if outcome.status != 0:
            raise Failure(f"{command}: exit status {outcome.status}: {outcome.stderr.strip()}")
        try:
            return json.loads(outcome.stdout)
        except ValueError as error:
            raise Failure(f"{command}: {error}") from None


class Failure(Exception):
    """Why nothing can be recorded."""


def clean_environment() -> dict[str, str]:
    """Returns the environment without what changes the layout or the language of the output."""
    dropped = ("COLUMNS", "LINES", "LANG", "CLICOLOR", "NO_COLOR", "RUST_", "LC_", "ROS_")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(dropped)}
    return {**kept, "LC_ALL": "C.UTF-8"}


def in_parallel(work: Callable[[str], Any], items: Iterable[str]) -> dict[str, Any]:
    """Returns the results by item, computed by a few workers."""
    listed = list(items)
    with concurrent.futures.ThreadPoolExecutor(WORKERS) as pool:
        futures = [pool.submit(work, item) for item in listed]
        try:
            return dict(zip(listed, [future.result() for future in futures]))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


# ---- recording


def key_paths(value: Any, at: str = "") -> Iterator[tuple[str, str]]:
    """Yields path and kind of each leaf of a JSON value; elements of lists share the path `…[]`."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from key_paths(inner, f"{at}.{key}" if at else key)
    elif isinstance(value, list) and value:
        for inner in value:
            yield from key_paths(inner, f"{at}[]")
    else:
        kinds = {bool: "boolean", int: "number", float: "number", str: "text", dict: "object", list: "list"}
        yield at, kinds.get(type(value), "null")


def merged_keys(values: Iterable[Any]) -> dict[str, str]:
    """Returns each key path of several values with all kinds that it has."""
    kinds: dict[str, set[str]] = {}
    for value in values:
        for path, kind in key_paths(value):
            kinds.setdefault(path, set()).add(kind)
    return {path: "|".join(sorted(found)) for path, found in sorted(kinds.items())}


def command_name(command: str) -> str:
    """Returns the subcommands that a command begins with, as `design gpc`."""
    words = command.split()
    nested = words[0] == "design" or words[:2] == ["psec", "campaign"]
    return " ".join(words[: 2 if nested else 1])


def settings(yaml: list[str]) -> list[str]:
    """Returns KEY=VALUE of each value in the lines of a parameter file with nested keys."""
    path: list[tuple[int, str]] = []
    found = []
    for line in yaml:
        key, _, value = line.strip().partition(":")
        indent = len(line) - len(line.lstrip())
        path = [(depth, name) for depth, name in path if depth < indent] + [(indent, key)]
        if value:
            found.append(".".join(name for _, name in path[2:]) + "=" + value.replace(" ", ""))
    return found


def run_commands(programs: Programs, machines: list[str], scenarios: list[str]) -> dict[str, list[str]]:
    """Returns the arguments of each run by its name in the recording."""
    commands: dict[str, list[str]] = {}
    for machine in machines:
        controllers = {controller: ["--controller", controller] for controller in CONTROLLERS}
        lines = programs.run(f"{POLYNOMIALS} --machine {machine} --yaml").stdout.splitlines()
        controllers["polynomials"] = [word for setting in settings(lines) for word in ("--set", setting)]
        for name, words in controllers.items():
            for scenario in scenarios:
                arguments = ["run", scenario, "--machine", machine, *words]
                commands[f"{scenario}, {name}, {machine}"] = arguments
                if scenario == FINE[0]:
                    commands[f"{scenario}, {name}, {machine}, {FINE[1]}"] = [*arguments, "--trace-period", FINE[1]]
    return commands


def record_run(programs: Programs, arguments: list[str]) -> dict[str, Any]:
    """Records exit status, errors, figures and trace of one run."""
    # Several runs at a time: each has a trace of its own.
    with tempfile.TemporaryDirectory(dir=programs.folder) as folder:
        trace = Path(folder) / "trace.csv"
        outcome = programs.run([*arguments, "--trace", str(trace), "--json"])
        record: dict[str, Any] = {"status": outcome.status}
        if outcome.stderr:
            record["stderr"] = outcome.stderr.replace(Path(folder).name, "TRACE").splitlines()
        if outcome.status == 0:
            record["figures"] = json.loads(outcome.stdout)
            record["trace"] = trace_digest(trace)
        return record


def trace_digest(trace: Path) -> dict[str, Any]:
    """Returns the columns of a trace, the number of its rows and their digest."""
    digest, rows = hashlib.sha256(), 0
    with trace.open("rb") as file:
        columns = file.readline().decode().strip().split(",")
        while block := file.read(1 << 20):
            digest.update(block)
            rows += block.count(b"\n")
    return {"columns": columns, "rows": rows, "sha256": digest.hexdigest()}


def record_help(programs: Programs) -> dict[str, list[str]]:
    """Records the help of all programs and subcommands."""
    texts: dict[str, list[str]] = {}
    pending: list[tuple[str, ...]] = [(), ("stress",)]
    while pending:
        words = pending.pop()
        name = " ".join((PROGRAM, *words))
        if name in texts:
            continue
        outcome = programs.run([*words, "--help"])
        if outcome.status != 0:
            raise Failure(f"{name} --help: exit status {outcome.status}")
        texts[name] = outcome.stdout.splitlines()
        pending += [(*words, found) for found in subcommands(texts[name]) if found != "help"]
    if (programs.bin / NODE).is_file():
        texts[NODE] = programs.execute([str(programs.bin / NODE), "--help"], TIMEOUT_S).stdout.splitlines()
    return texts


def subcommands(text: list[str]) -> list[str]:
    """Returns the commands that a help text lists."""
    if "Commands:" not in text:
        return []
    names = []
    for line in text[text.index("Commands:") + 1 :]:
        if not (match := re.match(r"  (\S+)", line)):
            break
        names.append(match[1])
    return names


def record_texts(programs: Programs, machines: list[str], scenarios: list[str]) -> dict[str, Any]:
    """Records the output of commands that print text, and the built-in files without comments."""
    commands = ["parameters", "parameters --markdown"]
    commands += [f"urdf --machine {machine}" for machine in machines]
    commands += [f"check {name}" for name in machines + scenarios]
    texts = {command: programs.run(command).record() for command in commands}
    for kind, names in (("machines", machines), ("scenarios", scenarios)):
        for name in names:
            lines = programs.run([kind, "--show", name]).stdout.splitlines()
            bare = [re.sub(r"(^|\s)#.*", "", line).rstrip() for line in lines]
            texts[f"{kind} --show {name}"] = [line for line in bare if line]
    return texts


def record_refusals(programs: Programs) -> dict[str, Any]:
    """Records exit status and output of bad invocations."""
    return {command: programs.run(command).record() for command in REFUSALS}


def record_commands(programs: Programs, say: Callable[[str], None]) -> dict[str, Any]:
    """Records all that needs no ROS."""
    for name, text in FILES.items():
        (programs.folder / name).write_text(text)
    machines = [entry["name"] for entry in programs.json("machines --json")]
    scenarios = [entry["name"] for entry in programs.json("scenarios --json")]
    recording: dict[str, Any] = {}
    say("help, texts and refusals")
    recording["help"] = record_help(programs)
    recording["texts"] = record_texts(programs, machines, scenarios)
    recording["refusals"] = record_refusals(programs)
    say("other commands")
    for command in PREPARATION:
        if (outcome := programs.run(command)).status != 0:
            raise Failure(f"{command}: exit status {outcome.status}: {outcome.stderr.strip()}")
    values = in_parallel(programs.json, JSON_COMMANDS + PREPARED_COMMANDS)
    recording["json"] = values
    say("runs")
    commands = run_commands(programs, machines, scenarios)
    runs = recording["runs"] = in_parallel(lambda name: record_run(programs, commands[name]), commands)
    say("stress")
    stress = f"stress --count {STRESS_COUNT} --json"
    recording["stress"] = {stress: programs.json(stress, STRESS_TIMEOUT_S)}
    outputs: dict[str, list[Any]] = {}
    for command, value in [*values.items(), *recording["stress"].items()]:
        outputs.setdefault(command_name(command), []).append(value)
    outputs["run"] += [run["figures"] for run in runs.values() if "figures" in run]
    recording["keys"] = {command: merged_keys(found) for command, found in sorted(outputs.items())}
    return recording


# ---- the node


def process_module() -> ModuleType:
    """Loads test_py/node_process.py of this tree, whatever the path of modules is."""
    spec = importlib.util.spec_from_file_location("node_process", ROOT / "test_py" / "node_process.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def record_node(programs: Programs) -> dict[str, Any]:
    """Records the node as seen from rclpy, and the command lines that it rejects."""
    for variable in ("ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "ROS_DOMAIN_ID"):
        os.environ.pop(variable, None)
    # Before rclpy makes its first context: nothing leaves this machine.
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    process = process_module()
    recording: dict[str, Any] = {"starts": {}, "refusals": {}}
    for name, arguments in NODE_STARTS.items():
        recording["starts"][name] = record_start(process, programs.bin / NODE, arguments.split())
    domain = process.DomainId()
    env = {"ROS_DOMAIN_ID": str(domain.value), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    try:
        for arguments in NODE_REFUSALS:
            command = [str(programs.bin / NODE), *arguments.split()]
            recording["refusals"][arguments] = programs.execute(command, NODE_TIMEOUT_S, env).record()
    finally:
        domain.release()
    recording["types"] = record_types(recording["starts"].values())
    return recording


def record_start(process: ModuleType, binary: Path, arguments: list[str]) -> dict[str, Any]:
    """Starts the node, records what rclpy sees of it, and ends it."""
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor

    with process.Node(arguments, binary=binary) as running:
        context = Context()
        rclpy.init(context=context, domain_id=running.domain_id)
        own = rclpy.create_node(f"freeze_{os.getpid()}", context=context, start_parameter_services=False)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(own)
        try:
            record = settled_graph(own, running)
            record["parameters"] = record_parameters(own, executor, record["name"])
        finally:
            executor.shutdown(timeout_sec=2.0)
            own.destroy_node()
            rclpy.shutdown(context=context)
        record["exit status"] = running.stop()
        return record


def settled_graph(own: Any, running: Any) -> dict[str, Any]:
    """Waits until nothing has changed in the graph for a while, and returns what the node has in it."""
    deadline = time.monotonic() + NODE_TIMEOUT_S
    last, since = None, time.monotonic()
    while True:
        if (status := running.poll()) is not None:
            raise Failure(f"the node ended with {status}: {running.output()}")
        found = graph(own)
        if found != last:
            last, since = found, time.monotonic()
        elif found and time.monotonic() - since > STABLE_S:
            return found
        if time.monotonic() > deadline:
            raise Failure(f"the node's topics and services are not complete after {NODE_TIMEOUT_S:g} s: {found}")
        time.sleep(0.1)


def graph(own: Any) -> dict[str, Any]:
    """Returns name, topics, services and actions of the only other node in the domain; nothing while it is absent."""
    from rclpy.action import graph as actions

    others = [(name, space) for name, space in own.get_node_names_and_namespaces() if name != own.get_name()]
    if not others:
        return {}
    if len(others) > 1:
        raise Failure(f"more than one node in the domain: {others}")
    [(name, space)] = others
    topics: dict[str, Any] = {}
    for topic, types in own.get_topic_names_and_types():
        found = {
            "publishers": own.get_publishers_info_by_topic(topic),
            "subscriptions": own.get_subscriptions_info_by_topic(topic),
        }
        ends = {
            kind: [endpoint(info) for info in infos if info.node_name == name and info.node_namespace == space]
            for kind, infos in found.items()
        }
        if any(ends.values()):
            topics[topic] = {"types": types} | {kind: infos for kind, infos in ends.items() if infos}
    return {
        "name": f"{space.rstrip('/')}/{name}",
        "topics": topics,
        "services": dict(own.get_service_names_and_types_by_node(name, space)),
        "clients": dict(own.get_client_names_and_types_by_node(name, space)),
        "actions": dict(actions.get_action_server_names_and_types_by_node(own, name, space)),
    }


def endpoint(info: Any) -> dict[str, Any]:
    """Returns type and quality of service of a publisher or a subscription."""
    qos = info.qos_profile
    return {
        "type": info.topic_type,
        "reliability": qos.reliability.name,
        "durability": qos.durability.name,
        "liveliness": qos.liveliness.name,
        "deadline_ns": qos.deadline.nanoseconds,
        "lifespan_ns": qos.lifespan.nanoseconds,
        "lease_ns": qos.liveliness_lease_duration.nanoseconds,
    }


def record_parameters(own: Any, executor: Any, target: str) -> dict[str, Any]:
    """Records the node's parameters with their values and descriptors, through its own services."""
    from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
    from rclpy.parameter import parameter_value_to_python

    def call(kind: Any, service: str, request: Any) -> Any:
        client = own.create_client(kind, f"{target}/{service}")
        try:
            if not client.wait_for_service(timeout_sec=NODE_TIMEOUT_S):
                raise Failure(f"{target}/{service}: no server after {NODE_TIMEOUT_S:g} s")
            future = client.call_async(request)
            executor.spin_until_future_complete(future, timeout_sec=NODE_TIMEOUT_S)
            if not future.done():
                raise Failure(f"{target}/{service}: no response after {NODE_TIMEOUT_S:g} s")
            return future.result()
        finally:
            own.destroy_client(client)

    listed = call(ListParameters, "list_parameters", ListParameters.Request())
    names = sorted(listed.result.names)
    values = call(GetParameters, "get_parameters", GetParameters.Request(names=names)).values
    descriptors = call(DescribeParameters, "describe_parameters", DescribeParameters.Request(names=names)).descriptors
    if not len(names) == len(values) == len(descriptors):
        raise Failure(f"{len(names)} parameters, {len(values)} values, {len(descriptors)} descriptors")
    return {
        name: {"value": plain(parameter_value_to_python(value)), "descriptor": plain(descriptor)}
        for name, value, descriptor in zip(names, values, descriptors)
    }


def plain(value: Any) -> Any:
    """Returns a value of rclpy as JSON can hold it: messages as objects, arrays as lists."""
    if hasattr(value, "get_fields_and_field_types"):
        return {field: plain(getattr(value, field)) for field in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return list(value)
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return [plain(inner) for inner in value]


def record_types(starts: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Records fields and constants of the types that the node uses; none of a type that is not installed."""
    names: set[str] = set()
    for start in starts:
        for found in (start["topics"].values(), start["services"].values(), start["actions"].values()):
            names.update(name for types in found for name in (types["types"] if isinstance(types, dict) else types))
    # An action's topics and services have types of their own, made from the action's: Name_FeedbackMessage and so on.
    return {name: fields_of(name) for name in sorted(names) if not re.search(r"/action/\w+_", name)}


def fields_of(name: str) -> dict[str, Any] | None:
    """Returns fields and constants of a message, or of the parts of a service or an action."""
    package, kind, bare = name.split("/")
    try:
        found = getattr(importlib.import_module(f"{package}.{kind}"), bare)
    except (ImportError, AttributeError):
        return None
    parts = {"srv": ["Request", "Response"], "action": ["Goal", "Result", "Feedback"]}.get(kind)
    return {part: message_fields(getattr(found, part)) for part in parts} if parts else message_fields(found)


def message_fields(kind: Any) -> dict[str, Any]:
    """Returns the fields of a message class with their types, and its constants."""
    names = [name for name in dir(type(kind)) if re.fullmatch(r"[A-Z][A-Z0-9_]*", name)]
    constants = {name: plain(getattr(kind, name)) for name in names}
    return {"fields": kind.get_fields_and_field_types()} | ({"constants": constants} if constants else {})


# ---- comparison


def read_renames(text: str) -> dict[str, str]:
    """Returns new words by old ones; raises ValueError for a line that is not OLD<TAB>NEW."""
    renames = {}
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            old, tab, new = line.partition("\t")
            if not tab or not old:
                raise ValueError(f"line {number} is not OLD<TAB>NEW: {line!r}")
            renames[old] = new
    return renames


def renamed(value: Any, renames: dict[str, str]) -> Any:
    """Returns a JSON value with whole words replaced in all keys and texts, all at once."""
    if not renames:
        return value
    words = "|".join(re.escape(old) for old in sorted(renames, key=len, reverse=True))
    pattern = re.compile(rf"(?<!\w)(?:{words})(?!\w)")

    def replaced(inner: Any) -> Any:
        if isinstance(inner, str):
            return pattern.sub(lambda match: renames[match[0]], inner)
        if isinstance(inner, dict):
            return {replaced(key): replaced(held) for key, held in inner.items()}
        return [replaced(held) for held in inner] if isinstance(inner, list) else inner

    return replaced(value)


def differences(a: Any, b: Any, at: str = "") -> Iterator[str]:
    """Yields a line for each difference of two JSON values."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in sorted(a.keys() | b.keys()):
            path = f"{at} › {key}" if at else key
            if key not in b:
                yield f"{path}: only in A: {shown(a[key])}"
            elif key not in a:
                yield f"{path}: only in B: {shown(b[key])}"
            else:
                yield from differences(a[key], b[key], path)
    elif isinstance(a, list) and isinstance(b, list):
        if all(isinstance(inner, str) for inner in a + b):
            yield from line_differences(a, b, at)
        else:
            for number, (left, right) in enumerate(zip(a, b)):
                yield from differences(left, right, f"{at}[{number}]")
            if len(a) != len(b):
                yield f"{at}: {len(a)} → {len(b)} elements"
    # Not by value alone: 0.0 is neither 0 nor -0.0, and NaN is itself.
    elif type(a) is not type(b) or repr(a) != repr(b):
        yield f"{at}: {shown(a)} → {shown(b)}"


def line_differences(a: list[str], b: list[str], at: str) -> Iterator[str]:
    """Yields a line for each line of text that was changed, taken away or added."""
    left, right = ([aligned(line) for line in lines] for lines in (a, b))
    for kind, a_from, a_to, b_from, b_to in difflib.SequenceMatcher(None, left, right, False).get_opcodes():
        if kind == "equal":
            continue
        common = min(a_to - a_from, b_to - b_from)
        for k in range(common):
            yield f"{at}: {shown(left[a_from + k])} → {shown(right[b_from + k])}"
        for line in left[a_from + common : a_to]:
            yield f"{at}: only in A: {shown(line)}"
        for line in right[b_from + common : b_to]:
            yield f"{at}: only in B: {shown(line)}"


def aligned(line: str) -> str:
    """Returns a line without what aligns columns of a table."""
    return re.sub(r"-{3,}", "---", re.sub(r"(?<=\S) {2,}", "  ", line)).rstrip()


def shown(value: Any) -> str:
    """Returns a value as a short text on one line."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}… ({len(text)} characters)"


def compare(a: Path, b: Path, renames: Path | None) -> int:
    """Prints the differences of two recordings and returns the exit status."""
    words = read_renames(renames.read_text(encoding="utf-8")) if renames else {}
    before, after = (json.loads(path.read_text(encoding="utf-8")) for path in (a, b))
    count = 0
    for line in differences(renamed(before, words), after):
        print(line)
        count += 1
    print(f"freeze: {count or 'no'} difference{'' if count == 1 else 's'}", file=sys.stderr)
    return int(count > 0)


# ---- command line


def record(bin: Path, out: Path, node: bool) -> None:
    """Records a build and writes the recording."""
    for program in [PROGRAM, *([NODE] if node else [])]:
        if not (bin / program).is_file():
            raise Failure(f"there is no {bin / program}: cargo build --release")
    began = time.monotonic()

    def say(what: str) -> None:
        print(f"freeze: {time.monotonic() - began:.0f} s: {what}", file=sys.stderr)

    with tempfile.TemporaryDirectory() as folder:
        programs = Programs(bin.resolve(), Path(folder).resolve())
        recording = record_commands(programs, say)
        if node:
            say("node")
            recording["node"] = record_node(programs)
    out.write_text(json.dumps(recording, indent=1, sort_keys=True, ensure_ascii=False) + "\n", encoding="utf-8")
    say(f"written to {out}")


def main() -> int:
    """Records or compares, as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=Path, metavar="DIR", help="folder of the programs to record")
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="file to write the recording to")
    parser.add_argument("--node", action="store_true", help="record the node, too; needs rclpy")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("A.json", "B.json"), help="recordings to compare")
    parser.add_argument("--renames", type=Path, metavar="FILE", help="lines OLD<TAB>NEW of words renamed after A")
    arguments = parser.parse_args()
    if bool(arguments.compare) == bool(arguments.bin):
        parser.error("either --bin and --out, or --compare")
    if arguments.compare and (arguments.out or arguments.node):
        parser.error("--out and --node go with --bin")
    if arguments.bin and (not arguments.out or arguments.renames):
        parser.error("--bin needs --out; --renames goes with --compare")
    try:
        if arguments.compare:
            return compare(*arguments.compare, arguments.renames)
        record(arguments.bin, arguments.out, arguments.node)
    except (Failure, OSError, ValueError) as error:
        print(f"freeze: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
