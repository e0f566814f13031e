//! Bit-identity of axes alone and concatenated, for every SIMD width.

use std::sync::Arc;

use virtual_axes_core::assess::PathTracker;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::machine::{AxisSample, Machine, MachineParameters, SimdWidth};
use virtual_axes_core::trial::{Measures, Trial, run, run_variants, trace};
use virtual_axes_core::units::seconds;
use virtual_axes_verification::fixtures::machines::{
    AXES, TSP, configured, configured_with, program, setpoints, trace_scenario,
};

/// Position cycles of a run.
const CYCLES: usize = 300;

fn parameters(config: &MachineConfig) -> Arc<MachineParameters> {
    Arc::new(MachineParameters::new(config).expect("can be discretized"))
}

/// Returns setpoints that reach limits, reverse and stand still, different for each axis.
fn psec(axis: usize, k: usize) -> f64 {
    let t = TSP * k.min(CYCLES / 2) as f64;
    let size = if axis < 3 { 0.02 } else { 0.3 };
    size * (1.0 - (9.0 * t + axis as f64).cos()) * (1.0 + 0.3 * axis as f64)
}

fn bits(sample: &AxisSample) -> [u64; 8] {
    let s = sample;
    let numbers = [
        s.position,
        s.velocity,
        s.current,
        s.voltage,
        s.velocity_setpoint,
        s.torque_feedforward,
        s.friction_current,
        s.gravity_current,
    ];
    numbers.map(f64::to_bits)
}

/// Returns the bits of `count` axes from `first` on: samples, positions of all ticks, statistics.
fn bits_of_run(machine: &mut Machine, first: usize, count: usize) -> Vec<u64> {
    let axes = machine.axis_count();
    let start: Vec<f64> = (0..axes).map(|axis| psec(axis % AXES, 0)).collect();
    machine.reset(&start);
    let horizon = machine.preview_length();
    let mut result = Vec::new();
    for k in 0..CYCLES {
        for axis in 0..axes {
            machine.set_load(axis, if k % 50 < 5 { 40.0 * (axis % AXES) as f64 } else { 0.0 });
        }
        let now: Vec<f64> = (0..axes).map(|axis| psec(axis % AXES, k)).collect();
        let ahead: Vec<f64> =
            (0..axes).flat_map(|axis| (1..=horizon).map(move |j| psec(axis % AXES, k + j))).collect();
        machine.advance(&now, &ahead);
        for axis in first..first + count {
            result.extend(bits(machine.axis(axis).sample()));
            result.extend((0..machine.ticks_per_period()).map(|tick| machine.position(axis, tick).to_bits()));
            let activity = machine.activity(axis);
            result.extend([activity.peak_current.to_bits(), activity.saturated_ticks]);
        }
    }
    result
}

/// Returns machines that differ in controller, friction compensation, limits and tilt.
fn machines() -> Vec<MachineConfig> {
    vec![
        configured("mikron_ucp710", &[]),
        configured("mikron_ucp710", &["position_loop.controller=gpc"]),
        configured(
            "mikron_ucp710",
            &["feedforward.friction=1", "delays.friction_ms=11.75", "friction.i0=0.3"],
        ),
        configured_with("mikron_ucp710", &["velocity_loop.gain=0.1"], &["a.gravity.tilt_nm=0"]),
    ]
}

#[test]
fn every_simd_width_is_bit_identical() {
    for config in machines() {
        let mut machine = Machine::new(parameters(&config));
        let widest = bits_of_run(&mut machine, 0, AXES);
        for width in [SimdWidth::Four, SimdWidth::Baseline] {
            machine.set_simd_width(width);
            assert!(widest == bits_of_run(&mut machine, 0, AXES), "{width:?}");
        }
    }
}

