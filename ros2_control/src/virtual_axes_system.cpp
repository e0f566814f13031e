#include "virtual_axes_ros2_control/virtual_axes_system.hpp"

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <utility>

#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/logging.hpp"

namespace virtual_axes_ros2_control
{
namespace
{

using hardware_interface::CallbackReturn;
using hardware_interface::return_type;

/// State interfaces and their signals.
const std::vector<std::pair<std::string, double VaSignals::*>> STATES = {
  {"position", &VaSignals::position},
  {"velocity", &VaSignals::velocity},
  {"effort", &VaSignals::effort},
  {"current", &VaSignals::current},
  {"following_error", &VaSignals::following_error},
};

const std::vector<std::string> PARAMETERS = {"machine", "controller", "joints", "joint_prefix"};

const std::vector<std::string> CONTROLLERS = {"cascade", "gpc", "rst"};

/// Returns a parameter of the `<hardware>` block without spaces around it, or an empty text.
std::string parameter(const hardware_interface::HardwareInfo & info, const std::string & name)
{
  const auto found = info.hardware_parameters.find(name);
  const std::string value = found == info.hardware_parameters.end() ? "" : found->second;
  const char * spaces = " \t\r\n";
  const std::size_t start = value.find_first_not_of(spaces);
  return start == std::string::npos ? "" : value.substr(start, value.find_last_not_of(spaces) + 1 - start);
}

}  // namespace

void VirtualAxesSystem::add_joint(const hardware_interface::ComponentInfo & joint, std::size_t axis)
{
  if (std::find(command_axes_.begin(), command_axes_.end(), axis) != command_axes_.end()) {
    throw std::invalid_argument("joint " + joint.name + " is given twice; allowed: each joint once");
  }
  if (joint.command_interfaces.size() != 1 || joint.command_interfaces[0].name != "position") {
    std::vector<std::string> found;
    for (const auto & interface : joint.command_interfaces) {
      found.push_back(interface.name);
    }
    throw std::invalid_argument(
      "joint " + joint.name + " has the command interfaces [" + list_of(found) + "]; allowed: position alone");
  }
  command_names_.push_back(joint.name + "/position");
  command_axes_.push_back(axis);
  for (const auto & interface : joint.state_interfaces) {
    const auto state = std::find_if(
      STATES.begin(), STATES.end(), [&](const auto & candidate) {return candidate.first == interface.name;});
    if (state == STATES.end()) {
      throw std::invalid_argument(
        "joint " + joint.name + " has the state interface " + interface.name +
        "; allowed: position, velocity, effort, current, following_error");
    }
    outputs_.push_back({joint.name + "/" + interface.name, axis, state->second});
  }
}

CallbackReturn VirtualAxesSystem::on_init(const InitParams & params)
{
  if (hardware_interface::SystemInterface::on_init(params) != CallbackReturn::SUCCESS) {
    return CallbackReturn::ERROR;
  }
  const hardware_interface::HardwareInfo & info = get_hardware_info();
  command_names_.clear();
  command_axes_.clear();
  outputs_.clear();
  // The framework and other tools have parameters of their own in this block.
  for (const auto & [name, value] : info.hardware_parameters) {
    if (std::find(PARAMETERS.begin(), PARAMETERS.end(), name) == PARAMETERS.end()) {
      RCLCPP_WARN(
        get_logger(), "parameter %s = %s is not read; this plugin reads %s", name.c_str(), value.c_str(),
        list_of(PARAMETERS).c_str());
    }
  }
  try {
    machine_ = parameter(info, "machine");
    controller_ = parameter(info, "controller");
    if (machine_.empty()) {
      throw std::invalid_argument(
        "parameter machine is missing; allowed: name of a built-in machine, as mikron_ucp710, or path of a machine file");
    }
    const bool is_known = std::find(CONTROLLERS.begin(), CONTROLLERS.end(), controller_) != CONTROLLERS.end();
    if (!controller_.empty() && !is_known) {
      throw std::invalid_argument("parameter controller is " + controller_ + "; allowed: " + list_of(CONTROLLERS));
    }
    if (info.joints.empty()) {
      throw std::invalid_argument("the hardware has no joints; allowed: at least one, with the command interface position");
    }
    const SteppedAxes axes(machine_, controller_);
    std::vector<std::string> names;
    for (const auto & joint : info.joints) {
      names.push_back(joint.name);
    }
    const auto numbers = axes.axes_of(names, words_of(parameter(info, "joints")), parameter(info, "joint_prefix"));
    for (std::size_t index = 0; index < numbers.size(); ++index) {
      add_joint(info.joints[index], numbers[index]);
    }
  } catch (const std::exception & error) {
    RCLCPP_ERROR(get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  return CallbackReturn::SUCCESS;
}

CallbackReturn VirtualAxesSystem::on_configure(const rclcpp_lifecycle::State &)
{
  try {
    axes_ = std::make_unique<SteppedAxes>(machine_, controller_);
    commands_ = axes_->rest_positions();
    set_states();
  } catch (const std::exception & error) {
    RCLCPP_ERROR(get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  return CallbackReturn::SUCCESS;
}

CallbackReturn VirtualAxesSystem::on_cleanup(const rclcpp_lifecycle::State &)
{
  is_active_ = false;
  axes_.reset();
  return CallbackReturn::SUCCESS;
}

CallbackReturn VirtualAxesSystem::on_activate(const rclcpp_lifecycle::State &)
{
  try {
    axes_->rest();
    commands_ = axes_->rest_positions();
    for (std::size_t index = 0; index < command_names_.size(); ++index) {
      set_command(command_names_[index], commands_[command_axes_[index]]);
    }
    set_states();
  } catch (const std::exception & error) {
    RCLCPP_ERROR(get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  is_active_ = true;
  return CallbackReturn::SUCCESS;
}

CallbackReturn VirtualAxesSystem::on_deactivate(const rclcpp_lifecycle::State &)
{
  is_active_ = false;
  try {
    axes_->rest();
    set_states();
  } catch (const std::exception & error) {
    RCLCPP_ERROR(get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  return CallbackReturn::SUCCESS;
}

return_type VirtualAxesSystem::prepare_command_mode_switch(
  const std::vector<std::string> & start_interfaces, const std::vector<std::string> &)
{
  for (const auto & name : start_interfaces) {
    // Interfaces of other components are listed too.
    const auto joint = std::find_if(
      info_.joints.begin(), info_.joints.end(),
      [&](const auto & candidate) {return name.rfind(candidate.name + "/", 0) == 0;});
    if (joint != info_.joints.end() && name != joint->name + "/position") {
      RCLCPP_ERROR(
        get_logger(), "command interface %s is not available; allowed: %s/position", name.c_str(),
        joint->name.c_str());
      return return_type::ERROR;
    }
  }
  return return_type::OK;
}

return_type VirtualAxesSystem::perform_command_mode_switch(
  const std::vector<std::string> &, const std::vector<std::string> &)
{
  return return_type::OK;
}

return_type VirtualAxesSystem::read(const rclcpp::Time &, const rclcpp::Duration & period)
{
  if (!is_active_) {
    return return_type::OK;
  }
  try {
    axes_->advance(period.nanoseconds());
    set_states();
  } catch (const std::exception & error) {
    is_active_ = false;
    RCLCPP_ERROR(get_logger(), "%s", error.what());
    return return_type::ERROR;
  }
  return return_type::OK;
}

return_type VirtualAxesSystem::write(const rclcpp::Time &, const rclcpp::Duration &)
{
  if (!is_active_) {
    return return_type::OK;
  }
  try {
    for (std::size_t index = 0; index < command_names_.size(); ++index) {
      commands_[command_axes_[index]] = get_command(command_names_[index]);
    }
    axes_->command(commands_);
  } catch (const std::exception & error) {
    is_active_ = false;
    RCLCPP_ERROR(get_logger(), "%s", error.what());
    return return_type::ERROR;
  }
  return return_type::OK;
}

void VirtualAxesSystem::set_states()
{
  for (const auto & output : outputs_) {
    set_state(output.name, axes_->signals(output.axis).*output.signal);
  }
}

}  // namespace virtual_axes_ros2_control

PLUGINLIB_EXPORT_CLASS(virtual_axes_ros2_control::VirtualAxesSystem, hardware_interface::SystemInterface)
