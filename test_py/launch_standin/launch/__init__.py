"""Stand-in for the part of ROS 2's `launch` that the launch files here use; it is not on PyPI.

Same names, signatures and rules: arguments have defaults and choices, configurations are texts, an
included file sees and changes the configurations of the one that includes it unless a group keeps them
apart. Nothing is started: `visit` returns the actions that would be executed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping


class LaunchContext:
    """State of the execution of a description."""

    def __init__(self) -> None:
        """Creates a context without configurations."""
        self.launch_configurations: dict[str, str] = {}

    def perform_substitution(self, substitution: object) -> str:
        """Evaluates a substitution."""
        return perform(self, substitution)


class Substitution:
    """Value that is converted to text during execution."""

    def perform(self, context: LaunchContext) -> str:
        """Returns the text."""
        raise NotImplementedError


class SubstitutionFailure(Exception):
    """Failure of a substitution without text."""


class Action:
    """Element of a description."""

    def __init__(self, *, condition: object = None) -> None:
        """Keeps the condition."""
        self.condition = condition

    def execute(self, context: LaunchContext) -> list[Action] | None:
        """Returns the actions that follow from this one."""
        return None


class LaunchDescription:
    """List of actions."""

    def __init__(self, initial_entities: Iterable[Action] | None = None) -> None:
        """Keeps the actions."""
        self.entities = list(initial_entities or [])

    def add_action(self, action: Action) -> None:
        """Appends an action."""
        self.entities.append(action)


def perform(context: LaunchContext, value: object) -> str:
    """Evaluates substitutions: a text, a substitution, or a list that is concatenated."""
    if isinstance(value, str):
        return value
    if isinstance(value, Substitution):
        return value.perform(context)
    if isinstance(value, Iterable):
        return "".join(perform(context, part) for part in value)
    raise TypeError(f"{value!r} is neither a text nor a substitution")


def visit(context: LaunchContext, entities: Iterable[object]) -> Iterator[Action]:
    """Executes actions in order, and yields each of them."""
    for entity in entities:
        if isinstance(entity, LaunchDescription):
            yield from visit(context, entity.entities)
            continue
        if not isinstance(entity, Action):
            raise TypeError(f"{entity!r} is not an action")
        if entity.condition is not None and not entity.condition.evaluate(context):
            continue
        yield entity
        yield from visit(context, entity.execute(context) or [])


def run(description: LaunchDescription, arguments: Mapping[str, str]) -> list[Action]:
    """Executes a description as `ros2 launch` does with `name:=value` arguments."""
    context = LaunchContext()
    for name, value in arguments.items():
        if not isinstance(value, str):
            raise TypeError(f"{name}:={value!r} is not a text")
    context.launch_configurations.update(arguments)
    return list(visit(context, [description]))
