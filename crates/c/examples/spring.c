#include <stdio.h>
#include "virtual_axes.h"

int main(void) {
  VaMachine *machine = NULL;
  if (va_create("mikron_ucp710", &machine) != VA_OK) {
    fprintf(stderr, "%s\n", va_last_error());
    return 1;
  }
  double psec[5] = {0.001, 0, 0, 0, 0}, position[5], loads[5] = {0};
  for (int step = 0; step < 2000; step++) {
    va_positions(machine, position, 5);
    loads[0] = -1e6 * position[0];
    va_set_loads(machine, loads, 5);
    va_step_for_ns(machine, 500000, psec, 5);
  }
  va_positions(machine, position, 5);
  printf("%.9f mm\n", 1000 * position[0]);
  va_destroy(machine);
}
