//! Distribution of the errors of many identifications.

use std::fmt::Write;

use virtual_axes_core::statistics::quantile;
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds};

use super::drawn::AxisOrientation;
use super::study::{StudyFigures, ValueError};
use super::trace_kind::TraceProgram;

/// Returns the distribution of the errors, one line per sampling period, for programs of rapids and of parts, for the results
/// that the identification calls valid and for all, and one line per result outside of the limits:
/// Kt / Jeq 3 %, lag one cycle, β 1.5 ms, weight 3 % or within its interval, unseen program 5 µm RMS.
pub fn study_table(figures: &[StudyFigures]) -> String {
    let mut text = String::from(
        "errors: median, 90 %, largest; coverage of the 95 % intervals in %, median of their half widths\n\
         period  traces  failed  invalid  Kt/Jeq %                      weight %                      lag cycles            \
         beta ms                       unseen um\n",
    );
    let mut periods: Vec<Nanoseconds> = figures.iter().map(|figure| figure.period).collect();
    periods.sort_unstable();
    periods.dedup();
    for period in periods {
        let of: Vec<&StudyFigures> = figures.iter().filter(|figure| figure.period == period).collect();
        text += &line(&format!("{} ms", period as f64 / MILLISECOND_NS as f64), &of);
    }
    let select = |is_wanted: fn(&TraceProgram) -> bool| -> Vec<&StudyFigures> {
        figures.iter().filter(|figure| is_wanted(&figure.program)).collect()
    };
    text += &line("rapids", &select(|program| matches!(program, TraceProgram::Rapids(_))));
    text += &line("parts", &select(|program| matches!(program, TraceProgram::Part(_))));
    let is_valid = |figure: &&StudyFigures| figure.failure.is_none() && figure.invalid.is_empty();
    text += &line("valid", &figures.iter().filter(is_valid).collect::<Vec<_>>());
    text += &line("all", &figures.iter().collect::<Vec<_>>());
    for figure in figures {
        if let Some(what) = figure.outside() {
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "seed {} {:?} {} ms {:?}: {what}",
                figure.seed,
                figure.orientation,
                figure.period as f64 / MILLISECOND_NS as f64,
                figure.program
            );
        }
    }
    text
}

/// Returns the line of the results `of` a group.
fn line(name: &str, of: &[&StudyFigures]) -> String {
    let values = |value: fn(&StudyFigures) -> Option<ValueError>, scale: f64| {
        let found: Vec<ValueError> = of.iter().filter_map(|figure| value(figure)).collect();
        let covered = found.iter().filter(|value| value.is_covered).count();
        let share = 100.0 * covered as f64 / found.len().max(1) as f64;
        let mut halves: Vec<f64> = found.iter().map(|value| (value.half_interval * scale).abs()).collect();
        let half = quantile(&mut halves, 0.5).unwrap_or(f64::NAN);
        format!("{} {share:3.0} {half:5.2}", spread(found.iter().map(|value| value.error * scale)))
    };
    let failed = of.iter().filter(|figure| figure.failure.is_some()).count();
    let invalid = of.iter().filter(|figure| !figure.invalid.is_empty()).count();
    format!(
        "{name:<7} {:>6} {failed:>7} {invalid:>8}  {}  {}  {}  {}  {}\n",
        of.len(),
        values(|figure| figure.acceleration, 100.0),
        values(|figure| figure.weight.filter(|_| figure.orientation == AxisOrientation::Vertical), 100.0),
        spread(of.iter().filter_map(|figure| figure.lag)),
        values(|figure| figure.beta, 1e3),
        spread(of.iter().filter_map(|figure| figure.residuals[1]).map(|rms| rms * 1e6)),
    )
}

/// Returns median, 90 % and largest magnitude.
fn spread(values: impl Iterator<Item = f64>) -> String {
    let mut magnitudes: Vec<f64> = values.map(f64::abs).collect();
    let mut at = |share: f64| quantile(&mut magnitudes, share).unwrap_or(f64::NAN);
    format!("{:6.2}{:7.2}{:7.1}", at(0.5), at(0.9), at(1.0))
}

impl StudyFigures {
    /// Returns what is outside of the limits; none if nothing is.
    pub fn outside(&self) -> Option<String> {
        if let Some(failure) = &self.failure {
            return Some(failure.replace('\n', "; "));
        }
        let mut all = Vec::new();
        let mut check = |is_inside: bool, what: String| {
            if !is_inside {
                all.push(what);
            }
        };
        if let Some(value) = self.acceleration {
            let is_inside = value.error.abs() <= 0.03 || value.is_covered;
            check(
                is_inside,
                format!("Kt/Jeq {:+.1} % ± {:.1}", 100.0 * value.error, 100.0 * value.half_interval),
            );
        }
        if let Some(value) = self.weight.filter(|_| self.orientation == AxisOrientation::Vertical) {
            let is_inside = value.error.abs() <= 0.03 || value.is_covered;
            check(
                is_inside,
                format!("weight {:+.1} % ± {:.1}", 100.0 * value.error, 100.0 * value.half_interval),
            );
        }
        if let Some(lag) = self.lag {
            check(lag.abs() <= 1.01, format!("lag {lag:+.2} cycles"));
        }
        if let Some(value) = self.beta {
            let is_inside = value.error.abs() <= 1.5e-3 || value.is_covered;
            check(is_inside, format!("beta {:+.2} ms", 1e3 * value.error));
        }
        if let Some(rms) = self.residuals[1] {
            check(rms <= 5e-6, format!("unseen {:.1} um", 1e6 * rms));
        }
        if !self.invalid.is_empty() {
            all.push(format!("invalid: {}", self.invalid.join(", ")));
        }
        (!all.is_empty()).then(|| all.join(", "))
    }
}
