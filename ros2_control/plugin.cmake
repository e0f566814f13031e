# Hardware component of ros2_control: built where hardware_interface and pluginlib are found and the C library is built.
find_package(hardware_interface QUIET)
find_package(pluginlib QUIET)
find_package(rclcpp QUIET)
find_package(rclcpp_lifecycle QUIET)
set(c_library_name "${CMAKE_STATIC_LIBRARY_PREFIX}virtual_axes_c${CMAKE_STATIC_LIBRARY_SUFFIX}")
set(skipped "")
if(NOT (hardware_interface_FOUND AND pluginlib_FOUND AND rclcpp_FOUND AND rclcpp_lifecycle_FOUND))
  set(skipped "hardware_interface, pluginlib, rclcpp or rclcpp_lifecycle not found")
elseif(NOT programs)
  set(skipped "VIRTUAL_AXES_BUILD_NODE is OFF")
elseif(VIRTUAL_AXES_BINARY_DIR AND NOT EXISTS "${programs}/${c_library_name}")
  set(skipped "${programs} has no ${c_library_name}")
endif()

if(skipped)
  message(STATUS "ros2_control plugin skipped: ${skipped}")
else()
  set(plugin ${PROJECT_NAME}_ros2_control)
  add_library(${plugin} SHARED ros2_control/src/virtual_axes_system.cpp)
  target_compile_features(${plugin} PRIVATE cxx_std_17)
  target_include_directories(${plugin} PRIVATE ros2_control/include crates/c/include)
  ament_target_dependencies(${plugin} hardware_interface pluginlib rclcpp rclcpp_lifecycle)
  find_package(Threads REQUIRED)
  target_link_libraries(${plugin} "${programs}/${c_library_name}" Threads::Threads ${CMAKE_DL_LIBS} m)
  # The plugin exports its own symbols alone, not those of the Rust library inside.
  target_link_options(${plugin} PRIVATE "LINKER:--exclude-libs,ALL")
  if(NOT VIRTUAL_AXES_BINARY_DIR)
    add_custom_target(${plugin}_library
      COMMAND "${CMAKE_COMMAND}" -E env "CARGO_TARGET_DIR=${cargo_target}"
        "${CARGO}" build --release --locked --package virtual_axes_c --lib
      BYPRODUCTS "${programs}/${c_library_name}"
      WORKING_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}"
      COMMENT "cargo build --release --package virtual_axes_c"
      VERBATIM
    )
    # One cargo at a time: both use the same target directory.
    add_dependencies(${plugin}_library ${PROJECT_NAME}_programs)
    add_dependencies(${plugin} ${plugin}_library)
  endif()
  install(TARGETS ${plugin} DESTINATION lib)
  pluginlib_export_plugin_description_file(hardware_interface ros2_control/virtual_axes_system.xml)
endif()
