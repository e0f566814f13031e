/**
 * C interface of the virtual machine-tool axes.
 *
 * Made from crates/c/src by `cargo run -p virtual_axes_c --example header`. Do not edit it.
 */

#ifndef VIRTUAL_AXES_H
#define VIRTUAL_AXES_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

/**
 * Result of a function.
 */
typedef enum VaStatus {
  /**
   * Done.
   */
  VA_OK = 0,
  /**
   * A pointer that must not be null is null.
   */
  VA_NULL_POINTER = 1,
  /**
   * A value is invalid; the text names it and what is allowed.
   */
  VA_INVALID = 2,
  /**
   * Error of this library. The machine is unusable until `va_reset` or `va_restore`.
   */
  VA_PANIC = 3,
} VaStatus;

/**
 * Mode of a drive.
 */
typedef enum VaDriveMode {
  /**
   * Position control: the axis follows the setpoints `psec`.
   */
  VA_POSITION = 0,
  /**
   * Velocity control: the axis follows the velocities of `va_set_velocities`; 0 is a controlled stop.
   */
  VA_VELOCITY = 1,
  /**
   * Drive off with short-circuited windings: the motor brakes by its back-EMF; the current is not limited.
   */
  VA_SHORT_CIRCUIT = 2,
  /**
   * Drive off, coasting: the motor current is controlled to 0.
   */
  VA_COAST = 3,
} VaDriveMode;

/**
 * Machine with its state.
 */
typedef struct VaMachine VaMachine;

/**
 * State of a machine with its parameters, to return to.
 */
typedef struct VaState VaState;

/**
 * Signals of one axis after a step (Prévost fig. 3).
 *
 * Position, velocity and current are those at the end of the step. Controller outputs are those of the last current cycle
 * Tsi, friction, gravity and load act over it.
 */
typedef struct VaSignals {
  /**
   * PSEC of the present position cycle, m or rad.
   */
  double psec;
  /**
   * PSEC delayed by α, at the input of the position controller, m or rad.
   */
  double delayed_psec;
  /**
   * Position, m or rad.
   */
  double position;
  /**
   * Velocity, m/s or rad/s.
   */
  double velocity;
  /**
   * Motor current, A.
   */
  double current;
  /**
   * Setpoint of the current loop after its limit, A.
   */
  double current_setpoint;
  /**
   * Voltage after its limit, V.
   */
  double voltage;
  /**
   * Ω*, output of the position controller after its limit, rad/s of the motor.
   */
  double velocity_setpoint;
  /**
   * VFFWS, velocity feedforward, rad/s of the motor.
   */
  double velocity_feedforward;
  /**
   * TFFWS, torque feedforward, and friction compensation, N·m at the motor.
   */
  double torque_feedforward;
  /**
   * Friction as motor current, A.
   */
  double friction_current;
  /**
   * Gravity as motor current, A.
   */
  double gravity_current;
  /**
   * External load as motor current, A; positive against motion towards plus, as friction and gravity.
   */
  double load_current;
  /**
   * Force or torque of the motor at the axis, N or N·m.
   */
  double effort;
  /**
   * Following error at the end of the step, `psec − position`, m or rad; it contains the delay α.
   */
  double following_error;
  /**
   * Following error with the delayed setpoint, m or rad.
   */
  double delay_compensated_following_error;
  /**
   * Wind-up of an elastic transmission, position of the motor at the axis minus `position`, m or rad.
   */
  double wind_up;
  /**
   * True if a setpoint is at its limit.
   */
  bool is_saturated;
  /**
   * True if the friction law is extrapolated beyond its fitted range.
   */
  bool is_friction_extrapolated;
} VaSignals;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Returns the text of the last error in the calling thread; empty if there was none.
 *
 * The text is valid until the next call that fails in this thread.
 */
const char *va_last_error(void);

/**
 * Creates a machine at rest at home: `name` is that of a built-in machine or the path of a machine file.
 *
 * `*machine` is null after an error, which names file, line, parameter, value and what is allowed.
 *
 * # Safety
 * `name` is null or a text that ends with a null character, `machine` null or a pointer to a pointer.
 */
enum VaStatus va_create(const char *name,
                        struct VaMachine **machine);

/**
 * Creates a machine as `va_create` does, with changed parameters: `count` texts such as `x.position_loop.gain=2`, in the
 * names and units of the machine file.
 *
 * All of them are set at once, also periods and parameters that need each other. `*machine` is null after an error.
 *
 * # Safety
 * `name` is null or a text that ends with a null character, `assignments` null or a pointer to `count` of them, `machine`
 * null or a pointer to a pointer.
 */
enum VaStatus va_create_with(const char *name,
                             const char *const *assignments,
                             size_t count,
                             struct VaMachine **machine);

