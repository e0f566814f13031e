//! One trajectory after another, on simulations that are kept.

use std::sync::Arc;

use blake3::Hasher;

use super::drive::Broken;
use super::fault::{Check, Fault};
use super::fleet::{Fleet, FleetError, Variant};
use super::plan::{Ask, Kind, Plan};
use super::watch::{AxisFigures, AxisWatch};
use virtual_axes_core::machine::{AxisSample, Width};
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::trajectory::stream::STREAM_PAUSE;
use virtual_axes_core::trajectory::{Context, MotionId, Rejection, Request, Start, Trajectory};

/// Most faults of a trajectory that are told.
const TOLD: usize = 8;

/// What a trajectory came to.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Record {
    /// Its number.
    pub number: u64,
    /// Place of its machine in the fleet, and its kind; none of one that was refused.
    pub ran: Option<(usize, Kind)>,
    /// Position periods that ran.
    pub periods: usize,
    /// Of each axis.
    pub axes: Vec<AxisFigures>,
    /// Whether it met a load.
    pub loaded: bool,
    /// What is wrong.
    pub faults: Vec<Fault>,
    /// Hash, to the bit, of number, machine, kind and periods, and of each axis ticks at a limit, peak current, error,
    /// energies, and where it ended.
    pub digest: [u8; 32],
}

impl Record {
    fn hash(&self) -> [u8; 32] {
        let mut hasher = Hasher::new();
        let (variant, kind) = self.ran.map_or((0, u64::MAX), |(place, kind)| (place as u64, kind as u64));
        for word in [self.number, variant, kind, 0, self.periods as u64] {
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
        let mut faults = Faults { number, found: Vec::new() };
        let record = match Plan::new(&self.fleet, self.seed, number) {
            Ok(plan) => self.follow(&plan, &mut faults, alter)?,
            Err(rejection) => {
                faults.refused(0, &rejection);
                Record::default()
            }
        };
        let mut record = Record { number, faults: faults.found, ..record };
        record.digest = record.hash();
        Ok(record)
    }

    fn next_motion(&mut self) -> MotionId {
        self.motions += 1;
        MotionId(self.motions)
    }

    /// Runs `plan`; one that is refused is a fault, since it is within all limits.
    fn follow(
        &mut self,
        plan: &Plan,
        faults: &mut Faults,
        alter: impl FnMut(usize, usize, &mut AxisSample),
    ) -> Result<Record, FleetError> {
        let motions = [self.next_motion(), self.next_motion()];
        let variant = &self.fleet.variants()[plan.variant];
        let place = &mut self.stands[plan.variant];
        let made = match place.take() {
            Some(made) => made,
            None => Stand::new(variant, self.width)?,
        };
        let stand = place.insert(made);
        Ok(stand.follow(plan, variant, motions, faults, alter).unwrap_or_else(|rejection| {
            let tick = stand.watches.first().map_or(0, AxisWatch::ticks);
            faults.refused(tick, &rejection);
            Record::default()
        }))
    }
}

/// A simulation of a variant, with what is looked at.
#[derive(Debug)]
struct Stand {
    simulation: Simulation,
    watches: Vec<AxisWatch>,
}

impl Stand {
    fn new(variant: &Variant, width: Width) -> Result<Self, FleetError> {
        let mut simulation = Simulation::new(&variant.config, variant.joints.clone(), 0)?;
        // What is measured here is measured apart.
        simulation.set_assessing(false);
        simulation.set_width(width);
        let periods = variant.config.periods();
        let axes = variant.config.axes().iter().zip(&variant.axes);
        let watches = axes.map(|(axis, theory)| AxisWatch::new(axis, &periods, theory)).collect();
        Ok(Stand { simulation, watches })
    }

    fn follow(
        &mut self,
        plan: &Plan,
        variant: &Variant,
        [motion, stop]: [MotionId; 2],
        faults: &mut Faults,
        mut alter: impl FnMut(usize, usize, &mut AxisSample),
    ) -> Result<Record, Rejection> {
        let Stand { simulation, watches } = self;
        watches.iter_mut().zip(&plan.start).for_each(|(watch, start)| watch.begin(*start));
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
        simulation.take_ends().for_each(drop);
        let name = |place: usize| variant.joints[place].name.as_str();
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
                    watch.see(&sample, [tick == 0, tick == 1], &mut |broken| {
                        faults.add(name(place), at, broken)
                    });
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
                watch.end_period(&activity, &mut |broken| faults.add(name(place), at, broken));
                // What is published of an instant tells limits at any tick since the one before.
                let sample = &simulation.samples()[place];
                let instant = simulation.machine().axis(place).sample().saturated;
                if sample.saturated != (instant || limited[place] > 0) {
                    faults.add(name(place), at, (Check::Counted, f64::from(u8::from(sample.saturated)), 0.0));
                }
                limited[place] = watch.limited_in_period() - u64::from(instant);
            }
        }
        let asked = matches!(plan.ask, Ask::Follow(_) | Ask::Stop(..));
        if ends != usize::from(asked) {
            let tick = periods * variant.ticks();
            faults.add("", tick, (Check::Ended, ends as f64, f64::from(u8::from(asked))));
        }
        let foreseen = plan.kind != Kind::Stop;
        let mut record = Record {
            ran: Some((plan.variant, plan.kind)),
            periods,
            loaded: !plan.loads.is_empty(),
            ..Record::default()
        };
        for (place, (watch, theory)) in watches.iter().zip(&variant.axes).enumerate() {
            let loaded = plan.loads.iter().any(|load| load.axis == place);
            let at = watch.ticks();
            record.axes.push(
                watch.finish(theory, foreseen, loaded, &mut |broken| faults.add(name(place), at, broken)),
            );
        }
        Ok(record)
    }
}

/// Faults as they are found.
struct Faults {
    number: u64,
    found: Vec<Fault>,
}

impl Faults {
    fn add(&mut self, axis: &str, tick: usize, (check, value, allowed): Broken) {
        if self.found.len() < TOLD {
            self.found.push(Fault {
                check,
                number: self.number,
                axis: axis.to_owned(),
                tick,
                value,
                allowed,
            });
        }
    }

    fn refused(&mut self, tick: usize, rejection: &Rejection) {
        let joint = rejection.joint.as_deref().unwrap_or_default();
        self.add(joint, tick, (Check::Taken(rejection.code), rejection.value, rejection.limit));
    }
}
