"""Node in the ROS graph that spins in a thread of its own."""

# rclpy has few type hints.
# mypy: disallow-untyped-calls=False

from __future__ import annotations

import itertools
import os
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import rclpy
from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

EXECUTION_TIMEOUT_S = 20.0
"""Timeout for a call to be executed by the executor, s."""
SETTLE_S = 0.2
"""Timeout for a reliable sample written at matching: it may wait for the next heartbeat, s."""
POLL_S = 0.02
"""Interval between looks at the graph, which sends no event when it changes, s."""


class Process(Protocol):
    """Process of the axes' node, if the caller has started it."""

    name: str
    """Full name of the node."""
    domain_id: int | None
    """ROS domain of the node; None for that of the environment."""

    def poll(self) -> int | None:
        """Returns the exit status, or None while the process runs."""

    def output(self) -> str:
        """Returns the output so far, for error messages."""


class GraphNode:
    """Node in the ROS graph that spins in a thread of its own.

    It has its own rclpy context, so that several of them, also in other domains, live in one process.
    """

    _count = itertools.count()

    def __init__(self, process: Process | None, domain_id: int | None, remaps: Sequence[str]) -> None:
        """Creates the node; `spin` starts its thread."""
        self.process = process
        if domain_id is None and process is not None:
            domain_id = process.domain_id
        self._changed = threading.Condition()
        self._closing = False
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
        self.name = f"axes_client_{os.getpid()}_{next(GraphNode._count)}"
        cli_args = ["--ros-args", *(word for remap in remaps for word in ("-r", remap))] if remaps else None
        self.node = rclpy.create_node(
            self.name,
            context=self._context,
            cli_args=cli_args,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name=self.name, daemon=True)

    def close(self) -> None:
        """Leaves the graph; has no effect when called again."""
        if self._context.ok():
            self._closing = True
            self._executor.shutdown(timeout_sec=2.0)
            self._thread.join(timeout=2.0)
            self.node.destroy_node()
            rclpy.shutdown(context=self._context)

    def _spin(self) -> None:
        """Executes callbacks until the node is closed."""
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass
        except (InvalidHandle, AttributeError):
            # A callback, or a wait of rclpy's executor, that was active when the node was destroyed.
            if not self._closing:
                raise

    def in_executor(self, call: Callable[[], Any]) -> Any:
        """Runs `call()` in the executor's thread and returns its result.

        From another thread rclpy's ActionClient can receive a response before it has stored the request, and drops it;
        the executor fails if an entity is destroyed during a wait. Raises `TimeoutError` after 20 s.
        """
        task = self._executor.create_task(call)
        self.wait_for(task.done, EXECUTION_TIMEOUT_S, "execution by the executor")
        return task.result()

    def wait_for(self, condition: Callable[[], Any], timeout: float, what: str) -> Any:
        """Waits until `condition()` is true and returns its value; `what` names it in error messages.

        Raises `TimeoutError` after `timeout` s, and `ChildProcessError` if the axes' process ends.
        """
        deadline = time.monotonic() + timeout
        with self._changed:
            while not (answer := condition()):
                left = deadline - time.monotonic()
                if left <= 0:
                    raise TimeoutError(f"no {what} within {timeout:g} s{self._account()}")
                if self.process is not None and self.process.poll() is not None:
                    raise ChildProcessError(f"the node ended while waiting for {what}{self._account()}")
                self._changed.wait(min(left, POLL_S))
            return answer

    def _account(self) -> str:
        """Returns the output of the axes' process, if it is known."""
        return f"; the node's output:\n{self.process.output()}" if self.process is not None else ""

    def _keep(self, store: list[Any]) -> Callable[[Any], None]:
        """Returns a callback that appends messages to a list."""

        def callback(message: Any) -> None:
            with self._changed:
                store.append(message)
                self._changed.notify_all()

        return callback
