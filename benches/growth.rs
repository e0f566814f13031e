//! Scaling of the cost of a simulation with the number of axes and the options of the drive model.
//!
//!     cargo bench --no-default-features --bench growth
//!     cargo bench --no-default-features --bench growth -- transmissions
//!
//! The rows of a table are run in turns, so that the background load of the computer affects all of them. A table
//! shows medians over the rounds and their ratio to the first row per simulated second of a machine.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use virtual_axes_core::assess::AxisAssessor;
use virtual_axes_core::config::{MachineConfig, ValueSource, parse_assignment};
use virtual_axes_core::machine::{Machine, MachineParameters};
use virtual_axes_core::units::seconds;
use virtual_axes_verification::fixtures::machines::{AXES, parameters};

/// Rounds of a table; odd.
const ROUNDS: usize = 11;
/// Simulated time of the table of axes, s.
const AXES_TIME: f64 = 120.0;
/// Period of the motion, position cycles: a minute.
const CYCLE: usize = 10_000;
/// Amplitude (m, rad) and oscillations per cycle of each axis: a cycle starts and ends at rest.
const MOTION: [(f64, f64); AXES] = [(0.1, 6.0), (0.08, 7.0), (0.05, 5.0), (0.3, 3.0), (0.6, 4.0)];

/// Row of a table.
struct Row<'a> {
    name: String,
    /// Simulated time, summed over the machines, s.
    simulated: f64,
    run: Box<dyn FnMut() + 'a>,
}

impl<'a> Row<'a> {
    fn new(name: impl ToString, simulated: f64, run: impl FnMut() + 'a) -> Self {
        Row { name: name.to_string(), simulated, run: Box::new(run) }
    }
}

/// Runs the rows in turns and prints them.
fn table(title: &str, column: &str, mut rows: Vec<Row>) {
    let mut times: Vec<Vec<f64>> = vec![Vec::new(); rows.len()];
    for _ in 0..ROUNDS {
        for (row, times) in rows.iter_mut().zip(&mut times) {
            let began = Instant::now();
            (row.run)();
            times.push(began.elapsed().as_secs_f64());
        }
    }
    println!("\n{title}");
    println!(
        "{column:>10} {:>8} {:>12} {:>18} {:>13} {:>14}",
        "rounds", "median, s", "machine-seconds/s", "min … max", "per machine-s"
    );
    let mut first = None;
    for (row, times) in rows.iter().zip(&mut times) {
        times.sort_unstable_by(f64::total_cmp);
        let (rounds, median) = (times.len(), times[times.len() / 2]);
        let cost = median / row.simulated;
        let spread = format!("{:.2} … {:.2}", times[0] / median, times[rounds - 1] / median);
        let ratio = cost / *first.get_or_insert(cost);
        println!("{:>10} {rounds:8} {median:12.4} {:18.0} {spread:>13} {ratio:14.3}", row.name, 1.0 / cost);
    }
}

fn cycle() -> Arc<Vec<[f64; AXES]>> {
    let at =
        |k: usize| MOTION.map(|(size, turns)| size * (1.0 - (TAU * turns * k as f64 / CYCLE as f64).cos()));
    Arc::new((0..CYCLE).map(at).collect())
}

/// Returns the row of a machine with a number of axes, those of `config` in turns, with their figures.
fn axes_row(name: impl ToString, config: &MachineConfig, count: usize) -> Row<'static> {
    let cycle = cycle();
    let instants = (AXES_TIME / seconds(config.periods().position)) as usize;
    let indices: Vec<usize> = (0..count).map(|axis| axis % AXES).collect();
    let parameters = MachineParameters::from_axes(config, &indices).expect("can be discretized");
    let mut machine = Machine::new(Arc::new(parameters));
    let mut psec = vec![0.0; count];
    Row::new(name, AXES_TIME, move || {
        let mut assessors = vec![AxisAssessor::default(); count];
        machine.reset(&vec![0.0; count]);
        for row in cycle.iter().cycle().take(instants) {
            psec.iter_mut().zip(&indices).for_each(|(psec, &index)| *psec = row[index]);
            machine.advance(&psec, &[]);
            for (axis, assessor) in assessors.iter_mut().enumerate() {
                assessor.observe(machine.axis(axis).sample(), &machine.activity(axis));
            }
        }
        black_box(assessors);
    })
}

