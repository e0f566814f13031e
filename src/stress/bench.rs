//! One trajectory after another, on simulations that are kept.

use std::sync::Arc;

use blake3::Hasher;

use super::drive::Broken;
use super::fault::{Check, Fault};
use super::fleet::{Fleet, FleetError};
use super::plan::{Ask, Kind, Plan};
use super::watch::{AxisFigures, AxisWatch};
use crate::machine::{AxisSample, Width};
use crate::simulation::Simulation;
use crate::trajectory::stream::STREAM_PAUSE;
use crate::trajectory::{Code, Context, JointLimits, MotionId, Rejection, Request, Start, Trajectory};

/// Most faults of a trajectory that are told.
const TOLD: usize = 8;

/// What a trajectory came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Its number.
    pub number: u64,
    /// Place of its machine in the fleet.
    pub variant: usize,
    /// Its kind.
    pub kind: Option<Kind>,
    /// Why the library did not take it.
    pub refused: Option<Code>,
    /// Position periods that ran.
    pub periods: usize,
    /// Of each axis.
    pub axes: Vec<AxisFigures>,
    /// Whether it met a load.
    pub loaded: bool,
    /// What is wrong.
    pub faults: Vec<Fault>,
    /// Hash of all that, but the faults, to the bit.
    pub digest: [u8; 32],
}

impl Record {
    fn new(number: u64) -> Self {
        Record {
            number,
            variant: 0,
            kind: None,
            refused: None,
            periods: 0,
            axes: Vec::new(),
            loaded: false,
            faults: Vec::new(),
            digest: [0; 32],
        }
    }

    fn refused(number: u64, rejection: &Rejection) -> Self {
        let mut record = Record { refused: Some(rejection.code), ..Record::new(number) };
        record.digest = record.hash();
        record
    }

    fn hash(&self) -> [u8; 32] {
        let mut hasher = Hasher::new();
        let kind = self.kind.map_or(u64::MAX, |kind| kind as u64);
        let refused = self.refused.map_or(0, |code| code as u64);
        for word in [self.number, self.variant as u64, kind, refused, self.periods as u64] {
            hasher.update(&word.to_le_bytes());
        }
        for axis in &self.axes {
            hasher.update(&axis.limited_ticks.to_le_bytes());
            let figures = [axis.peak_current, axis.error, axis.supplied, axis.dissipated, axis.returned];
            for value in figures.iter().chain(&axis.end) {
                hasher.update(&value.to_bits().to_le_bytes());
            }
        }
        *hasher.finalize().as_bytes()
    }
}

/// A simulation of a variant, with what is looked at.
#[derive(Debug)]
struct Stand {
    simulation: Simulation,
    watches: Vec<AxisWatch>,
}

/// The simulations of one thread.
#[derive(Debug)]
pub struct Bench {
    fleet: Fleet,
    seed: u64,
    width: Width,
    stands: Vec<Option<Stand>>,
    motions: u64,
}

impl Bench {
    /// No simulation yet.
    pub fn new(fleet: &Fleet, seed: u64, width: Width) -> Self {
        let stands = fleet.variants().iter().map(|_| None).collect();
        Bench { fleet: fleet.clone(), seed, width, stands, motions: 0 }
    }

    /// Runs trajectory `number`.
    ///
    /// # Errors
    /// [`FleetError`] if its machine cannot be simulated.
    pub fn run(&mut self, number: u64) -> Result<Record, FleetError> {
        self.run_altered(number, |_, _, _| {})
    }

