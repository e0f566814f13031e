/// Axes of one machine, advanced by the elapsed time of a control loop; needs the C interface alone, not ROS.
#ifndef VIRTUAL_AXES_ROS2_CONTROL__STEPPED_AXES_HPP_
#define VIRTUAL_AXES_ROS2_CONTROL__STEPPED_AXES_HPP_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "virtual_axes.h"

namespace virtual_axes_ros2_control
{

/// Longest time between two calls that is simulated, ns; a longer pause of the caller counts as this one.
constexpr std::int64_t MAX_PERIOD_NS = 1'000'000'000;

/// Throws the text of the last error of the C interface unless `status` is VA_OK.
inline void check(VaStatus status)
{
  if (status != VA_OK) {
    throw std::runtime_error(va_last_error());
  }
}

/// Returns the words of a text, separated by spaces, line ends or commas.
inline std::vector<std::string> words_of(const std::string & text)
{
  const char * separators = ", \t\r\n";
  std::vector<std::string> words;
  std::size_t end = 0;
  while ((end = text.find_first_not_of(separators, end)) != std::string::npos) {
    const std::size_t start = end;
    end = text.find_first_of(separators, start);
    words.push_back(text.substr(start, end - start));
  }
  return words;
}

/// Returns the names in one text, separated by commas.
inline std::string list_of(const std::vector<std::string> & names)
{
  std::string text;
  for (const auto & name : names) {
    text += (text.empty() ? "" : ", ") + name;
  }
  return text;
}

/// Machine that follows commands given at the cycles of a control loop with any period.
///
/// The drives sample their position setpoint at each position cycle Tsp of their own clock. A setpoint is the linear
/// interpolation of the two commands around that time, so that it depends on the commanded motion and not on the rate
/// of the loop. `advance` goes as far as setpoints are known, `command` continues to the present time.
class SteppedAxes
{
public:
  /// Creates the axes of a built-in machine or a machine file, at rest at home.
  ///
  /// `controller` is cascade, gpc or rst, for all axes, or empty: as in the machine file.
  SteppedAxes(const std::string & machine, const std::string & controller)
  : machine_(create(machine), va_destroy),
    position_period_ns_(static_cast<std::int64_t>(va_position_period_ns(machine_.get()))),
    current_period_ns_(static_cast<std::int64_t>(va_current_period_ns(machine_.get())))
  {
    const std::size_t count = va_axis_count(machine_.get());
    for (std::size_t axis = 0; axis < count; ++axis) {
      names_.emplace_back(va_axis_name(machine_.get(), axis));
      if (!controller.empty()) {
        const std::string parameter = names_.back() + ".position_loop.controller";
        check(va_set_parameter(machine_.get(), parameter.c_str(), controller.c_str()));
      }
    }
    setpoints_.resize(count);
    positions_.resize(count);
    rest();
  }

  /// Returns the names of the axes.
  const std::vector<std::string> & names() const {return names_;}

  /// Returns the positions at the last call of `rest`, m or rad, one per axis.
  const std::vector<double> & rest_positions() const {return positions_;}

  /// Returns the simulated time since the last call of `rest`, ns.
  std::int64_t time_ns() const {return time_ns_;}

  /// Returns the axis of each joint.
  ///
  /// `joints` has the joint names of all axes in the order of the machine; empty: `prefix` and the name of the axis.
  /// Throws std::invalid_argument for a name that is not there, a wrong number of names, or a name given twice.
  std::vector<std::size_t> axes_of(
    const std::vector<std::string> & found, const std::vector<std::string> & joints, const std::string & prefix) const
  {
    std::vector<std::string> allowed = joints;
    if (joints.empty()) {
      for (const auto & name : names_) {
        allowed.push_back(prefix + name);
      }
    } else if (joints.size() != names_.size()) {
      throw std::invalid_argument(
        "parameter joints has " + std::to_string(joints.size()) + " names; allowed: one for each of the axes " +
        list_of(names_));
    }
    std::vector<std::string> sorted = allowed;
    std::sort(sorted.begin(), sorted.end());
    const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
    if (twice != sorted.end()) {
      throw std::invalid_argument("parameter joints has " + *twice + " twice; allowed: each name once");
    }
    std::vector<std::size_t> axes;
    for (const auto & joint : found) {
      const auto place = std::find(allowed.begin(), allowed.end(), joint);
      if (place == allowed.end()) {
        throw std::invalid_argument("joint " + joint + " is no axis of the machine; allowed: " + list_of(allowed));
      }
      axes.push_back(static_cast<std::size_t>(place - allowed.begin()));
    }
    return axes;
  }

