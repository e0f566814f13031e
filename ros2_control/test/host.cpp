/// Host that makes the calls of the controller manager: configure, activate, then read, update and write in a loop.
///
/// `host motion` prints lines of a name and a number; `host errors` prints the log of rejected hardware blocks.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include "virtual_axes_ros2_control/virtual_axes_system.hpp"

namespace
{

using hardware_interface::CallbackReturn;
using hardware_interface::return_type;
using rclcpp_lifecycle::State;
using virtual_axes_ros2_control::InitParams;
using virtual_axes_ros2_control::VirtualAxesSystem;

constexpr std::size_t AXES = 5;
constexpr std::int64_t TSP_NS = 6'000'000;
constexpr std::int64_t DURATION_NS = 60'000'000'000;
const std::array<std::string, AXES> NAMES = {"x", "y", "z", "a", "c"};
const std::array<std::string, 5> SIGNALS = {"position", "velocity", "effort", "current", "following_error"};
using Row = std::array<double, AXES * 5>;
using Motion = std::map<std::int64_t, Row>;

/// Returns the commanded position: a circular motion that starts at rest, 20 mm or 0.2 rad.
double wanted(std::size_t axis, std::int64_t time_ns)
{
  const double angle = 3.0 * 1e-9 * static_cast<double>(time_ns);
  const double amplitude = axis < 3 ? 0.02 : 0.2;
  return amplitude / static_cast<double>(1 + axis % 3) * (1.0 - std::cos(angle));
}

hardware_interface::InterfaceInfo interface(const std::string & name)
{
  hardware_interface::InterfaceInfo info{};
  info.name = name;
  return info;
}

hardware_interface::HardwareInfo mill()
{
  hardware_interface::HardwareInfo info{};
  info.name = "mill";
  info.type = "system";
  info.hardware_parameters = {{"machine", "mikron_ucp710"}};
  for (const auto & name : NAMES) {
    hardware_interface::ComponentInfo joint{};
    joint.name = name;
    joint.command_interfaces = {interface("position")};
    for (const auto & signal : SIGNALS) {
      joint.state_interfaces.push_back(interface(signal));
    }
    info.joints.push_back(joint);
  }
  return info;
}

void require(bool condition, const char * text)
{
  if (!condition) {
    std::fprintf(stderr, "host: %s\n", text);
    std::exit(1);
  }
}

/// Calls `on_init` with a hardware block, in the parameters where the release has them.
template <typename Params = InitParams>
CallbackReturn init(VirtualAxesSystem & system, const hardware_interface::HardwareInfo & info)
{
  Params params;
  if constexpr (std::is_same_v<Params, hardware_interface::HardwareInfo>) {
    params = info;
  } else {
    params.hardware_info = info;
  }
  return system.on_init(params);
}

/// Initializes, exports the interfaces, configures and activates, as the resource manager does.
void start(VirtualAxesSystem & system, const hardware_interface::HardwareInfo & info)
{
  require(init(system, info) == CallbackReturn::SUCCESS, "on_init");
  require(system.on_export_state_interfaces().size() == AXES * SIGNALS.size(), "on_export_state_interfaces");
  require(system.on_export_command_interfaces().size() == AXES, "on_export_command_interfaces");
  require(system.on_configure(State()) == CallbackReturn::SUCCESS, "on_configure");
  require(system.on_activate(State()) == CallbackReturn::SUCCESS, "on_activate");
}

return_type read(VirtualAxesSystem & system, std::int64_t time_ns, std::int64_t period_ns)
{
  return system.read(rclcpp::Time(time_ns), rclcpp::Duration::from_nanoseconds(period_ns));
}

return_type write(VirtualAxesSystem & system, std::int64_t time_ns, std::int64_t period_ns)
{
  return system.write(rclcpp::Time(time_ns), rclcpp::Duration::from_nanoseconds(period_ns));
}

/// Runs the loop and returns the states at the position cycles.
Motion run(std::int64_t period_ns)
{
  VirtualAxesSystem system;
  start(system, mill());
  std::vector<std::string> commands;
  for (const auto & name : NAMES) {
    require(system.get_command(name + "/position") == 0.0, "commands are positions after on_activate");
    commands.push_back(name + "/position");
  }
  require(system.prepare_command_mode_switch(commands, {}) == return_type::OK, "prepare_command_mode_switch");
  require(system.perform_command_mode_switch(commands, {}) == return_type::OK, "perform_command_mode_switch");
  Motion motion;
  for (std::int64_t now = period_ns; now <= DURATION_NS; now += period_ns) {
    require(read(system, now, period_ns) == return_type::OK, "read");
    // The state is that at the present time, or at the position cycle since the last call.
    const std::int64_t cycle = now / TSP_NS * TSP_NS;
    if (cycle > now - period_ns) {
      Row & row = motion[cycle];
      for (std::size_t axis = 0; axis < AXES; ++axis) {
        for (std::size_t signal = 0; signal < 5; ++signal) {
          row[5 * axis + signal] = system.get_state(NAMES[axis] + "/" + SIGNALS[signal]);
        }
      }
    }
    for (std::size_t axis = 0; axis < AXES; ++axis) {
      system.set_command(NAMES[axis] + "/position", wanted(axis, now));
    }
    require(write(system, now, period_ns) == return_type::OK, "write");
  }
  require(system.get_state("x/velocity") != 0.0, "the axis moves");
  const double position = system.get_state("x/position");
  require(system.on_deactivate(State()) == CallbackReturn::SUCCESS, "on_deactivate");
  require(system.get_state("x/velocity") == 0.0, "an axis is at rest after on_deactivate");
  require(system.get_state("x/position") == position, "an axis keeps its position in on_deactivate");
  require(system.on_cleanup(State()) == CallbackReturn::SUCCESS, "on_cleanup");
  return motion;
}

/// Returns the states of the same motion by the C interface alone, one position cycle a step.
Motion reference()
{
  VaMachine * machine = nullptr;
  require(va_create("mikron_ucp710", &machine) == VA_OK, "va_create");
  Motion motion;
  for (std::int64_t now = 0; now < DURATION_NS; now += TSP_NS) {
    std::array<double, AXES> psec;
    for (std::size_t axis = 0; axis < AXES; ++axis) {
      psec[axis] = wanted(axis, now);
    }
    require(va_step(machine, psec.data(), AXES) == VA_OK, "va_step");
    Row & row = motion[now + TSP_NS];
    for (std::size_t axis = 0; axis < AXES; ++axis) {
      VaSignals s;
      require(va_signals(machine, axis, &s) == VA_OK, "va_signals");
      const std::array<double, 5> values = {s.position, s.velocity, s.effort, s.current, s.following_error};
      std::copy(values.begin(), values.end(), row.begin() + static_cast<std::ptrdiff_t>(5 * axis));
    }
  }
  va_destroy(machine);
  return motion;
}

/// Prints the number of compared times, of different states, and the largest differences of the setpoints and positions.
void compare(const char * name, const Motion & found, const Motion & wanted)
{
  std::size_t count = 0, different = 0;
  std::array<double, AXES> setpoints{}, positions{};
  for (const auto & [time, row] : found) {
    const auto place = wanted.find(time);
    if (place == wanted.end()) {
      continue;
    }
    ++count;
    different += std::memcmp(row.data(), place->second.data(), sizeof(Row)) != 0;
    for (std::size_t axis = 0; axis < AXES; ++axis) {
      const double position = row[5 * axis] - place->second[5 * axis];
      const double error = row[5 * axis + 4] - place->second[5 * axis + 4];
      positions[axis] = std::fmax(positions[axis], std::fabs(position));
      setpoints[axis] = std::fmax(setpoints[axis], std::fabs(position + error));
    }
  }
  std::printf("%s %zu %zu", name, count, different);
  for (const auto & largest : {setpoints, positions}) {
    for (const double value : largest) {
      std::printf(" %.6e", value);
    }
  }
  std::printf("\n");
}

/// Checks that a hardware block is rejected; the log has the reason.
void rejected(const hardware_interface::HardwareInfo & info)
{
  VirtualAxesSystem system;
  require(init(system, info) == CallbackReturn::ERROR, "this block must be rejected");
}

void errors()
{
  for (const auto & [name, value] : std::vector<std::pair<std::string, std::string>>{
      {"machine", ""}, {"machine", "nowhere.yaml"}, {"controller", "pid"}, {"joints", "x y"},
      {"joints", "x, x, z, a, c"}, {"joint_prefix", "left_"}})
  {
    auto info = mill();
    info.hardware_parameters[name] = value;
    rejected(info);
  }
  auto info = mill();
  info.joints[1].command_interfaces = {interface("velocity")};
  rejected(info);
  info = mill();
  info.joints[2].state_interfaces.push_back(interface("acceleration"));
  rejected(info);
  info = mill();
  info.joints.push_back(info.joints[0]);
  rejected(info);
  info = mill();
  info.joints.clear();
  rejected(info);
  info = mill();
  info.hardware_parameters["machine"] = "\n  mikron_ucp710 ";
  info.hardware_parameters["controler"] = "gpc";
  VirtualAxesSystem system;
  start(system, info);
  require(system.prepare_command_mode_switch({"x/velocity"}, {}) == return_type::ERROR, "velocity is rejected");
  require(system.prepare_command_mode_switch({"gripper/effort"}, {}) == return_type::OK, "other hardware");
  // Without a command, and with one that is not finite, the axes stay; a long pause is cut.
  system.set_command("x/position", std::nan(""));
  for (const std::int64_t period : {2'000'000L, -5L, 0L, 3'600'000'000'000L}) {
    require(read(system, 0, period) == return_type::OK, "read");
    require(write(system, 0, period) == return_type::OK, "write");
  }
  require(std::fabs(system.get_state("x/position")) < 1e-9, "the axis stays");
  // The built-in machine has no polynomials for rst.
  for (const std::string controller : {"cascade", "gpc", "rst"}) {
    auto with = mill();
    with.hardware_parameters["controller"] = controller;
    with.hardware_parameters["joints"] = "m1, m2, m3, m4, m5";
    with.joints.resize(1);
    with.joints[0].name = "m2";
    VirtualAxesSystem other;
    require((init(other, with) == CallbackReturn::SUCCESS) == (controller != "rst"), controller.c_str());
  }
}

}  // namespace

int main(int count, char ** words)
{
  if (count == 2 && std::strcmp(words[1], "errors") == 0) {
    errors();
    return 0;
  }
  const Motion at_1000 = run(1'000'000);
  compare("1000_and_c", at_1000, reference());
  compare("500_and_1000", run(2'000'000), at_1000);
  compare("167_and_1000", run(1'000'000'000 / 167), at_1000);
}
