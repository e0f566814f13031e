//! Look-ahead window: the path ahead with its planned motion, always down to a standstill.

use std::collections::VecDeque;
use std::sync::Arc;

use super::error::{FeedPlanError, StepError};
use super::piece::{Piece, PieceCurve};
use super::pieces::{Mark, Next, PieceSource};
use super::planned::segments;
use super::segment::{Law, PathSegment, straight_line};
use super::speed::SpeedSolver;
use super::stations::{MachineModel, Station};
use super::vector::JointVector;
use super::window::{Interval, Stations, Window, WindowStart};
use crate::motion::ProgramStep;

/// Largest number of intervals ahead.
const MAX_INTERVALS: usize = 6000;
/// Time ahead at which the window is planned again, and time up to which the path is read, in stopping times.
const RENEWAL: f64 = 2.0;
const HORIZON: f64 = 5.0;
/// Smallest number of intervals between two stops.
const MIN_INTERVALS: usize = 6;
/// Plans of one window with reduced limits before it is rejected.
const MAX_ROUNDS: usize = 12;
/// Places in an interval where the limits are checked.
const CHECKS: [f64; 8] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875];
/// Part of a slowed-down motion's u̇² that is used.
const RESERVE: f64 = 0.98;
/// Largest ratio to a limit there; the rest covers the values in between.
const ACCEPTED: f64 = 0.9985;

/// Interval of the path with its planned motion.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    station: Option<Station>,
    pub piece: Option<Arc<Piece>>,
    /// Start of the interval from the start of the piece.
    pub from: f64,
    pub segment: Option<PathSegment>,
    /// True if the motion stops at the end of the interval.
    is_stop: bool,
    /// Factor on the programmed feed.
    pub feed_factor: f64,
}

/// Look-ahead window over the pieces of a program.
pub(super) struct LookAhead<I> {
    source: PieceSource<I>,
    pub model: MachineModel,
    pub entries: VecDeque<Entry>,
    solver: SpeedSolver,
    is_finished: bool,
    from_stop: f64,
    last_piece: Option<Arc<Piece>>,
    /// Factor on the programmed feeds of pieces not yet read.
    pub feed_factor: f64,
    /// Number of windows planned.
    pub plans: usize,
}

