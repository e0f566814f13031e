"""Texts that are known only when a description is executed."""

from __future__ import annotations

from . import LaunchContext, Substitution, SubstitutionFailure


class LaunchConfiguration(Substitution):
    """The value of a configuration."""

    def __init__(self, variable_name: str, *, default: str | None = None) -> None:
        """Keep the name."""
        self.variable_name = variable_name
        self.default = default

    def perform(self, context: LaunchContext) -> str:
        """Give its value."""
        value = context.launch_configurations.get(self.variable_name, self.default)
        if value is None:
            raise SubstitutionFailure(f"launch configuration '{self.variable_name}' does not exist")
        return value
