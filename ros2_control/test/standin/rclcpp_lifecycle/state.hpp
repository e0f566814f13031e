/// Stand-in of rclcpp_lifecycle::State.
#pragma once

namespace rclcpp_lifecycle
{
class State
{
public:
  explicit State() {}
};
}
