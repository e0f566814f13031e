//! Predictive control beyond its linear range: at rest, saturated, and taking over.

mod common;

use std::sync::Arc;

use common::*;
use virtual_axes::config::{AxisKind, MachineConfig};
use virtual_axes::machine::{Machine, MachineParameters};

const MACHINES: [&str; 2] = ["mikron_ucp710", "linear_motor_center"];
const GPC: &str = "position_loop.controller=gpc";

fn machine_of(config: &MachineConfig) -> Machine {
    Machine::new(Arc::new(MachineParameters::new(config).expect("a machine")))
}

/// The axis alone moved by `psec`, known `horizon` periods ahead.
fn advance(machine: &mut Machine, place: usize, k: i64, psec: impl Fn(i64) -> f64) {
    let (axes, horizon) = (machine.axis_count(), machine.horizon());
    let mut now = vec![0.0; axes];
    let mut ahead = vec![0.0; axes * horizon];
    now[place] = psec(k);
    for j in 0..horizon {
        ahead[place * horizon + j] = psec(k + 1 + j as i64);
    }
    machine.advance_with(&now, &ahead, |_| ());
}

#[test]
fn step() {
    for name in MACHINES {
        for tuning in
            [vec![], vec!["n2=8", "nu=6", "lambda_rel=0.001"], vec!["n2=8", "nu=6", "lambda_rel=0.01"]]
        {
            let tuning: Vec<String> = tuning.iter().map(|t| format!("position_loop.gpc.{t}")).collect();
            let mut all = vec![GPC];
            all.extend(tuning.iter().map(String::as_str));
            let config = configured(name, &all);
            for place in 0..config.axes().len() {
                let step = if config.axes()[place].kind() == AxisKind::Linear { 0.1 } else { 1.0 };
                for preview in [true, false] {
                    let mut m = machine_of(&config);
                    let (mut peak, mut late, mut sat) = (0.0f64, 0.0f64, 0);
                    let mut settled = 0;
                    for k in 0..1000 {
                        let at = |k: i64| if k < 20 { 0.0 } else { step + 1e-10 * (k % 2) as f64 };
                        if preview {
                            advance(&mut m, place, k, at);
                        } else {
                            let mut p = vec![0.0; config.axes().len()];
                            p[place] = at(k);
                            m.advance(&p);
                        }
                        let s = m.axis(place).sample();
                        sat += usize::from(s.saturated);
                        peak = peak.max(s.position / step);
                        if k > 800 {
                            late = late.max((s.position - step).abs());
                        }
                        if (s.position - step).abs() > 2e-6 {
                            settled = k - 20;
                        }
                    }
                    println!(
                        "{name} {tuning:?} axis {place} preview {preview}: peak {peak:.3} late {:.3} µ saturated {sat} settled {settled}",
                        late * 1e6
                    );
                }
            }
        }
    }
}

#[test]
fn load() {
    for name in MACHINES {
        let config = configured(name, &[GPC]);
        for place in 0..config.axes().len() {
            let load = [60e3, 60e3, 60e3, 10e3, 10e3][place];
            let mut m = machine_of(&config);
            let (mut peak, mut late, mut sat) = (0.0f64, 0.0f64, 0);
            let mut settled = 0;
            for k in 0..1000 {
                m.set_load(place, if (20..23).contains(&k) { load } else { 0.0 });
                m.advance(&vec![0.0; config.axes().len()]);
                let s = m.axis(place).sample();
                sat += usize::from(s.saturated);
                peak = peak.max(s.position.abs());
                if k > 800 {
                    late = late.max(s.position.abs());
                }
                if s.position.abs() > 2e-6 {
                    settled = k - 20;
                }
            }
            println!(
                "{name} axis {place}: peak {peak:.4} late {:.3} µ saturated {sat} settled {settled}",
                late * 1e6
            );
        }
    }
}