/// Measures one machine with increasing numbers of axes.
fn axes(config: &MachineConfig) {
    let row = |count: usize| axes_row(count, config, count);
    table("axes: one machine, figures of the axes", "axes", [1, 2, 4, 5, 8, 16, 32].map(row).into());
}

/// Measures the default machine with rigid and with elastic transmissions on all axes, with presliding (LuGre and
/// generalized Maxwell-slip model), and with backlash.
fn transmissions(rigid: &MachineConfig) {
    let linear = ["x", "y", "z"].into_iter().flat_map(|axis| {
        [("stiffness_n_um", 200.0), ("damping_n_s_m", 15_000.0), ("load_mass_kg", 300.0)]
            .map(|(name, value)| (format!("{axis}.transmission.{name}"), value))
    });
    let rotary = ["a", "c"].into_iter().flat_map(|axis| {
        [("stiffness_nm_rad", 2e6), ("damping_nm_s_rad", 500.0), ("load_inertia_kg_m2", 2.0)]
            .map(|(name, value)| (format!("{axis}.transmission.{name}"), value))
    });
    let changes: Vec<(String, f64)> = linear.chain(rotary).collect();
    let elastic = parameters(&changes).machine_config().expect("a machine");
    let linear = ["x", "y", "z"].map(|axis| (format!("{axis}.friction.presliding_stiffness_n_um"), 50.0));
    let rotary = ["a", "c"].map(|axis| (format!("{axis}.friction.presliding_stiffness_nm_rad"), 3e6));
    let bristles: Vec<(String, f64)> = linear.into_iter().chain(rotary).collect();
    let presliding = parameters(&bristles).machine_config().expect("a machine");
    let slip = |count: usize| {
        let mut machine = parameters(&bristles);
        let source = ValueSource::named("benchmark");
        let assignments = ["x", "y", "z", "a", "c"].map(|axis| {
            parse_assignment(&format!("{axis}.friction.presliding_elements={count}"), &source)
                .expect("an assignment")
        });
        machine.set_all(assignments.into()).expect("values in their ranges");
        machine.machine_config().expect("a machine")
    };
    let (slip_4, slip_10) = (slip(4), slip(10));
    let linear = ["x", "y", "z"].map(|axis| (format!("{axis}.transmission.backlash_um"), 10.0));
    let rotary = ["a", "c"].map(|axis| (format!("{axis}.transmission.backlash_deg"), 0.005));
    let shares = ["x", "y", "z", "a", "c"].map(|axis| (format!("{axis}.transmission.load_friction"), 0.7));
    let gaps = [changes.clone(), linear.into(), rotary.into(), shares.into()].concat();
    let backlash = parameters(&gaps).machine_config().expect("a machine");
    let both = parameters(&[changes, bristles].concat()).machine_config().expect("a machine");
    let rows = vec![
        axes_row("rigid", rigid, AXES),
        axes_row("elastic", &elastic, AXES),
        axes_row("presliding", &presliding, AXES),
        axes_row("presliding, 4 elements", &slip_4, AXES),
        axes_row("presliding, 10 elements", &slip_10, AXES),
        axes_row("elastic, presliding", &both, AXES),
        axes_row("elastic, backlash", &backlash, AXES),
    ];
    table("transmissions: one machine of five axes, figures of the axes", "axes", rows);
}

fn main() {
    // `cargo bench` passes --bench.
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|word| word == name);
    let config = parameters::<&str>(&[]).machine_config().expect("the shipped machine");
    if is_wanted("axes") {
        axes(&config);
    }
    if is_wanted("transmissions") {
        transmissions(&config);
    }
}
