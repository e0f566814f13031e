//! Conditioning of a raw recording: time grid, gaps, zero-phase filter, plausibility, current lag.

use super::current_lag::{self, HIGHEST_LAG, LOWEST_LAG};
use super::filter::{GaussianFilter, MAX_CUTOFF_PERIOD, default_cutoff, deviation};
use super::filtered_section::FilteredSection;
use super::full_turns::without_resets;
use super::held_samples::{with_stamps_of_renewals, without_held_samples};
use super::ordering::{drop_copies, sort_samples};
use super::spans::{
    CHANNELS, CURRENT, NAMES, POSITION, PSEC, channels, extract_sections, is_smoother_over_stamps,
    usable_columns,
};
use super::stated::StatedValues;
use super::uniform_grid::{UniformGrid, assign_to_grid};
use super::{ConditioningError, Finding, RawRecording, SignalSpan, Signals, plausibility};
use crate::identify::BandLimitedSpline;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::{MILLISECOND, Rounded, seconds};

/// Error of a recording without position.
const NO_POSITION: &str =
    "no position was recorded, or none of its values is a number; name its column by position=COLUMN[UNIT]";
/// Largest stamp of a recording, s; times since 1970 or 1601 are below.
const LATEST: f64 = 1e11;
/// Fewest samples of a span, independent of the filter length.
const SHORTEST_SPAN: usize = 16;
/// Shortest permitted length of the longest span, in standard deviations of the filter.
const SPAN_DEVIATIONS: f64 = 20.0;
/// Longest sampling period that can show a lag of the current, relative to the position cycle.
const COARSEST: f64 = 0.5;
/// Allowed half-power frequencies of the low-pass filter of a control, Hz.
const TRACE_FILTERS: std::ops::RangeInclusive<f64> = 1.0..=1000.0;
/// Largest number of corrections of a delayed PSEC, and lag at which they end, s.
const SHIFTS: usize = 20;
const SHIFTED: f64 = 1e-5;
/// Relative rounding tolerance of a given cut-off frequency.
const ROUNDING: f64 = 1e-9;

/// Options of the conditioning.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Conditioning {
    /// Cut-off frequency (half power) of the filter of position, velocity, acceleration and current, Hz. The
    /// default is 100 Hz, limited to 0.16 / sampling period.
    pub cutoff: Option<f64>,
    /// Lag of the current behind the motion, s, −0.010 … 0.020; compensated as given. Without a value the lag
    /// is estimated, and compensated only if it is significant.
    pub current_lag: Option<f64>,
    /// Correction of a setpoint that the recording delays.
    pub psec_shift: PsecShift,
    /// Low-pass filter (second-order Butterworth, half power, Hz) of the control, which all recorded signals but PSEC
    /// have passed; simulated signals pass it too.
    pub trace_filter: Option<f64>,
    /// Values of the axis that the user has stated, against which the recording is checked.
    pub stated: StatedValues,
}

/// Correction of a setpoint that the recording delays.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum PsecShift {
    /// No correction; a PSEC that lags behind the position is rejected.
    #[default]
    None,
    /// PSEC is moved such that it does not lag behind the position.
    Auto,
    /// PSEC is moved forward by this time, s.
    By(f64),
}

