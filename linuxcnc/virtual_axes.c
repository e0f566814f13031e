/* HAL component virtual_axes: the simulated feed drives of a machine behind the pins of LinuxCNC.
 *
 *     loadrt virtual_axes machine=vmc set=periods.position_ms=1 off=stop control=position
 *     addf virtual-axes.read servo-thread       (before motion-controller: steps the drives, writes the outputs)
 *     addf virtual-axes.write servo-thread      (after motion-controller: takes the commands)
 *
 * Units of the pins: mm, mm/s, N for a linear axis, degrees, degrees/s, N·m for a rotary one; A for currents. */
#include <errno.h>

#include "hal.h"
#include "rtapi.h"
#include "rtapi_app.h"
#include <string.h>
#include "virtual_axes.h"

MODULE_DESCRIPTION("Simulated feed drives: position and velocity commands in, positions out");
MODULE_LICENSE("Apache-2.0");

#define MAX_AXES 16
#define MAX_CHANGES 64

static char *machine = "vmc";
RTAPI_MP_STRING(machine, "built-in machine or path of a machine file");
static char *set[MAX_CHANGES];
RTAPI_MP_ARRAY_STRING(set, MAX_CHANGES, "parameters, as x.position_loop.gain=2");
static char *off = "stop";
RTAPI_MP_STRING(off, "drive off: stop, brake (short circuit) or coast");
static char *control = "position";
RTAPI_MP_STRING(control, "commands of an enabled drive: position (cmd) or velocity (vel-cmd)");

typedef struct {
  hal_float_t *cmd, *vel_cmd, *load;
  hal_bit_t *enable;
  hal_float_t *fb, *vel, *current, *effort, *following_error, *wind_up;
  hal_bit_t *saturated;
} axis_pins;

typedef struct {
  axis_pins axis[MAX_AXES];
  hal_bit_t *fault;
  hal_u32_t *steps;
} component_pins;

static int component;
static component_pins *pins;
static VaMachine *drives;
static int axes;
static VaDriveMode mode_on, mode_off;
/* Units of the pins per m or rad. */
static double scale[MAX_AXES], unit[MAX_AXES];
static double setpoints[MAX_AXES];
/* Until the drives are first enabled, the axes are at rest and the feedback follows the command. */
static int is_started;

static void report(VaStatus status) {
  if (status != VA_OK && !*pins->fault) {
    rtapi_print_msg(RTAPI_MSG_ERR, "virtual_axes: %s\n", va_last_error());
    *pins->fault = 1;
  }
}

static void write_outputs(void) {
  for (int k = 0; k < axes; k++) {
    axis_pins *axis = &pins->axis[k];
    VaSignals signals;
    va_signals(drives, k, &signals);
    *axis->fb = signals.position * scale[k];
    *axis->vel = signals.velocity * scale[k];
    *axis->current = signals.current;
    *axis->effort = signals.effort;
    *axis->following_error = signals.following_error * scale[k];
    *axis->wind_up = signals.wind_up * scale[k];
    *axis->saturated = signals.is_saturated;
  }
}

/* Steps the drives by the period of the thread with the commands that were taken last. */
static void read_drives(void *unused, long period) {
  (void)unused;
  if (!is_started || *pins->fault) return;
  report(va_step_for_ns(drives, period, setpoints, axes));
  if (*pins->fault) return;
  *pins->steps += 1;
  write_outputs();
}

/* Takes the commands for the next step. */
static void write_drives(void *unused, long period) {
  (void)unused;
  (void)period;
  double velocities[MAX_AXES] = {0}, loads[MAX_AXES];
  int is_enabled = 0;
  if (*pins->fault) return;
  for (int k = 0; k < axes; k++) {
    axis_pins *axis = &pins->axis[k];
    setpoints[k] = *axis->cmd * unit[k];
    loads[k] = *axis->load;
    if (*axis->enable && mode_on == VA_VELOCITY) velocities[k] = *axis->vel_cmd * unit[k];
    is_enabled |= *axis->enable;
  }
  if (!is_started && is_enabled) {
    report(va_reset(drives, setpoints, axes));
    write_outputs();
    is_started = 1;
  }
  if (!is_started) {
    for (int k = 0; k < axes; k++) *pins->axis[k].fb = *pins->axis[k].cmd;
    return;
  }
  report(va_set_loads(drives, loads, axes));
  report(va_set_velocities(drives, velocities, axes));
  for (int k = 0; k < axes; k++) report(va_set_drive_mode(drives, k, *pins->axis[k].enable ? mode_on : mode_off));
}

