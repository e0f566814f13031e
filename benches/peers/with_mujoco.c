/* The single-axis case in MuJoCo, in C against the library of its PyPI wheel: no Python in the loop.
 *
 *     gcc -O3 -march=native -ffast-math -I WHEEL/include -o with_mujoco with_mujoco.c -lm WHEEL/libmujoco.so.4.0.0
 *     with_mujoco TABLE SETPOINTS STEPS
 *
 * A hinge with a `dcmotor` actuator (voltage in, current as its activation), stepped by mj_step, STEPS times in each
 * 125 us, with all unused features disabled. MuJoCo's motor has one constant K = sqrt(Kt Ke); with s = sqrt(Kt/Ke)
 * its current is s i and its voltage s u; all other quantities are equal.
 *
 * Not part of MuJoCo: the cascade with its rates, limits and delays (drive.h), called before each step; the friction
 * law, applied as an external torque and limited to the torque that stops the axis within MuJoCo's step (its constraint
 * solver would be slower). Difference: MuJoCo integrates by semi-implicit Euler, the model has the exact step, so that
 * MuJoCo needs more STEPS for the same error. Figures: the largest delay-compensated following error and current only.
 */
#include <mujoco/mujoco.h>

#include "machine.h"

int main(int argc, char **argv) {
  const int steps = argc == 4 ? atoi(argv[3]) : 0;
  if (steps < 1) fail("usage", "with_mujoco TABLE SETPOINTS STEPS");
  const double timestep = CURRENT_PERIOD / steps;
  struct table table;
  struct setpoints setpoints;
  read_table(argv[1], &table);
  read_setpoints(argv[2], &table, &setpoints);
  if (setpoints.axes != 1) fail("expected one axis in", argv[2]);
  const int column = setpoints.columns[0];
  const struct axis p = axis_of(&table, column, 1.0, 1.0);
  const double inertia = value(&table, "inertia_kg_m2", column), kt = p.torque_constant;
  const double scale = sqrt(kt / value(&table, "emf_constant_v_s_rad", column));

  char xml[2048], error[512] = "";
  snprintf(xml, sizeof xml,
           "<mujoco><option timestep='%.9g' integrator='Euler'><flag constraint='disable' contact='disable' "
           "gravity='disable' spring='disable' damper='disable' sensor='disable' eulerdamp='disable' "
           "autoreset='disable' warmstart='disable' island='disable' equality='disable' frictionloss='disable' "
           "limit='disable' refsafe='disable' filterparent='disable' midphase='disable' nativeccd='disable'/></option>"
           "<worldbody><body><joint name='motor' type='hinge' axis='0 0 1'/>"
           "<inertial pos='0 0 0' mass='1' diaginertia='%.17g %.17g %.17g'/></body></worldbody>"
           "<actuator><dcmotor joint='motor' motorconst='%.17g %.17g' resistance='%.17g' inductance='%.17g 0'/>"
           "</actuator></mujoco>",
           timestep, inertia, inertia, inertia, kt, value(&table, "emf_constant_v_s_rad", column), p.resistance,
           value(&table, "inductance_mh", column) * 1e-3);
  mjSpec *spec = mj_parseXMLString(xml, NULL, error, sizeof error);
  mjModel *model = spec ? mj_compile(spec, NULL) : NULL;
  if (!model) fail("MuJoCo", error);
  mjData *data = mj_makeData(model);
  if (model->na != 1 || model->nu != 1 || model->nv != 1) fail("MuJoCo", "unexpected number of states");

  char line[MAX_LINE];
  int runs;
  while (fgets(line, sizeof line, stdin) && sscanf(line, "run %d", &runs) == 1 && runs > 0) {
    double delay_compensated = 0.0, peak = 0.0;
    const double began = now();
    for (int r = 0; r < runs; r++) {
      mj_resetData(model, data);
      struct state s = at_rest(&p, setpoints.psec[0][0]);
      data->qpos[0] = s.theta;
      delay_compensated = peak = 0.0;
      for (int k = 0; k < setpoints.count; k++) {
        const double *psec = setpoints.psec[0] + k;
        for (int t = 0; t < TICKS_PER_POSITION; t++) {
          s.i = data->act[0] / scale;
          s.omega = data->qvel[0];
          s.theta = data->qpos[0];
          if (t == 0) {
            control_position(&p, &s, psec);
            delay_compensated = fmax(delay_compensated, fabs(psec[-p.alpha.periods] - position_of(&p, &s)));
          }
          if (t % TICKS_PER_VELOCITY == 0) control_velocity(&p, &s, t);
          control_current(&p, &s);
          peak = fmax(peak, fabs(s.i));
          data->ctrl[0] = scale * s.voltage;
          for (int step = 0; step < steps; step++) {
            const double omega = data->qvel[0];
            const double stopping = kt * data->act[0] / scale + inertia * omega / timestep;
            data->qfrc_applied[0] = -clamp(stopping, friction_bound(&p, omega));
            mj_step(model, data);
          }
        }
      }
    }
    printf("{\"seconds\": %.9g, \"machines\": [{\"axes\": {\"%s\": {\"max_delay_compensated_following_error\": %.17g, "
           "\"peak_current\": %.17g, \"position\": %.17g}}}]}\n",
           (now() - began) / runs, setpoints.joints[0], delay_compensated, peak, data->qpos[0] * p.ratio);
    fflush(stdout);
  }
  mj_deleteData(data);
  mj_deleteModel(model);
  mj_deleteSpec(spec);
  return 0;
}
