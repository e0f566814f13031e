/// Stand-in of hardware_interface::SystemInterface (ros2_control of ROS 2 Jazzy): the calls that the plugin makes.
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#include "hardware_interface/types/hardware_interface_return_values.hpp"
#include "rclcpp/duration.hpp"
#include "rclcpp/logging.hpp"
#include "rclcpp/time.hpp"
#include "rclcpp_lifecycle/state.hpp"

namespace hardware_interface
{

enum class CallbackReturn { SUCCESS, FAILURE, ERROR };

struct InterfaceInfo
{
  std::string name;
};

struct ComponentInfo
{
  std::string name;
  std::vector<InterfaceInfo> command_interfaces;
  std::vector<InterfaceInfo> state_interfaces;
};

struct HardwareInfo
{
  std::string name;
  std::unordered_map<std::string, std::string> hardware_parameters;
  std::vector<ComponentInfo> joints;
};

/// Base class with interfaces that are NaN until they are set, and unknown names that throw, as in ros2_control.
class SystemInterface
{
public:
  virtual ~SystemInterface() = default;

  virtual CallbackReturn on_init(const HardwareInfo & info)
  {
    info_ = info;
    for (const auto & joint : info.joints) {
      for (const auto & interface : joint.state_interfaces) {
        states_[joint.name + "/" + interface.name] = NAN;
      }
      for (const auto & interface : joint.command_interfaces) {
        values_[joint.name + "/" + interface.name] = NAN;
      }
    }
    return CallbackReturn::SUCCESS;
  }

  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) {return CallbackReturn::SUCCESS;}
  virtual CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) {return CallbackReturn::SUCCESS;}
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) {return CallbackReturn::SUCCESS;}
  virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) {return CallbackReturn::SUCCESS;}

  virtual return_type prepare_command_mode_switch(
    const std::vector<std::string> &, const std::vector<std::string> &)
  {
    return return_type::OK;
  }

  virtual return_type perform_command_mode_switch(
    const std::vector<std::string> &, const std::vector<std::string> &)
  {
    return return_type::OK;
  }

  virtual return_type read(const rclcpp::Time & time, const rclcpp::Duration & period) = 0;
  virtual return_type write(const rclcpp::Time & time, const rclcpp::Duration & period) = 0;

  void set_state(const std::string & name, double value) {states_.at(name) = value;}
  double get_state(const std::string & name) const {return states_.at(name);}
  void set_command(const std::string & name, double value) {values_.at(name) = value;}
  double get_command(const std::string & name) const {return values_.at(name);}
  rclcpp::Logger get_logger() const {return {};}

protected:
  HardwareInfo info_;

private:
  std::unordered_map<std::string, double> states_;
  std::unordered_map<std::string, double> values_;
};

}  // namespace hardware_interface
