/* The model of docs/internals/performance.md as a scalar C loop, with its figures: the reference of the comparison.
 *
 *     gcc -O3 -march=native -ffast-math -o scalar scalar.c -lm
 *     scalar TABLE SETPOINTS [--circle RADIUS FIRST LAST] [--machines COUNT] [--positions]
 *
 * TABLE is a file such as mikron_ucp710.txt. SETPOINTS is text: names of the axes, then a row of
 * setpoints (m, rad) for each position cycle. --circle adds the radial deviation of the first two axes from a
 * circle about (-RADIUS, 0), at every tick of the position cycles FIRST up to LAST. --machines runs COUNT machines
 * with different gains one after the other. --positions prints the positions at position cycles and exits.
 *
 * Each line "run N" on standard input makes N runs; the response is a line of JSON with seconds per run and figures.
 *
 * -ffast-math permits contraction, reordering and vectorization. The loop over ticks processes several axes, so that
 * the processor overlaps their chains of dependent operations: for five axes this is a fifth faster than one axis
 * after the other.
 */
#include "machine.h"

/* Accumulated figures of an axis. */
struct figures {
  double max_tracking, max_delay_compensated, square_tracking, square_delay_compensated;
  double peak_current, square_activity, last_current_setpoint;
  long saturated_ticks;
};

/* Radial deviation from a circle, in a window of position cycles. */
struct circle {
  double radius;
  int first, last;
  double sum, min, max;
  long count;
};

struct machine {
  int axes;
  struct axis axis[MAX_AXES];
  struct state state[MAX_AXES];
  struct figures figures[MAX_AXES];
  struct circle circle;
};

static inline void assess_instant(struct figures *f, const struct axis *p, const struct state *s, const double *psec,
                                  int k) {
  const double position = position_of(p, s);
  const double tracking = psec[0] - position, delay_compensated = psec[-p->alpha.periods] - position;
  f->max_tracking = fmax(f->max_tracking, fabs(tracking));
  f->max_delay_compensated = fmax(f->max_delay_compensated, fabs(delay_compensated));
  f->square_tracking += tracking * tracking;
  f->square_delay_compensated += delay_compensated * delay_compensated;
  const double change = s->current_setpoint - f->last_current_setpoint;
  if (k > 0) f->square_activity += change * change;
  f->last_current_setpoint = s->current_setpoint;
}

static inline void assess_tick(struct figures *f, const struct state *s) {
  f->peak_current = fmax(f->peak_current, fabs(s->i));
  f->saturated_ticks += s->speed_limited | s->current_limited | s->voltage_limited;
}

static inline void assess_circle(struct circle *c, double x, double y) {
  const double deviation = sqrt((x + c->radius) * (x + c->radius) + y * y) - c->radius;
  c->sum += deviation;
  c->min = fmin(c->min, deviation);
  c->max = fmax(c->max, deviation);
  c->count++;
}

/* Tick `t` of position cycle `k` of an axis: the loops that are due, the figures, the plant. */
static inline void step(const struct axis *p, struct state *s, struct figures *f, const double *psec, int k, int t) {
  if (t == 0) control_position(p, s, psec);
  if (t % TICKS_PER_VELOCITY == 0) control_velocity(p, s, t);
  control_current(p, s);
  if (t == 0) assess_instant(f, p, s, psec, k);
  assess_tick(f, s);
  move(p, s);
}

/* Position cycle of a machine with one axis: its state can stay in registers. */
static void period_of_one(const struct axis *p, struct state *state, struct figures *figures, const double *psec, int k) {
  struct state s = *state;
  struct figures f = *figures;
  for (int t = 0; t < TICKS_PER_POSITION; t++) step(p, &s, &f, psec, k, t);
  *state = s;
  *figures = f;
}

static void period_of_all(struct machine *m, const struct setpoints *sp, int k) {
  const int on_circle = m->circle.first <= k && k < m->circle.last;
  for (int t = 0; t < TICKS_PER_POSITION; t++) {
    if (on_circle)
      assess_circle(&m->circle, position_of(&m->axis[0], &m->state[0]), position_of(&m->axis[1], &m->state[1]));
    for (int a = 0; a < m->axes; a++) step(&m->axis[a], &m->state[a], &m->figures[a], sp->psec[a] + k, k, t);
  }
}

