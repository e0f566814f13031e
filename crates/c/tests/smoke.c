/* Calls of the C interface from C, as a user writes them: exit status 0 if all have the documented results.
 *
 * Run by interface.rs, and under valgrind and a sanitizer by tools/check_c_interface.sh. Prints the positions of a motion
 * as hexadecimal numbers, one line per position cycle, which interface.rs compares with the library. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "virtual_axes.h"

#define AXES 5
#define CYCLES 300

static int failures;

#define CHECK(condition)                                                                     \
  do {                                                                                       \
    if (!(condition)) {                                                                      \
      fprintf(stderr, "line %d: %s; last error: %s\n", __LINE__, #condition, va_last_error()); \
      failures++;                                                                            \
    }                                                                                        \
  } while (0)

static void setpoints(int cycle, double *psec) {
  for (int axis = 0; axis < AXES; axis++) {
    psec[axis] = (axis < 3 ? 0.01 : 0.2) * (cycle < 150 ? cycle / 150.0 : 1.0) / (axis + 1);
  }
}

/* A bad call has its status and a text that contains `word`. */
static void check_error(VaStatus found, VaStatus wanted, const char *word) {
  CHECK(found == wanted);
  CHECK(strstr(va_last_error(), word) != NULL);
}

static void bad_calls(VaMachine *machine) {
  double values[AXES] = {0};
  char text[64];
  VaMachine *none = (VaMachine *)1;
  VaSignals signals;

  check_error(va_create(NULL, &none), VA_NULL_POINTER, "name");
  CHECK(none == NULL);
  check_error(va_create("mikron", &none), VA_INVALID, "mikron_ucp710");
  CHECK(none == NULL);
  check_error(va_create("mikron_ucp710", NULL), VA_NULL_POINTER, "machine");
  check_error(va_create_from_text("x: [", "part.yaml", &none), VA_INVALID, "part.yaml");
  check_error(va_create_from_text("\xff", "part.yaml", &none), VA_INVALID, "UTF-8");
  check_error(va_step(NULL, values, AXES), VA_NULL_POINTER, "machine");
  check_error(va_step(machine, NULL, AXES), VA_NULL_POINTER, "psec");
  check_error(va_step(machine, values, AXES - 1), VA_INVALID, "it needs 5");
  check_error(va_step_for_ns(machine, 1, values, AXES), VA_INVALID, "125000");
  check_error(va_step_for_ns(machine, 0, values, AXES), VA_INVALID, "duration_ns");
  check_error(va_step_for_ns(machine, UINT64_MAX - UINT64_MAX % 125000, values, AXES), VA_INVALID, "up to");
  values[2] = 1e308;
  check_error(va_step(machine, values, AXES), VA_INVALID, "psec[2] is 1e308; it must lie in");
  check_error(va_reset(machine, values, AXES), VA_INVALID, "positions[2]");
  check_error(va_set_preview(machine, values, 1), VA_INVALID, "preview[2]");
  values[2] = NAN;
  check_error(va_step(machine, values, AXES), VA_INVALID, "psec[2]");
  check_error(va_set_loads(machine, values, AXES), VA_INVALID, "loads[2]");
  check_error(va_set_velocities(machine, values, AXES), VA_INVALID, "velocities[2]");
  check_error(va_set_drive_mode(machine, AXES, VA_COAST), VA_INVALID, "below 5");
  check_error(va_set_drive_mode(machine, 0, 4), VA_INVALID, "mode is 4; it must be a VaDriveMode, 0 to 3");
  const char *period[] = {"periods.position_ms=0.3"}, *gain[] = {"x.position_loop.gian=2", NULL};
  check_error(va_create_with("mikron_ucp710", period, 1, &none), VA_INVALID, "periods.position_ms");
  check_error(va_create_with("mikron_ucp710", gain, 1, &none), VA_INVALID, "x.position_loop.gain");
  check_error(va_create_with("mikron_ucp710", gain, 2, &none), VA_NULL_POINTER, "assignments[1]");
  check_error(va_create_with("mikron_ucp710", NULL, 1, &none), VA_NULL_POINTER, "assignments");
  check_error(va_reset(machine, values, AXES), VA_INVALID, "positions[2]");
  check_error(va_set_preview(machine, NULL, 3), VA_NULL_POINTER, "preview");
  check_error(va_set_preview(machine, values, SIZE_MAX), VA_INVALID, "cycles");
  check_error(va_positions(machine, values, 4), VA_INVALID, "positions");
  check_error(va_positions(machine, NULL, AXES), VA_NULL_POINTER, "positions");
  check_error(va_signals(machine, AXES, &signals), VA_INVALID, "below 5");
  check_error(va_signals(machine, 0, NULL), VA_NULL_POINTER, "signals");
  check_error(va_set_parameter(machine, "x.position_loop.gian", "2"), VA_INVALID, "x.position_loop.gain");
  check_error(va_set_parameter(machine, "x.position_loop.gain", "-2"), VA_INVALID, "x.position_loop.gain");
  check_error(va_set_parameter(machine, "periods.position_ms", "3"), VA_INVALID, "periods");
  check_error(va_set_parameter(machine, "", "2"), VA_INVALID, "parameter \"\" is unknown");
  check_error(va_set_parameter(machine, "joints", "[y, x, z, a, c]"), VA_INVALID, "joints = [y, x, z, a, c]: the axes");
  check_error(va_set_parameter(machine, "joints", "[x, y, z]"), VA_INVALID, "the axes of a machine cannot change");
  CHECK(va_set_parameter(machine, "joints", "[x, y, z, a, c]") == VA_OK);
  check_error(va_set_parameter(machine, "x.transmission.stiffness_n_um", "150"), VA_INVALID, "load_mass_kg");
  check_error(va_parameter(machine, "x.position_loop.gain", text, 1), VA_INVALID, "size");
  check_error(va_parameter(machine, "x.position_loop.gian", text, sizeof text), VA_INVALID, "unknown");
  check_error(va_save(machine, NULL), VA_NULL_POINTER, "state");
  check_error(va_restore(machine, NULL), VA_NULL_POINTER, "state");
  size_t size = 0;
  VaState *state = NULL;
  check_error(va_state_size(NULL, &size), VA_NULL_POINTER, "state");
  check_error(va_state_write(NULL, (uint8_t *)text, 1), VA_NULL_POINTER, "state");
  check_error(va_state_read(machine, NULL, 1, &state), VA_NULL_POINTER, "bytes");
  check_error(va_state_read(machine, (const uint8_t *)text, sizeof text, NULL), VA_NULL_POINTER, "state");
  check_error(va_state_read(machine, (const uint8_t *)text, sizeof text, &state), VA_INVALID, "no state");
  check_error(va_state_read(machine, (const uint8_t *)text, SIZE_MAX, &state), VA_INVALID, "size");
  CHECK(va_axis_count(NULL) == 0 && va_axis_name(NULL, 0) == NULL && va_axis_name(machine, AXES) == NULL);
  CHECK(va_time_ns(NULL) == 0 && va_preview_length(NULL) == 0 && va_position_period_ns(NULL) == 0);
  va_destroy(NULL);
  va_destroy_state(NULL);
}

