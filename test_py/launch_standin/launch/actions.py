"""Actions of a description."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from . import Action, LaunchContext, LaunchDescription, perform


class DeclareLaunchArgument(Action):
    """An argument of the file."""

    def __init__(
        self,
        name: str,
        *,
        default_value: object = None,
        description: str | None = None,
        choices: Sequence[str] | None = None,
        **kwargs: object,
    ) -> None:
        """Refuse a default that is not among the choices."""
        super().__init__(**kwargs)
        if choices is not None and isinstance(default_value, str) and default_value not in choices:
            raise ValueError(f"default {default_value!r} of {name} is not one of {choices}")
        self.name, self.default_value, self.description, self.choices = name, default_value, description, choices

    def execute(self, context: LaunchContext) -> None:
        """Set the default where no value has been given; refuse what is not to be chosen."""
        if self.name not in context.launch_configurations:
            if self.default_value is None:
                raise RuntimeError(f"required launch argument '{self.name}' was not provided")
            context.launch_configurations[self.name] = perform(context, self.default_value)
        value = context.launch_configurations[self.name]
        if self.choices is not None and value not in self.choices:
            raise RuntimeError(f"argument '{self.name}' is '{value}', valid are {list(self.choices)}")


class OpaqueFunction(Action):
    """A function that gives actions."""

    def __init__(self, *, function: Callable, args: Iterable = (), kwargs: dict | None = None) -> None:
        """Keep the call."""
        super().__init__()
        self.function, self.args, self.kwargs = function, list(args), kwargs or {}

    def execute(self, context: LaunchContext) -> list[Action] | None:
        """Call it."""
        return self.function(context, *self.args, **self.kwargs)


class LogInfo(Action):
    """A message."""

    def __init__(self, *, msg: object) -> None:
        """Keep it."""
        super().__init__()
        self.msg = msg


class IncludeLaunchDescription(Action):
    """Another file, with arguments."""

    def __init__(
        self, launch_description_source: object, *, launch_arguments: Iterable[tuple[str, object]] = ()
    ) -> None:
        """Keep both."""
        super().__init__()
        self.source, self.launch_arguments = launch_description_source, list(launch_arguments)

    def execute(self, context: LaunchContext) -> list[object]:
        """Set the arguments, which stay set, and go on with the file's actions."""
        description = self.source.get_launch_description(context)
        declared = {e.name for e in description.entities if isinstance(e, DeclareLaunchArgument)}
        for name, value in self.launch_arguments:
            if name not in declared:
                raise RuntimeError(f"the included file has no argument '{name}'")
            context.launch_configurations[name] = perform(context, value)
        return [description]


class _Restore(Action):
    def __init__(self, configurations: dict[str, str]) -> None:
        super().__init__()
        self.configurations = configurations

    def execute(self, context: LaunchContext) -> None:
        context.launch_configurations = self.configurations


class GroupAction(Action):
    """Actions whose configurations end with them."""

    def __init__(self, actions: Iterable[Action], *, scoped: bool = True, **kwargs: object) -> None:
        """Keep them."""
        super().__init__(**kwargs)
        self.actions, self.scoped = list(actions), scoped

    def execute(self, context: LaunchContext) -> list[Action]:
        """Put the configurations back behind the last action."""
        after: list[Action] = [_Restore(dict(context.launch_configurations))] if self.scoped else []
        return [*self.actions, *after]


class TimerAction(Action):
    """Actions after a time; nothing is waited for here."""

    def __init__(self, *, period: float, actions: Iterable[Action], **kwargs: object) -> None:
        """Keep them, and the time in s."""
        super().__init__(**kwargs)
        self.period, self.actions = period, list(actions)

    def execute(self, context: LaunchContext) -> list[Action]:
        """Give the actions."""
        return self.actions


__all__ = [
    "DeclareLaunchArgument",
    "GroupAction",
    "IncludeLaunchDescription",
    "LaunchDescription",
    "LogInfo",
    "OpaqueFunction",
    "TimerAction",
]
