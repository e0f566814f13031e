//! A controller that takes over from another while the axes move.

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

/// One position period of the ballbar trial, with the setpoints that are read ahead.
fn advance(machine: &mut Machine, ballbar: &Ballbar, k: i64, observe: impl FnMut(&Machine)) {
    let psec = |k: i64| ballbar.psec(k as f64 * TSP);
    let horizon = machine.preview_length() as i64;
    let ahead: Vec<f64> = (0..AXES).flat_map(|axis| (1..=horizon).map(move |j| psec(k + j)[axis])).collect();
    machine.advance_with(&psec(k), &ahead, observe);
}

/// What the velocity loop is asked for, rad/s: Ω* and the velocity feedforward.
fn command(sample: &AxisSample) -> f64 {
    sample.velocity_setpoint + sample.velocity_feedforward
}

/// Position periods of a turn at full feed.
fn turn(ballbar: &Ballbar) -> i64 {
    (TAU * ballbar.radius / ballbar.velocity / TSP) as i64
}

/// What is seen of a stretch of the circle.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// Largest change of what X or Y is asked for between two position instants, rad/s.
    change: f64,
    /// Radial deviation, smallest and largest at any tick, m.
    deviation: [f64; 2],
    saturated: bool,
}

/// Follows the circle to instant `to`, and says what was seen on the way.
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

    fn until(&mut self, to: i64) -> Seen {
        let mut seen = Seen { change: 0.0, deviation: [f64::INFINITY, f64::NEG_INFINITY], saturated: false };
        while self.next < to {
            let (ballbar, last) = (self.ballbar, &mut self.last);
            let mut position_instant = true;
            advance(&mut self.machine, ballbar, self.next, |m| {
                let [x, y] = [0, 1].map(|place| m.axis(place).sample());
                if std::mem::take(&mut position_instant) {
                    let now = [command(x), command(y)];
                    for (now, last) in now.into_iter().zip(last.iter_mut()) {
                        seen.change = seen.change.max((now - *last).abs());
                        *last = now;
                    }
                }
                let deviation = ballbar.radial_deviation(x.position, y.position);
                seen.deviation = [seen.deviation[0].min(deviation), seen.deviation[1].max(deviation)];
                seen.saturated |= x.saturated || y.saturated;
            });
            self.next += 1;
        }
        seen
    }
}

/// The first instant of a whole turn at steady feed.
const STEADY: i64 = 250;

/// What is seen on a turn when nothing is switched.
fn steady(ballbar: &Ballbar, changes: &[&str]) -> Seen {
    let mut run = Run::new(ballbar, parameters_of(changes));
    run.until(STEADY);
    run.until(STEADY + turn(ballbar))
}

#[test]
fn cascade_to_predictive_and_back_on_a_circle_is_not_felt() {
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
    // At every instant of a turn: a reversal is where a switch is felt most.
    for first in STEADY + turn / 4..STEADY + 5 * turn / 4 {
        undisturbed.until(first);
        let mut run = undisturbed.clone();
        for (parameters, before) in [(&to_gpc, cascade), (&to_cascade, gpc)] {
            run.machine.update_parameters(Arc::clone(parameters)).expect("the same machine");
            let seen = run.until(run.next + 80);
            assert!(!seen.saturated);
            assert!(seen.change <= 2.0 * before.change, "{first}: {} and {}", seen.change, before.change);
            assert!(
                seen.deviation[0] >= envelope[0] && seen.deviation[1] <= envelope[1],
                "{first}: {:?} outside {envelope:?}",
                seen.deviation
            );
        }
    }
}

#[test]
fn no_controller_takes_over_from_another_with_a_bump() {
    let ballbar = Ballbar::paper();
    // What the axes may accelerate within a position period, and what a turn asks for by itself.
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
                assert!(step <= allowed + 1.5, "{from:?} to {to:?} at {first}: {step} rad/s at once");
                let seen = run.until(first + 60);
                assert!(!seen.saturated, "{from:?} to {to:?} at {first}");
                assert!(seen.change <= allowed + 1.5, "{from:?} to {to:?} at {first}: {}", seen.change);
                // Half a second later nothing is left of it but the new controller's own deviation.
                run.until(first + 120);
                let late = run.until(first + 150).deviation;
                let own = steady(&ballbar, to).deviation;
                assert!(
                    late[0] >= own[0] - 5e-6 && late[1] <= own[1] + 5e-6,
                    "{from:?} to {to:?} at {first}: {late:?}, by itself {own:?}"
                );
            }
        }
    }
}
