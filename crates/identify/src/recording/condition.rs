//! From a recording as it was read to signals that are fit for use.

use super::filter::{Filtered, Gaussian, MAX_CUTOFF_PERIOD, default_cutoff, deviation};
use super::lag::{self, HIGHEST_LAG, LOWEST_LAG};
use super::order::{drop_copies, ordered};
use super::spans::{
    CHANNELS, CURRENT, NAMES, POSITION, PSEC, Piece, TORQUE_FEEDFORWARD, VELOCITY, VELOCITY_FEEDFORWARD,
    channels, columns, pieces, stamped_smoother,
};
use super::stamps::{Placed, place};
use super::{Finding, RawRecording, RecordingFault, Signals, Span, plausible};
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::seconds;

/// Fewest samples of a span, however short the filter is.
const SHORTEST_SPAN: usize = 16;
/// Standard deviations of the filter that the longest span must have at least.
const SPAN_DEVIATIONS: f64 = 20.0;
/// Part of the position period up to which a sampling period can show a lag of the current.
const COARSEST: f64 = 0.5;
/// Rounding that a given cut-off is forgiven.
const ROUNDING: f64 = 1e-9;

/// How a recording is conditioned.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Conditioning {
    /// Where the filter of position, velocity, acceleration and current passes half the power, Hz;
    /// none: 100 Hz, less where the sampling period allows only less (0.16 / period).
    pub cutoff: Option<f64>,
    /// By how much the current lags behind the motion, s, −0.010 … 0.020; it is taken back as given.
    /// None: it is estimated and taken back only where it is significant.
    pub current_lag: Option<f64>,
}

/// A span on its way.
pub(super) struct Part<'a> {
    pub filter: &'a Gaussian,
    pub piece: Piece,
    /// Position behind the filter with its derivatives.
    pub motion: Filtered,
    pub smooth_current: Option<Vec<f64>>,
}

impl<'a> Part<'a> {
    fn new(piece: Piece, filter: &'a Gaussian) -> Self {
        let apply = |channel: usize| piece.columns[channel].as_ref().map(|values| filter.apply(values));
        let motion = apply(POSITION).unwrap_or_default();
        let smooth_current = apply(CURRENT).map(|current| current.value);
        Part { filter, piece, motion, smooth_current }
    }

    /// Keeps the samples of `range`.
    pub fn cut(&mut self, range: std::ops::Range<usize>, period: f64) {
        let motion = &mut self.motion;
        for signal in [&mut motion.value, &mut motion.first, &mut motion.second]
            .into_iter()
            .chain(self.smooth_current.as_mut())
        {
            signal.truncate(range.end);
            signal.drain(..range.start.min(signal.len()));
        }
        self.piece.cut(range, period);
    }

    fn into_span(self) -> Span {
        let mut columns = self.piece.columns;
        Span {
            start: self.piece.start,
            psec: columns[PSEC].take(),
            position: columns[POSITION].take().unwrap_or_default(),
            velocity: self.motion.first,
            acceleration: self.motion.second,
            recorded_velocity: columns[VELOCITY].take(),
            current: columns[CURRENT].take(),
            smooth_current: self.smooth_current,
            velocity_feedforward: columns[VELOCITY_FEEDFORWARD].take(),
            torque_feedforward: columns[TORQUE_FEEDFORWARD].take(),
        }
    }
}

/// Checks a recording of `axis` and makes it even in time, with zero-phase derivatives.
///
/// Samples are put on an even grid where their count fits the time (stamps that jitter, loggers that stall and
/// catch up), otherwise interpolated to it; missing values are interpolated up to two in a row, longer gaps and
/// positions that freeze amid motion part the recording into spans. Velocity, acceleration and smoothed current
/// are those of one Gaussian without phase; at the ends of a span, over 5 standard deviations of 0.1325 / cutoff
/// each, it sees the signal mirrored about its end value. A lag of the current is taken back where it explains
/// the current clearly better and exceeds a sampling period. All that was done is among the findings.
///
/// # Errors
/// [`RecordingFault`] if the recording cannot be that of the axis as it was read, or nothing of it is left.
pub fn condition(
    raw: &RawRecording,
    axis: &AxisConfig,
    periods: &Periods,
    options: &Conditioning,
) -> Result<(Signals, Vec<Finding>), RecordingFault> {
    let mut findings = Vec::new();
    check_lengths(raw)?;
    let mut ordered = ordered(raw, &mut findings)?;
    let mut columns = columns(raw, &mut findings);
    drop_copies(&mut ordered, &raw.name, columns.iter().flatten(), &mut findings);
    drop_constant_current(&raw.name, &mut columns, &mut findings);
    let Some(position) = &columns[POSITION] else {
        return Err(RecordingFault::NoPosition { name: raw.name.clone() });
    };
    let smoother = |placed: &Placed| stamped_smoother(placed, position);
    let placed = place(&raw.name, &ordered, periods, smoother, &mut findings)?;
    let period = placed.period;
    let cutoff = cutoff(&raw.name, options, &placed)?;
    let filter = Gaussian::new(cutoff, period);
    let shortest = (2 * filter.radius() + 1).max(SHORTEST_SPAN);
    let (pieces, longest) = pieces(&raw.name, &placed, &columns, shortest, &mut findings);
    let nothing_left = || RecordingFault::NothingLeft { name: raw.name.clone(), longest, wanted: shortest };
    if pieces.is_empty() {
        return Err(nothing_left());
    }
    let mut parts: Vec<Part> = pieces.into_iter().map(|piece| Part::new(piece, &filter)).collect();
    plausible::check(&raw.name, &parts, axis, period, deviation(cutoff))?;
    let current_lag =
        current_lag(&raw.name, &parts, axis, periods, (period, cutoff), options, &mut findings)?;
    if current_lag != 0.0 {
        lag::take_back(&mut parts, current_lag, period);
        parts.retain(|part| part.piece.len() > 0);
        if parts.is_empty() {
            return Err(nothing_left());
        }
    }
    let mut spans: Vec<Span> = parts.into_iter().map(Part::into_span).collect();
    keep_apart(&mut spans, period);
    Ok((Signals { name: raw.name.clone(), period, cutoff, current_lag, spans }, findings))
}

