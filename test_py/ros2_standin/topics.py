"""Verbs of topics, services and nodes."""

from __future__ import annotations

import argparse
import time
from collections import deque

import rclpy
from graph import Failure, fill, interface, node, parse, to_yaml, wait_for
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

GRAPH_SECONDS = 1.5
"""Time of discovery before a list is printed."""


def _name(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"


def _qos(arguments: argparse.Namespace, default: QoSProfile) -> QoSProfile:
    if arguments.qos_reliability:
        default.reliability = ReliabilityPolicy[arguments.qos_reliability.upper()]
    if arguments.qos_durability:
        default.durability = DurabilityPolicy[arguments.qos_durability.upper()]
    if arguments.qos_depth:
        default.depth = arguments.qos_depth
    return default


def pub(arguments: argparse.Namespace) -> None:
    """Publishes a message once, some times, or at a rate."""
    kind = interface(arguments.type, "msg")
    message = kind()
    fill(message, parse(arguments.values))
    times = 1 if arguments.once else arguments.times
    wanted = arguments.wait_matching_subscriptions
    wanted = (1 if times else 0) if wanted is None else wanted
    default = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)
    with node() as own:
        publisher = own.create_publisher(kind, _name(arguments.topic), _qos(arguments, default))
        next_note = time.monotonic()
        while publisher.get_subscription_count() < wanted:
            if time.monotonic() >= next_note:
                print(f"Waiting for at least {wanted} matching subscription(s)...", flush=True)
                next_note += 1.0
            rclpy.spin_once(own, timeout_sec=0.1)
        print("publisher: beginning loop", flush=True)
        count = 0
        while not times or count < times:
            count += 1
            print(f"publishing #{count}: {message!r}\n", flush=True)
            publisher.publish(message)
            if count != times:
                time.sleep(1.0 / arguments.rate)
        time.sleep(arguments.keep_alive)


def _type_of(own: Node, topic: str, given: str | None) -> str:
    if given:
        return given

    def found() -> str | None:
        return next((types[0] for name, types in own.get_topic_names_and_types() if name == topic), None)

    if not (kind := wait_for(own, found)):
        raise Failure(
            f"WARNING: topic [{topic}] does not appear to be published yet\n"
            "Could not determine the type for the passed topic"
        )
    return kind


def _matching(own: Node, topic: str) -> QoSProfile:
    """Returns the strongest profile that all publishers offer."""
    profiles = [info.qos_profile for info in own.get_publishers_info_by_topic(topic)]
    reliable = bool(profiles) and all(p.reliability == ReliabilityPolicy.RELIABLE for p in profiles)
    kept = bool(profiles) and all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
    return QoSProfile(
        depth=10,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
    )


def echo(arguments: argparse.Namespace) -> None:
    """Prints messages as YAML."""
    topic = _name(arguments.topic)
    with node() as own:
        kind = interface(_type_of(own, topic, arguments.type), "msg")
        wait_for(own, lambda: own.get_publishers_info_by_topic(topic), 2.0)
        count = 0

        def show(message: object) -> None:
            nonlocal count
            if arguments.once and count:
                return
            count += 1
            for part in (arguments.field or "").split(".") if arguments.field else ():
                message = getattr(message, part)
            is_message = hasattr(message, "get_fields_and_field_types")
            text = to_yaml(message, full=arguments.full_length, flow=arguments.flow_style) if is_message else message
            print(f"{text}\n---", flush=True)

        own.create_subscription(kind, topic, show, _qos(arguments, _matching(own, topic)))
        while not (arguments.once and count):
            rclpy.spin_once(own, timeout_sec=0.1)


def hz(arguments: argparse.Namespace) -> None:
    """Prints the rate of a topic every second."""
    topic = _name(arguments.topic)
    with node() as own:
        kind = interface(_type_of(own, topic, None), "msg")
        times: deque[float] = deque(maxlen=arguments.window + 1)
        own.create_subscription(kind, topic, lambda _: times.append(time.monotonic()), _matching(own, topic))
        shown = time.monotonic()
        while True:
            rclpy.spin_once(own, timeout_sec=0.1)
            if time.monotonic() < shown + 1.0 or len(times) < 3:
                continue
            shown = time.monotonic()
            gaps = [later - earlier for earlier, later in zip(times, list(times)[1:])]
            mean = sum(gaps) / len(gaps)
            deviation = (sum((gap - mean) ** 2 for gap in gaps) / len(gaps)) ** 0.5
            print(
                f"average rate: {1 / mean:.3f}\n\tmin: {min(gaps):.3f}s max: {max(gaps):.3f}s "
                f"std dev: {deviation:.5f}s window: {len(gaps)}",
                flush=True,
            )


def list_topics(arguments: argparse.Namespace) -> None:
    """Prints the topics."""
    with node() as own:
        wait_for(own, lambda: False, GRAPH_SECONDS)
        for name, types in own.get_topic_names_and_types():
            print(f"{name} [{', '.join(types)}]" if arguments.show_types else name)


def list_nodes(arguments: argparse.Namespace) -> None:
    """Prints the nodes."""
    with node() as own:
        wait_for(own, lambda: False, GRAPH_SECONDS)
        found = own.get_node_names_and_namespaces()
        names = [f"{space.rstrip('/')}/{name}" for name, space in found if not name.startswith("_")]
        print(*sorted(names), sep="\n")


def call(arguments: argparse.Namespace) -> None:
    """Calls a service."""
    kind = interface(arguments.type, "srv")
    request = kind.Request()
    fill(request, parse(arguments.values))
    with node() as own:
        client = own.create_client(kind, _name(arguments.service))
        if not client.wait_for_service(0.5):
            print("waiting for service to become available...", flush=True)
            client.wait_for_service()
        print(f"requester: making request: {request!r}\n", flush=True)
        future = client.call_async(request)
        rclpy.spin_until_future_complete(own, future)
        print(f"response:\n{future.result()!r}\n")
