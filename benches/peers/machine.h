/* Parser of the machine table and the setpoints; the discretized motor; the line protocol. */
#ifndef MACHINE_H
#define MACHINE_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "drive.h"

enum { MAX_AXES = 8, MAX_ROWS = 64, MAX_LINE = 4096, LOOKBACK = 16 };

_Noreturn static void fail(const char *what, const char *which) {
  fprintf(stderr, "scalar: %s: %s\n", what, which);
  exit(1);
}

/* Returns the number of a word. */
static double number(const char *word) {
  char *end;
  const double value = strtod(word, &end);
  if (end == word || *end) fail("invalid number", word);
  return value;
}

static FILE *open_text(const char *path) {
  FILE *file = fopen(path, "r");
  if (!file) fail("cannot open", path);
  return file;
}

/* Table of a machine: a row per quantity, a column per axis. */
struct table {
  int axes, rows;
  char joints[MAX_AXES][16];
  char keys[MAX_ROWS][32];
  double values[MAX_ROWS][MAX_AXES];
};

static void read_table(const char *path, struct table *t) {
  char line[MAX_LINE];
  FILE *file = open_text(path);
  memset(t, 0, sizeof *t);
  while (fgets(line, sizeof line, file)) {
    char *key = strtok(line, " \t\n");
    if (!key || *key == '#') continue;
    const int joints = !strcmp(key, "joint");
    if (t->rows == MAX_ROWS) fail("too many rows in", path);
    if (!joints) snprintf(t->keys[t->rows], sizeof t->keys[0], "%s", key);
    int column = 0;
    for (char *word; column < MAX_AXES && (word = strtok(NULL, " \t\n")); column++) {
      if (joints) snprintf(t->joints[column], sizeof t->joints[0], "%s", word);
      else t->values[t->rows][column] = number(word);
    }
    if (joints) t->axes = column;
    else if (column != t->axes) fail("expected one value per joint for", t->keys[t->rows]);
    else t->rows++;
  }
  fclose(file);
}

static double value(const struct table *t, const char *key, int column) {
  for (int row = 0; row < t->rows; row++)
    if (!strcmp(t->keys[row], key)) return t->values[row][column];
  fail("missing in the table:", key);
}

/* exp of a 5 by 5 matrix: Taylor series with scaling and squaring. */
static void matrix_exponential(double a[5][5], double e[5][5]) {
  enum { HALVINGS = 10, TERMS = 16 };
  double term[5][5] = {0}, next[5][5];
  memset(e, 0, 25 * sizeof e[0][0]);
  for (int r = 0; r < 5; r++) term[r][r] = 1.0;
  /* Computes exp(a) - 1, so that squaring keeps the precision of small entries beside the ones. */
  for (int k = 1; k <= TERMS; k++) {
    for (int r = 0; r < 5; r++)
      for (int c = 0; c < 5; c++) {
        next[r][c] = 0.0;
        for (int m = 0; m < 5; m++) next[r][c] += term[r][m] * a[m][c] / (ldexp(1.0, HALVINGS) * k);
      }
    memcpy(term, next, sizeof term);
    for (int r = 0; r < 5; r++)
      for (int c = 0; c < 5; c++) e[r][c] += term[r][c];
  }
  for (int k = 0; k < HALVINGS; k++) {
    for (int r = 0; r < 5; r++)
      for (int c = 0; c < 5; c++) {
        next[r][c] = 2.0 * e[r][c];
        for (int m = 0; m < 5; m++) next[r][c] += e[r][m] * e[m][c];
      }
    memcpy(e, next, sizeof next);
  }
  for (int r = 0; r < 5; r++) e[r][r] += 1.0;
}

static struct delay delay_of(double seconds) {
  const int ticks = (int)lround(seconds / CURRENT_PERIOD);
  const struct delay d = {ticks / TICKS_PER_POSITION, ticks % TICKS_PER_POSITION};
  if (d.periods + 3 > LOOKBACK) fail("a delay is longer than", "the setpoint history");
  /* Before the switch the zero-order hold is one cycle further back; without a switch it is not. */
  return d.step ? (struct delay){d.periods + 1, d.step} : (struct delay){d.periods, TICKS_PER_POSITION};
}

