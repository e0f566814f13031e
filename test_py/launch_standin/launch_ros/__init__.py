"""Stand-in for the part of ROS 2's `launch_ros` that the launch files here use; it is not on PyPI."""
