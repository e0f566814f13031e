//! Profile of a control, from a part program and the setpoints that the control made of it, or the positions of the axes
//! (`recorded_positions`).
//!
//! 1. Each sample of the log is assigned to a motion of the program (`track`).
//! 2. Ramps from rest to a constant speed show acceleration, jerk limit and filters of the axes (`axis_motions`, `ramp`, `law`).
//! 3. Corners show path and speed (`corner`, `corner_rule`), circles the parts of the acceleration across and along the path
//!    (`arcs`), rows of short lines the block cycle and the look-ahead (`blocks`), dwells the wait at standstills
//!    (`standstill`).
//!
//! All values are in closed form from the log; the planner has no part in them.

mod arcs;
mod axis_motions;
mod blocks;
mod control_estimate;
mod corner;
mod corner_rule;
mod identification;
mod law;
mod log;
mod probe;
mod ramp;
mod recorded_positions;
mod rest_deviation;
mod standstill;
mod track;

use virtual_axes_core::config::MachineConfig;

pub use self::identification::{ControlIdentification, ControlValue};
pub use self::log::ControlLog;
pub use self::probe::probe_program;

use self::arcs::identify_circles;
use self::axis_motions::AxisMotions;
use self::blocks::identify_blocks;
use self::corner_rule::identify_corners;
use self::law::Smoothing;
use self::rest_deviation::{RestDeviation, without_scales};
use self::standstill::{identify_ends, identify_wait};
use self::track::{Track, motions};
use crate::motion::ProgramStep;

/// Identifies the profile of a control from the steps of a program and the setpoints that it made of them.
///
/// # Errors
///
/// Returns an error if the program is invalid, or if the log is not one of it.
pub fn identify_control<E: std::fmt::Display>(
    steps: impl Iterator<Item = Result<ProgramStep, E>>,
    machine: &MachineConfig,
    log: &ControlLog,
) -> Result<ControlIdentification, String> {
    let motions = motions(steps)?;
    let deviations = Track::new(log, motions.clone())?.rest_deviations();
    let corrected = without_scales(log, &deviations);
    let log = corrected.as_ref().unwrap_or(log);
    let track = Track::new(log, motions)?;
    let mut found =
        ControlIdentification { motions: track.motions.len(), ..ControlIdentification::default() };
    found.motion_time = motion_time(&track);
    found.warnings.extend(deviations.iter().map(RestDeviation::warning));
    let axes = AxisMotions::new(machine, &track);
    found.warnings.extend(axes.feed_warning(&track));
    axes.identify(&mut found);
    if let Some(law) = &axes.law {
        identify_corners(&track, law, &mut found);
        identify_circles(&track, law, &mut found);
        identify_blocks(&track, law, &mut found);
        identify_ends(&track, law, &mut found);
    }
    identify_wait(&track, &axes, &mut found);
    if log.accuracy.is_estimated() {
        for value in &mut found.values {
            value.half_width = value.half_width.hypot(OF_DRIVES * value.magnitude());
        }
        if log.accuracy.resolution > MOST_DEVIATION {
            found.warnings.push(format!(
                "the setpoints that are estimated from the positions deviate by {:.1} µm at rest, more than {:.0} µm: values can \
                 be wrong beyond their intervals; record positions with less noise and more digits",
                1e6 * log.accuracy.resolution,
                1e6 * MOST_DEVIATION
            ));
        }
        let hidden = match axes.law.as_ref().map(|law| &law.smoothing) {
            Some(Smoothing::None(_)) => Some("filters as short as those of the drives"),
            Some(Smoothing::Filters(stages)) if stages.len() == 1 => {
                Some("a second filter below a third of the first")
            }
            _ => None,
        };
        found.not_shown.extend(
            hidden.map(|what| format!("{what}: recorded positions do not show them beside the drives")),
        );
    }
    for value in found.values.extract_if(.., |value| !value.is_identified()) {
        found
            .not_shown
            .push(format!("{}: the {} motions that show it contradict each other", value.key, value.count));
    }
    Ok(found)
}

/// Relative uncertainty of values from recorded positions, by drives that differ from those of the machine.
const OF_DRIVES: f64 = 0.01;
/// Deviation of estimated setpoints at rest above which intervals do not contain the errors by noise, m.
const MOST_DEVIATION: f64 = 1e-5;

