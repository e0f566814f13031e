//! Part programs as input: names, files and options.

use std::fs::File;
use std::io::{self, BufRead, Read};
use std::path::{Path, PathBuf};

use virtual_axes_core::text::{builtin_names, builtin_text};
use virtual_axes_io::files::{self, InputError};
use virtual_axes_nc::builtin::open_program;
use virtual_axes_nc::interpret::{CodePattern, Dialect, IgnoredCodes, ToolTable, WorkOffset, is_g_code};
use virtual_axes_nc::offline::{OverrideSchedule, PartProgramOptions};
use virtual_axes_nc::plan::PlanOptions;

use crate::builtin::PROGRAMS;

/// Extensions of part programs.
const EXTENSIONS: [&str; 12] =
    ["nc", "ngc", "tap", "cnc", "mpf", "spf", "min", "ssb", "lib", "gcode", "iso", "eia"];
/// Extensions of other inputs.
const OTHER_EXTENSIONS: [&str; 5] = ["csv", "yaml", "yml", "mcap", "json"];
/// Bytes at the start of a file in which a part program without known extension is recognized.
const HEAD: u64 = 1 << 14;
/// Micrometer, m.
const MICROMETER: f64 = 1e-6;

/// Options of the interpretation and planning of a part program.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct PartProgramArguments {
    /// Feed override of a part program, 0 to 200 %: constant, or from times on, as in `0:100,2.5:0,4:120`.
    #[arg(long = "override", value_name = "PERCENT|S:PERCENT,…", allow_hyphen_values = true)]
    feed_override: Option<String>,
    /// Dialect of a part program: linuxcnc, fanuc, haas, sinumerik, grbl, mach3, okuma or marlin [default: of the machine file, or detected from the content].
    #[arg(long, value_name = "DIALECT")]
    dialect: Option<Dialect>,
    /// Work offset of a part program in place of that of the machine file, as in G54=120,80,-350: X, Y and Z in mm, then A, B and C in degrees. Repeatable.
    #[arg(long = "work-offset", value_name = "G54=X,Y,Z", allow_hyphen_values = true)]
    work_offset: Vec<WorkOffset>,
    /// Tool table of a part program: tool.tbl of LinuxCNC in mm, or CSV with number, length_mm and radius_mm [default: of the machine file].
    #[arg(long, value_name = "FILE")]
    tools: Option<PathBuf>,
    /// Duration of a tool change of a part program, s [default: of the machine file].
    #[arg(long = "tool-change-s", value_name = "S", value_parser = not_negative, allow_negative_numbers = true)]
    tool_change_s: Option<f64>,
    /// Duration of a change of the spindle speed of a part program, s [default: of the machine file].
    #[arg(long = "spindle-s", value_name = "S", value_parser = not_negative, allow_negative_numbers = true)]
    spindle_s: Option<f64>,
    /// G and M codes that have no effect in a part program: M7,G187,M100-M199,M1xx,G5*. Of a line without other codes only F, S and T remain, and axis words beside M codes. Each one found is noted.
    #[arg(long, value_name = "CODES", value_delimiter = ',')]
    ignore: Vec<CodePattern>,
    /// Bound of the chord error of a part program's setpoints as a polyline, µm: slows the feed in curves [default: none].
    #[arg(long, value_name = "UM", value_parser = positive, allow_negative_numbers = true)]
    chord_error_um: Option<f64>,
    /// Bound of the centripetal acceleration of the tool tip of a part program, m/s² [default: none besides the axes'].
    #[arg(long, value_name = "M_S2", value_parser = positive, allow_negative_numbers = true)]
    centripetal_m_s2: Option<f64>,
}

/// Returns the error of an input that is no part program.
pub fn no_part_program(name: &str) -> String {
    let names: Vec<&str> = builtin_names(PROGRAMS).collect();
    format!("{name}: a part program is required; built-in ones are {}", names.join(", "))
}

