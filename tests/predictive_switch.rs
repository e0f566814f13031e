//! A controller that takes over from another while the axes move.

mod common;

use std::sync::Arc;

use common::*;
use virtual_axes::config::MachineConfig;
use virtual_axes::machine::{AxisSample, Machine, MachineParameters};

const MACHINE: &str = "mikron_ucp710";
const GPC: &str = "position_loop.controller=gpc";
/// How far the radial deviation may leave the envelope of the two steady states, m.
const ALLOWANCE: f64 = 60e-6;

fn parameters_of(config: &MachineConfig) -> Arc<MachineParameters> {
    Arc::new(MachineParameters::new(config).expect("a machine"))
}

/// One position period of the ballbar trial; the axes at every tick.
fn advance(machine: &mut Machine, ballbar: &Ballbar, k: i64, mut observe: impl FnMut(&Machine)) {
    let psec = |k: i64| ballbar.psec(k as f64 * TSP);
    let horizon = machine.horizon() as i64;
    let ahead: Vec<f64> = (0..AXES).flat_map(|axis| (1..=horizon).map(move |j| psec(k + j)[axis])).collect();
    machine.advance_with(&psec(k), &ahead, |m| observe(m));
}

/// What the velocity loop is asked for, rad/s: Ω* and the velocity feedforward.
fn command(sample: &AxisSample) -> f64 {
    sample.velocity_setpoint + sample.velocity_feedforward
}

#[test]
fn x() {
    let ballbar = Ballbar::paper();
    let cascade = parameters_of(&configured(MACHINE, &[]));
    let gpc = parameters_of(&configured(MACHINE, &[GPC]));
    let turn = (TAU_TURN / TSP) as i64;
    for start in (340..340 + 620).step_by(31) {
        let mut m = Machine::new(Arc::clone(&cascade));
        let mut last: Option<[f64; 2]> = None;
        let (mut before, mut at1, mut at2, mut lo, mut hi) = (0f64, 0f64, 0f64, 0f64, 0f64);
        for k in 0..start + 180 {
            if k == start {
                m.adopt(Arc::clone(&gpc)).unwrap();
            }
            if k == start + 90 {
                m.adopt(Arc::clone(&cascade)).unwrap();
            }
            let mut first = true;
            let mut now = [0.0; 2];
            advance(&mut m, &ballbar, k, |m| {
                if first {
                    now = [0, 1].map(|i| command(m.axis(i).sample()));
                    first = false;
                }
                let [x, y] = [0, 1].map(|i| m.axis(i).sample().position);
                if k >= start {
                    let d = ballbar.radial_deviation(x, y);
                    lo = lo.min(d);
                    hi = hi.max(d);
                }
            });
            if let Some(last) = last {
                let change = (0..2).map(|i| (now[i] - last[i]).abs()).fold(0.0, f64::max);
                if k < start && k > start - turn {
                    before = before.max(change);
                }
                if (start..start + 90).contains(&k) {
                    at1 = at1.max(change);
                }
                if k >= start + 90 {
                    at2 = at2.max(change);
                }
            }
            last = Some(now);
        }
        println!(
            "start {start}: before {before:.3} to gpc {at1:.3} to cascade {at2:.3} deviation {:.1} {:.1}",
            lo * 1e6,
            hi * 1e6
        );
    }
    let _ = ALLOWANCE;
}
const TAU_TURN: f64 = 3.77;
