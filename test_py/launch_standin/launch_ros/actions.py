"""Nodes."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Mapping

import yaml
from launch import Action, LaunchContext, perform

from .parameter_descriptions import ParameterValue


class Node(Action):
    """Program with ROS arguments; its execution creates the command line."""

    def __init__(
        self,
        *,
        executable: str,
        package: str | None = None,
        name: str | None = None,
        namespace: str | None = None,
        parameters: Iterable[object] | None = None,
        remappings: Iterable[tuple[str, str]] | None = None,
        arguments: Iterable[object] | None = None,
        ros_arguments: Iterable[object] | None = None,
        output: str = "log",
        **kwargs: object,
    ) -> None:
        """Keeps the arguments."""
        super().__init__(**kwargs)
        self.package, self.executable, self.name, self.output = package, executable, name, output
        self.namespace = namespace or ""
        self.parameters, self.remappings = list(parameters or []), list(remappings or [])
        self.arguments, self.ros_arguments = list(arguments or []), list(ros_arguments or [])
        self.values: dict[str, object] = {}
        """Parameters of the dictionaries, evaluated."""
        self.files: list[str] = []
        """Parameter files, in order."""
        self.command: list[str] = []
        """Arguments after the program."""

    def execute(self, context: LaunchContext) -> None:
        """Writes parameter dictionaries to files, as launch_ros does, and creates the command line."""
        namespace = "/" + self.namespace.strip("/") if self.namespace.strip("/") else ""
        command = [perform(context, argument) for argument in self.arguments]
        command.append("--ros-args")
        command += [perform(context, argument) for argument in self.ros_arguments]
        if self.name is not None:
            command += ["-r", f"__node:={self.name}"]
        if namespace:
            command += ["-r", f"__ns:={namespace}"]
        key = f"{namespace}/{self.name}" if self.name is not None else "/**"
        for parameters in self.parameters:
            if isinstance(parameters, Mapping):
                values = {name: self._evaluated(context, name, value) for name, value in parameters.items()}
                self.values |= values
                with tempfile.NamedTemporaryFile("w", prefix="launch_params_", delete=False) as file:
                    yaml.safe_dump({key: {"ros__parameters": values}}, file, default_flow_style=False)
                path = file.name
            else:
                path = perform(context, parameters)
                if not os.path.isfile(path):
                    raise FileNotFoundError(f"parameter file {path} of {self.executable}")
            self.files.append(path)
            command += ["--params-file", path]
        for source, target in self.remappings:
            command += ["-r", f"{perform(context, source)}:={perform(context, target)}"]
        self.command = command

    @staticmethod
    def _evaluated(context: LaunchContext, name: str, value: object) -> object:
        if isinstance(value, ParameterValue):
            return value.evaluate(context)
        if isinstance(value, bool | int | float):
            return value
        # launch_ros parses texts as YAML unless their type is given.
        text = perform(context, value)
        read = yaml.safe_load(text)
        if not isinstance(read, bool | int | float | str):
            raise TypeError(f"parameter {name} is {text!r}: its type is not clear")
        return read
