/// Stand-in of the results of read and write.
#pragma once

#include <cstdint>

namespace hardware_interface
{
enum class return_type : std::uint8_t { OK = 0, ERROR = 1, DEACTIVATE = 2 };
}
