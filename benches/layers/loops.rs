//! Benchmarks of kinematics, drive, control, design and machine.

use std::cell::LazyCell;
use std::f64::consts::TAU;
use std::hint::black_box;
use std::sync::Arc;

use criterion::Criterion;
use virtual_axes_core::config::{AxisKind, FeedforwardConfig, FrictionConfig, PiConfig};
use virtual_axes_core::control::{
    BumplessTransfer, FallbackController, Feedforward, Pi, PiState, PositionController, PositionState, Rst,
    SetpointHistory, SetpointWindow,
};
use virtual_axes_core::design::{
    ControlWeight, GpcTuning, PolePlacement, gpc, margins, pole_pair, pole_placement,
};
use virtual_axes_core::drive::{Friction, MotorState, Plant};
use virtual_axes_core::kinematics::{Kinematics, Poses, TableAngles};
use virtual_axes_core::machine::{Machine, MachineParameters, SimdWidth, prediction_model};
use virtual_axes_core::units::{POSITION_GAIN, seconds};

use crate::{bench, shipped, swing};

/// Ticks, cycles or poses per iteration.
const MANY: usize = 1000;
/// Position cycles per iteration of a machine.
const PERIODS: usize = 100;
/// Controller tuning of the paper.
const TUNING: GpcTuning = GpcTuning { n1: 1, n2: 15, nu: 1, weight: ControlWeight::Relative(0.01) };

/// Friction of the X axis of the shipped machine; the constants below are its Kt (N·m/A), r (m/rad), loops and largest
/// current (A).
const FRICTION: FrictionConfig = FrictionConfig { a: 1.576, b: 0.01965, c: -0.5332, d: -0.2801, i0: 1.043 };
const TORQUE_CONSTANT: f64 = 2.64;
const RATIO: f64 = 0.020 / TAU;
const GAIN: f64 = 1.5 * POSITION_GAIN;
const VELOCITY_LOOP: PiConfig = PiConfig { gain: 5.0, integral_time: 4e-3 };
const FEEDFORWARD: FeedforwardConfig = FeedforwardConfig { velocity: 1.0, torque: 0.002034, friction: 0.0 };
const MAX_CURRENT: f64 = 54.0;

pub fn all(criterion: &mut Criterion) {
    kinematics(criterion);
    drive(criterion);
    control(criterion);
    design(criterion);
    machine(criterion);
}

fn kinematics(criterion: &mut Criterion) {
    let kinematics = Kinematics::new(&shipped());
    let axes = 5;
    let joints: Vec<f64> = (0..MANY).flat_map(|k| (0..axes).map(move |axis| swing(axis, k))).collect();
    // Column-major: all values of an axis, then of the next.
    let columns: Vec<f64> = (0..axes).flat_map(|axis| (0..MANY).map(move |k| swing(axis, k))).collect();
    let poses: Vec<_> = joints.chunks(axes).map(|joints| kinematics.forward(joints)).collect();
    let mut group = criterion.benchmark_group("kinematics, poses");
    bench(&mut group, "joints to the tool, one by one", MANY, || {
        joints.chunks(axes).for_each(|joints| _ = black_box(kinematics.forward(joints)));
    });
    let (mut turned, mut together) = (TableAngles::default(), Poses::default());
    bench(&mut group, "joints to the tool, together", MANY, || {
        kinematics.forward_batch(&mut turned, black_box(&columns), MANY, &mut together);
        together.len()
    });
    let mut found = vec![0.0; axes];
    bench(&mut group, "tool to joints", MANY, || {
        for (pose, near) in poses.iter().zip(joints.chunks(axes)) {
            kinematics.inverse(pose, near, &mut found).expect("within reach");
            black_box(&found);
        }
    });
    group.finish();
}

fn drive(criterion: &mut Criterion) {
    let config = shipped();
    let (x, tick) = (&config.axes()[0], seconds(config.periods().current));
    let friction = Friction::new(FRICTION, AxisKind::Linear, RATIO, TORQUE_CONSTANT);
    let plant = Plant::new(x, tick).expect("it can be discretized");
    let speeds: Vec<f64> = (0..MANY).map(|k| 100.0 * swing(0, k)).collect();
    let mut group = criterion.benchmark_group("drive, ticks");
    bench(&mut group, "bound of friction", MANY, || {
        speeds.iter().map(|&speed| friction.bound(black_box(speed))).sum::<f64>()
    });
    let mut state = MotorState::default();
    bench(&mut group, "motor, friction and load of one axis", MANY, || {
        (0..MANY).for_each(|k| _ = black_box(plant.step(&mut state, 20.0 * speeds[k].cos(), 1.0)));
    });
    group.finish();
}

