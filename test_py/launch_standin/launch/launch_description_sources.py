"""Where included descriptions come from."""

from __future__ import annotations

import runpy

from . import LaunchContext, LaunchDescription, perform


class PythonLaunchDescriptionSource:
    """A launch file in Python."""

    def __init__(self, launch_file_path: object) -> None:
        """Keep the path."""
        self.path = launch_file_path

    def get_launch_description(self, context: LaunchContext) -> LaunchDescription:
        """Execute the file and call its generator."""
        return runpy.run_path(perform(context, self.path))["generate_launch_description"]()
