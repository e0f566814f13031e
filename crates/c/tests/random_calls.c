/* Random calls in any order, with valid, null and invalid arguments: exit status 0 if each returns a documented status.
 *
 *     random_calls SEED CALLS
 *
 * Memory errors and leaks are found by the sanitizers that interface.rs compiles it with. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "virtual_axes.h"

#define SLOTS 3
#define MOST 16

static uint64_t state;

/* xorshift64* */
static uint64_t next(void) {
  state ^= state >> 12;
  state ^= state << 25;
  state ^= state >> 27;
  return state * 0x2545F4914F6CDD1DULL;
}

static size_t below(size_t count) { return (size_t)(next() >> 33) % count; }

static double number(void) {
  static const double special[] = {0, -0.0, 1e-310, 1e308, -1e308, NAN, INFINITY, -INFINITY, 1e-3, 0.5};
  return below(4) ? (double)(int64_t)next() * 1e-21 : special[below(sizeof special / sizeof *special)];
}

static const char *word(void) {
  static const char *const words[] = {
      "mikron_ucp710", "linear_motor_center", "", "x", "x.position_loop.gain", "x.position_loop.controller",
      "y.friction.coulomb", "2.5", "gpc", "cascade", "-1", "1e400", "[1, 2]", "\xff\xfe", "a=b", "periods.position_ms",
      "/dev/null", "/", "x: {y: [", "c.delays.alpha_ms", "12", "3"};
  size_t index = below(sizeof words / sizeof *words + 1);
  return index ? words[index - 1] : NULL;
}

int main(int count, char **arguments) {
  if (count != 3) return 2;
  state = strtoull(arguments[1], NULL, 10) * 2 + 1;
  long calls = strtol(arguments[2], NULL, 10), tally[4] = {0};
  VaMachine *machines[SLOTS] = {0};
  VaState *states[SLOTS] = {0};
  for (long call = 0; call < calls; call++) {
    VaMachine **machine = &machines[below(SLOTS)];
    VaState **saved = &states[below(SLOTS)];
    double values[MOST * 8];
    for (size_t k = 0; k < sizeof values / sizeof *values; k++) values[k] = below(10) ? number() : 0.001;
    /* Mostly a fitting number of values, all finite. */
    size_t axes = va_axis_count(*machine), length = below(5) ? axes : below(MOST);
    if (below(3)) for (size_t k = 0; k < MOST; k++) values[k] = isfinite(values[k]) ? fmod(values[k], 0.01) : 0;
    double *array = below(10) ? values : NULL;
    char text[64];
    VaSignals signals;
    VaStatus status = VA_OK;
    switch (below(17)) {
      case 0:
        if (!*machine) status = va_create(below(2) ? "mikron_ucp710" : word(), machine);
        break;
      case 1:
        if (!*machine) status = va_create_from_text(word(), word(), machine);
        break;
      case 2:
        if (!below(12)) va_destroy(*machine), *machine = NULL;
        break;
      case 3:
      case 4:
        status = va_step(*machine, array, length);
        break;
      case 5:
        status = va_step_for_ns(*machine, below(4) ? 125000 * (1 + below(100)) : next(), array, length);
        break;
      case 6:
        status = va_set_loads(*machine, array, length);
        break;
      case 7:
        status = va_set_preview(*machine, array, axes <= MOST && below(4) ? below(8) : (below(2) ? 0 : SIZE_MAX));
        break;
      case 8:
        status = va_reset(*machine, array, length);
        break;
      case 9:
        status = va_positions(*machine, array, length);
        break;
      case 10:
        status = below(2) ? va_velocities(*machine, array, length) : va_currents(*machine, array, length);
        break;
      case 11:
        status = va_signals(*machine, below(8), below(10) ? &signals : NULL);
        break;
      case 12:
        status = va_set_parameter(*machine, word(), word());
        break;
      case 13:
        status = va_parameter(*machine, word(), below(10) ? text : NULL, below(sizeof text + 1));
        break;
      case 14:
        va_destroy_state(*saved);
        *saved = NULL;
        status = va_save(*machine, below(10) ? saved : NULL);
        break;
      case 15:
        status = va_restore(*machine, *saved);
        break;
      case 16: {
        /* A state through bytes, often damaged. */
        size_t size = 0;
        status = va_state_size(*saved, &size);
        if (status != VA_OK) break;
        uint8_t *bytes = malloc(size);
        status = va_state_write(*saved, bytes, size);
        VaState *read = NULL;
        if (below(3) == 0) bytes[below(size)] ^= 1 << below(8);
        if (status == VA_OK) status = va_state_read(*machine, bytes, below(3) ? size : below(size), &read);
        if (read) status = va_restore(*machine, read);
        va_destroy_state(read);
        free(bytes);
        break;
      }
    }
    if (status > VA_INVALID) {
      fprintf(stderr, "call %ld: status %d: %s\n", call, (int)status, va_last_error());
      return 1;
    }
    if (status != VA_OK && !strlen(va_last_error())) return 1;
    tally[status]++;
  }
  for (int slot = 0; slot < SLOTS; slot++) va_destroy(machines[slot]), va_destroy_state(states[slot]);
  printf("%ld done, %ld null pointers, %ld invalid\n", tally[0], tally[1], tally[2]);
  return 0;
}
