//! Fuzz target of the simulation: commands in any order, with values that are often valid.

use std::sync::Arc;

use arbitrary::{Arbitrary, Result, Unstructured};
use virtual_axes_core::trajectory::{
    MotionId, Start, Trajectory, TrajectoryPoint, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds, SECOND_NS, seconds};

use crate::{JOINTS, MACHINE, ORIGIN, assert_one_line, bounded, machine_at_rest, step};

/// Largest number of position cycles per input.
const MAX_PERIODS: usize = 200;
/// Largest number of points of a trajectory.
const MAX_POINTS: usize = 12;

/// Draws a value up to `scale`, or rarely any 64-bit float.
fn value(input: &mut Unstructured<'_>, scale: f64) -> Result<f64> {
    Ok(match input.arbitrary::<u8>()? {
        0..=3 => f64::arbitrary(input)?,
        4..=99 => 0.0,
        _ => scale * f64::from(input.arbitrary::<i16>()?) / f64::from(i16::MAX),
    })
}

fn start(input: &mut Unstructured<'_>, now: Nanoseconds) -> Result<Start> {
    Ok(match input.arbitrary::<u8>()? {
        0..=160 => Start::Now,
        161..=250 => Start::At(now + Nanoseconds::from(input.arbitrary::<i16>()?) * MILLISECOND_NS / 10),
        _ => Start::At(input.arbitrary()?),
    })
}

/// Draws a request of some joints that starts at their commanded positions.
fn request(
    input: &mut Unstructured<'_>,
    now: Nanoseconds,
    commanded: &[f64],
) -> Result<Option<TrajectoryRequest>> {
    let mask: u8 = input.arbitrary()?;
    let indices: Vec<usize> = (0..JOINTS.len()).filter(|index| mask >> index & 1 == 1).collect();
    let mut request = TrajectoryRequest::new(
        start(input, now)?,
        indices.iter().map(|&index| JOINTS[index].name.clone()).collect(),
    );
    let order = input.int_in_range(0..=2)?;
    let mut at: Vec<f64> = indices.iter().map(|&index| commanded[index]).collect();
    let mut time: Nanoseconds = 0;
    for index in 0..input.int_in_range(0..=MAX_POINTS)? {
        let pause = match input.arbitrary::<u8>()? {
            0..=7 => Nanoseconds::from(input.arbitrary::<i32>()?),
            8..=99 => Nanoseconds::from(input.int_in_range(1..=60u8)?) * MACHINE.periods().position,
            _ => Nanoseconds::from(input.arbitrary::<u16>()?) * (MILLISECOND_NS / 100),
        };
        if index > 0 || input.ratio(1, 8)? {
            time += pause;
            for (at, &index) in at.iter_mut().zip(&indices) {
                // Usually within the velocity limit.
                *at +=
                    value(input, 1.2 * JOINTS[index].limits.velocity * seconds(pause.clamp(0, SECOND_NS)))?;
            }
        }
        let row = |scale: f64, input: &mut Unstructured<'_>| -> Result<Vec<f64>> {
            indices.iter().map(|_| value(input, scale)).collect()
        };
        let velocities = if order > 0 { row(0.4, input)? } else { Vec::new() };
        let accelerations = if order > 1 { row(3.0, input)? } else { Vec::new() };
        let row = TrajectoryPoint {
            positions: &at,
            velocities: &velocities,
            accelerations: &accelerations,
            effort: &[],
        };
        if let Err(rejection) = request.push(time, row) {
            assert_one_line(&rejection.to_string());
            return Ok(None);
        }
    }
    Ok(Some(request))
}

fn play(input: &mut Unstructured<'_>) -> Result<()> {
    let period = MACHINE.periods().position;
    let mut simulation = machine_at_rest();
    let (mut left, mut id, mut active) = (MAX_PERIODS, 0, 0);
    while left > 0 && !input.is_empty() {
        let now = simulation.time_of(simulation.next_instant());
        match input.int_in_range(0..=9u8)? {
            0..=3 => {
                let commanded: Vec<f64> = (0..JOINTS.len())
                    .map(|joint| simulation.psec_ahead(joint, 0).unwrap_or_default())
                    .collect();
                let Some(request) = request(input, now, &commanded)? else { continue };
                let context = ValidationContext {
                    joints: &JOINTS,
                    period,
                    max_points: MAX_POINTS,
                    allow_nonzero_end_velocity: input.arbitrary()?,
                };
                let accepted = Trajectory::new(request, &context).and_then(|trajectory| {
                    id += 1;
                    simulation.submit(MotionId(id), Arc::new(trajectory))
                });
                match accepted {
                    Ok(admission) => {
                        active += 1;
                        assert!(admission.start_k <= admission.join_k);
                    }
                    Err(rejection) => assert_one_line(&rejection.to_string()),
                }
            }
            4..=6 => {
                let periods = input.int_in_range(1..=40usize)?.min(left);
                left -= periods;
                let before: Vec<f64> = simulation.samples().iter().map(|sample| sample.psec).collect();
                let (resets, stream) = (simulation.next_instant(), simulation.is_streaming());
                step(&mut simulation, periods);
                let passed = seconds((simulation.next_instant() - resets) * period);
                for ((sample, before), joint) in simulation.samples().iter().zip(before).zip(JOINTS.iter()) {
                    let largest = joint.speed_bound() * passed * (1.0 + 1e-6);
                    let moved = (sample.psec - before).abs();
                    // The first setpoint of a stream may be one step away from the position of the axis.
                    assert!(stream || moved <= largest + 1e-9, "{}: {moved} in {passed} s", joint.name);
                }
            }
            7 => {
                let index = input.int_in_range(0..=JOINTS.len())?;
                let at = simulation.psec_ahead(index, 0).unwrap_or_default();
                let position = at + value(input, 2e-3)?;
                let sent = input.arbitrary::<bool>()?.then_some(now);
                if let Err(rejection) = simulation.submit_setpoint_stamped(index, position, sent) {
                    assert_one_line(&rejection.to_string());
                }
            }
            8 => {
                let hold = Nanoseconds::from(input.arbitrary::<i32>()?);
                simulation.set_load(input.int_in_range(0..=JOINTS.len())?, value(input, 2e3)?, hold);
            }
            _ => match input.arbitrary::<u8>()? {
                0..=15 => simulation.jump_to(input.arbitrary::<u32>().map(|at| ORIGIN + i64::from(at))?),
                16..=31 => simulation.reset(),
                n => _ = simulation.cancel(MotionId(u64::from(n % 16))),
            },
        }
        active -= simulation.drain_finished().count();
    }
    // An accepted motion ends once: completed, preempted, or aborted by this reset.
    simulation.reset();
    step(&mut simulation, 1);
    active -= simulation.drain_finished().count();
    assert_eq!(active, 0, "motions without an end");
    Ok(())
}

/// Submits trajectories, stops, streams, loads, resets and clock jumps between steps of the simulation.
pub fn trajectory(data: &[u8]) {
    bounded(data.len(), || {
        // A short input ends the sequence.
        let _ = play(&mut Unstructured::new(data));
    });
}
