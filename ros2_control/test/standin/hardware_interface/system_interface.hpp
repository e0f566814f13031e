/// Stand-in of hardware_interface::SystemInterface: the calls that the plugin and its host make.
#pragma once

#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#include "hardware_interface/hardware_info.hpp"
#include "hardware_interface/types/hardware_interface_return_values.hpp"
#include "rclcpp/duration.hpp"
#include "rclcpp/logging.hpp"
#include "rclcpp/time.hpp"
#include "rclcpp_lifecycle/node_interfaces/lifecycle_node_interface.hpp"
#include "rclcpp_lifecycle/state.hpp"
#if __has_include("hardware_interface/types/hardware_component_interface_params.hpp")
#include "hardware_interface/types/hardware_component_interface_params.hpp"
#define STANDIN_HAS_INTERFACE_PARAMS 1
#else
#define STANDIN_HAS_INTERFACE_PARAMS 0
#endif

namespace hardware_interface
{

using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

/// Base class whose interfaces exist once they are exported, are NaN until they are set, and throw for unknown names.
class SystemInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface
{
public:
  SystemInterface() = default;
  SystemInterface(const SystemInterface &) = delete;

#if STANDIN_HAS_INTERFACE_PARAMS
  virtual CallbackReturn on_init(const HardwareComponentInterfaceParams & params)
  {
    info_ = params.hardware_info;
    return CallbackReturn::SUCCESS;
  }
#else
  virtual CallbackReturn on_init(const HardwareInfo & info)
  {
    info_ = info;
    return CallbackReturn::SUCCESS;
  }
#endif

  virtual std::vector<std::shared_ptr<const double>> on_export_state_interfaces()
  {
    std::vector<std::shared_ptr<const double>> exported;
    for (const auto & joint : joints()) {
      for (const auto & interface : joint.state_interfaces) {
        exported.push_back(states_[joint.name + "/" + interface.name] = std::make_shared<double>(NAN));
      }
    }
    return exported;
  }

  virtual std::vector<std::shared_ptr<double>> on_export_command_interfaces()
  {
    std::vector<std::shared_ptr<double>> exported;
    for (const auto & joint : joints()) {
      for (const auto & interface : joint.command_interfaces) {
        exported.push_back(commands_[joint.name + "/" + interface.name] = std::make_shared<double>(NAN));
      }
    }
    return exported;
  }

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

  void set_state(const std::string & name, const double & value) {*states_.at(name) = value;}
  double get_state(const std::string & name) const {return *states_.at(name);}
  void set_command(const std::string & name, const double & value) {*commands_.at(name) = value;}
  double get_command(const std::string & name) const {return *commands_.at(name);}
  rclcpp::Logger get_logger() const {return rclcpp::get_logger(info_.name);}
  const HardwareInfo & get_hardware_info() const {return info_;}

protected:
  HardwareInfo info_;

private:
  using Values = std::unordered_map<std::string, std::shared_ptr<double>>;

  /// Returns the joints of a system; a block of another type exports none.
  std::vector<ComponentInfo> joints() const {return info_.type == "system" ? info_.joints : std::vector<ComponentInfo>();}

  Values states_;
  Values commands_;
};

}  // namespace hardware_interface