/// Conditions a recording of `axis`: checks it, resamples it to a uniform time grid and filters it without
/// phase.
///
/// Samples are assigned to a uniform grid if their number fits the recorded time (jittering stamps, loggers
/// that stall and catch up); otherwise they are interpolated to it. Up to two missing values in a row are
/// interpolated. Longer gaps and frozen positions during motion split the recording into spans. Velocity,
/// acceleration and smoothed current are outputs of one zero-phase Gaussian filter; within 5 standard
/// deviations (of 0.1325 / cutoff each) of the ends of a span the filter uses the signal mirrored about its
/// end value. A lag of the current is compensated if that explains the current clearly better and the lag
/// exceeds a sampling period. The findings list every correction.
///
/// # Errors
/// [`ConditioningError`] if the recording is not plausible for the axis or no usable span is left.
pub fn condition(
    raw: &RawRecording,
    axis: &AxisConfig,
    periods: &Periods,
    options: &Conditioning,
) -> Result<(Signals, Vec<Finding>), ConditioningError> {
    let mut findings = Vec::new();
    check_lengths(raw)?;
    let unrolled = without_resets(raw, axis, &mut findings);
    let raw = unrolled.as_ref().unwrap_or(raw);
    let renewed = without_held_samples(raw, &mut findings);
    let raw = renewed.as_ref().unwrap_or(raw);
    let is_held = renewed.is_some();
    let (stamped, renewal) = with_stamps_of_renewals(raw, &mut findings).unzip();
    let raw = stamped.as_ref().unwrap_or(raw);
    let mut ordered = sort_samples(raw, &mut findings)?;
    let mut columns = usable_columns(raw, &mut findings);
    let position = columns[POSITION].as_ref();
    drop_copies(&mut ordered, &raw.name, position, columns.iter().flatten(), &mut findings);
    drop_constant_current(&raw.name, &mut columns, &mut findings);
    let Some(position) = &columns[POSITION] else {
        return Err(ConditioningError::new(&raw.name, NO_POSITION));
    };
    let smoother = |placed: &UniformGrid| is_smoother_over_stamps(placed, position);
    let placed = assign_to_grid(&raw.name, &ordered, periods, smoother, &mut findings)?;
    if stamped.is_some() {
        // The note of the renewals is the reason: another clock would not help.
        findings.retain(|finding| finding.code != "irregular");
    }
    let period = placed.period;
    let cutoff = select_cutoff(&raw.name, options, &placed)?;
    let filter = GaussianFilter::new(cutoff, period);
    let shortest = (2 * filter.radius() + 1).max(SHORTEST_SPAN);
    let (pieces, longest) = extract_sections(&raw.name, &placed, &columns, shortest, &mut findings);
    let nothing_left = || {
        let reason = format!(
            "the longest section without gap has {longest} samples, at least {shortest} are required; record without gaps"
        );
        ConditioningError::new(&raw.name, reason)
    };
    if pieces.is_empty() {
        return Err(nothing_left());
    }
    let mut parts: Vec<FilteredSection> =
        pieces.into_iter().map(|section| FilteredSection::new(section, &filter)).collect();
    shift_psec(&raw.name, &mut parts, options.psec_shift, period, &mut findings);
    if let Some(reason) =
        plausibility::check(&raw.name, &parts, (axis, options.stated), period, deviation(cutoff))?
    {
        let what = format!("{}: the current {reason}: its sign is inverted", raw.name);
        findings.push(Finding::note("current-inverted", what));
        parts.iter_mut().for_each(FilteredSection::invert_current);
    }
    let current_lag =
        select_current_lag(&raw.name, &parts, axis, periods, (period, cutoff), options, &mut findings)?;
    if current_lag != 0.0 {
        current_lag::compensate(&mut parts, current_lag, period);
        parts.retain(|part| part.section.len() > 0);
        if parts.is_empty() {
            return Err(nothing_left());
        }
    }
    let mut spans: Vec<SignalSpan> = parts.into_iter().map(FilteredSection::into_span).collect();
    separate_spans(&mut spans, period);
    let trace_filter = select_trace_filter(&raw.name, options)?;
    let (name, torque_constant) = (raw.name.clone(), raw.torque_constant());
    let renewal = renewal.or(is_held.then_some(period));
    Ok((
        Signals { name, period, renewal, cutoff, trace_filter, torque_constant, current_lag, spans },
        findings,
    ))
}

/// Moves PSEC forward in time and reports by how much.
fn shift_psec(
    name: &str,
    parts: &mut [FilteredSection],
    shift: PsecShift,
    period: f64,
    findings: &mut Vec<Finding>,
) {
    let recorded: Vec<Option<BandLimitedSpline>> = parts
        .iter()
        .map(|part| part.section.columns[PSEC].as_ref().map(|psec| BandLimitedSpline::new(psec, period)))
        .collect();
    let move_by = |parts: &mut [FilteredSection], by: f64| {
        for (part, spline) in parts.iter_mut().zip(&recorded) {
            if let (Some(psec), Some(spline)) = (&mut part.section.columns[PSEC], spline) {
                *psec = (0..psec.len()).map(|i| spline.at(i as f64 * period + by)[0]).collect();
            }
        }
    };
    let mut by = match shift {
        PsecShift::None => return,
        PsecShift::By(time) => time,
        PsecShift::Auto => 0.0,
    };
    move_by(parts, by);
    // The regression underestimates a lag that is long compared with the accelerations.
    for _ in 0..if shift == PsecShift::Auto { SHIFTS } else { 0 } {
        let lag = -plausibility::psec_lead(parts);
        if lag < SHIFTED {
            break;
        }
        by += lag;
        move_by(parts, by);
    }
    let what = format!("{name}: PSEC is moved forward by {:.2} ms; α is counted from there", by * 1e3);
    findings.push(Finding::note("psec-shifted", what));
}

fn check_lengths(raw: &RawRecording) -> Result<(), ConditioningError> {
    let channels = channels(raw);
    for n in 0..CHANNELS {
        let Some(values) = channels[n].filter(|values| values.len() != raw.time.len()) else { continue };
        let reason = format!(
            "the {} has {} values for {} stamps; the file is likely truncated",
            NAMES[n],
            values.len(),
            raw.time.len()
        );
        return Err(ConditioningError::new(&raw.name, reason));
    }
    if let Some(time) = raw.time.iter().find(|time| time.abs() > LATEST) {
        let reason = format!(
            "a stamp is {} s, must lie in ±{LATEST:e} s; check column and unit of the time",
            Rounded(*time)
        );
        return Err(ConditioningError::new(&raw.name, reason));
    }
    match channels[POSITION] {
        Some(position) if position.is_empty() || position.iter().any(|x| x.is_finite()) => Ok(()),
        _ => Err(ConditioningError::new(&raw.name, NO_POSITION)),
    }
}

