"""Services of the axes: reset, stop and parameters."""

# rclpy has few type hints.
# mypy: disallow-untyped-calls=False

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import Trigger

from .graph_node import SETTLE_S, GraphNode


class ParameterRejected(Exception):
    """Rejection of a parameter value; the text is the reason."""


def parameter_messages(values: Mapping[str, Any]) -> list[ParameterMsg]:
    """Returns parameters as messages of the set requests."""
    return [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]


class ServiceNode(GraphNode):
    """Client of the services of the axes; every call raises `TimeoutError` without a response."""

    target: str
    """Full name of the axes' node."""
    _clients: dict[str, Any]

    def call(self, kind: Any, service: str, request: Any, timeout: float = 10.0) -> Any:
        """Calls a service of the node and returns the response; `service` is without the node's name."""
        client = self._clients.get(service)
        if client is None:
            client = self._clients[service] = self.node.create_client(kind, f"{self.target}/{service}")
        if not client.service_is_ready():
            self.wait_for(client.service_is_ready, timeout, f"service {service}")
            time.sleep(SETTLE_S)
        future = client.call_async(request)
        self.wait_for(future.done, timeout, f"response of service {service}")
        return future.result()

    def reset(self, timeout: float = 10.0) -> str:
        """Resets the axes to rest at the start position; returns the node's message.

        Raises `RuntimeError` if the node rejects it.
        """
        return self._trigger("reset", timeout)

    def stop(self, timeout: float = 10.0) -> str:
        """Stops the axes within their limits; returns the node's message, raises `RuntimeError` as `reset` does."""
        return self._trigger("stop", timeout)

    def _trigger(self, service: str, timeout: float) -> str:
        """Calls a service without arguments."""
        answer = self.call(Trigger, service, Trigger.Request(), timeout)
        if not answer.success:
            raise RuntimeError(f"{service}: {answer.message}")
        return str(answer.message)

    def list_parameters(self) -> list[str]:
        """Returns the names of all parameters."""
        return list(self.call(ListParameters, "list_parameters", ListParameters.Request()).result.names)

    def describe(self, names: Sequence[str]) -> list[ParameterDescriptor]:
        """Returns descriptions, types and ranges of parameters."""
        request = DescribeParameters.Request(names=list(names))
        return list(self.call(DescribeParameters, "describe_parameters", request).descriptors)

    def get_parameters(self, names: Sequence[str]) -> dict[str, Any]:
        """Returns values of parameters by name, in the units of the machine file."""
        answer = self.call(GetParameters, "get_parameters", GetParameters.Request(names=list(names)))
        return {name: parameter_value_to_python(value) for name, value in zip(names, answer.values)}

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Sets parameters one by one, in the units of the machine file.

        Raises `ParameterRejected` with the node's reasons.
        """
        request = SetParameters.Request(parameters=parameter_messages(values))
        results = self.call(SetParameters, "set_parameters", request).results
        reasons = [result.reason for result in results if not result.successful]
        if reasons or len(results) != len(values):
            raise ParameterRejected("; ".join(reasons))

    def set_parameters_atomically(self, values: Mapping[str, Any]) -> None:
        """Sets all parameters at the same position cycle or none; raises `ParameterRejected` with the reason."""
        request = SetParametersAtomically.Request(parameters=parameter_messages(values))
        result = self.call(SetParametersAtomically, "set_parameters_atomically", request).result
        if not result.successful:
            raise ParameterRejected(result.reason)
