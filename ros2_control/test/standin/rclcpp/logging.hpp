/// Stand-in of rclcpp's log macros: errors and warnings go to standard error.
#pragma once

#include <cstdio>

namespace rclcpp
{
struct Logger
{
};
}

#define RCLCPP_ERROR(logger, ...) \
  do { \
    (void)(logger); \
    std::fprintf(stderr, __VA_ARGS__); \
    std::fputc('\n', stderr); \
  } while (false)

#define RCLCPP_WARN(logger, ...) RCLCPP_ERROR(logger, __VA_ARGS__)
