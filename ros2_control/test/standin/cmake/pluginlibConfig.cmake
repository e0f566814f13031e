# Stand-in of the package's CMake configuration.
set(pluginlib_INCLUDE_DIRS "${CMAKE_CURRENT_LIST_DIR}/..")

# Installs the description in its folder; pluginlib also registers it for the package of the base class.
macro(pluginlib_export_plugin_description_file base_package file)
  get_filename_component(folder "${file}" DIRECTORY)
  install(FILES "${file}" DESTINATION "share/${PROJECT_NAME}/${folder}")
endmacro()