/* Writes a state to bytes and destroys it; reads it into another machine, which has other parameters. */
static VaMachine *copy_by_bytes(VaState *state) {
  size_t size = 0;
  CHECK(va_state_size(state, &size) == VA_OK && size > 1000);
  uint8_t *bytes = malloc(size);
  check_error(va_state_write(state, bytes, size - 1), VA_INVALID, "va_state_size");
  check_error(va_state_write(state, NULL, size), VA_NULL_POINTER, "bytes");
  CHECK(va_state_write(state, bytes, size) == VA_OK);
  va_destroy_state(state);
  VaMachine *copy = NULL;
  CHECK(va_create("linear_motor_center", &copy) == VA_OK);
  check_error(va_state_read(copy, bytes, size, &state), VA_INVALID, "other axes or periods");
  va_destroy(copy);
  CHECK(va_create("mikron_ucp710", &copy) == VA_OK);
  CHECK(va_set_parameter(copy, "x.position_loop.gain", "3") == VA_OK);
  check_error(va_state_read(copy, bytes, size - 1, &state), VA_INVALID, "truncated or damaged");
  CHECK(!state);
  bytes[size / 2] ^= 1;
  check_error(va_state_read(copy, bytes, size, &state), VA_INVALID, "truncated or damaged");
  bytes[size / 2] ^= 1;
  CHECK(va_state_read(copy, bytes, size, &state) == VA_OK && state);
  CHECK(va_restore(copy, state) == VA_OK);
  va_destroy_state(state);
  free(bytes);
  return copy;
}

