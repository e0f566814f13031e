//! Set-up of a machine for part programs: dialect, work offsets, tools and times.

use std::path::{Path, PathBuf};

use super::declaration::{CheckedValues, Definitions, Field, parameters};
use super::definition::DefaultValue::Text;
use super::definition::{ParameterDefinition, choice, number, text, texts};
use super::error::ValueSource;

/// Key of the file with the tools.
const TOOL_TABLE: &str = "part_program.tool_table";

/// Defines the duration of a step without motion.
const fn duration(key: &'static str) -> ParameterDefinition {
    number(key, "s", 0.0, 3600.0).zero()
}

parameters! {
    /// Set-up of a machine for part programs, with work offsets and tools in the notation of the files and options.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct PartProgramConfig of Machine {
        /// Dialect of part programs; without one it is detected from their content.
        pub dialect: Option<String> = choice(
            "part_program.dialect",
            &["linuxcnc", "fanuc", "haas", "sinumerik", "grbl", "mach3", "okuma", "marlin"],
        ).optional();
        /// Work offsets, each as in "G54=120,80,-350": X, Y and Z in mm, then A, B and C in degrees; those that are not
        /// given are the workpiece frame.
        pub work_offsets: Option<Vec<String>> = texts("part_program.work_offsets").optional();
        /// Tools, each a line of a tool table of LinuxCNC in mm, as in "T1 Z50 D10 ; end mill": number, length, diameter
        /// and name; they replace those of the same number in part_program.tool_table.
        pub tools: Option<Vec<String>> = texts("part_program.tools").optional();
        /// File with a tool table: tool.tbl of LinuxCNC in mm, or CSV with number, length_mm and radius_mm; a relative
        /// path begins at the folder of the machine file.
        pub tool_table: Option<PathBuf> = text(TOOL_TABLE).default(Text("")) => path_beside_source;
        /// Duration of a tool change (M6), s.
        pub tool_change_time: f64 = duration("part_program.tool_change_s");
        /// Duration of a change of the spindle speed (M3, M4, M5, S), s.
        pub spindle_time: f64 = duration("part_program.spindle_s");
    }
}

/// Returns a path; a relative one begins at the folder of the file in which it stands.
fn path_beside_source(values: &CheckedValues<'_>, rows: Definitions) -> Option<Option<PathBuf>> {
    let path = <Option<PathBuf>>::read(values, rows)?;
    let source = values.entries.get(TOOL_TABLE).map(|entry| &entry.source);
    let folder = match source {
        Some(ValueSource::File { name, .. }) => Path::new(name.as_ref()).parent(),
        _ => None,
    };
    Some(path.map(|path| folder.map_or_else(|| path.clone(), |folder| folder.join(&path))))
}
