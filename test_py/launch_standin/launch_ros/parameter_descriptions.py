"""Parameters whose type is said."""

from __future__ import annotations

from launch import LaunchContext, perform


class ParameterValue:
    """A value that is not guessed from its text."""

    def __init__(self, value: object, *, value_type: type | None = None) -> None:
        """Keep both."""
        self.value, self.value_type = value, value_type

    def evaluate(self, context: LaunchContext) -> object:
        """Give the value as its type."""
        if self.value_type is str:
            return perform(context, self.value)
        return self.value
