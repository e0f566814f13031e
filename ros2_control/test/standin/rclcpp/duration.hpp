/// Stand-in of rclcpp::Duration.
#pragma once

#include <cstdint>

namespace rclcpp
{
struct Duration
{
  std::int64_t value;
  std::int64_t nanoseconds() const {return value;}
};
}
