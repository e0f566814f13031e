//! Benchmarks of complete runs of trial, tune and identify.

use std::cell::LazyCell;
use std::hint::black_box;
use std::sync::Arc;

use criterion::Criterion;
use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::trial::{self, Measures, Trial};
use virtual_axes_core::units::seconds;
use virtual_axes_identify::identify::campaign::{Campaign, CampaignOptions};
use virtual_axes_identify::identify::{
    FeedforwardMode, IdentificationInput, IdentificationOptions, RefinementScope, identify,
};
use virtual_axes_identify::recording::{Conditioning, RawRecording, Signals, condition};
use virtual_axes_identify::tune::{
    Cost, MarginLimits, NoProgress, Tuning, TuningProblem, Workload, fine_design_grid, tune_gpc_from,
};

use crate::{bench, shipped};
use virtual_axes_verification::fixtures::machines::{program, setpoints};
use virtual_axes_verification::fixtures::recordings::{
    Disturbance, initial_parameters, record_campaign, true_parameters,
};

/// Machines simulated side by side, as in a search.
const SIDE_BY_SIDE_MACHINES: usize = 32;
/// Number of designs of the grid.
const DESIGNS: usize = 5000;
/// Number of designs of the grid that one iteration evaluates.
const SCREENED: usize = 64;
/// Samples of long benchmarks.
const FEW_SAMPLES: usize = 10;

pub fn all(criterion: &mut Criterion) {
    trial(criterion);
    tune(criterion);
    identify_one(criterion);
}

fn trial_of<'a>(name: &str, machine: &'a MachineConfig, record: bool) -> Trial<'a> {
    Trial {
        machine,
        program: Some(program(name, machine)),
        allow_nonzero_end_velocity: false,
        record,
        measures: Measures::ALL,
    }
}

fn trial(criterion: &mut Criterion) {
    let config = shipped();
    let ticks = |seconds_of_all: f64| (seconds_of_all / seconds(config.periods().current)) as usize;
    let mut group = criterion.benchmark_group("trial, ticks of a machine");
    group.sample_size(FEW_SAMPLES);
    for name in ["ballbar", "corner-90", "five-axis"] {
        let of = |record| trial_of(name, &config, record);
        let (bare, recorded) = (of(false), of(true));
        let points = |trial: &Trial| setpoints(name, trial.program.clone().expect("planned"), &config);
        let run = |trial: &Trial| trial::run(trial, points(trial), |_| Ok(())).expect("a run");
        let count = ticks(run(&bare).figures.duration);
        bench(&mut group, &format!("{name}, figures"), count, || run(&bare));
        bench(&mut group, &format!("{name}, figures and recording"), count, || run(&recorded));
        bench(&mut group, &format!("{name}, every tick observed"), count, || {
            trial::trace(&bare, points(&bare), |tick| {
                black_box(tick.machine.axes());
                Ok(())
            })
        });
        if name != "ballbar" {
            continue;
        }
        let variants = vec![config.clone(); SIDE_BY_SIDE_MACHINES];
        let own: Vec<usize> = (0..config.axes().len()).collect();
        bench(&mut group, &format!("{name}, 32 machines together"), count * SIDE_BY_SIDE_MACHINES, || {
            trial::run_variants(&bare, points(&bare), &variants, &own, || Ok(()))
        });
    }
    group.finish();
}

fn tune(criterion: &mut Criterion) {
    let config = shipped();
    let parameters = Parameters::embedded_default().expect("the shipped machine");
    let program = program("ballbar", &config);
    let workload =
        Workload::read("ballbar", Some(Arc::clone(&program)), setpoints("ballbar", program, &config), || {
            Ok(())
        })
        .expect("setpoints");
    let cost = Cost::default();
    let problem =
        LazyCell::new(|| TuningProblem::new(&parameters, &workload, &cost, &NoProgress).expect("a bench"));
    let designs: Vec<Tuning> = fine_design_grid(DESIGNS).into_iter().step_by(DESIGNS / SCREENED).collect();
    let mut group = criterion.benchmark_group("tune, designs");
    bench(&mut group, "margins of the worst axis", designs.len(), || {
        designs.iter().filter(|design| problem.margins(design).is_some()).count()
    });
    group.sample_size(FEW_SAMPLES);
    bench(&mut group, "screened on the ballbar, the best refined, all cores", designs.len(), || {
        tune_gpc_from(&problem, &MarginLimits::STABLE, designs.clone()).expect("a tuning")
    });
    group.finish();
}

fn identify_one(criterion: &mut Criterion) {
    const AXIS: &str = "x";
    let start = initial_parameters(AXIS);
    let machine = start.machine_config().expect("a machine");
    let axis = &machine.axes()[0];
    let raw: LazyCell<Vec<RawRecording>, _> = LazyCell::new(|| {
        let disturbance = Disturbance::usual(axis.kind(), 1);
        let parts = record_campaign(
            &true_parameters(),
            AXIS,
            &FeedforwardMode::ALL,
            &CampaignOptions::default(),
            &disturbance,
        );
        parts.into_iter().map(|(_, recording)| recording).collect()
    });
    let conditioned = |raw: &RawRecording| -> Signals {
        condition(raw, axis, &machine.periods(), &Conditioning::default()).expect("a recording").0
    };
    let signals: LazyCell<Vec<Signals>, _> = LazyCell::new(|| raw.iter().map(conditioned).collect());
    // The campaign is planned for the machine to identify.
    let config = shipped();
    let planned = Campaign::plan(&config, 0, &FeedforwardMode::ALL, &CampaignOptions::default());
    let samples = planned.expect("planned").psec().len();
    let mut group = criterion.benchmark_group("identify, position cycles recorded");
    group.sample_size(FEW_SAMPLES);
    bench(&mut group, "a campaign planned", samples, || {
        Campaign::plan(&config, 0, &FeedforwardMode::ALL, &CampaignOptions::default())
    });
    bench(&mut group, "recordings checked and filtered", samples, || {
        raw.iter().map(conditioned).collect::<Vec<_>>()
    });
    let refined = |refine: RefinementScope| {
        let modes = FeedforwardMode::ALL.into_iter().map(Some);
        let inputs: Vec<IdentificationInput> = signals
            .iter()
            .zip(modes)
            .map(|(signals, feedforward)| IdentificationInput { signals, feedforward })
            .collect();
        identify(
            &inputs,
            axis,
            &machine.periods(),
            &IdentificationOptions { refine, ..IdentificationOptions::default() },
        )
    };
    bench(&mut group, "one axis by the steps of the paper", samples, || refined(RefinementScope::NONE));
    bench(&mut group, "one axis, refined on the closed loop", samples, || refined(RefinementScope::ALL));
    group.finish();
}
