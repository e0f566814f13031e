"""Stand-in for the part of ROS 2's `launch` and `launch_ros` that the launch files here use; they are not on PyPI.

Same names, signatures and rules: arguments have defaults and choices, configurations are texts, an included file sees
and changes the configurations of the one that includes it unless a group keeps them apart. Nothing is started: `run`
returns the actions that would be executed. The import of this module provides the names of the real packages.
"""

from __future__ import annotations

import os
import runpy
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import yaml

PROGRAMS: dict[tuple[str, str], str] = {}
"""Replacement of the package index: path by package and executable."""


class LaunchContext:
    """State of the execution of a description."""

    def __init__(self) -> None:
        """Creates a context without configurations."""
        self.launch_configurations: dict[str, str] = {}


class Action:
    """Element of a description."""

    def execute(self, context: LaunchContext) -> Iterable[object] | None:
        """Returns the actions that follow from this one."""
        return None


class LaunchDescription(Action):
    """List of actions."""

    def __init__(self, initial_entities: Iterable[Action]) -> None:
        """Keeps the actions."""
        self.entities = list(initial_entities)

    def execute(self, context: LaunchContext) -> list[Action]:
        """Returns the actions."""
        return self.entities


def text(value: object) -> str:
    """Returns a text; raises `TypeError` for other values, which launch does not accept."""
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is not a text")
    return value


def visit(context: LaunchContext, entities: Iterable[Action]) -> Iterator[Action]:
    """Executes actions in order, and yields each of them."""
    for entity in entities:
        yield entity
        yield from visit(context, entity.execute(context) or [])


def run(description: LaunchDescription, arguments: Mapping[str, str]) -> list[Action]:
    """Executes a description as `ros2 launch` does with `name:=value` arguments."""
    context = LaunchContext()
    context.launch_configurations.update({name: text(value) for name, value in arguments.items()})
    return list(visit(context, [description]))


class DeclareLaunchArgument(Action):
    """Argument of the file."""

    def __init__(
        self, name: str, *, default_value: str, description: str | None = None, choices: Sequence[str] | None = None
    ) -> None:
        """Keeps the arguments."""
        self.name, self.default_value, self.description, self.choices = name, default_value, description, choices

    def execute(self, context: LaunchContext) -> None:
        """Sets the default where no value is given; rejects values that are not among the choices."""
        value = context.launch_configurations.setdefault(self.name, text(self.default_value))
        if self.choices is not None and value not in self.choices:
            raise RuntimeError(f"argument '{self.name}' is '{value}', valid are {list(self.choices)}")


class OpaqueFunction(Action):
    """Function that returns actions."""

    def __init__(self, *, function: Callable[[LaunchContext], list[Action]]) -> None:
        """Keeps the function."""
        self.execute = function


class LogInfo(Action):
    """Log message."""

    def __init__(self, *, msg: str) -> None:
        """Keeps the message."""
        self.msg = msg


class Shutdown(Action):
    """End of the launch."""

    def __init__(self, *, reason: str) -> None:
        """Keeps the reason."""
        self.reason = reason


class ProcessExited(NamedTuple):
    """Event of the end of a process."""

    process_name: str
    returncode: int


class PythonLaunchDescriptionSource:
    """Launch file in Python."""

    def __init__(self, launch_file_path: str) -> None:
        """Keeps the path."""
        self.path = text(launch_file_path)


class IncludeLaunchDescription(Action):
    """Another launch file, with arguments."""

    def __init__(
        self, source: PythonLaunchDescriptionSource, *, launch_arguments: Iterable[tuple[str, str]] = ()
    ) -> None:
        """Keeps source and arguments."""
        self.source, self.launch_arguments = source, dict(launch_arguments)

    def execute(self, context: LaunchContext) -> list[Action]:
        """Sets the arguments, which stay set, and continues with the file's actions."""
        description = runpy.run_path(self.source.path)["generate_launch_description"]()
        declared = {entity.name for entity in description.entities if isinstance(entity, DeclareLaunchArgument)}
        if unknown := self.launch_arguments.keys() - declared:
            raise RuntimeError(f"the included file has no arguments {unknown}")
        context.launch_configurations.update(self.launch_arguments)
        return [description]


class GroupAction(Action):
    """Actions with scoped configurations."""

    def __init__(self, actions: Iterable[Action]) -> None:
        """Keeps the actions."""
        self.actions = list(actions)

    def execute(self, context: LaunchContext) -> Iterator[Action]:
        """Yields the actions, and restores the configurations after them."""
        before = dict(context.launch_configurations)
        yield from self.actions
        context.launch_configurations = before


