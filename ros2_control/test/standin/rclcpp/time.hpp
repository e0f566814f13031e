/// Stand-in of rclcpp::Time.
#pragma once

#include <cstdint>

namespace rclcpp
{
struct Time
{
  std::int64_t value;
};
}