/**
 * Creates a machine from the text of a machine file; `source` names it in errors.
 *
 * # Safety
 * `yaml` and `source` are null or texts that end with a null character, `machine` null or a pointer to a pointer.
 */
enum VaStatus va_create_from_text(const char *yaml,
                                  const char *source,
                                  struct VaMachine **machine);

/**
 * Destroys a machine; null is allowed.
 *
 * # Safety
 * `machine` is null or a machine of this library, which is not used any more.
 */
void va_destroy(struct VaMachine *machine);

/**
 * Returns the version of this library.
 */
const char *va_version(void);

/**
 * Returns the number of axes; 0 for null.
 *
 * # Safety
 * `machine` is null or a machine of this library.
 */
size_t va_axis_count(const struct VaMachine *machine);

/**
 * Returns the name of an axis, valid as long as the machine; null if there is no such axis.
 *
 * # Safety
 * `machine` is null or a machine of this library.
 */
const char *va_axis_name(const struct VaMachine *machine, size_t axis);

/**
 * Returns true for a rotary axis, in rad, and false for a linear one, in m, or if there is no such axis.
 *
 * # Safety
 * `machine` is null or a machine of this library.
 */
bool va_axis_is_rotary(const struct VaMachine *machine,
                       size_t axis);

/**
 * Returns the position cycle Tsp, ns: the time between two setpoints; 0 for null.
 *
 * # Safety
 * `machine` is null or a machine of this library.
 */
uint64_t va_position_period_ns(const struct VaMachine *machine);

/**
 * Returns the current cycle Tsi, ns: the shortest step; 0 for null.
 *
 * # Safety
 * `machine` is null or a machine of this library.
 */
uint64_t va_current_period_ns(const struct VaMachine *machine);

/**
 * Sets a parameter and keeps the state (bumpless transfer); `name` and the unit are those of the machine file, as
 * `x.position_loop.gain`, and `value` is a text in YAML.
 *
 * Periods and the axes, their number, order and types, cannot change. Parameters that need each other, as stiffness and
 * load mass of an elastic axis, are given in the machine file: one alone is an error.
 *
 * # Safety
 * `machine` is null or a machine of this library, `name` and `value` are null or texts that end with a null character.
 */
enum VaStatus va_set_parameter(struct VaMachine *machine,
                               const char *name,
                               const char *value);

/**
 * Writes the value of a parameter as text to `value`, with at most `size` bytes including the null character at the end.
 *
 * A text that is longer is an error.
 *
 * # Safety
 * `machine` is null or a machine of this library, `name` null or a text that ends with a null character, `value` null or
 * space for `size` bytes.
 */
enum VaStatus va_parameter(const struct VaMachine *machine,
                           const char *name,
                           char *value,
                           size_t size);

/**
 * Writes the positions at the end of the last step, m or rad, one per axis.
 *
 * # Safety
 * `machine` is null or a machine of this library, `positions` null or space for `count` numbers.
 */
enum VaStatus va_positions(const struct VaMachine *machine, double *positions, size_t count);

/**
 * Writes the velocities at the end of the last step, m/s or rad/s, one per axis.
 *
 * # Safety
 * `machine` is null or a machine of this library, `velocities` null or space for `count` numbers.
 */
enum VaStatus va_velocities(const struct VaMachine *machine, double *velocities, size_t count);

/**
 * Writes the motor currents at the end of the last step, A, one per axis.
 *
 * # Safety
 * `machine` is null or a machine of this library, `currents` null or space for `count` numbers.
 */
enum VaStatus va_currents(const struct VaMachine *machine, double *currents, size_t count);

/**
 * Writes all signals of an axis after the last step.
 *
 * # Safety
 * `machine` is null or a machine of this library, `signals` null or a pointer to a `VaSignals`.
 */
enum VaStatus va_signals(const struct VaMachine *machine, size_t axis, struct VaSignals *signals);

/**
 * Saves the state of a machine; `*state` is null after an error.
 *
 * # Safety
 * `machine` is null or a machine of this library, `state` null or a pointer to a pointer.
 */
enum VaStatus va_save(const struct VaMachine *machine, struct VaState **state);

/**
 * Returns to a saved state, with the parameters, loads and preview of that time; the state can be used again.
 *
 * # Safety
 * `machine` is null or a machine of this library, `state` null or a state of this library.
 */
enum VaStatus va_restore(struct VaMachine *machine,
                         const struct VaState *state);

/**
 * Destroys a state; null is allowed.
 *
 * # Safety
 * `state` is null or a state of this library, which is not used any more.
 */
void va_destroy_state(struct VaState *state);

/**
 * Writes the number of bytes of a state to `size`.
 *
 * # Safety
 * `state` is null or a state of this library, `size` null or a pointer to a number.
 */
enum VaStatus va_state_size(const struct VaState *state, size_t *size);