/// Returns the time from the first to the last change of a position, s.
fn motion_time(track: &Track<'_>) -> f64 {
    let moving = |sample: &usize| !track.is_at_rest[*sample];
    let mut samples = 0..track.is_at_rest.len();
    let first = samples.find(moving);
    let last = samples.rfind(moving).or(first);
    match (first, last) {
        // The first sample is at rest until the end of its window.
        (Some(first), Some(last)) => {
            (last + 2).saturating_sub(first + track.log.accuracy.window) as f64 * track.log.period
        }
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::io::Cursor;

    use virtual_axes_builtin::MACHINES;
    use virtual_axes_core::config::{Parameters, ValueSource};
    use virtual_axes_core::trial::GridSource;

    use super::*;
    use crate::interpret::Interpreter;
    use crate::offline::{PartProgramOptions, PartProgramSource};

    type Rows = Vec<(f64, Vec<f64>)>;

    /// Machine with the profile `linuxcnc`, its probe program and the setpoints of each millisecond.
    struct Probe {
        machine: MachineConfig,
        program: String,
        setpoints: Vec<Vec<f64>>,
    }

    impl Probe {
        fn new() -> Self {
            let mut parameters = Parameters::load("vmc", MACHINES).unwrap();
            for text in ["control.profile=linuxcnc", "periods.position_ms=1"] {
                parameters.set_text(text, &ValueSource::named("test")).unwrap();
            }
            let machine = parameters.machine_config().unwrap();
            let program = probe_program(&machine, &[]).unwrap();
            let (options, track) = (PartProgramOptions::default(), RefCell::default());
            let mut source =
                PartProgramSource::read(&program, ("probe.nc", None), &machine, &options, &track).unwrap();
            let mut row = vec![0.0; machine.axes().len()];
            let mut setpoints = Vec::new();
            while source.next(&mut row).unwrap() {
                setpoints.push(row.clone());
            }
            Self { machine, program, setpoints }
        }

        /// Returns the setpoints at times, s, that follow from their index, and multiplied by a factor.
        fn rows(&self, time: impl Fn(usize) -> f64, factor: f64) -> Rows {
            let row = |(k, row): (usize, &Vec<f64>)| (time(k), row.iter().map(|x| factor * x).collect());
            self.setpoints.iter().enumerate().map(row).collect()
        }

        /// Returns the profile and the notes on the log.
        fn identified(
            &self,
            rows: &Rows,
            resolution: f64,
        ) -> Result<(ControlIdentification, Vec<String>), String> {
            let joints: Vec<usize> = (0..self.machine.axes().len()).collect();
            let log = ControlLog::new(&self.machine, &joints, rows, resolution)?;
            let options = PartProgramOptions::default().interpreter(&self.machine)?;
            let steps = Interpreter::new(Cursor::new(self.program.clone()), "probe.nc", options);
            Ok((identify_control(steps, &self.machine, &log)?, log.notes))
        }
    }

    /// Returns a number from -1 to 1 without order.
    fn noise(k: usize) -> f64 {
        (4e4 * (13.0 * k as f64).sin()).fract()
    }

    #[test]
    fn intervals_contain_the_profile_for_stamps_of_any_kind() {
        let probe = Probe::new();
        let even = |k: usize| 1e-3 * k as f64;
        let jittering = |jitter: f64| probe.rows(move |k| even(k) + jitter * noise(k), 1.0);
        let mut missing = jittering(2e-4);
        missing.retain(|(time, _)| (1e3 * time).round() % 101.0 != 7.0);
        let twice: Rows = probe
            .rows(even, 1.0)
            .into_iter()
            .flat_map(|(time, row)| [(time, row.clone()), (time + 5e-4, row)])
            .collect();
        let mut coarse = probe.rows(even, 1.0);
        for value in coarse.iter_mut().flat_map(|(_, row)| row) {
            *value = 1e-5 * (1e5 * *value).round();
        }
        // Whole milliseconds at 1.5 ms, which is also a wrong rate.
        let rounded = probe.rows(|k| 1e-3 * (1.5 * k as f64).round(), 1.0);
        let cases = [
            ("0.5 µs", jittering(5e-7), 1e-9, 1.0, ""),
            ("2 µs", jittering(2e-6), 1e-9, 1.0, ""),
            ("0.4 ms", jittering(4e-4), 1e-9, 1.0, "off an even grid"),
            ("missing", missing, 1e-9, 1.0, "off an even grid"),
            ("twice", twice, 1e-9, 1.0, "runs of 2: one of each run is used, each 1 ms"),
            ("10 µm", coarse, 1e-5, 1.0, ""),
            ("rounded", rounded, 1e-9, 1.0 / 1.5, "off an even grid"),
        ];
        for (name, rows, resolution, rate, note) in cases {
            let (found, notes) = probe.identified(&rows, resolution).unwrap();
            let truth = [
                ("x.limits.acceleration_m_s2", 4.0 * rate * rate),
                ("y.limits.acceleration_m_s2", 4.0 * rate * rate),
                ("z.limits.velocity_m_min", 20.0 * rate),
                ("control.normal_fraction", 0.866),
                ("control.tangential_fraction", 0.5),
                ("control.overlap_fraction", 0.5),
                ("control.kink_fraction", 0.1),
                // With the part of a dwell of 200 ms that is longer.
                ("control.wait_ms", 225.0 / rate - 200.0),
            ];
            for (key, expected) in truth {
                let value = found.values.iter().find(|value| value.key == key);
                let is_near = value.is_some_and(|value| (value.value - expected).abs() <= value.half_width);
                assert!(is_near, "{name}: {value:?}, not {expected}");
            }
            assert_eq!(notes.is_empty(), note.is_empty(), "{name}: {notes:?}");
            assert!(notes.iter().all(|text| text.contains(note)), "{name}: {notes:?}");
            let is_warned = found.warnings.iter().any(|text| {
                text.contains("at 0.6667 of") && text.contains("1000 Hz") && text.contains("66.6667 %")
            });
            assert_eq!(is_warned, rate < 1.0, "{name}: {:?}", found.warnings);
        }
    }

    #[test]
    fn values_with_absurd_intervals_are_not_identified() {
        let cases = [
            ("x.limits.acceleration_m_s2", 4.0, 0.1, true),
            ("x.limits.acceleration_m_s2", 4.0, 1.5e151, false),
            ("x.limits.acceleration_m_s2", 4.0, f64::NAN, false),
            ("control.kink_fraction", 1e-3, 2e-3, true),
            ("control.wait_ms", 0.0, 0.1, true),
            ("control.wait_ms", 0.0, f64::INFINITY, false),
        ];
        for (key, value, half_width, expected) in cases {
            let value = ControlValue { key: key.to_owned(), value, half_width, unit: "", count: 1 };
            assert_eq!(value.is_identified(), expected, "{value:?}");
        }
    }

    #[test]
    fn a_scaled_axis_is_named_and_intervals_contain_the_accelerations() {
        let probe = Probe::new();
        let mut rows = probe.rows(|k| 1e-3 * k as f64, 1.0);
        rows.iter_mut().for_each(|(_, row)| row[1] *= 1.0003);
        let (found, _) = probe.identified(&rows, 1e-9).unwrap();
        let [warning] = found.warnings.as_slice() else { panic!("{:?}", found.warnings) };
        assert!(
            warning.starts_with("Y rests up to") && warning.contains("1.000300 times the positions"),
            "{warning}"
        );
        for axis in ["x", "y", "z"] {
            let key = format!("{axis}.limits.acceleration_m_s2");
            let value = found.values.iter().find(|value| value.key == key).expect("an acceleration");
            let error = (value.value - 4.0).abs();
            assert!(error <= value.half_width && error < 5e-4, "{value:?}");
        }
    }

    #[test]
    fn errors_name_stamps_and_unit() {
        let probe = Probe::new();
        let even = |k: usize| 1e-3 * k as f64;
        let late = |k: usize| if k == 500 { even(k) + 8e-4 } else { even(k) };
        let cases = [
            (probe.rows(late, 1.0), "do not fit an even grid: they are up to 0.79"),
            (probe.rows(even, 1e3), "its unit is mm, not m (--column"),
            (probe.rows(even, 1.0 / 25.4), "its unit is in, not mm (--column"),
            (probe.rows(even, 1.0).split_off(5000), "starts late"),
        ];
        for (rows, part) in cases {
            let error = probe.identified(&rows, 1e-9).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
