//! Options for the form of the output.

/// Form of the output on standard output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputFormat {
    /// Verdict and tables.
    Text,
    /// Verdict only.
    Quiet,
    /// One JSON object.
    Json,
    /// Comma-separated values with a heading.
    Csv,
}

/// Arguments of the commands that print figures.
#[derive(Debug, Clone, Copy, clap::Args)]
#[group(multiple = false)]
pub struct OutputArguments {
    /// Print only the verdict, and no progress.
    #[arg(long, short)]
    quiet: bool,
    /// Print the figures as one JSON object.
    #[arg(long)]
    json: bool,
    /// Print the figures as comma-separated values, in full precision.
    #[arg(long)]
    csv: bool,
}

impl OutputArguments {
    /// Returns the form of the output.
    pub fn format(self) -> OutputFormat {
        match self {
            OutputArguments { quiet: true, .. } => OutputFormat::Quiet,
            OutputArguments { json: true, .. } => OutputFormat::Json,
            OutputArguments { csv: true, .. } => OutputFormat::Csv,
            _ => OutputFormat::Text,
        }
    }

    /// Returns true if no progress is to be shown.
    pub fn is_quiet(self) -> bool {
        self.quiet
    }
}
