//! Machine with hidden axes.

use virtual_axes_identify::recording::RawRecording;

use super::error::TraceError;
use super::hidden_axis::HiddenAxis;
use super::program::ProductionProgram;
use super::recorder::TraceRecorder;

/// Machine with hidden axes and one control.
#[derive(Debug, Clone, PartialEq)]
pub struct HiddenMachine {
    /// Axes in the order of joints, with equal periods.
    pub axes: Vec<HiddenAxis>,
}

impl HiddenMachine {
    /// Draws the axes X, Y (horizontal) and Z (vertical) of a machine. Each axis is that of [`HiddenAxis::draw`] with
    /// equal seed.
    pub fn draw(seed: u64) -> Self {
        HiddenMachine { axes: (0..3).map(|joint| HiddenAxis::draw_joint(seed, joint)).collect() }
    }

    /// Plans program `seed` of up to `duration` s within the limits of the axes.
    ///
    /// # Errors
    /// [`TraceError`] if the duration is out of range or the program cannot be planned.
    pub fn program(&self, seed: u64, duration: f64) -> Result<ProductionProgram, TraceError> {
        let fallback = HiddenAxis::draw_joint(0, 0).config.limits;
        let mut limits = [self.axes.first().map_or(fallback, |axis| axis.config.limits); 3];
        for axis in &self.axes {
            if let Some(limits) = limits.get_mut(axis.joint) {
                *limits = axis.config.limits;
            }
        }
        ProductionProgram::draw(seed, duration, &limits)
    }

    /// Records a program: one recording per axis, with equal stamps.
    ///
    /// # Errors
    /// [`TraceError`] if an option of the recorder is out of range or an axis cannot be simulated.
    pub fn record(
        &self,
        program: &ProductionProgram,
        recorder: &TraceRecorder,
        seed: u64,
    ) -> Result<Vec<RawRecording>, TraceError> {
        self.axes.iter().map(|axis| axis.record(program, recorder, seed)).collect()
    }
}