class LaunchConfiguration:
    """Value of a configuration."""

    def __init__(self, variable_name: str) -> None:
        """Keeps the name."""
        self.name = variable_name

    def perform(self, context: LaunchContext) -> str:
        """Returns the value."""
        return context.launch_configurations[self.name]


class ExecutableInPackage:
    """Path of a package's program."""

    def __init__(self, executable: str, package: str) -> None:
        """Keeps executable and package."""
        self.key = package, executable

    def perform(self, _context: LaunchContext) -> str:
        """Returns the path."""
        path = PROGRAMS.get(self.key)
        if path is None or not os.access(path, os.X_OK):
            package, executable = self.key
            raise LookupError(f"executable '{executable}' not found on the libexec directory of '{package}'")
        return path


class ParameterValue:
    """Value with an explicit type instead of a type guessed from its text."""

    def __init__(self, value: object, *, value_type: type) -> None:
        """Keeps the value converted to the type."""
        self.value = text(value) if value_type is str else value_type(value)


class Node(Action):
    """Program with ROS arguments; its execution creates the command line."""

    def __init__(
        self,
        *,
        executable: str,
        package: str,
        name: str | None = None,
        namespace: str = "",
        parameters: Sequence[object] = (),
        remappings: Sequence[tuple[str, str]] = (),
        arguments: Sequence[str] = (),
        ros_arguments: Sequence[str] = (),
        output: str = "log",
        respawn: bool = False,
        respawn_delay: float | None = None,
        on_exit: Callable[[ProcessExited, LaunchContext], list[Action]] | None = None,
        prefix: str | None = None,
    ) -> None:
        """Keeps the arguments."""
        self.respawn, self.respawn_delay, self.on_exit, self.prefix = respawn, respawn_delay, on_exit, prefix
        self.package, self.executable, self.name, self.namespace = package, executable, name, namespace
        self.parameters, self.remappings, self.output = parameters, remappings, output
        self.arguments, self.ros_arguments = arguments, ros_arguments
        self.values: dict[str, object] = {}
        """Parameters of the dictionaries, evaluated."""
        self.files: list[str] = []
        """Parameter files, in order."""
        self.command: list[str] = []
        """Arguments after the program."""

    def execute(self, _context: LaunchContext) -> None:
        """Writes parameter dictionaries to files, as launch_ros does, and creates the command line."""
        namespace = "/" + self.namespace.strip("/") if self.namespace.strip("/") else ""
        self.command = [*map(text, self.arguments), "--ros-args", *map(text, self.ros_arguments)]
        self.command += ["-r", f"__node:={self.name}"] if self.name is not None else []
        self.command += ["-r", f"__ns:={namespace}"] if namespace else []
        key = f"{namespace}/{self.name}" if self.name is not None else "/**"
        for path in self.parameters:
            if isinstance(path, Mapping):
                values = {name: evaluated(name, value) for name, value in path.items()}
                self.values |= values
                with tempfile.NamedTemporaryFile("w", prefix="launch_params_", delete=False) as file:
                    yaml.safe_dump({key: {"ros__parameters": values}}, file, default_flow_style=False)
                path = file.name
            elif not os.path.isfile(text(path)):
                raise FileNotFoundError(f"parameter file {path} of {self.executable}")
            self.files.append(path)
            self.command += ["--params-file", path]
        for source, target in self.remappings:
            self.command += ["-r", f"{text(source)}:={text(target)}"]


def evaluated(name: str, value: object) -> object:
    """Returns the value of a parameter: launch_ros parses texts as YAML unless their type is given."""
    if isinstance(value, ParameterValue):
        return value.value
    read = value if isinstance(value, bool | int | float) else yaml.safe_load(text(value))
    if not isinstance(read, bool | int | float | str):
        raise TypeError(f"parameter {name} is {value!r}: its type is not clear")
    return read


actions = substitutions = launch_description_sources = parameter_descriptions = sys.modules[__name__]
events = process = sys.modules[__name__]
for package, modules in {
    "launch": ("actions", "substitutions", "launch_description_sources", "events", "events.process"),
    "launch_ros": ("actions", "substitutions", "parameter_descriptions"),
}.items():
    for provided in (package, *(f"{package}.{module}" for module in modules)):
        sys.modules[provided] = sys.modules[__name__]