fn control(criterion: &mut Criterion) {
    let config = shipped();
    let (x, periods) = (&config.axes()[0], config.periods());
    let period = seconds(periods.position);
    let mut group = criterion.benchmark_group("control, instants");
    let pi = Pi::new(&VELOCITY_LOOP, seconds(periods.velocity), 1.0 / TORQUE_CONSTANT, MAX_CURRENT);
    let mut memory = PiState::default();
    bench(&mut group, "PI with anti-windup", MANY, || {
        (0..MANY).map(|k| pi.update_with_feedforward(&mut memory, black_box(swing(0, k)), 0.1)).sum::<f64>()
    });
    let transfer = BumplessTransfer { max_step: 1.0, cycles: 10 };
    let model = prediction_model(x, &periods).expect("a model");
    let fallback =
        FallbackController { gain: GAIN, period, standstill_cycles: 100, standstill_tolerance: 1e-6 };
    let rst = gpc(&model, &TUNING).expect("a controller");
    let controllers = [
        ("proportional position controller", PositionController::proportional(fallback.gain, transfer)),
        ("predictive position controller", PositionController::rst(rst, fallback, transfer)),
    ];
    for (name, controller) in controllers {
        let mut state = PositionState::at_rest(0.0);
        bench(&mut group, name, MANY, || {
            let at = |k: i64| swing(0, k.rem_euclid(MANY as i64) as usize);
            let update = |k: i64| controller.update(&mut state, |j| at(k + j), at(k) - 1e-4, 0.0);
            (0..MANY as i64).map(update).sum::<f64>()
        });
    }
    let ticks = periods.ticks_per_position();
    let mut history =
        SetpointHistory::new(0.0, ticks, SetpointWindow { delay: 4 * ticks, lookback: 0, preview: 0 });
    let feedforward = Feedforward::new(&FEEDFORWARD, period, RATIO);
    bench(&mut group, "delayed setpoint and feedforward", MANY, || {
        let mut sum = 0.0;
        for k in 0..MANY {
            history.push(swing(0, k));
            let k = history.present_index() - 2;
            sum +=
                history.at(k) + feedforward.velocities(&history, k)[1] + feedforward.torques(&history, k)[1];
        }
        sum
    });
    group.finish();
}

fn design(criterion: &mut Criterion) {
    let config = shipped();
    let (x, periods) = (&config.axes()[0], config.periods());
    let model = prediction_model(x, &periods).expect("a model");
    let period = seconds(periods.position);
    let mut group = criterion.benchmark_group("design, controllers");
    bench(&mut group, "prediction model of an axis", 1, || prediction_model(black_box(x), &periods));
    for (name, n2, nu) in
        [("gpc, N2 = 15, Nu = 1", 15, 1), ("gpc, N2 = 30, Nu = 4", 30, 4), ("gpc, N2 = 60, Nu = 10", 60, 10)]
    {
        bench(&mut group, name, 1, || gpc(black_box(&model), &GpcTuning { n2, nu, ..TUNING }));
    }
    let poles = pole_pair(60.0, 0.8, period).expect("a pair").to_vec();
    let wanted = PolePlacement { poles, integrator: false, velocity_feedforward: 1.0 };
    bench(&mut group, "pole placement", 1, || pole_placement(black_box(&model), &wanted));
    let rst = gpc(&model, &TUNING).expect("a controller");
    bench(&mut group, "margins of a predictive controller", 1, || margins(black_box(&model), &rst));
    let cascade = Rst::proportional(GAIN).expect("a controller");
    bench(&mut group, "margins of the cascade", 1, || margins(black_box(&model), &cascade));
    group.finish();
}

fn machine(criterion: &mut Criterion) {
    let config = shipped();
    let ticks = config.periods().ticks_per_position() as usize;
    let mut group = criterion.benchmark_group("machine, axis-ticks");
    for (width, name) in [(SimdWidth::Widest, "widest vectors"), (SimdWidth::Baseline, "baseline vectors")] {
        let counts: &[usize] = if width == SimdWidth::Widest { &[1, 4, 5, 8, 32] } else { &[1, 5, 8] };
        for &axes in counts {
            let indices: Vec<usize> = (0..axes).map(|axis| axis % config.axes().len()).collect();
            let machine = LazyCell::new(|| {
                let parameters =
                    MachineParameters::from_axes(&config, &indices).expect("it can be discretized");
                let mut machine = Machine::new(Arc::new(parameters));
                machine.set_simd_width(width);
                machine
            });
            let psec: Vec<Vec<f64>> =
                (0..PERIODS).map(|k| (0..axes).map(|axis| swing(axis, k)).collect()).collect();
            let mut machine = machine;
            bench(&mut group, &format!("{axes} axes, {name}"), axes * ticks * PERIODS, || {
                // Each iteration starts at rest.
                machine.reset(&psec[0]);
                psec.iter().for_each(|psec| machine.advance(psec, &[]));
                machine.position(0, 0)
            });
        }
    }
    let mut five = Machine::new(Arc::new(MachineParameters::new(&config).expect("it can be discretized")));
    let psec: Vec<Vec<f64>> = (0..PERIODS).map(|k| (0..5).map(|axis| swing(axis, k)).collect()).collect();
    bench(&mut group, "5 axes, every tick observed", 5 * ticks * PERIODS, || {
        five.reset(&psec[0]);
        psec.iter().for_each(|psec| five.advance_with(psec, &[], |machine| _ = black_box(machine.axes())));
    });
    group.finish();
    let mut group = criterion.benchmark_group("machine, machines made");
    bench(&mut group, "five axes discretized", 1, || MachineParameters::new(black_box(&config)));
    group.finish();
}
