/// Hardware component of ros2_control with the drives of a machine.
#ifndef VIRTUAL_AXES_ROS2_CONTROL__VIRTUAL_AXES_SYSTEM_HPP_
#define VIRTUAL_AXES_ROS2_CONTROL__VIRTUAL_AXES_SYSTEM_HPP_

#include <memory>
#include <string>
#include <vector>

#include "hardware_interface/system_interface.hpp"
#include "hardware_interface/types/hardware_interface_return_values.hpp"
#include "rclcpp/duration.hpp"
#include "rclcpp/time.hpp"
#include "rclcpp_lifecycle/state.hpp"
#include "virtual_axes_ros2_control/stepped_axes.hpp"

#if __has_include("hardware_interface/types/hardware_component_interface_params.hpp")
#include "hardware_interface/types/hardware_component_interface_params.hpp"
#define VIRTUAL_AXES_HAS_INTERFACE_PARAMS 1
#else
#define VIRTUAL_AXES_HAS_INTERFACE_PARAMS 0
#endif

namespace virtual_axes_ros2_control
{

/// Argument of `on_init`. Newer releases of ros2_control pass parameters with the hardware block in them, and deprecate
/// or lack the call with the block itself; older releases have that call alone.
#if VIRTUAL_AXES_HAS_INTERFACE_PARAMS
using InitParams = hardware_interface::HardwareComponentInterfaceParams;
#else
using InitParams = hardware_interface::HardwareInfo;
#endif

/// System with simulated feed drives: command interface position; state interfaces position, velocity, effort, current
/// and following_error of each joint, in m, m/s, N and A, or rad, rad/s, N·m and A.
class VirtualAxesSystem : public hardware_interface::SystemInterface
{
public:
  using hardware_interface::SystemInterface::on_init;

  /// Reads and checks the parameters machine, controller, joints and joint_prefix, and the interfaces of the joints.
  hardware_interface::CallbackReturn on_init(const InitParams & params) override;

  /// Creates the axes at rest at home.
  hardware_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State & previous_state) override;

  /// Destroys the axes.
  hardware_interface::CallbackReturn on_cleanup(const rclcpp_lifecycle::State & previous_state) override;

  /// Puts the axes at rest where they are and sets the commands to their positions.
  hardware_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State & previous_state) override;

  /// Freezes the axes.
  hardware_interface::CallbackReturn on_deactivate(const rclcpp_lifecycle::State & previous_state) override;

  /// Rejects command interfaces of these joints other than position.
  hardware_interface::return_type prepare_command_mode_switch(
    const std::vector<std::string> & start_interfaces, const std::vector<std::string> & stop_interfaces) override;

  /// Accepts: position is the only mode.
  hardware_interface::return_type perform_command_mode_switch(
    const std::vector<std::string> & start_interfaces, const std::vector<std::string> & stop_interfaces) override;

  /// Advances the axes by the period as far as setpoints are known, and sets the state interfaces.
  hardware_interface::return_type read(const rclcpp::Time & time, const rclcpp::Duration & period) override;

  /// Passes the commands to the axes.
  hardware_interface::return_type write(const rclcpp::Time & time, const rclcpp::Duration & period) override;

private:
  /// State interface of one joint.
  struct StateOutput
  {
    /// Name with the joint, as in x/position.
    std::string name;
    std::size_t axis;
    double VaSignals::* signal;
  };

  /// Checks the interfaces of a joint and adds its outputs; throws std::invalid_argument.
  void add_joint(const hardware_interface::ComponentInfo & joint, std::size_t axis);

  /// Sets the state interfaces from the axes.
  void set_states();

  std::string machine_;
  std::string controller_;
  /// Names of the command interfaces and their axes.
  std::vector<std::string> command_names_;
  std::vector<std::size_t> command_axes_;
  std::vector<StateOutput> outputs_;
  /// Command of each axis; an axis without joint keeps its position.
  std::vector<double> commands_;
  std::unique_ptr<SteppedAxes> axes_;
  bool is_active_ = false;
};

}  // namespace virtual_axes_ros2_control

#endif  // VIRTUAL_AXES_ROS2_CONTROL__VIRTUAL_AXES_SYSTEM_HPP_
