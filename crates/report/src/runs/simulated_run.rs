//! One simulated run with its variant of the machine.

use virtual_axes_core::config::{ControllerName, MachineConfig, Parameters, Value};
use virtual_axes_core::kinematics::{AxisRole, Kinematics};
use virtual_axes_core::trial::TrialOutcome;

use super::figure::{self, Figure};
use super::{ProgramReport, axis_warnings, table};
use crate::Table;

/// Returns the name of the controller of the axes, or several names joined by `+`.
pub fn controller_name(parameters: &Parameters) -> String {
    let mut names: Vec<String> = Vec::new();
    let mut feedforward = false;
    for (key, value) in parameters.iter() {
        match value {
            Value::Text(name) if key.ends_with(".position_loop.controller") && !names.contains(&name) => {
                names.push(name);
            }
            Value::Double(weight) if key.contains(".feedforward.") => feedforward |= weight != 0.0,
            _ => {}
        }
    }
    match names.as_slice() {
        [name] if name == ControllerName::Cascade.name() && !feedforward => {
            ControllerName::CASCADE_WITHOUT_FEEDFORWARD.to_owned()
        }
        _ => names.join("+"),
    }
}

/// Simulated run with its variant of the machine.
#[derive(Debug)]
pub struct SimulatedRun {
    /// Name of the controller.
    pub controller: String,
    /// Changed parameters of all runs, then of this run, in the syntax of the command line.
    pub changes: Vec<String>,
    /// Number of changes that all runs share.
    pub shared_changes: usize,
    /// Machine of the run.
    pub machine: MachineConfig,
    /// Warnings on the input, such as a feed that is not reached. The verdict contains them.
    pub input_warnings: Vec<String>,
    /// Notes on the input, such as a limit without effect.
    pub input_notes: Vec<String>,
    /// Times, worst lines and feed of a part program.
    pub part_program: Option<ProgramReport>,
    /// Result of the run.
    pub outcome: TrialOutcome,
}

impl SimulatedRun {
    /// Returns the title that distinguishes the run from the others.
    pub fn title(&self) -> String {
        let mut title = self.controller.clone();
        for change in self.changes.iter().skip(self.shared_changes) {
            title.push_str(", ");
            title.push_str(change);
        }
        title
    }

    /// Returns the errors along the path: of a part program first those against the programmed path. `ends` adds the contour
    /// errors without the overshoot at the ends of the path.
    pub fn path_figures(&self, ends: bool) -> Vec<Figure> {
        let program = self.part_program.as_ref();
        let mut found = program.map(|program| figure::of_program(&program.figures)).unwrap_or_default();
        found.extend(figure::of_path(&self.outcome.figures, ends));
        found
    }

    /// Creates the table of contour error, orientation error, circles and corners.
    pub fn path_table(&self) -> Table {
        let figures = &self.outcome.figures;
        let mut table = Table::new("Path", &[("path error", ""), ("value", ""), ("unit", "")]);
        for figure in
            self.path_figures(figure::overshoots(figures)).into_iter().chain(figure::of_circles(figures))
        {
            table.rows.push(vec![figure.title(), figure.text(), figure.unit.to_owned()]);
        }
        table
    }

    /// Returns remarks on the run, one per line.
    pub fn remarks(&self) -> Vec<String> {
        let unit = "the unit of position_loop.gain is (m/min)/mm or (1000 °/min)/°, 16.667 1/s";
        let with_unit = |warning: String| match warning.contains("position loop") {
            true => format!("{warning}; {unit}"),
            false => warning,
        };
        let loops = self.axis_warnings().into_iter().map(with_unit);
        loops
            .chain(self.input_warnings.clone())
            .chain(self.input_notes.clone())
            .chain(table::remarks(&self.outcome.figures))
            .collect()
    }

    /// Returns warnings on the loops of the moving axes, on a gantry of which one axis rests, and on moving axes that the
    /// contour error does not contain.
    pub fn axis_warnings(&self) -> Vec<String> {
        let figures = self.outcome.figures.axes.iter();
        let moving = self.machine.axes().iter().zip(figures).filter(|(_, figures)| figures.moves);
        let loops = moving.flat_map(|(axis, _)| axis_warnings::loops(axis, &self.machine.periods()));
        loops.chain(self.resting_gantry_axis()).chain(self.axes_without_role()).collect()
    }

    /// Returns a warning on moving axes that have no part in the contour error; the second axis of a gantry needs none.
    fn axes_without_role(&self) -> Option<String> {
        self.outcome.figures.contour?;
        let kinematics = Kinematics::new(&self.machine);
        let roles = AxisRole::ALL.map(|role| kinematics.role(role));
        let is_in_gantry = |index| self.machine.gantry().is_some_and(|gantry| gantry.axes.contains(&index));
        let axes = self.outcome.figures.axes.iter().enumerate();
        let without = axes
            .filter(|(index, axis)| axis.moves && !roles.contains(&Some(*index)) && !is_in_gantry(*index));
        let names: Vec<&str> = without.map(|(_, axis)| axis.name.as_str()).collect();
        (!names.is_empty()).then(|| {
            format!(
                "the contour error does not contain {}: the tool is moved by joints named x, y, z, a, b and c \
                 (kinematics.chain)",
                names.join(", ")
            )
        })
    }

    /// Returns a warning if only one axis of a gantry has setpoints that move.
    fn resting_gantry_axis(&self) -> Option<String> {
        let axes = self.machine.gantry()?.axes;
        let [first, second] = axes.map(|index| self.outcome.figures.axes.get(index));
        let (moving, resting) = match (first?, second?) {
            (moving, resting) if moving.moves && !resting.moves => (moving, resting),
            (resting, moving) if moving.moves && !resting.moves => (moving, resting),
            _ => return None,
        };
        Some(format!(
            "the setpoints move {} of gantry.axes and not {}: the beam pulls at both; give setpoints for both",
            moving.name, resting.name
        ))
    }
}