/// Moves the start of a span behind the end of the span before it; jittering first stamps can make them
/// overlap.
fn separate_spans(spans: &mut [SignalSpan], period: f64) {
    let mut earliest = f64::NEG_INFINITY;
    for span in spans {
        span.start = span.start.max(earliest);
        earliest = span.start + span.position.len() as f64 * period;
    }
}

/// Drops a current that is constant although the axis moves: it was not measured.
fn drop_constant_current(
    name: &str,
    columns: &mut [Option<Vec<f64>>; CHANNELS],
    findings: &mut Vec<Finding>,
) {
    let varies = |channel: usize| {
        let values = columns.get(channel).and_then(Option::as_ref);
        let mut finite = values.into_iter().flatten().filter(|value| value.is_finite());
        let first = finite.next().copied();
        first.is_some_and(|first| finite.any(|value| *value != first))
    };
    if columns[CURRENT].is_some() && varies(POSITION) && !varies(CURRENT) {
        columns[CURRENT] = None;
        let what = format!("{name}: the current is constant although the axis moves; it is dropped");
        findings.push(Finding::warning("constant-current", what, "record the motor current"));
    }
}

fn select_cutoff(name: &str, options: &Conditioning, placed: &UniformGrid) -> Result<f64, ConditioningError> {
    let period = placed.period;
    let Some(found) = options.cutoff else { return Ok(default_cutoff(period)) };
    let longest =
        placed.blocks.iter().filter_map(|block| block.slots.last()).max().map_or(1, |slot| slot + 1);
    let lowest = deviation(1.0) * SPAN_DEVIATIONS / (longest as f64 * period);
    let highest = MAX_CUTOFF_PERIOD / period;
    if found >= lowest && found <= highest * (1.0 + ROUNDING) {
        return Ok(found);
    }
    let reason = format!(
        "cut-off {} Hz, must be {lowest:.3} … {highest:.1} Hz at a sampling period of {} s",
        Rounded(found),
        Rounded(period)
    );
    Err(ConditioningError::new(name, reason))
}

fn select_trace_filter(name: &str, options: &Conditioning) -> Result<Option<f64>, ConditioningError> {
    match options.trace_filter {
        Some(found) if !TRACE_FILTERS.contains(&found) => {
            let (lowest, highest) = (TRACE_FILTERS.start(), TRACE_FILTERS.end());
            let reason = format!("trace filter {} Hz, must lie in {lowest} … {highest} Hz", Rounded(found));
            Err(ConditioningError::new(name, reason))
        }
        given => Ok(given),
    }
}

/// Returns the current lag to compensate, s.
fn select_current_lag(
    name: &str,
    parts: &[FilteredSection],
    axis: &AxisConfig,
    periods: &Periods,
    (period, cutoff): (f64, f64),
    options: &Conditioning,
    findings: &mut Vec<Finding>,
) -> Result<f64, ConditioningError> {
    const CODE: &str = "current-lag";
    if let Some(found) = options.current_lag {
        if !(LOWEST_LAG..=HIGHEST_LAG).contains(&found) {
            let [found, lowest, highest] =
                [found, LOWEST_LAG, HIGHEST_LAG].map(|lag| Rounded(lag / MILLISECOND));
            let reason = format!("--current-lag-ms is {found}, must be {lowest} … {highest}");
            return Err(ConditioningError::new(name, reason));
        }
        return Ok(found);
    }
    // A current sampled at about the position cycle shows the ripple of the setpoints, which looks like a
    // lag.
    if period > COARSEST * seconds(periods.position) {
        return Ok(0.0);
    }
    // A narrower filter prevents matching the ripple at the position cycle with the neighboring period.
    let filter = GaussianFilter::new(current_lag::max_cutoff(periods).min(cutoff), period);
    let long = parts.iter().filter(|part| part.section.len() > 2 * filter.radius());
    let smooth: Vec<FilteredSection> =
        long.map(|part| FilteredSection::new(part.section.clone(), &filter)).collect();
    let Some(lag) = current_lag::estimate(&smooth, axis.kind(), period) else { return Ok(0.0) };
    let milliseconds = lag.lag * 1e3;
    if lag.is_better && lag.is_at_end {
        let what = format!(
            "{name}: the current lags the motion by {milliseconds:.1} ms or more; it is not compensated"
        );
        findings.push(Finding::warning(CODE, what, "record the current with the clock of the position"));
        return Ok(0.0);
    }
    if lag.is_better && lag.exceeds_period {
        let what = format!(
            "{name}: the current lags the motion by {milliseconds:.2} ms (R² {:.4} with compensation, {:.4} without); \
             compensated",
            lag.r2, lag.r2_without
        );
        findings.push(Finding::note(CODE, what));
        return Ok(lag.lag);
    }
    if lag.is_better {
        let what = format!(
            "{name}: the current seems to {} the motion by {:.2} ms, no more than a sampling period of {} ms; it is not \
             compensated",
            if milliseconds < 0.0 { "lead" } else { "lag" },
            milliseconds.abs(),
            Rounded(period * 1e3)
        );
        findings.push(Finding::note(CODE, what));
    }
    Ok(0.0)
}
