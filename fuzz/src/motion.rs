//! What a graph can ask of the axes in any order, in values that are often good ones.

use std::sync::Arc;

use arbitrary::{Arbitrary, Result, Unstructured};
use virtual_axes_core::trajectory::{
    MotionId, Start, Trajectory, TrajectoryPoint, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds, SECOND_NS, seconds};

use crate::{JOINTS, MACHINE, ORIGIN, bounded, machine_at_rest, refused, step};

/// Most position periods that one input is worth.
const MOST_PERIODS: usize = 200;
/// Most points of a trajectory.
const MOST_POINTS: usize = 12;

/// A value up to `scale`; now and then any that 64 bits can mean.
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

/// A request of some joints that begins where they are commanded to be.
fn request(
    input: &mut Unstructured<'_>,
    now: Nanoseconds,
    commanded: &[f64],
) -> Result<Option<TrajectoryRequest>> {
    let mask: u8 = input.arbitrary()?;
    let places: Vec<usize> = (0..JOINTS.len()).filter(|place| mask >> place & 1 == 1).collect();
    let mut request = TrajectoryRequest::new(
        start(input, now)?,
        places.iter().map(|&place| JOINTS[place].name.clone()).collect(),
    );
    let order = input.int_in_range(0..=2)?;
    let mut at: Vec<f64> = places.iter().map(|&place| commanded[place]).collect();
    let mut time: Nanoseconds = 0;
    for index in 0..input.int_in_range(0..=MOST_POINTS)? {
        let pause = match input.arbitrary::<u8>()? {
            0..=7 => Nanoseconds::from(input.arbitrary::<i32>()?),
            8..=99 => Nanoseconds::from(input.int_in_range(1..=60u8)?) * MACHINE.periods().position,
            _ => Nanoseconds::from(input.arbitrary::<u16>()?) * (MILLISECOND_NS / 100),
        };
        if index > 0 || input.ratio(1, 8)? {
            time += pause;
            for (at, &place) in at.iter_mut().zip(&places) {
                // Within its reach, more or less.
                *at +=
                    value(input, 1.2 * JOINTS[place].limits.velocity * seconds(pause.clamp(0, SECOND_NS)))?;
            }
        }
        let row = |scale: f64, input: &mut Unstructured<'_>| -> Result<Vec<f64>> {
            places.iter().map(|_| value(input, scale)).collect()
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
            refused(&rejection.to_string());
            return Ok(None);
        }
    }
    Ok(Some(request))
}

fn play(input: &mut Unstructured<'_>) -> Result<()> {
    let period = MACHINE.periods().position;
    let mut simulation = machine_at_rest();
    let (mut left, mut id, mut offered) = (MOST_PERIODS, 0, 0);
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
                    max_points: MOST_POINTS,
                    allow_nonzero_end_velocity: input.arbitrary()?,
                };
                let accepted = Trajectory::new(request, &context).and_then(|trajectory| {
                    id += 1;
                    simulation.submit(MotionId(id), Arc::new(trajectory))
                });
                match accepted {
                    Ok(admission) => {
                        offered += 1;
                        assert!(admission.start_k <= admission.join_k);
                    }
                    Err(rejection) => refused(&rejection.to_string()),
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
                    let reach = joint.speed_bound() * passed * (1.0 + 1e-6);
                    let moved = (sample.psec - before).abs();
                    // The first setpoint of a stream may be one step away from where the axis stands.
                    assert!(stream || moved <= reach + 1e-9, "{}: {moved} in {passed} s", joint.name);
                }
            }
            7 => {
                let place = input.int_in_range(0..=JOINTS.len())?;
                let at = simulation.psec_ahead(place, 0).unwrap_or_default();
                let position = at + value(input, 2e-3)?;
                let sent = input.arbitrary::<bool>()?.then_some(now);
                if let Err(rejection) = simulation.submit_setpoint_stamped(place, position, sent) {
                    refused(&rejection.to_string());
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
        offered -= simulation.drain_finished().count();
    }
    // What was accepted ends once: by its end, by another, or by this.
    simulation.reset();
    step(&mut simulation, 1);
    offered -= simulation.drain_finished().count();
    assert_eq!(offered, 0, "motions without an end");
    Ok(())
}

/// Trajectories, stops, streams, loads, resets and jumps of the clock, between steps of the machine.
pub fn trajectory(data: &[u8]) {
    bounded(data.len(), || {
        // An input that is too short ends where it ends.
        let _ = play(&mut Unstructured::new(data));
    });
}
