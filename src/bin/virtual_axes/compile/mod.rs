//! `virtual_axes compile`: a part program with points and feeds for its machine.

mod compile_output;

use std::error::Error;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::builder::NonEmptyStringValueParser;
use virtual_axes_core::config::{DEFAULT_MACHINE, Parameters};
use virtual_axes_core::text::builtin_text;
use virtual_axes_identify::tune::{PlantDeviation, deviating_machine};
use virtual_axes_io::files::OutputFile;
use virtual_axes_nc::builtin::program_folder;
use virtual_axes_nc::compile::{CompileAim, CompileError, CompileOptions, compile};

use crate::arguments::log_arguments::LogArguments;
use crate::arguments::output_arguments::{OutputArguments, OutputFormat};
use crate::arguments::variant;
use crate::builtin::PROGRAMS;
use crate::input::CommandInput;
use crate::input::must_not_replace;
use crate::input::part_program::{PartProgramArguments, no_part_program};
use crate::output::progress::Spinner;
use crate::output::unusable::{BEYOND_LIMITS, UnusableResult};
use crate::output::{interrupt, print_error};
use compile_output::CompileOutput;

/// Micrometer, m.
const MICROMETER: f64 = 1e-6;
/// Order of the combined deviations: the first ones differ most, and guide the search.
const ORDER: [usize; 8] = [6, 1, 4, 3, 0, 2, 5, 7];

/// Arguments of `virtual_axes compile`.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("aim").required(true))]
pub struct CompileArguments {
    /// Built-in part program, or part program file.
    #[arg(value_name = "FILE", value_parser = NonEmptyStringValueParser::new())]
    input: String,
    /// Built-in machine or machine file.
    #[arg(long, default_value = DEFAULT_MACHINE, value_parser = NonEmptyStringValueParser::new())]
    machine: String,
    /// Set a parameter, for example `x.velocity_loop.gain=4.5`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Contour tolerance of the cuts on all plants, µm, in the least time.
    #[arg(long, group = "aim", value_name = "UM", value_parser = tolerance, allow_negative_numbers = true)]
    tolerance_um: Option<f64>,
    /// Least contour error in the cycle time of the program.
    #[arg(long, group = "aim")]
    same_time: bool,
    /// Cycle time that `--same-time` may add, %.
    #[arg(long, default_value_t = 0.0, value_name = "PERCENT", value_parser = more_time, allow_negative_numbers = true, conflicts_with = "tolerance_um")]
    more_time: f64,
    /// Highest feed, % of the programmed feed; the limits of the axes hold.
    #[arg(long, default_value_t = 100.0, value_name = "PERCENT", value_parser = feed_limit, allow_negative_numbers = true)]
    feed_limit: f64,
    /// Relative deviation of inertia, friction and torque constant of the plants beside the nominal one.
    #[arg(long, default_value_t = 0.3, allow_negative_numbers = true, value_parser = deviation)]
    by: f64,
    /// Write the compiled program to this file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    part_program: PartProgramArguments,
    #[command(flatten)]
    output: OutputArguments,
}

impl CompileArguments {
    /// Returns the form of the output.
    pub fn output(&self) -> OutputArguments {
        self.output
    }
}

fn in_range(text: &str, least: f64, most: f64) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value| (least..=most).contains(value));
    value.ok_or_else(|| format!("must be in {least} … {most}"))
}

fn tolerance(text: &str) -> Result<f64, String> {
    in_range(text, 0.1, 10_000.0)
}

fn more_time(text: &str) -> Result<f64, String> {
    in_range(text, 0.0, 100.0)
}

fn feed_limit(text: &str) -> Result<f64, String> {
    in_range(text, 100.0, 1000.0)
}

fn deviation(text: &str) -> Result<f64, String> {
    in_range(text, 0.0, 0.8)
}

/// Text of a program whose bytes are UTF-8, or one character for each byte.
struct ProgramText {
    text: String,
    is_utf8: bool,
}

