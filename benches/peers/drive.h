/* One feed drive and its cascade: parameters, state, and the operations of a tick.
 *
 * A plain scalar form of the equations of docs/internals/performance.md: no SIMD intrinsics, no approximation of
 * exp or sin. All functions are inlined into the loop of scalar.c; constants are computed once.
 * SI units; motor quantities in rad and N·m.
 */
#ifndef DRIVE_H
#define DRIVE_H

#include <math.h>

enum { TICKS_PER_POSITION = 48, TICKS_PER_VELOCITY = 2 };
static const double POSITION_PERIOD = 6e-3, VELOCITY_PERIOD = 250e-6, CURRENT_PERIOD = 125e-6;

/* A row of the discretized motor: the weights of i, omega, u and the held torque. */
struct row {
  double current, speed, voltage, torque;
};

/* A PI controller whose output is divided by `scale`, then limited. */
struct pi {
  double gain, integral_gain, inverse_scale, limit;
};

/* Delay of the zero-order-held setpoints: at tick `step` of a cycle it changes from `periods` cycles to one less. */
struct delay {
  int periods, step;
};

/* Constants of an axis. */
struct axis {
  struct row current, speed, angle; /* exact zero-order hold over a tick */
  double inverse_speed_per_torque;
  double ratio, inverse_ratio; /* m or rad of the axis per rad of the motor */
  double torque_constant, resistance, max_speed;
  double velocity_per_speed; /* unit of the friction law (m/min, rev/min) per rad/s of the motor */
  double friction_a, friction_b, friction_c, friction_d, friction_i0; /* a, c and i0 as torques */
  double weight_torque, tilt_torque, tilt_phase;
  double position_gain;
  double velocity_feedforward, torque_feedforward; /* per difference, and per second difference, of setpoints */
  struct pi velocity_pi, current_pi;
  struct delay alpha, beta, gamma;
};

/* State of an axis. */
struct state {
  double i, omega, theta;
  double velocity_integral, current_integral;
  double velocity_setpoint, current_setpoint, voltage;
  double feedforward_velocity[2], feedforward_torque[2]; /* before and after the switch of their delay */
  int speed_limited, current_limited, voltage_limited;
};

static inline double position_of(const struct axis *p, const struct state *s) { return s->theta * p->ratio; }

static inline double gravity(const struct axis *p, double position) {
  if (p->tilt_torque == 0.0) return p->weight_torque;
  return p->weight_torque + p->tilt_torque * sin(position + p->tilt_phase);
}

static inline double clamp(double value, double limit) {
  return value > limit ? limit : value < -limit ? -limit : value;
}

/* The integral is updated before its use, and held where the output is limited and the error would increase it
 * further (anti-windup). */
static inline double pi_update(const struct pi *p, double *integral, int *limited, double error, double feedforward) {
  const double sum = *integral + p->integral_gain * error;
  const double unlimited = (p->gain * error + sum + feedforward) * p->inverse_scale;
  const double output = clamp(unlimited, p->limit);
  *limited = unlimited != output;
  if (!(*limited && error * (unlimited - output) > 0.0)) *integral = sum;
  return output;
}

/* At rest at `position`, held against gravity. */
static inline struct state at_rest(const struct axis *p, double position) {
  struct state s = {0};
  const double torque = gravity(p, position);
  s.theta = position * p->inverse_ratio;
  s.i = torque / p->torque_constant;
  s.velocity_integral = torque;
  s.current_integral = p->resistance * s.i;
  return s;
}

/* Position cycle. `psec` points to the setpoint of the new cycle; the previous ones precede it in memory. */
static inline void control_position(const struct axis *p, struct state *s, const double *psec) {
  const double delayed = psec[-(p->alpha.periods)];
  const double unlimited = p->position_gain * (delayed * p->inverse_ratio - s->theta);
  s->velocity_setpoint = clamp(unlimited, p->max_speed);
  s->speed_limited = unlimited != s->velocity_setpoint;
  for (int after = 0; after < 2; after++) {
    const double *v = psec - p->beta.periods + after, *t = psec - p->gamma.periods + after;
    s->feedforward_velocity[after] = p->velocity_feedforward * (v[0] - v[-1]);
    s->feedforward_torque[after] = p->torque_feedforward * ((t[0] - t[-1]) - (t[-1] - t[-2]));
  }
}

/* Instant of the velocity loop, at `tick` of the position cycle. */
static inline void control_velocity(const struct axis *p, struct state *s, int tick) {
  const double velocity = s->feedforward_velocity[tick >= p->beta.step];
  const double torque = s->feedforward_torque[tick >= p->gamma.step];
  const double error = s->velocity_setpoint + velocity - s->omega;
  s->current_setpoint = pi_update(&p->velocity_pi, &s->velocity_integral, &s->current_limited, error, torque);
}

static inline void control_current(const struct axis *p, struct state *s) {
  const double error = s->current_setpoint - s->i;
  s->voltage = pi_update(&p->current_pi, &s->current_integral, &s->voltage_limited, error, 0.0);
}

/* Maximum friction torque at a motor speed. */
static inline double friction_bound(const struct axis *p, double omega) {
  if (omega == 0.0) return p->friction_i0;
  const double v = fabs(omega) * p->velocity_per_speed;
  const double bound = p->friction_a * exp(p->friction_b * v) + p->friction_c * exp(p->friction_d * v);
  return bound > 0.0 ? bound : 0.0;
}

static inline double row_times(const struct row *r, const struct state *s, double torque) {
  return r->current * s->i + r->speed * s->omega + r->voltage * s->voltage + r->torque * torque;
}

/* Advances the plant by a tick. Friction is the torque that ends the tick at standstill, limited to its maximum. */
static inline void move(const struct axis *p, struct state *s) {
  const double external = -gravity(p, position_of(p, s));
  const double bound = friction_bound(p, s->omega);
  const double stopping = row_times(&p->speed, s, external) * p->inverse_speed_per_torque;
  const double friction = clamp(stopping, bound);
  const double torque = external - friction;
  const double i = row_times(&p->current, s, torque);
  const double omega = row_times(&p->speed, s, torque);
  s->theta += row_times(&p->angle, s, torque);
  s->i = i;
  s->omega = friction == stopping ? 0.0 : omega;
}

#endif
