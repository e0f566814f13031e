/* Steps a machine through the setpoints on standard input and prints positions, velocities and currents.
 *
 *     replay MACHINE.yaml < SETPOINTS
 *
 * A line of SETPOINTS has a number per axis; predictive controllers see the following lines. Numbers are hexadecimal on both
 * sides, so that no digit is lost. */
#include <stdio.h>
#include <stdlib.h>

#include "virtual_axes.h"

#define AXES 5
#define MOST_PREVIEW 256

static void print(const double *values) {
  for (int axis = 0; axis < AXES; axis++) {
    printf("%a ", values[axis]);
  }
}

int main(int argc, char **argv) {
  VaMachine *machine = NULL;
  if (argc != 2 || va_create(argv[1], &machine) != VA_OK || va_axis_count(machine) != AXES) {
    fprintf(stderr, "replay MACHINE.yaml: %s\n", va_last_error());
    return 2;
  }
  size_t rows = 0, space = 1024;
  double(*psec)[AXES] = malloc(space * sizeof *psec);
  for (size_t read = 0; psec != NULL; read++) {
    if (rows == space) {
      psec = realloc(psec, (space *= 2) * sizeof *psec);
      if (psec == NULL) {
        return 3;
      }
    }
    if (scanf("%la", &psec[rows][read % AXES]) != 1) {
      break;
    }
    rows += read % AXES == AXES - 1;
  }
  if (rows == 0 || va_reset(machine, psec[0], AXES) != VA_OK) {
    fprintf(stderr, "no start: %s\n", va_last_error());
    return 5;
  }
  size_t ahead = va_preview_length(machine);
  double preview[AXES * MOST_PREVIEW];
  if (ahead > MOST_PREVIEW) {
    return 4;
  }
  for (size_t row = 0; row < rows; row++) {
    for (size_t axis = 0; axis < AXES; axis++) {
      for (size_t cycle = 0; cycle < ahead; cycle++) {
        size_t next = row + 1 + cycle < rows ? row + 1 + cycle : rows - 1;
        preview[axis * ahead + cycle] = psec[next][axis];
      }
    }
    double position[AXES], velocity[AXES], current[AXES];
    if ((ahead > 0 && va_set_preview(machine, preview, ahead) != VA_OK) || va_step(machine, psec[row], AXES) != VA_OK ||
        va_positions(machine, position, AXES) != VA_OK || va_velocities(machine, velocity, AXES) != VA_OK ||
        va_currents(machine, current, AXES) != VA_OK) {
      fprintf(stderr, "row %zu: %s\n", row, va_last_error());
      return 1;
    }
    print(position);
    print(velocity);
    print(current);
    printf("\n");
  }
  free(psec);
  va_destroy(machine);
  return 0;
}