int main(void) {
  VaMachine *machine = NULL;
  CHECK(va_create("mikron_ucp710", &machine) == VA_OK);
  if (!machine) return 1;
  CHECK(strlen(va_version()) > 0);
  CHECK(va_axis_count(machine) == AXES);
  CHECK(strcmp(va_axis_name(machine, 3), "a") == 0);
  CHECK(va_axis_is_rotary(machine, 3) && !va_axis_is_rotary(machine, 0));
  CHECK(va_position_period_ns(machine) == 6000000 && va_current_period_ns(machine) == 125000);

  double psec[AXES], position[AXES], other[AXES];
  for (int cycle = 0; cycle < CYCLES; cycle++) {
    setpoints(cycle, psec);
    CHECK(va_step(machine, psec, AXES) == VA_OK);
    CHECK(va_positions(machine, position, AXES) == VA_OK);
    for (int axis = 0; axis < AXES; axis++) printf("%a%c", position[axis], axis + 1 < AXES ? ' ' : '\n');
  }
  CHECK(va_time_ns(machine) == CYCLES * va_position_period_ns(machine));
  bad_calls(machine);

  /* Nothing has changed. */
  CHECK(va_positions(machine, other, AXES) == VA_OK);
  CHECK(memcmp(position, other, sizeof position) == 0);

  /* A saved state and the same steps, in parts of 0.5 ms. */
  VaState *state = NULL;
  CHECK(va_save(machine, &state) == VA_OK && state);
  double loads[AXES] = {200, 0, 0, 5, 0};
  psec[0] += 0.0001;
  CHECK(va_set_loads(machine, loads, AXES) == VA_OK);
  CHECK(va_set_parameter(machine, "x.position_loop.gain", "2") == VA_OK);
  CHECK(va_step(machine, psec, AXES) == VA_OK);
  CHECK(va_positions(machine, position, AXES) == VA_OK);
  CHECK(va_restore(machine, state) == VA_OK);
  char gain[32];
  CHECK(va_parameter(machine, "x.position_loop.gain", gain, sizeof gain) == VA_OK && strcmp(gain, "2") != 0);
  CHECK(va_set_loads(machine, loads, AXES) == VA_OK);
  CHECK(va_set_parameter(machine, "x.position_loop.gain", "2") == VA_OK);
  for (int part = 0; part < 12; part++) CHECK(va_step_for_ns(machine, 500000, psec, AXES) == VA_OK);
  CHECK(va_positions(machine, other, AXES) == VA_OK);
  CHECK(memcmp(position, other, sizeof position) == 0);

  /* The state within a position cycle as bytes, in another machine. */
  CHECK(va_step_for_ns(machine, 375000, psec, AXES) == VA_OK);
  VaState *part = NULL;
  CHECK(va_save(machine, &part) == VA_OK);
  VaMachine *copy = copy_by_bytes(part);
  for (int cycle = 0; cycle < 50; cycle++) {
    psec[1] += 0.0001;
    CHECK(va_step_for_ns(machine, 6125000, psec, AXES) == VA_OK && va_positions(machine, position, AXES) == VA_OK);
    CHECK(va_step_for_ns(copy, 6125000, psec, AXES) == VA_OK && va_positions(copy, other, AXES) == VA_OK);
    CHECK(memcmp(position, other, sizeof position) == 0);
  }
  CHECK(va_time_ns(copy) == va_time_ns(machine));
  va_destroy(copy);

  VaSignals signals;
  CHECK(va_signals(machine, 0, &signals) == VA_OK);
  CHECK(signals.position == other[0] && signals.psec == psec[0] && signals.load_current != 0);
  double velocity[AXES], current[AXES];
  CHECK(va_velocities(machine, velocity, AXES) == VA_OK && signals.velocity == velocity[0]);
  CHECK(va_currents(machine, current, AXES) == VA_OK && signals.current == current[0]);

  /* A machine with 1 ms for the position cycle: X moves under velocity control, stops, and is under position control again. */
  const char *changes[] = {"periods.position_ms=1", "x.delays.alpha_ms=0"};
  VaMachine *fast = NULL;
  CHECK(va_create_with("mikron_ucp710", changes, 2, &fast) == VA_OK && va_position_period_ns(fast) == 1000000);
  double speeds[AXES] = {0.05};
  memset(psec, 0, sizeof psec);
  CHECK(va_set_drive_mode(fast, 0, VA_VELOCITY) == VA_OK && va_set_velocities(fast, speeds, AXES) == VA_OK);
  CHECK(va_step_for_ns(fast, 1000000000, psec, AXES) == VA_OK && va_velocities(fast, velocity, AXES) == VA_OK);
  CHECK(fabs(velocity[0] - 0.05) < 1e-9 && velocity[1] == 0);
  speeds[0] = 0;
  CHECK(va_set_velocities(fast, speeds, AXES) == VA_OK && va_step_for_ns(fast, 300000000, psec, AXES) == VA_OK);
  CHECK(va_positions(fast, position, AXES) == VA_OK && fabs(position[0] - 0.05) < 0.002);
  psec[0] = position[0];
  CHECK(va_set_drive_mode(fast, 0, VA_POSITION) == VA_OK && va_step_for_ns(fast, 300000000, psec, AXES) == VA_OK);
  CHECK(va_positions(fast, other, AXES) == VA_OK && fabs(position[0] - other[0]) < 1e-6);
  CHECK(va_set_drive_mode(fast, 0, VA_COAST) == VA_OK && va_step(fast, psec, AXES) == VA_OK);
  CHECK(va_signals(fast, 0, &signals) == VA_OK && signals.current_setpoint == 0 && !signals.is_saturated);
  va_destroy(fast);

  CHECK(va_reset(machine, NULL, 0) == VA_OK && va_time_ns(machine) == 0);
  CHECK(va_positions(machine, position, AXES) == VA_OK && position[0] == 0);
  va_destroy_state(state);
  va_destroy(machine);
  if (failures) fprintf(stderr, "%d failures\n", failures);
  return failures != 0;
}