/* An axis of the table, with its position and velocity gain scaled. */
static struct axis axis_of(const struct table *t, int c, double position_scale, double velocity_scale) {
  const double ratio =
      value(t, "rotary", c) ? 1.0 / value(t, "gear_ratio", c) : value(t, "screw_lead_mm", c) * 1e-3 / (2.0 * M_PI);
  const double kt = value(t, "torque_constant_nm_a", c), resistance = value(t, "resistance_ohm", c);
  const double inductance = value(t, "inductance_mh", c) * 1e-3, inertia = value(t, "inertia_kg_m2", c);
  /* i, omega, theta, and the held u and torque. */
  double a[5][5] = {0}, e[5][5];
  a[0][0] = -resistance / inductance * CURRENT_PERIOD;
  a[0][1] = -value(t, "emf_constant_v_s_rad", c) / inductance * CURRENT_PERIOD;
  a[0][3] = 1.0 / inductance * CURRENT_PERIOD;
  a[1][0] = kt / inertia * CURRENT_PERIOD;
  a[1][4] = 1.0 / inertia * CURRENT_PERIOD;
  a[2][1] = CURRENT_PERIOD;
  matrix_exponential(a, e);
  const double kv = value(t, "velocity_gain", c) * velocity_scale, ki = value(t, "current_gain", c);
  return (struct axis){
      .current = {e[0][0], e[0][1], e[0][3], e[0][4]},
      .speed = {e[1][0], e[1][1], e[1][3], e[1][4]},
      .angle = {e[2][0], e[2][1], e[2][3], e[2][4]},
      .inverse_speed_per_torque = 1.0 / e[1][4],
      .ratio = ratio,
      .inverse_ratio = 1.0 / ratio,
      .torque_constant = kt,
      .resistance = resistance,
      .max_speed = value(t, "max_speed_rpm", c) * 2.0 * M_PI / 60.0,
      .velocity_per_speed = value(t, "rotary", c) ? ratio * 60.0 / (2.0 * M_PI) : ratio * 60.0,
      .friction_a = kt * value(t, "friction_a", c),
      .friction_b = value(t, "friction_b", c),
      .friction_c = kt * value(t, "friction_c", c),
      .friction_d = value(t, "friction_d", c),
      .friction_i0 = kt * value(t, "friction_i0", c),
      .weight_torque = ratio * value(t, "weight_n", c),
      .tilt_torque = ratio * value(t, "tilt_nm", c),
      .tilt_phase = value(t, "tilt_phase_deg", c) * M_PI / 180.0,
      .position_gain = value(t, "position_gain", c) * 1000.0 / 60.0 * position_scale,
      .velocity_feedforward = value(t, "velocity_feedforward", c) / POSITION_PERIOD / ratio,
      .torque_feedforward = value(t, "torque_feedforward", c) / (POSITION_PERIOD * POSITION_PERIOD) / ratio,
      .velocity_pi = {kv, kv * VELOCITY_PERIOD / (value(t, "velocity_time_ms", c) * 1e-3), 1.0 / kt,
                      value(t, "max_current_a", c)},
      .current_pi = {ki, ki * CURRENT_PERIOD / (value(t, "current_time_ms", c) * 1e-3), 1.0,
                     value(t, "max_voltage_v", c)},
      .alpha = delay_of(value(t, "alpha_ms", c) * 1e-3),
      .beta = delay_of(value(t, "beta_ms", c) * 1e-3),
      .gamma = delay_of(value(t, "gamma_ms", c) * 1e-3),
  };
}

/* Setpoints of some axes: a row per position cycle. Each axis has its own column, with its first value repeated
 * before its start. */
struct setpoints {
  int axes, count;
  int columns[MAX_AXES]; /* of the table */
  char joints[MAX_AXES][16];
  double *psec[MAX_AXES];
};

static void read_setpoints(const char *path, const struct table *t, struct setpoints *s) {
  char line[MAX_LINE];
  int room = 0;
  FILE *file = open_text(path);
  memset(s, 0, sizeof *s);
  if (!fgets(line, sizeof line, file)) fail("missing first line in", path);
  for (char *word = strtok(line, " \t\n"); word && s->axes < MAX_AXES; word = strtok(NULL, " \t\n")) {
    int column = 0;
    while (column < t->axes && strcmp(t->joints[column], word)) column++;
    if (column == t->axes) fail("unknown joint", word);
    snprintf(s->joints[s->axes], sizeof s->joints[0], "%s", word);
    s->columns[s->axes++] = column;
  }
  while (fgets(line, sizeof line, file)) {
    if (s->count == room) {
      room = room ? 2 * room : 1024;
      for (int a = 0; a < s->axes; a++) {
        s->psec[a] = realloc(s->psec[a] ? s->psec[a] - LOOKBACK : NULL, (room + LOOKBACK) * sizeof(double));
        if (!s->psec[a]) fail("out of memory for", path);
        s->psec[a] += LOOKBACK;
      }
    }
    char *word = strtok(line, " \t\n");
    for (int a = 0; a < s->axes; a++, word = strtok(NULL, " \t\n")) {
      if (!word) fail("expected one value per joint in each row of", path);
      s->psec[a][s->count] = number(word);
    }
    if (word) fail("expected one value per joint in each row of", path);
    s->count++;
  }
  fclose(file);
  if (!s->count) fail("no setpoints in", path);
  for (int a = 0; a < s->axes; a++)
    for (int k = 1; k <= LOOKBACK; k++) s->psec[a][-k] = s->psec[a][0];
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

#endif