impl<I, E> LookAhead<I>
where
    I: Iterator<Item = Result<ProgramStep, E>>,
    E: Into<StepError>,
{
    pub fn new(source: PieceSource<I>, model: MachineModel) -> Self {
        let entries = VecDeque::new();
        let solver = SpeedSolver::default();
        Self {
            source,
            model,
            entries,
            solver,
            is_finished: false,
            from_stop: 0.0,
            last_piece: None,
            feed_factor: 1.0,
            plans: 0,
        }
    }

    /// Returns the joints at the start of the program, or `None` if it has no motion.
    pub fn start(&mut self) -> Result<Option<JointVector>, FeedPlanError> {
        while !self.is_finished && self.last_piece.is_none() {
            self.extend(self.entries.len(), 0.0)?;
        }
        let piece = self.entries.iter().find_map(|entry| entry.piece.as_ref());
        Ok(piece.map(|piece| self.model.joints(piece, 0.0)[0]))
    }

    /// Returns the duration of the motions read at their programmed feed, s.
    pub fn programmed_time(&self) -> f64 {
        self.source.programmed_time()
    }

    /// Returns lines and feeds of the motions read.
    pub fn marks(&mut self) -> &mut VecDeque<Mark> {
        self.source.marks()
    }

    /// Plans ahead if less than the renewal time is planned. The motion up to `reserve` seconds after the start of the
    /// first interval remains as it is.
    pub fn renew(&mut self, reserve: f64) -> Result<(), FeedPlanError> {
        loop {
            let (mut planned, mut count, mut ends_at_stop) = (0.0, 0, false);
            for entry in &self.entries {
                let Some(segment) = &entry.segment else { break };
                planned += segment.duration;
                count += 1;
                ends_at_stop = entry.is_stop;
            }
            let stopping = self.stopping_time();
            let is_complete = self.is_finished && count == self.entries.len();
            if is_complete || planned > reserve + RENEWAL * stopping {
                return Ok(());
            }
            if count > 0 && !ends_at_stop {
                let mut kept = 0;
                let mut time = 0.0;
                while kept < count && time < reserve {
                    time += self.entries[kept].segment.map_or(0.0, |segment| segment.duration);
                    kept += 1;
                }
                let before = self.entries.len();
                self.extend(count, HORIZON * stopping)?;
                let is_extended = self.entries.len() > before || self.entries.len() > count;
                if !is_extended || kept + 2 >= count {
                    return Ok(());
                }
                if self.plan(kept)? {
                    continue;
                }
                return Ok(());
            }
            self.extend(count, HORIZON * stopping)?;
            if self.entries.len() == count {
                return Ok(());
            }
            if self.entries[count].segment.is_none() && !self.plan(count)? {
                return Err(self.no_feed(count));
            }
        }
    }

    fn no_feed(&self, index: usize) -> FeedPlanError {
        let window = self.entries.range(index..).filter_map(|entry| entry.station.as_ref());
        let shortest = window.min_by(|a, b| a.interval.length.total_cmp(&b.interval.length));
        let (line, interval) = shortest.map_or((0, 0.0), |s| (s.piece.line, s.interval.length));
        FeedPlanError::NoFeed { line, interval }
    }

    /// Returns the time of a stop from the highest rate in the window, s.
    fn stopping_time(&self) -> f64 {
        let mut longest = 0.0_f64;
        for station in self.entries.iter().filter_map(|entry| entry.station.as_ref()).step_by(16) {
            let [acceleration, jerk] = self.model.tangential(&station.interval.ends[0]);
            let rate = station.interval.cap;
            longest =
                longest.max((rate / acceleration).min(2.0 * (rate / jerk).sqrt()) + acceleration / jerk);
        }
        longest
    }

    /// Reads pieces until the entries from `from` on last about `time` or end at a stop.
    fn extend(&mut self, from: usize, time: f64) -> Result<(), FeedPlanError> {
        let mut ahead = 0.0;
        let rate_time = |entry: &Entry| {
            entry.station.as_ref().map_or(0.0, |s| s.interval.length / s.interval.cap.max(f64::MIN_POSITIVE))
        };
        for entry in self.entries.range(from..) {
            ahead += rate_time(entry);
            if entry.is_stop {
                return Ok(());
            }
        }
        let mut stations = Vec::new();
        while !self.is_finished && self.entries.len() < MAX_INTERVALS {
            match self.source.next()? {
                None => self.is_finished = true,
                Some(Next::Dwell(0.0)) => {}
                Some(Next::Dwell(time)) => {
                    let piece = self.last_piece.clone();
                    self.push_segments(piece.as_ref(), vec![PathSegment::dwell(time)]);
                    return Ok(());
                }
                Some(Next::Piece(mut piece)) => {
                    piece.scale_feed(self.feed_factor);
                    let piece = Arc::new(piece);
                    self.last_piece = Some(Arc::clone(&piece));
                    let is_stop = piece.stop.is_some();
                    if let Some(segments) = self.straight(&piece) {
                        self.push_segments(Some(&piece), segments);
                        return Ok(());
                    }
                    stations.clear();
                    self.model.stations(&piece, self.from_stop, &mut stations);
                    self.from_stop = if is_stop { 0.0 } else { self.from_stop + piece.length };
                    let count = stations.len();
                    for (i, station) in stations.drain(..).enumerate() {
                        let entry = Entry {
                            piece: Some(Arc::clone(&piece)),
                            from: station.from,
                            segment: None,
                            is_stop: is_stop && i + 1 == count,
                            feed_factor: self.feed_factor,
                            station: Some(station),
                        };
                        ahead += rate_time(&entry);
                        self.entries.push_back(entry);
                    }
                    if is_stop || (ahead > time && self.entries.len() >= from + 4 * MIN_INTERVALS) {
                        return Ok(());
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns the closed-form motion if `piece` is a straight line of the joints from standstill to standstill.
    fn straight(&self, piece: &Piece) -> Option<Vec<PathSegment>> {
        let PieceCurve::Exact(element) = &piece.curve else { return None };
        let turns = |index: &usize| element.from[*index] != element.to[*index];
        let is_straight =
            element.is_line() && (piece.tcp_length.is_none() || !self.model.kinds.rotary.iter().any(turns));
        if !is_straight || self.from_stop > 0.0 || piece.stop.is_none() {
            return None;
        }
        let (node, cap) = self.model.node(piece, 0.0);
        let [acceleration, jerk] = self.model.tangential(&node);
        Some(straight_line(piece.length, [cap, acceleration, jerk]))
    }

    fn push_segments(&mut self, piece: Option<&Arc<Piece>>, segments: Vec<PathSegment>) {
        let mut from = 0.0;
        for segment in segments {
            if segment.law == Law::Dwell {
                from = piece.map_or(0.0, |piece| piece.length);
            }
            let length = segment.length;
            self.entries.push_back(Entry {
                station: None,
                piece: piece.map(Arc::clone),
                from,
                segment: Some(segment),
                is_stop: true,
                feed_factor: self.feed_factor,
            });
            from += length;
        }
    }

    /// Plans the entries from `first` on; returns false if that fails, and leaves them as they are.
    fn plan(&mut self, first: usize) -> Result<bool, FeedPlanError> {
        let is_moving = first > 0 && !self.entries[first - 1].is_stop;
        let end = (first..self.entries.len())
            .find(|&i| self.entries[i].is_stop)
            .map_or(self.entries.len(), |i| i + 1);
        let start = match self.entries[first].segment {
            Some(segment) if is_moving => {
                let (b, slope) = segment.start_state();
                WindowStart::Moving { b, slope }
            }
            _ => WindowStart::Rest,
        };
        let window = self.entries.range(first..end);
        let mut intervals: Vec<Interval> =
            window.filter_map(|entry| entry.station.as_ref()).map(|s| s.interval.clone()).collect();
        if intervals.len() != end - first || intervals.len() < MIN_INTERVALS {
            return Ok(false);
        }
        self.plans += 1;
        let mut last = None;
        for _ in 0..MAX_ROUNDS {
            let Some((stations, is_optimal)) = self.solve(&intervals, start) else { break };
            let segments = segments(&intervals, start, &stations);
            let is_within = self.reduce(first, &mut intervals, &segments);
            if is_within && is_optimal {
                self.accept(first, segments);
                return Ok(true);
            }
            last = Some((stations, segments));
            if !is_optimal {
                break;
            }
        }
        // From a standstill any motion is within the limits if it is slow enough.
        let Some((mut stations, found)) = last.filter(|_| start == WindowStart::Rest) else {
            return Ok(false);
        };
        let factor = self.slowdown(first, &intervals, &found);
        stations.iter_mut().for_each(|(b, slope)| (*b, *slope) = (*b * factor, *slope * factor));
        let segments = segments(&intervals, start, &stations);
        let is_valid = segments.iter().all(|segment| segment.duration.is_finite() && segment.duration > 0.0);
        if is_valid {
            self.accept(first, segments);
        }
        Ok(is_valid)
    }

    fn accept(&mut self, first: usize, segments: Vec<PathSegment>) {
        for (i, segment) in segments.into_iter().enumerate() {
            self.entries[first + i].segment = Some(segment);
        }
    }

    /// Returns the stations of the fastest motion, and true if it is optimal.
    fn solve(&mut self, intervals: &[Interval], start: WindowStart) -> Option<(Stations, bool)> {
        let rest = [intervals[0].length, intervals[intervals.len() - 1].length];
        let window = Window { intervals, start, rest, joints: &self.model.joints };
        let (stations, is_optimal) = self.solver.solve(&window)?;
        stations
            .iter()
            .all(|(b, slope)| *b > 0.0 && b.is_finite() && slope.is_finite())
            .then_some((stations, is_optimal))
    }

    /// Returns the factor on u̇² with which the joints keep their limits.
    fn slowdown(&self, first: usize, intervals: &[Interval], segments: &[PathSegment]) -> f64 {
        let mut factor = 1.0_f64;
        for (i, segment) in segments.iter().enumerate() {
            let entry = &self.entries[first + i];
            let Some(piece) = &entry.piece else { continue };
            for at in CHECKS {
                let [acceleration, jerk] = self.load(piece, entry.from, segment, at);
                let rate = segment.at(at * segment.duration).rate / intervals[i].cap;
                factor = factor.min(1.0 / acceleration).min(jerk.powf(-2.0 / 3.0)).min(1.0 / (rate * rate));
            }
        }
        RESERVE * factor
    }

    /// Returns true if the joints keep their limits inside all intervals; otherwise reduces the usable limits there.
    fn reduce(&self, first: usize, intervals: &mut [Interval], segments: &[PathSegment]) -> bool {
        let mut is_within = true;
        for (i, segment) in segments.iter().enumerate() {
            let entry = &self.entries[first + i];
            let Some(piece) = &entry.piece else { continue };
            let loads = CHECKS.iter().flat_map(|at| self.load(piece, entry.from, segment, *at));
            let worst = loads.fold(0.0, f64::max);
            if worst > ACCEPTED {
                is_within = false;
                let factor = (ACCEPTED / worst).clamp(0.5, 1.0) * 0.997;
                let near = i.saturating_sub(1)..(i + 2).min(intervals.len());
                intervals[near].iter_mut().for_each(|interval| interval.share *= factor);
            }
        }
        is_within
    }

    /// Returns the largest ratios of a joint's acceleration and jerk to its limits at the fraction `at` of a segment.
    fn load(&self, piece: &Piece, from: f64, segment: &PathSegment, at: f64) -> [f64; 2] {
        let t = at * segment.duration;
        let state = segment.at(t);
        let jerk = segment.jerk_at(&state);
        let [_, q1, q2, q3] = self.model.joints(piece, from + state.u);
        let (v, a) = (state.rate, state.acceleration);
        let mut worst = [0.0_f64; 2];
        for (j, bounds) in self.model.joints.iter().enumerate() {
            let acceleration = q1[j] * a + q2[j] * v * v;
            let jerk = q1[j] * jerk + 3.0 * q2[j] * v * a + q3[j] * v * v * v;
            worst[0] = worst[0].max(acceleration.abs() / bounds.acceleration);
            worst[1] = worst[1].max(jerk.abs() / bounds.jerk);
        }
        worst
    }
}