#[test]
fn axes_are_bit_identical_alone_and_concatenated() {
    let all: Vec<_> = machines().iter().map(parameters).collect();
    let concatenated = MachineParameters::concatenate(&all).expect("equal periods");
    let mut concatenated = Machine::new(Arc::new(concatenated));
    for (index, one) in all.iter().enumerate() {
        let mut alone = Machine::new(Arc::clone(one));
        assert!(
            bits_of_run(&mut alone, 0, AXES) == bits_of_run(&mut concatenated, index * AXES, AXES),
            "machine {index}"
        );
    }
}

#[test]
fn a_reset_axis_is_bit_identical_to_a_new_one_and_the_others_go_on() {
    let config = configured("mikron_ucp710", &["position_loop.controller=gpc"]);
    let (mut reset, mut other) = (Machine::new(parameters(&config)), Machine::new(parameters(&config)));
    let mut new = Machine::new(parameters(&config));
    let now = |k: usize| [0, 1, 2, 3, 4].map(|axis| psec(axis, k));
    for k in 0..CYCLES {
        if k == 100 {
            reset.reset_axis(0, psec(0, 0));
            new.reset(&now(0));
        }
        let mut given = now(k);
        other.advance(&given, &[]);
        if k >= 100 {
            given[0] = psec(0, k - 100);
            new.advance(&now(k - 100), &[]);
        }
        reset.advance(&given, &[]);
        if k >= 100 {
            assert_eq!(bits(reset.axis(0).sample()), bits(new.axis(0).sample()), "cycle {k}");
        }
        for axis in 1..AXES {
            assert_eq!(
                bits(reset.axis(axis).sample()),
                bits(other.axis(axis).sample()),
                "axis {axis}, cycle {k}"
            );
        }
    }
}

#[test]
fn machines_with_different_periods_cannot_be_concatenated() {
    let slow = configured("mikron_ucp710", &[]);
    let fast = virtual_axes_verification::fixtures::machines::parameters(&[("periods.current_us", 62.5)])
        .machine_config()
        .expect("valid");
    assert!(MachineParameters::concatenate(&[parameters(&slow), parameters(&fast)]).is_none());
    assert!(MachineParameters::concatenate(&[]).is_none());
}

#[test]
fn observed_ticks_agree_with_cycle_statistics() {
    for config in machines() {
        let mut machine = Machine::new(parameters(&config));
        let mut observed = machine.clone();
        for k in 0..CYCLES {
            let now: Vec<f64> = (0..AXES).map(|axis| psec(axis, k)).collect();
            machine.advance(&now, &[]);
            let mut tick = 0;
            let mut peaks = [0.0_f64; AXES];
            let mut saturated = [0; AXES];
            observed.advance_with(&now, &[], |observed| {
                for (axis, peak) in peaks.iter_mut().enumerate() {
                    let sample = observed.axis(axis).sample();
                    assert_eq!(sample.position.to_bits(), machine.position(axis, tick).to_bits());
                    *peak = peak.max(sample.current.abs());
                    saturated[axis] += u64::from(sample.saturated);
                }
                tick += 1;
            });
            assert_eq!(tick, machine.ticks_per_period());
            for axis in 0..AXES {
                let activity = machine.activity(axis);
                assert_eq!((activity.peak_current, activity.saturated_ticks), (peaks[axis], saturated[axis]));
                assert_eq!(observed.axis(axis).sample(), machine.axis(axis).sample());
            }
        }
    }
}

