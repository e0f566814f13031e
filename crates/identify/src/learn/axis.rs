//! Learning filter of an axis and its convergence on deviating plants.

use virtual_axes_core::config::{AxisConfig, DeviationConfig, Periods};
use virtual_axes_core::design::{Contraction, ImpulseResponse, LearningFilter, LearningTuning};
use virtual_axes_core::machine::{MachineError, closed_loop_response};
use virtual_axes_core::units::seconds;

use super::error::LearningError;
use crate::tune::PlantDeviation;

/// Convergence of an axis on a deviating plant.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisContraction {
    /// Deviation of the plant. Friction is not part of the linear closed loop.
    pub deviation: PlantDeviation,
    /// Contraction; `None` if the closed loop is unstable or does not settle.
    pub contraction: Option<Contraction>,
}

/// Axis with its learning filter.
#[derive(Debug, Clone, PartialEq)]
pub struct LearningAxis {
    /// Index in the machine.
    pub index: usize,
    /// Name of the joint.
    pub name: String,
    /// Filters, designed on the nominal plant.
    pub filter: LearningFilter,
    /// Closed loop of the nominal plant from setpoint to position.
    pub response: ImpulseResponse,
    /// Convergence on plants with inertia and torque constant changed singly and together.
    pub deviating: Vec<AxisContraction>,
}

impl LearningAxis {
    /// Designs the filters of the axis `index`; positions are compared with setpoints `delay` position cycles older.
    /// `by` is the relative deviation of the plants, for which the bandwidth is chosen as well.
    pub(super) fn design(
        (index, axis): (usize, &AxisConfig),
        periods: &Periods,
        delay: i64,
        by: f64,
        tuning: &LearningTuning,
    ) -> Result<Self, LearningError> {
        let name = axis.name().to_owned();
        let response_with = |deviation: &PlantDeviation| {
            let PlantDeviation { inertia, friction, torque_constant } = *deviation;
            let deviation = DeviationConfig { inertia, friction, torque_constant };
            closed_loop_response(&AxisConfig { deviation, ..axis.clone() }, periods)
                .map(|response| response.advanced(delay))
        };
        let response = response_with(&PlantDeviation::NONE)
            .map_err(|source| MachineError::Axis { axis: name.clone(), source })?;
        let plants: Vec<(PlantDeviation, Option<ImpulseResponse>)> =
            linear_deviations(by).map(|deviation| (deviation, response_with(&deviation).ok())).collect();
        let others: Vec<ImpulseResponse> = plants.iter().filter_map(|(_, other)| other.clone()).collect();
        let period = seconds(periods.position);
        let filter = LearningFilter::design(&response, &others, period, tuning)
            .map_err(|source| LearningError::Design { axis: name.clone(), source })?;
        let deviating = plants.into_iter().map(|(deviation, other)| AxisContraction {
            deviation,
            contraction: other.map(|other| filter.contraction(&other, period)),
        });
        Ok(LearningAxis { index, name, deviating: deviating.collect(), filter, response })
    }

    /// Returns the largest contraction factor of the deviating plants, infinite if one of them has no settling closed loop.
    pub fn worst_deviating(&self) -> Contraction {
        let unstable = Contraction { factor: f64::INFINITY, frequency: 0.0 };
        let all = self.deviating.iter().map(|plant| plant.contraction.unwrap_or(unstable));
        all.fold(self.filter.nominal(), |worst, one| if one.factor > worst.factor { one } else { worst })
    }
}

/// Returns the deviations of inertia and torque constant by themselves and together.
fn linear_deviations(by: f64) -> impl Iterator<Item = PlantDeviation> {
    let [low, high] = [1.0 - by, 1.0 + by];
    let of = |inertia, torque_constant| PlantDeviation { inertia, torque_constant, friction: 1.0 };
    [
        of(low, 1.0),
        of(high, 1.0),
        of(1.0, low),
        of(1.0, high),
        of(low, low),
        of(low, high),
        of(high, low),
        of(high, high),
    ]
    .into_iter()
}
