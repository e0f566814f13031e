//! Bumpless transfer between position controllers in motion.

use std::f64::consts::TAU;
use std::sync::Arc;

use virtual_axes_core::machine::{AxisSample, Machine, MachineParameters};
use virtual_axes_verification::fixtures::machines::*;

const MACHINE: &str = "mikron_ucp710";
const CASCADE: &[&str] = &[];
const NO_FEEDFORWARD: &[&str] = &["feedforward.velocity=0", "feedforward.torque_kg_m2=0"];
const GPC: &[&str] = &["position_loop.controller=gpc"];
const STIFF_GPC: &[&str] = &[
    "position_loop.controller=gpc",
    "position_loop.gpc.n2=8",
    "position_loop.gpc.nu=6",
    "position_loop.gpc.lambda_rel=0.001",
];
const STIFF: &[&str] = &["position_loop.gain=3"];
const COMPENSATED: &[&str] = &["feedforward.friction=1", "delays.friction_ms=11.75"];

fn parameters_of(changes: &[&str]) -> Arc<MachineParameters> {
    Arc::new(MachineParameters::new(&configured(MACHINE, changes)).expect("a machine"))
}

/// Advances by one position cycle of the ballbar scenario, with the preview of the controllers.
fn advance(machine: &mut Machine, ballbar: &Ballbar, k: i64, observe: impl FnMut(&Machine)) {
    let psec = |k: i64| ballbar.psec(k as f64 * TSP);
    let horizon = machine.preview_length() as i64;
    let ahead: Vec<f64> = (0..AXES).flat_map(|axis| (1..=horizon).map(move |j| psec(k + j)[axis])).collect();
    machine.advance_with(&psec(k), &ahead, observe);
}

/// Returns the setpoint of the velocity loop, Ω* + VFFWS, rad/s.
fn command(sample: &AxisSample) -> f64 {
    sample.velocity_setpoint + sample.velocity_feedforward
}

/// Returns the number of position cycles of a turn at full feed.
fn turn(ballbar: &Ballbar) -> i64 {
    (TAU * ballbar.radius / ballbar.velocity / TSP) as i64
}

/// Observations on a section of the circle.
#[derive(Debug, Clone, Copy)]
struct Observation {
    /// Largest change of Ω* + VFFWS of X or Y per position cycle, rad/s.
    change: f64,
    /// Smallest and largest radial deviation of all ticks, m.
    deviation: [f64; 2],
    saturated: bool,
}

/// Run along the circle.
#[derive(Clone)]
struct Run<'a> {
    ballbar: &'a Ballbar,
    machine: Machine,
    next: i64,
    last: [f64; 2],
}

impl<'a> Run<'a> {
    fn new(ballbar: &'a Ballbar, parameters: Arc<MachineParameters>) -> Self {
        Run { ballbar, machine: Machine::new(parameters), next: 0, last: [0.0; 2] }
    }

    fn until(&mut self, to: i64) -> Observation {
        let mut observed =
            Observation { change: 0.0, deviation: [f64::INFINITY, f64::NEG_INFINITY], saturated: false };
        while self.next < to {
            let (ballbar, last) = (self.ballbar, &mut self.last);
            let mut is_first_tick = true;
            advance(&mut self.machine, ballbar, self.next, |m| {
                let [x, y] = [0, 1].map(|index| m.axis(index).sample());
                if std::mem::take(&mut is_first_tick) {
                    let now = [command(x), command(y)];
                    for (now, last) in now.into_iter().zip(last.iter_mut()) {
                        observed.change = observed.change.max((now - *last).abs());
                        *last = now;
                    }
                }
                let deviation = ballbar.radial_deviation(x.position, y.position);
                observed.deviation =
                    [observed.deviation[0].min(deviation), observed.deviation[1].max(deviation)];
                observed.saturated |= x.saturated || y.saturated;
            });
            self.next += 1;
        }
        observed
    }
}

/// First position cycle of a whole turn at steady feed.
const STEADY: i64 = 250;

/// Returns the observation of one turn without a transfer.
fn steady(ballbar: &Ballbar, changes: &[&str]) -> Observation {
    let mut run = Run::new(ballbar, parameters_of(changes));
    run.until(STEADY);
    run.until(STEADY + turn(ballbar))
}

#[test]
fn transfer_between_cascade_and_gpc_on_a_circle_is_bumpless() {
    let ballbar = Ballbar::paper();
    let turn = turn(&ballbar);
    let (cascade, gpc) = (steady(&ballbar, CASCADE), steady(&ballbar, GPC));
    let envelope = [
        cascade.deviation[0].min(gpc.deviation[0]) - 60e-6,
        cascade.deviation[1].max(gpc.deviation[1]) + 60e-6,
    ];
    let (to_cascade, to_gpc) = (parameters_of(CASCADE), parameters_of(GPC));
    let mut undisturbed = Run::new(&ballbar, Arc::clone(&to_cascade));
    undisturbed.until(STEADY + turn / 4);
    // At every position cycle of a turn; reversals are most sensitive.
    for first in STEADY + turn / 4..STEADY + 5 * turn / 4 {
        undisturbed.until(first);
        let mut run = undisturbed.clone();
        for (parameters, before) in [(&to_gpc, cascade), (&to_cascade, gpc)] {
            run.machine.update_parameters(Arc::clone(parameters)).expect("the same machine");
            let observed = run.until(run.next + 80);
            assert!(!observed.saturated);
            assert!(
                observed.change <= 2.0 * before.change,
                "{first}: {} and {}",
                observed.change,
                before.change
            );
            assert!(
                observed.deviation[0] >= envelope[0] && observed.deviation[1] <= envelope[1],
                "{first}: {:?} outside {envelope:?}",
                observed.deviation
            );
        }
    }
}

#[test]
fn transfer_between_all_controllers_is_bumpless() {
    let ballbar = Ballbar::paper();
    // Acceleration limit within a position cycle, and the change along the circle.
    let allowed = 3.0 * TSP / (0.020 / TAU);
    let all = [CASCADE, NO_FEEDFORWARD, GPC, STIFF_GPC, STIFF, COMPENSATED];
    for from in all {
        for to in all {
            // In mid-quadrant and at reversals of X and of Y.
            for first in [400, 431, 479, 505, 560] {
                let mut run = Run::new(&ballbar, parameters_of(from));
                run.until(first);
                let before = run.last;
                run.machine.update_parameters(parameters_of(to)).expect("the same machine");
                run.until(first + 1);
                let step = (0..2).map(|i| (run.last[i] - before[i]).abs()).fold(0.0, f64::max);
                assert!(step <= allowed + 1.5, "{from:?} to {to:?} at {first}: {step} rad/s in one cycle");
                let observed = run.until(first + 60);
                assert!(!observed.saturated, "{from:?} to {to:?} at {first}");
                assert!(
                    observed.change <= allowed + 1.5,
                    "{from:?} to {to:?} at {first}: {}",
                    observed.change
                );
                // Half a second later only the deviation of the new controller remains.
                run.until(first + 120);
                let late = run.until(first + 150).deviation;
                let own = steady(&ballbar, to).deviation;
                assert!(
                    late[0] >= own[0] - 5e-6 && late[1] <= own[1] + 5e-6,
                    "{from:?} to {to:?} at {first}: {late:?}, without transfer {own:?}"
                );
            }
        }
    }
}
