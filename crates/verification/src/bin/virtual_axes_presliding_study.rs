//! Identification of the presliding of random axes: distribution of the errors and coverage of the intervals.
//!
//!     virtual_axes_presliding_study --seeds 5000..5200 [--list]

use std::ops::Range;
use std::process::ExitCode;

use clap::Parser;
use virtual_axes_verification::parse_seeds;
use virtual_axes_verification::presliding_study::PreslidingStudy;

#[derive(Debug, Parser)]
struct Arguments {
    /// Seeds of the random axes.
    #[arg(long, default_value = "5000..5200", value_parser = parse_seeds)]
    seeds: Range<u64>,
    /// Print a line for each axis.
    #[arg(long)]
    list: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut study = PreslidingStudy::default();
    for seed in arguments.seeds {
        let case = study.add(seed);
        if arguments.list {
            println!("{case}");
        }
    }
    print!("{study}");
    ExitCode::SUCCESS
}