#[test]
fn variants_in_one_machine_have_the_figures_of_separate_runs() {
    let base = configured("mikron_ucp710", &[]);
    let (x, y) = (0, 1);
    let variants: Vec<MachineConfig> = ["2.0", "1.2", "1.5"]
        .iter()
        .map(|gain| {
            let gains = ["x", "y"].map(|joint| format!("{joint}.position_loop.gain={gain}"));
            configured_with("mikron_ucp710", &[], &gains.each_ref().map(String::as_str))
        })
        .chain([configured_with(
            "mikron_ucp710",
            &[],
            &["x.position_loop.controller=gpc", "y.position_loop.controller=gpc"],
        )])
        .collect();
    for scenario in ["corner-90", "ballbar"] {
        let program = program(scenario, &base);
        let trial = |machine| Trial {
            machine,
            program: Some(Arc::clone(&program)),
            allow_nonzero_end_velocity: false,
            record: false,
            measures: Measures::ALL,
        };
        let setpoints = |machine| setpoints(scenario, Arc::clone(&program), machine);
        let together =
            run_variants(&trial(&base), setpoints(&base), &variants, &[x, y], || Ok(())).expect("a run");
        assert_eq!(together.len(), variants.len());
        for (variant, figures) in variants.iter().zip(&together) {
            let alone = run(&trial(variant), setpoints(variant), |_| Ok(())).expect("a run").figures;
            assert_eq!(*figures, alone, "{scenario}");
            let traced = trace(&trial(variant), setpoints(variant), |_| Ok(())).expect("a run").figures;
            assert_eq!(traced, alone, "{scenario}");
        }
        assert_ne!(together[0].contour, together[1].contour);
    }
}

#[test]
fn contour_error_of_a_position_cycle_equals_that_of_single_poses() {
    for scenario in ["ballbar", "ballbar-both", "corner-90", "contour-a", "bspline-3d", "five-axis"] {
        for controller in ["cascade", "gpc"] {
            let config = configured("mikron_ucp710", &[&format!("position_loop.controller={controller}")]);
            let program = program(scenario, &config);
            let (kinematics, ticks) =
                (Kinematics::new(&config), config.periods().ticks_per_position() as usize);
            let mut seen: Vec<(f64, Vec<f64>)> = Vec::new();
            trace_scenario(scenario, &config, |tick| {
                let joints = (0..AXES).map(|axis| tick.machine.axis(axis).sample().position).collect();
                seen.push((seconds(tick.time), joints));
            });
            let mut one_by_one = PathTracker::new(Arc::clone(program.path()));
            let mut at_once = one_by_one.clone();
            let (mut turned, mut poses, mut found) = Default::default();
            for period in seen.chunks(ticks) {
                let until = |tick: usize| program.progress(period[tick].0) + 5e-3;
                let axes = (0..AXES).flat_map(|axis| period.iter().map(move |(_, joints)| joints[axis]));
                kinematics.forward_batch(&mut turned, &axes.collect::<Vec<_>>(), period.len(), &mut poses);
                let at_once_first = at_once.follow(&poses, until, &mut found).expect("poses");
                let mut expected: [Vec<f64>; 3] = Default::default();
                let mut first = None;
                for (tick, (_, joints)) in period.iter().enumerate() {
                    let (pose, single) = (poses.get(tick), kinematics.forward(joints));
                    assert!(
                        (pose.tip - single.tip).norm() <= 1e-15 && (pose.axis - single.axis).norm() <= 1e-15
                    );
                    let nearest = one_by_one.nearest(&pose, until(tick));
                    first.get_or_insert(nearest);
                    let deviations = [nearest.distance, nearest.within_ends, nearest.orientation];
                    expected.iter_mut().zip(deviations).for_each(|(column, value)| column.push(value));
                }
                let first = first.expect("poses");
                let at = format!("{scenario} at {} s", period[0].0);
                assert!((at_once_first.progress - first.progress).abs() <= 1e-9, "{at}");
                assert!((at_once_first.point - first.point).norm() <= 1e-9, "{at}");
                // A foot point within 10⁻¹² m, on curves along which the tool axis turns by less than 10 rad/m.
                for (found, expected, tolerance) in [
                    (&found.distance, &expected[0], 1e-12),
                    (&found.within_ends, &expected[1], 1e-12),
                    (&found.orientation, &expected[2], 1e-11),
                ] {
                    assert_eq!(found.len(), expected.len());
                    for (found, expected) in found.iter().zip(expected) {
                        assert!((found - expected).abs() <= tolerance, "{at}: {found} instead of {expected}");
                    }
                }
            }
        }
    }
}
