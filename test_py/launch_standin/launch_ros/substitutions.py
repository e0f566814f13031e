"""Texts from the package index."""

from __future__ import annotations

import os

from launch import LaunchContext, Substitution, SubstitutionFailure, perform

PROGRAMS: dict[tuple[str, str], str] = {}
"""Replacement of the package index: path by package and executable."""


class ExecutableInPackage(Substitution):
    """Path of a package's program."""

    def __init__(self, executable: object, package: object) -> None:
        """Keeps executable and package."""
        self.executable, self.package = executable, package

    def perform(self, context: LaunchContext) -> str:
        """Returns the path."""
        executable, package = perform(context, self.executable), perform(context, self.package)
        path = PROGRAMS.get((package, executable))
        if path is None or not os.access(path, os.X_OK):
            raise SubstitutionFailure(f"executable '{executable}' not found on the libexec directory of '{package}'")
        return path
