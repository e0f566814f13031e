"""Parameters with an explicit type."""

from __future__ import annotations

from launch import LaunchContext, perform


class ParameterValue:
    """Value with an explicit type instead of a type guessed from its text."""

    def __init__(self, value: object, *, value_type: type | None = None) -> None:
        """Keeps value and type."""
        self.value, self.value_type = value, value_type

    def evaluate(self, context: LaunchContext) -> object:
        """Returns the value converted to its type."""
        if self.value_type is str:
            return perform(context, self.value)
        return self.value
