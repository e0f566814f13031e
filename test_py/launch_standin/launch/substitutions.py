"""Texts that are evaluated during the execution of a description."""

from __future__ import annotations

from . import LaunchContext, Substitution, SubstitutionFailure


class LaunchConfiguration(Substitution):
    """Value of a configuration."""

    def __init__(self, variable_name: str, *, default: str | None = None) -> None:
        """Keeps the name."""
        self.variable_name = variable_name
        self.default = default

    def perform(self, context: LaunchContext) -> str:
        """Returns the value."""
        value = context.launch_configurations.get(self.variable_name, self.default)
        if value is None:
            raise SubstitutionFailure(f"launch configuration '{self.variable_name}' does not exist")
        return value