static void run(struct machine *m, const struct setpoints *sp, FILE *positions) {
  for (int a = 0; a < m->axes; a++) {
    m->state[a] = at_rest(&m->axis[a], sp->psec[a][0]);
    m->figures[a] = (struct figures){0};
  }
  m->circle.sum = 0.0;
  m->circle.count = 0;
  m->circle.min = HUGE_VAL;
  m->circle.max = -HUGE_VAL;
  for (int k = 0; k < sp->count; k++) {
    if (positions)
      for (int a = 0; a < m->axes; a++)
        fprintf(positions, "%.17g%c", position_of(&m->axis[a], &m->state[a]), a + 1 < m->axes ? ' ' : '\n');
    if (m->axes == 1) period_of_one(&m->axis[0], &m->state[0], &m->figures[0], sp->psec[0] + k, k);
    else period_of_all(m, sp, k);
  }
}

static void print_figures(const struct machine *m, const struct setpoints *sp) {
  const double n = sp->count, changes = n > 1 ? n - 1 : 1;
  printf("\"axes\": {");
  for (int a = 0; a < m->axes; a++) {
    const struct figures *f = &m->figures[a];
    printf("%s\"%s\": {\"max_following_error\": %.17g, \"rms_following_error\": %.17g, "
           "\"max_delay_compensated_following_error\": %.17g, \"rms_delay_compensated_following_error\": %.17g, "
           "\"peak_current\": %.17g, \"saturation_time\": %.17g, \"control_activity\": %.17g, \"position\": %.17g}",
           a ? ", " : "", sp->joints[a], f->max_tracking, sqrt(f->square_tracking / n), f->max_delay_compensated,
           sqrt(f->square_delay_compensated / n), f->peak_current, f->saturated_ticks * CURRENT_PERIOD,
           sqrt(f->square_activity / changes), position_of(&m->axis[a], &m->state[a]));
  }
  printf("}");
  if (m->circle.count)
    printf(", \"circle\": {\"mean\": %.17g, \"min\": %.17g, \"max\": %.17g}", m->circle.sum / m->circle.count,
           m->circle.min, m->circle.max);
}

/* Returns -1 to 1 over the machines of a sweep; 0 for a single one. */
static double place(int index, int count) { return count > 1 ? 2.0 * index / (count - 1) - 1.0 : 0.0; }

int main(int argc, char **argv) {
  /* Relative range of Kp and Kv over the machines of a sweep. */
  const double position_spread = 0.2, velocity_spread = 0.1;
  if (argc < 3) fail("usage", "scalar TABLE SETPOINTS [--circle RADIUS FIRST LAST] [--machines COUNT] [--positions]");
  struct table table;
  struct setpoints setpoints;
  struct circle circle = {0};
  int count = 1, positions = 0;
  read_table(argv[1], &table);
  read_setpoints(argv[2], &table, &setpoints);
  for (int arg = 3; arg < argc; arg++) {
    if (!strcmp(argv[arg], "--circle") && arg + 3 < argc && setpoints.axes >= 2) {
      circle.radius = number(argv[arg + 1]);
      circle.first = number(argv[arg + 2]);
      circle.last = number(argv[arg + 3]);
      arg += 3;
    } else if (!strcmp(argv[arg], "--machines") && arg + 1 < argc) {
      count = number(argv[++arg]);
    } else if (!strcmp(argv[arg], "--positions")) {
      positions = 1;
    } else {
      fail("unknown argument, or missing values of", argv[arg]);
    }
  }
  if (count < 1) fail("machines", "must be at least 1");
  struct machine *machines = calloc(count, sizeof *machines);
  if (!machines) fail("out of memory for", "the machines");
  for (int m = 0; m < count; m++) {
    const double x = place(m, count);
    machines[m].axes = setpoints.axes;
    machines[m].circle = circle;
    for (int a = 0; a < setpoints.axes; a++)
      machines[m].axis[a] =
          axis_of(&table, setpoints.columns[a], 1.0 + position_spread * x, 1.0 - velocity_spread * x);
  }
  if (positions) {
    run(&machines[0], &setpoints, stdout);
    return 0;
  }

  char line[MAX_LINE];
  int runs;
  while (fgets(line, sizeof line, stdin) && sscanf(line, "run %d", &runs) == 1 && runs > 0) {
    const double began = now();
    for (int r = 0; r < runs; r++)
      for (int m = 0; m < count; m++) run(&machines[m], &setpoints, NULL);
    printf("{\"seconds\": %.9g, \"machines\": [", (now() - began) / runs);
    for (int m = 0; m < count; m++) {
      printf("%s{", m ? ", " : "");
      print_figures(&machines[m], &setpoints);
      printf("}");
    }
    printf("]}\n");
    fflush(stdout);
  }
  return 0;
}
