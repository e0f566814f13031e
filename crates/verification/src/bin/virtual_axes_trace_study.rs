//! Identification of random production traces: distribution of the errors over many hidden axes.
//!
//!     virtual_axes_trace_study --seeds 1000..1100 [--backlash-um 5 --stribeck 0.1] [--list]

use std::ops::Range;
use std::process::ExitCode;

use clap::Parser;
use virtual_axes_verification::parse_seeds;
use virtual_axes_verification::production_traces::{AxisOrientation, TraceStudy};

#[derive(Debug, Parser)]
struct Arguments {
    /// Seeds of the hidden axes; each gives a horizontal and a vertical axis.
    #[arg(long, default_value = "1000..1100", value_parser = parse_seeds)]
    seeds: Range<u64>,
    /// Backlash of the axes, µm.
    #[arg(long, default_value_t = 0.0)]
    backlash_um: f64,
    /// Peak of the additional friction near standstill, A.
    #[arg(long, default_value_t = 0.0)]
    stribeck: f64,
    /// Duration of the programs, s.
    #[arg(long, default_value_t = 20.0)]
    duration: f64,
    /// Print a line for each axis.
    #[arg(long)]
    list: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut study = TraceStudy::new(arguments.duration, arguments.backlash_um * 1e-6, arguments.stribeck);
    for seed in arguments.seeds {
        for orientation in [AxisOrientation::Horizontal, AxisOrientation::Vertical] {
            let case = study.add(seed, orientation);
            if arguments.list {
                println!("{case}");
            }
        }
    }
    print!("{study}");
    ExitCode::SUCCESS
}
