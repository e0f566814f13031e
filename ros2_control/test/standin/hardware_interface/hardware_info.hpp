/// Stand-in of the hardware block of a URDF.
#pragma once

#include <string>
#include <unordered_map>
#include <vector>

namespace hardware_interface
{

struct InterfaceInfo
{
  std::string name;
  std::string data_type = "double";
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
  std::string type;
  std::unordered_map<std::string, std::string> hardware_parameters;
  std::vector<ComponentInfo> joints;
};

}  // namespace hardware_interface