    /// The same, `alter`ing what is seen of an axis at a tick before it is looked at: what is wrong with it must be
    /// found.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_altered(
        &mut self,
        number: u64,
        alter: impl FnMut(usize, usize, &mut AxisSample),
    ) -> Result<Record, FleetError> {
        let plan = match Plan::new(&self.fleet, self.seed, number) {
            Ok(plan) => plan,
            Err(rejection) => return Ok(Record::refused(number, &rejection)),
        };
        self.ready(plan.variant)?;
        match self.follow(&plan, alter) {
            Ok(record) => Ok(record),
            Err(rejection) => Ok(Record::refused(number, &rejection)),
        }
    }

    /// Makes the simulation of a variant, if there is none yet.
    fn ready(&mut self, place: usize) -> Result<(), FleetError> {
        if self.stands[place].is_none() {
            let variant = &self.fleet.variants()[place];
            let mut simulation = Simulation::new(&variant.config, variant.joints.clone(), 0)?;
            // What is measured here is measured apart.
            simulation.set_assessing(false);
            simulation.set_width(self.width);
            let periods = variant.config.periods();
            let axes = variant.config.axes().iter().zip(&variant.axes);
            let watches = axes.map(|(axis, theory)| AxisWatch::new(axis, &periods, theory)).collect();
            self.stands[place] = Some(Stand { simulation, watches });
        }
        Ok(())
    }

    fn next_motion(&mut self) -> MotionId {
        self.motions += 1;
        MotionId(self.motions)
    }

    fn follow(
        &mut self,
        plan: &Plan,
        mut alter: impl FnMut(usize, usize, &mut AxisSample),
    ) -> Result<Record, Rejection> {
        let fleet = self.fleet.clone();
        let (motion, stop) = (self.next_motion(), self.next_motion());
        let variant = &fleet.variants()[plan.variant];
        let Some(Stand { simulation, watches }) = self.stands[plan.variant].as_mut() else {
            return Err(Rejection::new(Code::UnknownJoint, "the machine has not been made ready"));
        };
        simulation.reset_to(&plan.start)?;
        if matches!(plan.ask, Ask::Stream(_)) {
            // A stop of the trajectory before holds streams off until they have paused.
            for _ in 0..=STREAM_PAUSE / variant.period() + 1 {
                simulation.step();
            }
        }
        let context = Context {
            joints: &variant.joints,
            period: variant.period(),
            max_points: usize::MAX,
            allow_nonzero_end_velocity: false,
        };
        let checked = |request: Request| Trajectory::new(request, &context).map(Arc::new);
        if let Ask::Follow(request) | Ask::Stop(request, _) = &plan.ask {
            simulation.offer(motion, checked(request.clone())?)?;
        }
        watches.iter_mut().zip(&plan.start).for_each(|(watch, start)| watch.begin(*start));
        simulation.take_ends().for_each(drop);
        let mut faults = Faults { number: plan.number, names: &variant.joints, found: Vec::new() };
        let mut loads = plan.loads.iter().peekable();
        let (mut periods, mut ends) = (0, 0);
        let mut limited = vec![0; watches.len()];
        for k in 0..plan.periods {
            while let Some(load) = loads.next_if(|load| load.at <= k) {
                simulation.set_load(load.axis, load.value, load.periods as i64 * variant.period());
            }
            match &plan.ask {
                Ask::Stop(_, at) if *at == k => {
                    let request = Request::new(Start::Now, Vec::new());
                    simulation.offer(stop, checked(request)?)?;
                }
                Ask::Stream(columns) => {
                    for (axis, column) in columns {
                        simulation.stream(*axis, column[k.min(column.len() - 1)])?;
                    }
                }
                _ => {}
            }
            let mut tick = 0;
            let ran = simulation.step_with(|machine, _| {
                for (place, watch) in watches.iter_mut().enumerate() {
                    let mut sample = *machine.axis(place).sample();
                    alter(place, watch.ticks(), &mut sample);
                    let at = watch.ticks();
                    watch.see(&sample, [tick == 0, tick == 1], &mut |broken| faults.add(place, at, broken));
                }
                tick += 1;
            });
            ends += simulation.take_ends().filter(|end| end.id == motion).count();
            if !ran {
                continue;
            }
            periods += 1;
            for (place, watch) in watches.iter_mut().enumerate() {
                let at = watch.ticks();
                let activity = simulation.machine().activity(place);
                watch.end_period(&activity, &mut |broken| faults.add(place, at, broken));
                // What is published of an instant tells limits at any tick since the one before.
                let sample = &simulation.samples()[place];
                let instant = simulation.machine().axis(place).sample().saturated;
                if sample.saturated != (instant || limited[place] > 0) {
                    faults.add(place, at, (Check::Counted, f64::from(u8::from(sample.saturated)), 0.0));
                }
                limited[place] = watch.limited_in_period() - u64::from(instant);
            }
        }
        let asked = matches!(plan.ask, Ask::Follow(_) | Ask::Stop(..));
        if ends != usize::from(asked) {
            faults.add(0, periods, (Check::Ended, ends as f64, 1.0));
        }
        let foreseen = plan.kind != Kind::Stop;
        let mut record = Record {
            variant: plan.variant,
            kind: Some(plan.kind),
            periods,
            loaded: !plan.loads.is_empty(),
            ..Record::new(plan.number)
        };
        for (place, (watch, theory)) in watches.iter().zip(&variant.axes).enumerate() {
            let loaded = plan.loads.iter().any(|load| load.axis == place);
            let at = watch.ticks();
            record
                .axes
                .push(watch.finish(theory, foreseen, loaded, &mut |broken| faults.add(place, at, broken)));
        }
        record.faults = faults.found;
        record.digest = record.hash();
        Ok(record)
    }
}

/// Faults as they are found.
struct Faults<'a> {
    number: u64,
    names: &'a [JointLimits],
    found: Vec<Fault>,
}

impl Faults<'_> {
    fn add(&mut self, place: usize, tick: usize, (check, value, allowed): Broken) {
        if self.found.len() < TOLD {
            let axis = self.names[place].name.clone();
            self.found.push(Fault { check, number: self.number, axis, tick, value, allowed });
        }
    }
}
