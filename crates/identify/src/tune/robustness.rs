//! Robustness of a tuning against deviations of the plant.

use rayon::prelude::*;

use super::cost::Cost;
use super::error::TuneError;
use super::margin_limits::worst_margins;
use super::progress::Progress;
use super::workload::Workload;
use virtual_axes_core::config::{Assignment, MachineConfig, Parameters, Value, ValueSource};
use virtual_axes_core::design::Margins;
use virtual_axes_core::machine::{
    MachineError, contour_axes, design_controller, deviating_plant_model, prediction_model, with_contour_gain,
};
use virtual_axes_core::trial::Figures;

/// Factors of the plant relative to the model of the controller design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantDeviation {
    /// Factor of the inertia.
    pub inertia: f64,
    /// Factor of the friction.
    pub friction: f64,
    /// Factor of the torque constant.
    pub torque_constant: f64,
}

impl PlantDeviation {
    /// No deviation.
    pub const NONE: PlantDeviation = PlantDeviation { inertia: 1.0, friction: 1.0, torque_constant: 1.0 };

    /// Returns each deviation by itself, low and high.
    pub fn single(by: f64) -> [PlantDeviation; 6] {
        let [low, high] = [1.0 - by, 1.0 + by];
        [
            PlantDeviation { inertia: low, ..Self::NONE },
            PlantDeviation { inertia: high, ..Self::NONE },
            PlantDeviation { friction: low, ..Self::NONE },
            PlantDeviation { friction: high, ..Self::NONE },
            PlantDeviation { torque_constant: low, ..Self::NONE },
            PlantDeviation { torque_constant: high, ..Self::NONE },
        ]
    }

    /// Returns all combinations of low and high deviations.
    pub fn combined(by: f64) -> [PlantDeviation; 8] {
        let at = |above: usize| if above == 1 { 1.0 + by } else { 1.0 - by };
        std::array::from_fn(|i| PlantDeviation {
            inertia: at(i >> 2),
            friction: at(i >> 1 & 1),
            torque_constant: at(i & 1),
        })
    }
}

/// Run on a deviating plant.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviatingRun {
    /// Deviation of the plant of every axis.
    pub deviation: PlantDeviation,
    /// Margins of the worst moving axis with the controller of the nominal plant; none if a loop is unstable.
    pub margins: Option<Margins>,
    /// Cost.
    pub cost: f64,
    /// Figures of the run without circles.
    pub figures: Figures,
}

/// Tuning evaluated on several plants.
#[derive(Debug, Clone, PartialEq)]
pub struct Robustness {
    /// Run without deviation.
    pub nominal: DeviatingRun,
    /// Runs with single deviations in the order of [`PlantDeviation::single`].
    pub single: Vec<DeviatingRun>,
    /// Worst run of [`PlantDeviation::combined`]: unstable before stable, then the highest cost.
    pub worst: DeviatingRun,
}

/// Runs `parameters` on `workload` with inertia, friction and torque constant changed by ±`by` (relative).
///
/// The changes multiply the deviations of the parameters themselves.
///
/// # Errors
/// [`TuneError`] if a run fails.
pub fn analyze_robustness(
    parameters: &Parameters,
    workload: &Workload,
    cost: &Cost,
    by: f64,
    progress: &dyn Progress,
) -> Result<Robustness, TuneError> {
    let (single, combined) = (PlantDeviation::single(by), PlantDeviation::combined(by));
    let all: Vec<PlantDeviation> = [PlantDeviation::NONE].into_iter().chain(single).chain(combined).collect();
    progress.begin("deviating plants", all.len());
    let plants = all
        .iter()
        .map(|deviation| deviating_machine(parameters, deviation))
        .collect::<Result<Vec<_>, _>>()?;
    let machine = parameters.machine_config()?;
    let axes: Vec<usize> = (0..machine.axes().len()).collect();
    let allow = parameters.node_config().allow_nonzero_velocity_at_trajectory_end;
    let side_by_side = |plants: &[MachineConfig]| {
        let figures = workload.run_variants(&machine, plants, &axes, allow, || progress.check_interrupt())?;
        figures.iter().for_each(|_| progress.finish_run());
        Ok(figures)
    };
    let share = plants.len().div_ceil(rayon::current_num_threads().max(1));
    let figures = plants.par_chunks(share).map(side_by_side).collect::<Result<Vec<_>, TuneError>>()?;
    let run = |((deviation, config), figures): ((PlantDeviation, &MachineConfig), Figures)| {
        let margins = margins(config, &figures)?;
        Ok(DeviatingRun { deviation, margins, cost: cost.of(&figures, config), figures })
    };
    let runs = all.into_iter().zip(&plants).zip(figures.into_iter().flatten()).map(run);
    let mut runs = runs.collect::<Result<Vec<_>, TuneError>>()?;
    let combined = runs.split_off(1 + single.len());
    let nominal = runs.remove(0);
    let key = |run: &DeviatingRun| (run.margins.is_none(), run.cost);
    let worst = combined.into_iter().fold(None, |worst: Option<DeviatingRun>, run| match worst {
        Some(worst) if key(&worst) >= key(&run) => Some(worst),
        _ => Some(run),
    });
    Ok(Robustness { worst: worst.unwrap_or_else(|| nominal.clone()), nominal, single: runs })
}

/// Returns the machine of `parameters` with inertia, friction and torque constant of each axis multiplied by a deviation.
///
/// # Errors
/// [`TuneError`] if a factor is outside of its range.
pub fn deviating_machine(
    parameters: &Parameters,
    deviation: &PlantDeviation,
) -> Result<MachineConfig, TuneError> {
    let source = ValueSource::named("deviation");
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

/// Returns the margins of the worst moving axis: nominal controller on the deviating plant, along the path and, with
/// cross-coupled control, across it.
fn margins(config: &MachineConfig, figures: &Figures) -> Result<Option<Margins>, TuneError> {
    let gain = config.contour_gain();
    let coupled = contour_axes(gain, config.axes().iter());
    let mut loops = Vec::new();
    for (index, axis) in config.axes().iter().enumerate().filter(|(index, _)| figures.axes[*index].moves) {
        let periods = config.periods();
        let named = |source| MachineError::Axis { axis: axis.name().to_owned(), source };
        let nominal = prediction_model(axis, &periods).map_err(named)?;
        let plant = deviating_plant_model(axis, &periods).map_err(named)?;
        let along = design_controller(axis, &nominal);
        if coupled.contains(&index) {
            let across = along.clone().and_then(|rst| with_contour_gain(&rst, gain));
            loops.push((plant.clone(), across));
        }
        loops.push((plant, along));
    }
    Ok(worst_margins(loops.iter().map(|(plant, rst)| (plant, rst.clone()))))
}
