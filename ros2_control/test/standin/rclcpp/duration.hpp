/// Stand-in of rclcpp::Duration.
#pragma once

#include <chrono>
#include <cstdint>

namespace rclcpp
{
class Duration
{
public:
  explicit Duration(std::chrono::nanoseconds duration)
  : value_(duration) {}

  static Duration from_nanoseconds(std::int64_t nanoseconds) {return Duration(std::chrono::nanoseconds(nanoseconds));}

  std::int64_t nanoseconds() const {return value_.count();}

private:
  std::chrono::nanoseconds value_;
};
}
