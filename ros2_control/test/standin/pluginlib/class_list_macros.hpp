/// Stand-in of pluginlib's export: checks that the class can be created as its base.
#pragma once

#include <memory>
#include <type_traits>

#define PLUGINLIB_EXPORT_CLASS(Class, Base) \
  static_assert(std::is_base_of_v<Base, Class> && std::is_default_constructible_v<Class>);