fn check_lengths(raw: &RawRecording) -> Result<(), RecordingFault> {
    let channels = channels(raw);
    for n in 0..CHANNELS {
        let Some(values) = channels[n].filter(|values| values.len() != raw.time.len()) else { continue };
        return Err(RecordingFault::Lengths {
            name: raw.name.clone(),
            channel: NAMES[n],
            found: values.len(),
            stamps: raw.time.len(),
        });
    }
    match channels[POSITION] {
        Some(position) if position.is_empty() || position.iter().any(|x| x.is_finite()) => Ok(()),
        _ => Err(RecordingFault::NoPosition { name: raw.name.clone() }),
    }
}

/// Where the first stamps of a span jitter it could begin before the one before has ended: it is moved behind it.
fn keep_apart(spans: &mut [Span], period: f64) {
    let mut earliest = f64::NEG_INFINITY;
    for span in spans {
        span.start = span.start.max(earliest);
        earliest = span.start + span.position.len() as f64 * period;
    }
}

/// A current that does not change although the axis moves was not measured.
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
        let what =
            format!("{name}: the current is the same throughout although the axis moves; it is left out");
        findings.push(Finding::warning("constant-current", what, "record the motor current"));
    }
}

fn cutoff(name: &str, options: &Conditioning, placed: &Placed) -> Result<f64, RecordingFault> {
    let period = placed.period;
    let Some(found) = options.cutoff else { return Ok(default_cutoff(period)) };
    let longest =
        placed.blocks.iter().filter_map(|block| block.slots.last()).max().map_or(1, |slot| slot + 1);
    let lowest = deviation(1.0) * SPAN_DEVIATIONS / (longest as f64 * period);
    let highest = MAX_CUTOFF_PERIOD / period;
    if found >= lowest && found <= highest * (1.0 + ROUNDING) {
        return Ok(found);
    }
    Err(RecordingFault::Cutoff { name: name.to_owned(), found, lowest, highest, period })
}

/// The lag that is to be taken back, s.
fn current_lag(
    name: &str,
    parts: &[Part],
    axis: &AxisConfig,
    periods: &Periods,
    (period, cutoff): (f64, f64),
    options: &Conditioning,
    findings: &mut Vec<Finding>,
) -> Result<f64, RecordingFault> {
    const CODE: &str = "current-lag";
    if let Some(found) = options.current_lag {
        if !(LOWEST_LAG..=HIGHEST_LAG).contains(&found) {
            let (lowest, highest) = (LOWEST_LAG, HIGHEST_LAG);
            return Err(RecordingFault::Lag { name: name.to_owned(), found, lowest, highest });
        }
        return Ok(found);
    }
    // Sampled about as slowly as the setpoints come, the current shows their ripple, which looks like a lag.
    if period > COARSEST * seconds(periods.position) {
        return Ok(0.0);
    }
    // A filter of its own, so that the ripple at the position period is not matched with its neighbor.
    let filter = Gaussian::new(lag::cutoff(periods).min(cutoff), period);
    let long = parts.iter().filter(|part| part.piece.len() > 2 * filter.radius());
    let smooth: Vec<Part> = long.map(|part| Part::new(part.piece.clone(), &filter)).collect();
    let Some(lag) = lag::estimate(&smooth, axis.kind(), period) else { return Ok(0.0) };
    let milliseconds = lag.lag * 1e3;
    if lag.better && lag.at_end {
        let what =
            format!("{name}: the current lags the motion by {milliseconds:.1} ms or more; it is left so");
        findings.push(Finding::warning(CODE, what, "record the current with the clock of the position"));
        return Ok(0.0);
    }
    if lag.better && lag.long {
        let what = format!(
            "{name}: the current lags the motion by {milliseconds:.2} ms (R² {:.4} with, {:.4} without); \
             this is taken back",
            lag.r2, lag.r2_without
        );
        findings.push(Finding::note(CODE, what));
        return Ok(lag.lag);
    }
    if lag.better {
        let what = format!(
            "{name}: the current seems to lag the motion by {milliseconds:.2} ms, no more than a sampling period \
             of {} ms; it is left so",
            period * 1e3
        );
        findings.push(Finding::note(CODE, what));
    }
    Ok(0.0)
}
