//! One tuning on plants that deviate from what it was designed for.

use rayon::prelude::*;

use super::cost::Cost;
use super::course::Course;
use super::loops::worst;
use super::{TuneError, Watch};
use virtual_axes_core::config::{Assignment, MachineConfig, Parameters, Source, Value};
use virtual_axes_core::design::Margins;
use virtual_axes_core::machine::{MachineError, designed, deviating_model, prediction_model};
use virtual_axes_core::trial::Figures;

/// Factors of the plant relative to what the controllers are designed for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Of the inertia.
    pub inertia: f64,
    /// Of the friction.
    pub friction: f64,
    /// Of the torque constant.
    pub torque_constant: f64,
}

impl Deviation {
    /// None.
    pub const NONE: Deviation = Deviation { inertia: 1.0, friction: 1.0, torque_constant: 1.0 };

    /// Each by itself below and above.
    pub fn single(by: f64) -> [Deviation; 6] {
        let [low, high] = [1.0 - by, 1.0 + by];
        [
            Deviation { inertia: low, ..Self::NONE },
            Deviation { inertia: high, ..Self::NONE },
            Deviation { friction: low, ..Self::NONE },
            Deviation { friction: high, ..Self::NONE },
            Deviation { torque_constant: low, ..Self::NONE },
            Deviation { torque_constant: high, ..Self::NONE },
        ]
    }

    /// All three together, below or above each.
    pub fn combined(by: f64) -> [Deviation; 8] {
        let at = |above: usize| if above == 1 { 1.0 + by } else { 1.0 - by };
        std::array::from_fn(|i| Deviation {
            inertia: at(i >> 2),
            friction: at(i >> 1 & 1),
            torque_constant: at(i & 1),
        })
    }
}

/// A run on a deviating plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviated {
    /// By what the plant of every axis deviates.
    pub deviation: Deviation,
    /// Of the worst axis that moves, the controller being that for the plant without deviation; none where
    /// a loop is unstable.
    pub margins: Option<Margins>,
    /// What it costs.
    pub cost: f64,
    /// What was measured, all but the circles.
    pub figures: Figures,
}

/// One tuning on several plants.
#[derive(Debug, Clone, PartialEq)]
pub struct Robustness {
    /// Without deviation.
    pub nominal: Deviated,
    /// One deviation at a time, in the order of [`Deviation::single`].
    pub single: Vec<Deviated>,
    /// The worst of [`Deviation::combined`]: unstable before stable, then that which costs most.
    pub worst: Deviated,
}

/// Runs `parameters` on `course` with inertia, friction and torque constant off `by` a part.
///
/// It comes on top of what the parameters deviate by themselves.
///
/// # Errors
/// [`TuneError`].
pub fn robustness(
    parameters: &Parameters,
    course: &Course,
    cost: &Cost,
    by: f64,
    watch: &dyn Watch,
) -> Result<Robustness, TuneError> {
    let (single, combined) = (Deviation::single(by), Deviation::combined(by));
    let all: Vec<Deviation> = [Deviation::NONE].into_iter().chain(single).chain(combined).collect();
    watch.begin("deviating plants", all.len());
    let plants =
        all.iter().map(|deviation| deviating(parameters, deviation)).collect::<Result<Vec<_>, _>>()?;
    let machine = parameters.machine_config()?;
    let axes: Vec<usize> = (0..machine.axes().len()).collect();
    let allow = parameters.node_config().allow_nonzero_velocity_at_trajectory_end;
    let side_by_side = |plants: &[MachineConfig]| {
        let figures = course.run_together(&machine, plants, &axes, allow, || watch.go_on())?;
        figures.iter().for_each(|_| watch.done());
        Ok(figures)
    };
    let share = plants.len().div_ceil(rayon::current_num_threads().max(1));
    let figures = plants.par_chunks(share).map(side_by_side).collect::<Result<Vec<_>, TuneError>>()?;
    let run = |((deviation, config), figures): ((Deviation, &MachineConfig), Figures)| {
        let margins = margins(config, &figures)?;
        Ok(Deviated { deviation, margins, cost: cost.of(&figures, config), figures })
    };
    let runs = all.into_iter().zip(&plants).zip(figures.into_iter().flatten()).map(run);
    let mut runs = runs.collect::<Result<Vec<_>, TuneError>>()?;
    let combined = runs.split_off(1 + single.len());
    let nominal = runs.remove(0);
    let key = |run: &Deviated| (run.margins.is_none(), run.cost);
    let worst = combined.into_iter().fold(None, |worst: Option<Deviated>, run| match worst {
        Some(worst) if key(&worst) >= key(&run) => Some(worst),
        _ => Some(run),
    });
    Ok(Robustness { worst: worst.unwrap_or_else(|| nominal.clone()), nominal, single: runs })
}

/// The machine with plants that deviate.
fn deviating(parameters: &Parameters, deviation: &Deviation) -> Result<MachineConfig, TuneError> {
    let source = Source::named("deviation");
    let mut changed = parameters.clone();
    let factors = [
        ("inertia", deviation.inertia),
        ("friction", deviation.friction),
        ("torque_constant", deviation.torque_constant),
    ];
    let joints: Vec<String> =
        parameters.machine_config()?.axes().iter().map(|axis| axis.name().to_owned()).collect();
    let own = |joint: &str, name: &str| match parameters.get(&format!("{joint}.deviation.{name}")) {
        Some(Value::Double(factor)) => factor,
        _ => 1.0,
    };
    let of_joint = |joint: &String| {
        factors.map(|(name, factor)| Assignment {
            key: format!("{joint}.deviation.{name}"),
            value: Value::Double(factor * own(joint, name)),
            source: source.clone(),
        })
    };
    changed.set_all(joints.iter().flat_map(of_joint).collect())?;
    Ok(changed.machine_config()?)
}

/// Of the worst axis that moves: the controller for the nominal plant on the plant as it is.
fn margins(config: &MachineConfig, figures: &Figures) -> Result<Option<Margins>, TuneError> {
    let mut loops = Vec::new();
    for (axis, _) in config.axes().iter().zip(&figures.axes).filter(|(_, figures)| figures.moves) {
        let periods = config.periods();
        let named = |source| MachineError::Axis { axis: axis.name().to_owned(), source };
        let nominal = prediction_model(axis, &periods).map_err(named)?;
        let plant = deviating_model(axis, &periods).map_err(named)?;
        loops.push((plant, designed(axis, &nominal)));
    }
    Ok(worst(loops.iter().map(|(plant, rst)| (plant, rst.clone()))))
}
