/// Stand-in of rclcpp's log macros: errors go to standard error.
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
