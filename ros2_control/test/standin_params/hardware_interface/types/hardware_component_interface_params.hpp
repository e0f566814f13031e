/// Stand-in of the parameters of on_init. Without this folder the stand-ins are those of an older ros2_control.
#pragma once

#include "hardware_interface/hardware_info.hpp"

namespace hardware_interface
{
struct HardwareComponentInterfaceParams
{
  HardwareInfo hardware_info;
};
}