impl PartProgramArguments {
    /// Returns the first option that is given.
    pub fn given(&self) -> Option<&'static str> {
        let given = [
            (self.feed_override.is_some(), "--override"),
            (self.dialect.is_some(), "--dialect"),
            (!self.work_offset.is_empty(), "--work-offset"),
            (self.tools.is_some(), "--tools"),
            (self.tool_change_s.is_some(), "--tool-change-s"),
            (self.spindle_s.is_some(), "--spindle-s"),
            (!self.ignore.is_empty(), "--ignore"),
            (self.chord_error_um.is_some(), "--chord-error-um"),
            (self.centripetal_m_s2.is_some(), "--centripetal-m-s2"),
        ];
        given.into_iter().find(|(is_given, _)| *is_given).map(|(_, name)| name)
    }

    /// Returns the options.
    ///
    /// # Errors
    ///
    /// Returns an error if the feed override or the tool table is invalid.
    pub fn options(&self) -> Result<PartProgramOptions, String> {
        let schedule = match &self.feed_override {
            Some(text) => {
                OverrideSchedule::parse(text).map_err(|error| format!("--override {text}: {error}"))?
            }
            None => OverrideSchedule::default(),
        };
        let default = PlanOptions::default();
        let plan = PlanOptions {
            chord_error: self.chord_error_um.map_or(default.chord_error, |error| error * MICROMETER),
            centripetal_acceleration: self.centripetal_m_s2.unwrap_or(default.centripetal_acceleration),
            ..default
        };
        let tools = match &self.tools {
            Some(path) => ToolTable::from_file(path).map_err(|error| format!("--tools {error}"))?,
            None => ToolTable::default(),
        };
        Ok(PartProgramOptions {
            schedule,
            dialect: self.dialect,
            ignored: IgnoredCodes::new(self.ignore.clone()),
            work_offsets: self.work_offset.clone(),
            tools,
            tool_change_time: self.tool_change_s,
            spindle_time: self.spindle_s,
            plan,
        })
    }
}

/// Reads a number of at least 0.
fn not_negative(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|value| *value >= 0.0 && value.is_finite());
    number.ok_or_else(|| "must be a number of at least 0".to_owned())
}

/// Reads a positive number.
fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|value| *value > 0.0 && value.is_finite());
    number.ok_or_else(|| "must be a positive number".to_owned())
}

/// Returns true for a built-in part program, for a file with the extension of one, and for a file with G code as content.
pub fn is_part_program(name: &str) -> bool {
    builtin_text(PROGRAMS, name).is_some()
        || has_program_extension(name)
        || (!has_extension(name, &OTHER_EXTENSIONS) && has_part_program(Path::new(name)).unwrap_or(false))
}

/// Returns true for the name of a file with the extension of a part program.
pub fn has_program_extension(name: &str) -> bool {
    has_extension(name, &EXTENSIONS)
}

/// Returns true for the name of a file with one of the extensions.
fn has_extension(name: &str, known: &[&str]) -> bool {
    let extension = Path::new(name).extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| known.iter().any(|known| extension.eq_ignore_ascii_case(known)))
}

/// Returns true if a regular file begins with lines of G code.
fn has_part_program(path: &Path) -> io::Result<bool> {
    if !path.metadata()?.is_file() {
        return Ok(false);
    }
    let mut head = Vec::new();
    File::open(path)?.take(HEAD).read_to_end(&mut head)?;
    Ok(is_g_code(&head))
}

/// Opens a file that is no part program and detects its kind; the error of an unknown one names the extensions of part
/// programs.
pub fn open_other(path: &Path) -> Result<files::Input, String> {
    files::Input::open(path).map_err(|error| match error {
        InputError::Unknown { .. } | InputError::Syntax { is_first_line: true, .. } => {
            format!("{error}; part programs have the extension {}", EXTENSIONS.join(", "))
        }
        InputError::Unreadable { .. } | InputError::Syntax { .. } => error.to_string(),
    })
}

/// Returns the number of lines of a part program.
///
/// # Errors
///
/// Returns an error of the operating system.
pub fn count_lines(name: &str) -> io::Result<u64> {
    let mut reader = open_program(name, PROGRAMS)?;
    let (mut lines, mut is_open) = (0, false);
    loop {
        let bytes = reader.fill_buf()?;
        let Some(last) = bytes.last() else { return Ok(lines + u64::from(is_open)) };
        lines += bytes.iter().filter(|byte| **byte == b'\n').count() as u64;
        is_open = *last != b'\n';
        let length = bytes.len();
        reader.consume(length);
    }
}
