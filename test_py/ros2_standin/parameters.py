"""Verbs of parameters."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rclpy
import yaml
from graph import DISCOVERY_SECONDS, Failure, node
from rclpy.parameter import Parameter, get_parameter_value, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

TYPES = {
    1: "Boolean value is",
    2: "Integer value is",
    3: "Double value is",
    4: "String value is",
    5: "Byte values are",
    6: "Boolean values are",
    7: "Integer values are",
    8: "Double values are",
    9: "String values are",
}


@contextmanager
def _client(name: str) -> Iterator[Callable[..., object]]:
    """Yields a function that calls a method of the node's parameter client."""
    with node() as own:
        client = AsyncParameterClient(own, name)
        if not client.wait_for_services(DISCOVERY_SECONDS):
            raise Failure("Node not found")

        def call(method: str, *arguments: object) -> object:
            future = getattr(client, method)(*arguments)
            rclpy.spin_until_future_complete(own, future, timeout_sec=DISCOVERY_SECONDS)
            if not future.done():
                raise Failure(f"Exception while calling service of node '{name}': no response")
            return future.result()

        yield call


def get(arguments: argparse.Namespace) -> None:
    """Prints a value."""
    with _client(arguments.node) as call:
        [value] = call("get_parameters", [arguments.name]).values or [None]
    if value is None or value.type == 0:
        raise Failure("Parameter not set")
    print(f"{TYPES[value.type]}: {parameter_value_to_python(value)}")


def set_value(arguments: argparse.Namespace) -> None:
    """Sets a value."""
    message = Parameter(arguments.name, value=yaml.safe_load(arguments.value)).to_parameter_msg()
    message.value = get_parameter_value(string_value=arguments.value)
    with _client(arguments.node) as call:
        [result] = call("set_parameters", [message]).results
    reason = f": {result.reason}" if result.reason else ""
    if result.successful:
        print(f"Set parameter successful{reason}")
    else:
        print(f"Setting parameter failed{reason}", file=sys.stderr)


def list_names(arguments: argparse.Namespace) -> None:
    """Prints the names."""
    with _client(arguments.node) as call:
        names = call("list_parameters", [], 0).result.names
    for name in sorted(names):
        print(f"  {name}")