/**
 * Writes a state with the parameters of its machine to `bytes`, to store it or to read it in another process.
 *
 * `size` must be that of `va_state_size`.
 *
 * # Safety
 * `state` is null or a state of this library, `bytes` null or space for `size` bytes.
 */
enum VaStatus va_state_write(const struct VaState *state,
                             uint8_t *bytes,
                             size_t size);

/**
 * Reads a state that `va_state_write` has written; `*state` is null after an error.
 *
 * `va_restore` returns `machine` to it, with the parameters of that time, and it goes on with the same bits. The axes and
 * periods of the machine must be those of the state. Bytes that are truncated, damaged, or written by another version are
 * an error.
 *
 * # Safety
 * `machine` is null or a machine of this library, `bytes` null or a pointer to `size` bytes, `state` null or a pointer to a
 * pointer.
 */
enum VaStatus va_state_read(const struct VaMachine *machine,
                            const uint8_t *bytes,
                            size_t size,
                            struct VaState **state);

/**
 * Advances by one position cycle with the setpoints `psec`, m or rad, one per axis.
 *
 * Within a position cycle, after `va_step_for_ns`, it advances by the same time.
 *
 * # Safety
 * `machine` is null or a machine of this library, `psec` null or a pointer to `count` numbers.
 */
enum VaStatus va_step(struct VaMachine *machine, const double *psec, size_t count);

/**
 * Advances by a time, ns: any multiple of the current cycle Tsi up to 1000 s.
 *
 * The drives read the setpoints `psec`, m or rad, at the start of each position cycle Tsp and hold them in between.
 * Loads that `va_set_loads` sets act from the start of the step.
 *
 * # Safety
 * `machine` is null or a machine of this library, `psec` null or a pointer to `count` numbers.
 */
enum VaStatus va_step_for_ns(struct VaMachine *machine,
                             uint64_t duration_ns,
                             const double *psec,
                             size_t count);

/**
 * Sets the external loads, N or N·m within ±10⁶, one per axis, positive towards plus; they act from the next step on.
 *
 * # Safety
 * `machine` is null or a machine of this library, `loads` null or a pointer to `count` numbers.
 */
enum VaStatus va_set_loads(struct VaMachine *machine,
                           const double *loads,
                           size_t count);

/**
 * Sets the mode of the drive of an axis, a `VaDriveMode`, from the next position cycle on; `va_reset` returns to
 * `VA_POSITION`.
 *
 * A drive that is off has no holding brake: a vertical axis falls or sinks. When it is switched on, the integrals of its
 * controllers start from 0. The caller lets `psec` follow the position before it switches to `VA_POSITION`.
 *
 * # Safety
 * `machine` is null or a machine of this library.
 */
enum VaStatus va_set_drive_mode(struct VaMachine *machine,
                                size_t axis,
                                uint32_t mode);

/**
 * Sets the velocities, m/s or rad/s within ±10⁶, one per axis, from the next position cycle on: the setpoints of axes in
 * `VA_VELOCITY`; of axes in `VA_POSITION` they are added to the output of the position controller. `va_reset` sets 0.
 *
 * # Safety
 * `machine` is null or a machine of this library, `velocities` null or a pointer to `count` numbers.
 */
enum VaStatus va_set_velocities(struct VaMachine *machine,
                                const double *velocities,
                                size_t count);

/**
 * Returns the number of future setpoints that the controllers read, the largest of all axes; 0 for null.
 *
 * # Safety
 * `machine` is null or a machine of this library.
 */
size_t va_preview_length(const struct VaMachine *machine);

/**
 * Sets the setpoints of the `cycles` position cycles after the next one, m or rad, axis by axis, which predictive
 * controllers read; 0 cycles remove them.
 *
 * The preview is read at the start of each position cycle until it is set again: the caller sets it before each. Beyond
 * it, controllers read its last setpoint, without a preview the present one.
 *
 * # Safety
 * `machine` is null or a machine of this library, `preview` null or a pointer to `cycles` numbers for each axis.
 */
enum VaStatus va_set_preview(struct VaMachine *machine,
                             const double *preview,
                             size_t cycles);

/**
 * Puts the axes at rest at `positions`, m or rad, one per axis, or at home if it is null, at time 0.
 *
 * Loads and preview are removed, parameters kept.
 *
 * # Safety
 * `machine` is null or a machine of this library, `positions` null or a pointer to `count` numbers.
 */
enum VaStatus va_reset(struct VaMachine *machine,
                       const double *positions,
                       size_t count);

/**
 * Returns the simulated time since the start or the last reset, ns; 0 for null.
 *
 * # Safety
 * `machine` is null or a machine of this library.
 */
uint64_t va_time_ns(const struct VaMachine *machine);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* VIRTUAL_AXES_H */
