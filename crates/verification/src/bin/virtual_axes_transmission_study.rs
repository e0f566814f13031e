//! Identification of the transmission of random axes with both encoders: distribution of the errors and coverage of the intervals.
//!
//!     virtual_axes_transmission_study --seeds 9000..9200 [--list]

use std::ops::Range;
use std::process::ExitCode;

use clap::Parser;
use virtual_axes_verification::parse_seeds;
use virtual_axes_verification::transmission_study::TransmissionStudy;

#[derive(Debug, Parser)]
struct Arguments {
    /// Seeds of the random axes.
    #[arg(long, default_value = "9000..9200", value_parser = parse_seeds)]
    seeds: Range<u64>,
    /// Print a line for each axis.
    #[arg(long)]
    list: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut study = TransmissionStudy::default();
    for seed in arguments.seeds {
        let case = study.add(seed);
        if arguments.list {
            println!("{case}");
        }
    }
    print!("{study}");
    ExitCode::SUCCESS
}
