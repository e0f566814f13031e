# Stand-in of the package's CMake configuration.
set(rclcpp_INCLUDE_DIRS "${CMAKE_CURRENT_LIST_DIR}/..")
