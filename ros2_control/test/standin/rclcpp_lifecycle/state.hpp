/// Stand-in of rclcpp_lifecycle::State.
#pragma once

namespace rclcpp_lifecycle
{
struct State
{
};
}