static int axis_pins_new(int k) {
  axis_pins *axis = &pins->axis[k];
  const struct { hal_pin_dir_t dir; hal_float_t **pin; const char *name; } floats[] = {
      {HAL_IN, &axis->cmd, "cmd"}, {HAL_IN, &axis->vel_cmd, "vel-cmd"}, {HAL_IN, &axis->load, "load"},
      {HAL_OUT, &axis->fb, "fb"}, {HAL_OUT, &axis->vel, "vel"}, {HAL_OUT, &axis->current, "current"},
      {HAL_OUT, &axis->effort, "effort"}, {HAL_OUT, &axis->following_error, "following-error"},
      {HAL_OUT, &axis->wind_up, "wind-up"}};
  for (unsigned i = 0; i < sizeof floats / sizeof *floats; i++) {
    int status = hal_pin_float_newf(floats[i].dir, floats[i].pin, component, "virtual-axes.%d.%s", k, floats[i].name);
    if (status) return status;
  }
  int status = hal_pin_bit_newf(HAL_IN, &axis->enable, component, "virtual-axes.%d.enable", k);
  return status ? status : hal_pin_bit_newf(HAL_OUT, &axis->saturated, component, "virtual-axes.%d.saturated", k);
}

/* Sets `value` to that of the word `given`; returns 0 if it is one of the words. */
static int choose(const char *name, const char *given, const char *const *words, const VaDriveMode *modes,
                  VaDriveMode *value) {
  for (int i = 0; words[i]; i++) {
    if (!strcmp(given, words[i])) {
      *value = modes[i];
      return 0;
    }
  }
  rtapi_print_msg(RTAPI_MSG_ERR, "virtual_axes: %s=%s is unknown; allowed: %s, %s%s%s\n", name, given, words[0],
                  words[1], words[2] ? ", " : "", words[2] ? words[2] : "");
  return -1;
}

static int create(void) {
  static const char *const off_words[] = {"stop", "brake", "coast", NULL};
  static const VaDriveMode off_modes[] = {VA_VELOCITY, VA_SHORT_CIRCUIT, VA_COAST};
  static const char *const control_words[] = {"position", "velocity", NULL};
  static const VaDriveMode control_modes[] = {VA_POSITION, VA_VELOCITY};
  if (choose("off", off, off_words, off_modes, &mode_off)) return -EINVAL;
  if (choose("control", control, control_words, control_modes, &mode_on)) return -EINVAL;
  int changes = 0;
  while (changes < MAX_CHANGES && set[changes]) changes++;
  if (va_create_with(machine, (const char *const *)set, changes, &drives) != VA_OK) {
    rtapi_print_msg(RTAPI_MSG_ERR, "virtual_axes: %s\n", va_last_error());
    return -EINVAL;
  }
  axes = va_axis_count(drives);
  if (axes > MAX_AXES) {
    rtapi_print_msg(RTAPI_MSG_ERR, "virtual_axes: machine=%s has %d axes; at most %d are allowed\n", machine, axes,
                    MAX_AXES);
    return -EINVAL;
  }
  const double pi = 3.14159265358979323846;
  for (int k = 0; k < axes; k++) {
    scale[k] = va_axis_is_rotary(drives, k) ? 180.0 / pi : 1000.0;
    unit[k] = va_axis_is_rotary(drives, k) ? pi / 180.0 : 0.001;
  }
  return 0;
}

static int export(void) {
  pins = hal_malloc(sizeof *pins);
  if (!pins) return -ENOMEM;
  int status = 0;
  for (int k = 0; k < axes && !status; k++) status = axis_pins_new(k);
  if (!status) status = hal_pin_bit_newf(HAL_OUT, &pins->fault, component, "virtual-axes.fault");
  if (!status) status = hal_pin_u32_newf(HAL_OUT, &pins->steps, component, "virtual-axes.steps");
  if (!status) status = hal_export_funct("virtual-axes.read", read_drives, NULL, 1, 0, component);
  if (!status) status = hal_export_funct("virtual-axes.write", write_drives, NULL, 1, 0, component);
  return status;
}

int rtapi_app_main(void) {
  component = hal_init("virtual_axes");
  if (component < 0) return component;
  int status = create();
  if (!status) status = export();
  if (!status) return hal_ready(component);
  va_destroy(drives);
  hal_exit(component);
  return status;
}

void rtapi_app_exit(void) {
  hal_exit(component);
  va_destroy(drives);
}
