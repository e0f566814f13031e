"""Sources of included descriptions."""

from __future__ import annotations

import runpy

from . import LaunchContext, LaunchDescription, perform


class PythonLaunchDescriptionSource:
    """Launch file in Python."""

    def __init__(self, launch_file_path: object) -> None:
        """Keeps the path."""
        self.path = launch_file_path

    def get_launch_description(self, context: LaunchContext) -> LaunchDescription:
        """Executes the file and calls its generator."""
        return runpy.run_path(perform(context, self.path))["generate_launch_description"]()
