"""Actions of a description."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from . import Action, LaunchContext, LaunchDescription, perform


class DeclareLaunchArgument(Action):
    """Argument of the file."""

    def __init__(
        self,
        name: str,
        *,
        default_value: object = None,
        description: str | None = None,
        choices: Sequence[str] | None = None,
        **kwargs: object,
    ) -> None:
        """Rejects a default that is not among the choices."""
        super().__init__(**kwargs)
        if choices is not None and isinstance(default_value, str) and default_value not in choices:
            raise ValueError(f"default {default_value!r} of {name} is not one of {choices}")
        self.name, self.default_value, self.description, self.choices = name, default_value, description, choices

    def execute(self, context: LaunchContext) -> None:
        """Sets the default where no value is given; rejects values that are not among the choices."""
        if self.name not in context.launch_configurations:
            if self.default_value is None:
                raise RuntimeError(f"required launch argument '{self.name}' was not provided")
            context.launch_configurations[self.name] = perform(context, self.default_value)
        value = context.launch_configurations[self.name]
        if self.choices is not None and value not in self.choices:
            raise RuntimeError(f"argument '{self.name}' is '{value}', valid are {list(self.choices)}")


class OpaqueFunction(Action):
    """Function that returns actions."""

    def __init__(self, *, function: Callable, args: Iterable = (), kwargs: dict | None = None) -> None:
        """Keeps the call."""
        super().__init__()
        self.function, self.args, self.kwargs = function, list(args), kwargs or {}

    def execute(self, context: LaunchContext) -> list[Action] | None:
        """Calls the function."""
        return self.function(context, *self.args, **self.kwargs)


class LogInfo(Action):
    """Log message."""

    def __init__(self, *, msg: object) -> None:
        """Keeps the message."""
        super().__init__()
        self.msg = msg


class IncludeLaunchDescription(Action):
    """Another launch file, with arguments."""

    def __init__(
        self, launch_description_source: object, *, launch_arguments: Iterable[tuple[str, object]] = ()
    ) -> None:
        """Keeps source and arguments."""
        super().__init__()
        self.source, self.launch_arguments = launch_description_source, list(launch_arguments)

    def execute(self, context: LaunchContext) -> list[object]:
        """Sets the arguments, which stay set, and continues with the file's actions."""
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
    """Actions with scoped configurations."""

    def __init__(self, actions: Iterable[Action], *, scoped: bool = True, **kwargs: object) -> None:
        """Keeps the actions."""
        super().__init__(**kwargs)
        self.actions, self.scoped = list(actions), scoped

    def execute(self, context: LaunchContext) -> list[Action]:
        """Returns the actions, followed by one that restores the configurations."""
        after: list[Action] = [_Restore(dict(context.launch_configurations))] if self.scoped else []
        return [*self.actions, *after]


__all__ = [
    "DeclareLaunchArgument",
    "GroupAction",
    "IncludeLaunchDescription",
    "LaunchDescription",
    "LogInfo",
    "OpaqueFunction",
]