  /// Puts the axes at rest at their present positions, at time 0, with these positions as commands.
  void rest()
  {
    check(va_positions(machine_.get(), positions_.data(), positions_.size()));
    check(va_reset(machine_.get(), positions_.data(), positions_.size()));
    setpoints_ = positions_;
    commands_ = positions_;
    elapsed_ns_ = commanded_ns_ = time_ns_ = 0;
    known_until_ns_ = position_period_ns_;
  }

  /// Adds `period_ns` to the elapsed time and advances the axes to it, at most to the next position cycle, whose setpoint
  /// depends on the next command. Negative periods count as 0, and `MAX_PERIOD_NS` is the longest.
  void advance(std::int64_t period_ns)
  {
    elapsed_ns_ += std::clamp<std::int64_t>(period_ns, 0, MAX_PERIOD_NS);
    step();
  }

  /// Takes the commands at the elapsed time, m or rad, one per axis, samples the setpoints of the position cycles up to
  /// it, and advances the axes to it. A command that is not finite keeps the last one of the axis.
  void command(const std::vector<double> & commands)
  {
    const double interval = static_cast<double>(elapsed_ns_ - commanded_ns_);
    step();
    while (known_until_ns_ <= elapsed_ns_) {
      const bool is_present = known_until_ns_ == elapsed_ns_;
      const double fraction = is_present ? 1.0 : static_cast<double>(known_until_ns_ - commanded_ns_) / interval;
      for (std::size_t axis = 0; axis < commands_.size(); ++axis) {
        const double wanted = finite(commands, axis);
        setpoints_[axis] = is_present ? wanted : commands_[axis] + fraction * (wanted - commands_[axis]);
      }
      known_until_ns_ += position_period_ns_;
      step();
    }
    for (std::size_t axis = 0; axis < commands_.size(); ++axis) {
      commands_[axis] = finite(commands, axis);
    }
    commanded_ns_ = elapsed_ns_;
  }

  /// Returns the signals of an axis at `time_ns`.
  VaSignals signals(std::size_t axis) const
  {
    VaSignals signals;
    check(va_signals(machine_.get(), axis, &signals));
    return signals;
  }

private:
  static VaMachine * create(const std::string & name)
  {
    VaMachine * machine = nullptr;
    check(va_create(name.c_str(), &machine));
    return machine;
  }

  /// Returns the command of an axis, or its last one if that is not finite.
  double finite(const std::vector<double> & commands, std::size_t axis) const
  {
    return std::isfinite(commands.at(axis)) ? commands[axis] : commands_[axis];
  }

  /// Advances by whole current cycles Tsi, to the elapsed time or the end of the known setpoint.
  void step()
  {
    const std::int64_t end = std::min(elapsed_ns_, known_until_ns_);
    const std::int64_t duration = (end - time_ns_) / current_period_ns_ * current_period_ns_;
    if (duration > 0) {
      check(va_step_for_ns(
        machine_.get(), static_cast<std::uint64_t>(duration), setpoints_.data(), setpoints_.size()));
      time_ns_ += duration;
    }
  }

  std::unique_ptr<VaMachine, void (*)(VaMachine *)> machine_;
  std::int64_t position_period_ns_;
  std::int64_t current_period_ns_;
  std::vector<std::string> names_;
  std::vector<double> positions_;
  /// Setpoints of the present position cycle.
  std::vector<double> setpoints_;
  /// Commands at `commanded_ns_`.
  std::vector<double> commands_;
  std::int64_t elapsed_ns_ = 0;
  std::int64_t commanded_ns_ = 0;
  std::int64_t time_ns_ = 0;
  /// End of the position cycle of `setpoints_`.
  std::int64_t known_until_ns_ = 0;
};

}  // namespace virtual_axes_ros2_control

#endif  // VIRTUAL_AXES_ROS2_CONTROL__STEPPED_AXES_HPP_