impl ProgramText {
    fn read(name: &str) -> Result<Self, String> {
        if let Some(text) = builtin_text(PROGRAMS, name) {
            return Ok(Self { text: text.to_owned(), is_utf8: true });
        }
        let bytes = fs::read(name).map_err(|error| format!("{name}: {error}"))?;
        if bytes.contains(&0) {
            return Err(format!("{name}: contains bytes 0, as UTF-16 does; convert the program to UTF-8"));
        }
        Ok(match String::from_utf8(bytes) {
            Ok(text) => Self { text, is_utf8: true },
            Err(error) => {
                Self { text: error.as_bytes().iter().copied().map(char::from).collect(), is_utf8: false }
            }
        })
    }

    /// Returns a text in the encoding of the program.
    fn bytes(&self, text: &str) -> Vec<u8> {
        match self.is_utf8 {
            true => text.as_bytes().to_vec(),
            false => text.chars().map(|c| u8::try_from(c).unwrap_or(b'?')).collect(),
        }
    }
}

/// Runs the command and returns the report.
pub fn run(arguments: &CompileArguments) -> Result<String, Box<dyn Error>> {
    let machine = Parameters::load(&arguments.machine, crate::builtin::MACHINES)?;
    let parameters = variant::parameters(&machine, None, &arguments.set, &[])?;
    let config = variant::checked(&parameters, &machine, &arguments.machine)?;
    let input = CommandInput::open(&arguments.input, None, &LogArguments::default())?;
    if !input.is_part_program() {
        return Err(no_part_program(&arguments.input).into());
    }
    let input = input.with_part_program(&arguments.part_program)?;
    if let Some(out) = &arguments.out {
        must_not_replace(out, Path::new(&arguments.input))?;
        must_not_replace(out, Path::new(&arguments.machine))?;
    }
    // All errors of the program at once.
    for (line, note) in input.survey(&config, &mut |_| ())?.notes() {
        print_error(&format!("note: {}:{line}: {note}", arguments.input));
    }
    // A file that cannot be written is an error before the calculation.
    let out = arguments.out.as_deref().map(OutputFile::create).transpose()?;
    let program = ProgramText::read(&arguments.input)?;
    let deviations = PlantDeviation::combined(arguments.by);
    let deviations = ORDER.map(|index| deviations[index]);
    let plants = std::iter::once(Ok(config.clone()))
        .chain(deviations.iter().map(|deviation| deviating_machine(&parameters, deviation)))
        .collect::<Result<Vec<_>, _>>()?;
    let options = CompileOptions {
        aim: match arguments.tolerance_um {
            Some(tolerance) => CompileAim::Tolerance(tolerance * MICROMETER),
            None => CompileAim::Time(arguments.more_time / 100.0),
        },
        feed_limit: arguments.feed_limit / 100.0,
        program: arguments.part_program.options()?,
    };
    let place = (arguments.input.as_str(), program_folder(&arguments.input, PROGRAMS));
    let spinner = (!arguments.output.is_quiet()).then(Spinner::new);
    if let Some(spinner) = &spinner {
        spinner.set_activity(format!("compiling {}", arguments.input))?;
    }
    let found = compile(&program.text, place, &plants, &options, &interrupt::check).map_err(
        |error| -> Box<dyn Error> {
            match error {
                CompileError::Trial(error) => input.name_error(error),
                CompileError::Program(error) => error.into(),
                error => format!("{}: {error}", arguments.input).into(),
            }
        },
    )?;
    drop(spinner);
    if let Some(mut file) = out {
        file.write_all(&program.bytes(&found.text))?;
        file.finish()?;
    }
    let output = CompileOutput { input: &input, machine: &config, options: &options, found: &found };
    let text = match arguments.output.format() {
        OutputFormat::Json => format!("{:#}\n", output.json()),
        OutputFormat::Csv => output.csv(),
        OutputFormat::Quiet => output.verdict(),
        OutputFormat::Text => output.text(),
    };
    match output.excess() {
        None => Ok(text),
        Some(excess) => {
            let reason = format!("{}: {excess}", arguments.input);
            Err(Box::new(UnusableResult { text, reason, status: BEYOND_LIMITS }))
        }
    }
}
