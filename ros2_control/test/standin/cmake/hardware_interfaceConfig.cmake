# Stand-in of the package's CMake configuration.
set(hardware_interface_INCLUDE_DIRS "${CMAKE_CURRENT_LIST_DIR}/.." "${CMAKE_CURRENT_LIST_DIR}/../../standin_params")
