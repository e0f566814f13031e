/// Stand-in of the results of read and write.
#pragma once

namespace hardware_interface
{
enum class return_type { OK, ERROR };
}
