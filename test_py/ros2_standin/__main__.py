"""Stand-in for the `ros2` command, which is not on PyPI: the verbs that README and tutorials use.

Same arguments, defaults and form of output as ros2cli of ROS 2 Jazzy; other verbs and options are errors.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable

import packages
import parameters
import topics
from graph import Failure

Handler = Callable[[argparse.Namespace], None]


def _verb(verbs: argparse._SubParsersAction, name: str, handler: Handler) -> argparse.ArgumentParser:
    parser = verbs.add_parser(name)
    parser.set_defaults(handler=handler)
    return parser


def _qos_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--qos-reliability", choices=["reliable", "best_effort"])
    parser.add_argument("--qos-durability", choices=["volatile", "transient_local"])
    parser.add_argument("--qos-depth", type=int)


def _topic_verbs(commands: argparse._SubParsersAction) -> None:
    verbs = commands.add_parser("topic").add_subparsers(required=True)
    pub = _verb(verbs, "pub", topics.pub)
    pub.add_argument("topic")
    pub.add_argument("type")
    pub.add_argument("values", nargs="?", default="{}")
    pub.add_argument("-r", "--rate", type=float, default=1.0)
    pub.add_argument("-1", "--once", action="store_true")
    pub.add_argument("-t", "--times", type=int, default=0)
    pub.add_argument("-w", "--wait-matching-subscriptions", type=int)
    pub.add_argument("--keep-alive", type=float, default=0.1)
    _qos_options(pub)
    echo = _verb(verbs, "echo", topics.echo)
    echo.add_argument("topic")
    echo.add_argument("type", nargs="?")
    echo.add_argument("--once", action="store_true")
    echo.add_argument("--field")
    echo.add_argument("-f", "--full-length", action="store_true")
    echo.add_argument("--flow-style", action="store_true")
    _qos_options(echo)
    hz = _verb(verbs, "hz", topics.hz)
    hz.add_argument("topic")
    hz.add_argument("-w", "--window", type=int, default=10000)
    listed = _verb(verbs, "list", topics.list_topics)
    listed.add_argument("-t", "--show-types", action="store_true")


def _parameter_verbs(commands: argparse._SubParsersAction) -> None:
    verbs = commands.add_parser("param").add_subparsers(required=True)
    for name, handler, extra in (
        ("get", parameters.get, ["name"]),
        ("set", parameters.set_value, ["name", "value"]),
        ("list", parameters.list_names, []),
    ):
        parser = _verb(verbs, name, handler)
        for argument in ("node", *extra):
            parser.add_argument(argument)


def main() -> None:
    """Executes a verb."""
    parser = argparse.ArgumentParser(prog="ros2")
    commands = parser.add_subparsers(required=True)
    _topic_verbs(commands)
    _parameter_verbs(commands)
    call = _verb(commands.add_parser("service").add_subparsers(required=True), "call", topics.call)
    for argument in ("service", "type"):
        call.add_argument(argument)
    call.add_argument("values", nargs="?", default="{}")
    _verb(commands.add_parser("node").add_subparsers(required=True), "list", topics.list_nodes)
    for name, handler, target in (("run", packages.run, "executable"), ("launch", packages.launch, "file")):
        verb = _verb(commands, name, handler)
        verb.add_argument("package")
        verb.add_argument(target)
        verb.add_argument("arguments", nargs=argparse.REMAINDER)
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        arguments.handler(arguments)
    except Failure as failure:
        sys.exit(str(failure))
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
