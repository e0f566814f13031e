/// Stand-in of rclcpp's log macros: errors and warnings go to standard error. The compiler checks the formats.
#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>

namespace rclcpp
{
class Logger
{
private:
  Logger() = default;
  friend Logger get_logger(const std::string & name);
};

inline Logger get_logger(const std::string &) {return Logger();}

__attribute__((format(printf, 2, 3)))
inline void log_line(const Logger &, const char * format, ...)
{
  va_list values;
  va_start(values, format);
  std::vfprintf(stderr, format, values);
  va_end(values);
  std::fputc('\n', stderr);
}
}

#define RCLCPP_ERROR(logger, ...) rclcpp::log_line(logger, __VA_ARGS__)
#define RCLCPP_WARN(logger, ...) rclcpp::log_line(logger, __VA_ARGS__)
