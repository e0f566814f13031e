/// Stand-in of rclcpp::Time.
#pragma once

#include <cstdint>

namespace rclcpp
{
class Time
{
public:
  explicit Time(std::int64_t nanoseconds = 0)
  : value_(nanoseconds) {}

  std::int64_t nanoseconds() const {return value_;}

private:
  std::int64_t value_;
};
}
