//! Look-ahead window: the path ahead with its planned motion, always down to a standstill.

use std::collections::VecDeque;
use std::sync::Arc;

use super::activity::ProgramStop;
use super::error::FeedPlanError;
use super::interval_motion::{IntervalMotion, Law, motions, straight_line};
use super::machine_model::{MachineModel, Surroundings, is_continued};
use super::piece::{Piece, PieceCurve};
use super::pieces::PieceSource;
use super::planned_interval::PlannedInterval;
use super::source::Part;
use super::speed::SpeedSolver;
use super::trapezoid::TrapezoidPlanner;
use super::vector::JointVector;
use super::window::{Interval, Stations, Window, WindowStart};

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
/// Usable fraction of the limits behind a moving start, where the plan before may be the only one within the limits: the
/// difference to the usual one covers its tolerance.
const START_SHARE: f64 = 0.998;
/// Part of the planned time after which a plan that failed is tried again.
const RETRY: f64 = 0.8;
/// Part of the planned time after which a window with the largest number of intervals is planned again: the work stays in
/// proportion to the path.
const FULL_RETRY: f64 = 0.5;

/// Look-ahead window over the pieces of a program.
pub(super) struct LookAhead<'a> {
    pub source: PieceSource<'a>,
    pub model: Arc<MachineModel>,
    pub entries: VecDeque<PlannedInterval>,
    solver: SpeedSolver,
    /// Planner of a control with trapezoidal speed, in place of the time-optimal one.
    pub trapezoid: Option<TrapezoidPlanner>,
    is_finished: bool,
    from_stop: f64,
    last_piece: Option<Arc<Piece>>,
    /// Pieces and standstills behind the last entry, read for the division of those before them, with the constant rate
    /// of a steady piece.
    next: VecDeque<(Part<Arc<Piece>>, Option<f64>)>,
    /// Constant rate of the last piece, where it is steady, and distance to its end in which the rate continues.
    steady: (Option<f64>, f64),
    /// Time of a stop from the highest rate in the window, s.
    stopping_time: f64,
    /// Time along the path up to which the plan reaches far enough, s.
    sufficient: f64,
    /// Planned time above which the window is not planned again, since that failed or the window is full, s.
    retry_time: f64,
    /// Factor on the programmed feeds of pieces not yet read.
    pub feed_factor: f64,
    /// Number of intervals planned, each time they were planned.
    pub planned_intervals: u64,
}

impl<'a> LookAhead<'a> {
    pub fn new(source: PieceSource<'a>, model: Arc<MachineModel>) -> Self {
        Self {
            source,
            model,
            entries: VecDeque::new(),
            solver: SpeedSolver::default(),
            trapezoid: None,
            is_finished: false,
            from_stop: 0.0,
            last_piece: None,
            next: VecDeque::new(),
            steady: (None, 0.0),
            stopping_time: 0.0,
            sufficient: 0.0,
            retry_time: f64::INFINITY,
            feed_factor: 1.0,
            planned_intervals: 0,
        }
    }

    /// Returns the joints at the start of the program, or `None` if it has no motion.
    pub fn start(&mut self) -> Result<Option<JointVector>, FeedPlanError> {
        while self.trapezoid.is_none() && !self.is_finished && self.last_piece.is_none() {
            self.read_pieces(self.entries.len(), 0.0)?;
        }
        while self.trapezoid.is_some() && self.entries.iter().all(|entry| entry.piece.is_none()) {
            if !self.extend_trapezoid()? {
                break;
            }
        }
        let piece = self.entries.iter().find_map(|entry| entry.piece.as_ref());
        Ok(piece.map(|piece| self.model.joints(piece, 0.0)[0]))
    }

    /// Plans ahead if less than the renewal time is planned. The motion up to `reserve` seconds after the start of the
    /// first interval, which is at `passed` along the path, remains as it is.
    pub fn renew(&mut self, passed: f64, reserve: f64) -> Result<(), FeedPlanError> {
        if passed + reserve < self.sufficient {
            return Ok(());
        }
        if self.trapezoid.is_some() {
            let planned = |entry: &PlannedInterval| entry.motion.map_or(0.0, |motion| motion.duration);
            while self.entries.iter().map(planned).sum::<f64>() <= reserve && self.extend_trapezoid()? {}
            return Ok(());
        }
        loop {
            let stopping = self.stopping_time;
            let enough = (reserve + RENEWAL * stopping).min(self.retry_time);
            // The standstill at the end of the window shapes the intervals before it, however long they last.
            let margin = if self.retry_time.is_finite() { 0 } else { MIN_INTERVALS };
            let (mut planned, mut count, mut kept, mut ends_at_stop) = (0.0, 0, 0, false);
            let mut beyond = 0;
            for entry in &self.entries {
                let Some(motion) = &entry.motion else { break };
                kept += usize::from(planned < reserve);
                planned += motion.duration;
                count += 1;
                ends_at_stop = entry.is_stop;
                beyond += usize::from(planned > enough);
                if beyond > margin || (beyond > 0 && entry.is_stop) {
                    self.set_sufficient(passed);
                    return Ok(());
                }
            }
            if self.is_finished && count == self.entries.len() {
                return Ok(());
            }
            // A window from a standstill is longer than the part of it that remains as it is.
            let kept_time = if count == 0 || ends_at_stop { reserve } else { 0.0 };
            self.extend(count, kept_time)?;
            if self.entries.len() == count {
                return Ok(());
            }
            if count > 0 && !ends_at_stop {
                if kept + 2 >= count || !self.plan(kept)? {
                    self.retry_time = RETRY * planned;
                    return Ok(());
                }
                self.set_retry_time(reserve);
            } else if self.entries[count].motion.is_none() {
                if !self.plan(count)? {
                    return Err(self.no_feed(count));
                }
                self.set_retry_time(reserve);
            }
        }
    }

    /// Sets the time up to which the plan reaches far enough.
    fn set_sufficient(&mut self, passed: f64) {
        self.sufficient = 0.0;
        if self.retry_time.is_finite() {
            return;
        }
        // Ends of the last intervals: those before the last ones may be short of the renewal time.
        let (mut end, mut ends) = (passed, [f64::NEG_INFINITY; MIN_INTERVALS + 1]);
        for motion in self.entries.iter().map_while(|entry| entry.motion) {
            end += motion.duration;
            ends.rotate_left(1);
            ends[MIN_INTERVALS] = end;
        }
        self.sufficient = ends[0] - RENEWAL * self.stopping_time;
    }

    /// Appends the next motion of a control with trapezoidal speed; returns false at the end of the program.
    fn extend_trapezoid(&mut self) -> Result<bool, FeedPlanError> {
        let Some(trapezoid) = &mut self.trapezoid else { return Ok(false) };
        trapezoid.extend(&mut self.source, &self.model, self.feed_factor, &mut self.entries)
    }

    /// Sets the planned time above which the present plan is kept; it exceeds the part of the motion that remains as it is.
    fn set_retry_time(&mut self, reserve: f64) {
        let is_full = self.entries.len() >= MAX_INTERVALS;
        let planned = || self.entries.iter().filter_map(|entry| entry.motion).map(|motion| motion.duration);
        let retry_time = || (FULL_RETRY * planned().sum::<f64>()).max(2.0 * reserve);
        self.retry_time = if is_full { retry_time() } else { f64::INFINITY };
    }

    fn no_feed(&self, index: usize) -> FeedPlanError {
        let length = |entry: &PlannedInterval| entry.interval.as_ref().map(|interval| interval.length);
        let window = self.entries.range(index..).filter_map(|entry| Some((length(entry)?, entry)));
        let (interval, line) = window
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or((0.0, 0), |(length, entry)| (length, entry.piece.as_ref().map_or(0, |piece| piece.line)));
        FeedPlanError::NoFeed { line, interval }
    }

    /// Returns the time of a stop from the rate of an interval, s.
    fn interval_stopping_time(&self, interval: &Interval) -> f64 {
        let [acceleration, jerk] = self.model.tangential(&interval.ends[0]);
        interval.cap / acceleration + acceleration / jerk
    }

    /// Reads pieces until the entries from `from` on last `time` and the horizon of their stopping time, or end at a stop.
    fn extend(&mut self, from: usize, time: f64) -> Result<(), FeedPlanError> {
        loop {
            let stopping = self.stopping_time;
            self.read_pieces(from, time + HORIZON * stopping)?;
            let intervals = self.entries.iter().filter_map(|entry| entry.interval.as_ref());
            self.stopping_time =
                intervals.map(|interval| self.interval_stopping_time(interval)).fold(0.0, f64::max);
            if self.stopping_time <= stopping {
                return Ok(());
            }
        }
    }

    /// Reads pieces until the entries from `from` on last about `time` or end at a stop.
    fn read_pieces(&mut self, from: usize, time: f64) -> Result<(), FeedPlanError> {
        // Intervals beyond the time, of which the last ones brake to the standstill at the end of the window.
        let (mut ahead, mut beyond) = (0.0, 0);
        let rate_time = |interval: &Interval| interval.length / interval.cap.max(f64::MIN_POSITIVE);
        for entry in self.entries.range(from..) {
            ahead += entry.interval.as_ref().map_or(0.0, rate_time);
            beyond += usize::from(ahead > time);
            if entry.is_stop {
                return Ok(());
            }
        }
        while self.entries.len() < MAX_INTERVALS {
            self.read_next(0)?;
            let Some((part, steady)) = self.next.pop_front() else {
                self.is_finished = true;
                return Ok(());
            };
            match part {
                Part::Stop(ProgramStop { time: 0.0, .. }) => {}
                Part::Stop(ProgramStop { time, activity }) => {
                    let piece = self.last_piece.clone();
                    self.push_motions(piece.as_ref(), vec![IntervalMotion::dwell(time)]);
                    if let Some(entry) = self.entries.back_mut() {
                        entry.standstill = Some(activity);
                    }
                    return Ok(());
                }
                Part::Path(piece) => {
                    self.last_piece = Some(Arc::clone(&piece));
                    if let Some(motions) = self.straight(&piece) {
                        self.push_motions(Some(&piece), motions);
                        return Ok(());
                    }
                    let around = self.surroundings(&piece, steady)?;
                    let entries = &mut self.entries;
                    self.model.divide(&piece, &around, |from, interval| {
                        ahead += rate_time(&interval);
                        beyond += usize::from(ahead > time);
                        let (interval, piece) = (Some(interval), Some(Arc::clone(&piece)));
                        let (motion, standstill, is_stop) = (None, None, false);
                        entries.push_back(PlannedInterval {
                            interval,
                            piece,
                            from,
                            motion,
                            standstill,
                            is_stop,
                        });
                    });
                    if let Some(last) = entries.back_mut() {
                        last.is_stop = piece.is_stop;
                    }
                    self.from_stop = if piece.is_stop { 0.0 } else { self.from_stop + piece.length };
                    if piece.is_stop
                        || (beyond > MIN_INTERVALS && self.entries.len() >= from + 4 * MIN_INTERVALS)
                    {
                        return Ok(());
                    }
                }
            }
        }
        Ok(())
    }

    /// Reads pieces and standstills up to `index` of those behind the last entry, if the program has as many.
    fn read_next(&mut self, index: usize) -> Result<(), FeedPlanError> {
        while self.next.len() <= index {
            let part = match self.source.next()? {
                None => break,
                Some(Part::Stop(standstill)) => (Part::Stop(standstill), None),
                Some(Part::Path(mut piece)) => {
                    piece.scale_feed(self.feed_factor);
                    let steady = self.model.steady_rate(&piece);
                    (Part::Path(Arc::new(piece)), steady)
                }
            };
            self.next.push_back(part);
        }
        Ok(())
    }

    /// Returns the surroundings of the piece that was read last, and reads those behind it that its division depends on.
    fn surroundings(&mut self, piece: &Piece, steady: Option<f64>) -> Result<Surroundings, FeedPlanError> {
        let is_start = self.from_stop == 0.0;
        let before = if !is_start && is_continued(steady, self.steady.0) { self.steady.1 } else { 0.0 };
        self.steady = (steady, before + piece.length);
        let (mut after, mut index, mut is_stop, mut rate) = (0.0, 0, piece.is_stop, steady);
        let reach = self.model.reach(piece);
        while !is_stop && rate.is_some() && after < reach {
            self.read_next(index)?;
            let Some((Part::Path(next), next_rate)) = self.next.get(index) else { break };
            if !is_continued(rate, *next_rate) {
                break;
            }
            after += next.length;
            (rate, is_stop, index) = (*next_rate, next.is_stop, index + 1);
        }
        Ok(Surroundings { from_stop: self.from_stop, is_steady: steady.is_some(), constant: [before, after] })
    }

    /// Returns the closed-form motion if `piece` is a straight line of the joints from standstill to standstill.
    fn straight(&self, piece: &Piece) -> Option<Vec<IntervalMotion>> {
        let PieceCurve::Exact(curve) = &piece.curve else { return None };
        let turns = |index: &usize| curve.from[*index] != curve.to[*index];
        let is_straight =
            curve.is_line() && (piece.tcp_length.is_none() || !self.model.kinds.rotary.iter().any(turns));
        if !is_straight || self.from_stop > 0.0 || !piece.is_stop {
            return None;
        }
        let (node, cap) = self.model.node(piece, 0.0);
        let [acceleration, jerk] = self.model.tangential(&node);
        Some(straight_line(piece.length, [cap, acceleration, jerk]))
    }

    fn push_motions(&mut self, piece: Option<&Arc<Piece>>, motions: Vec<IntervalMotion>) {
        let mut from = 0.0;
        for motion in motions {
            if motion.law == Law::Dwell {
                from = piece.map_or(0.0, |piece| piece.length);
            }
            let length = motion.length;
            self.entries.push_back(PlannedInterval {
                interval: None,
                piece: piece.map(Arc::clone),
                from,
                motion: Some(motion),
                standstill: None,
                is_stop: true,
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
        let start = match self.entries[first].motion {
            Some(motion) if is_moving => {
                let (b, slope) = motion.start_state();
                WindowStart::Moving { b, slope }
            }
            _ => WindowStart::Rest,
        };
        let window = self.entries.range(first..end);
        let mut intervals: Vec<Interval> = window.filter_map(|entry| entry.interval.clone()).collect();
        if intervals.len() != end - first || intervals.len() < MIN_INTERVALS {
            return Ok(false);
        }
        if is_moving {
            let mut time = 0.0;
            for (interval, entry) in intervals.iter_mut().zip(self.entries.range(first..)) {
                let Some(motion) = entry.motion else { break };
                time += motion.duration;
                if time < self.stopping_time {
                    interval.share = START_SHARE;
                }
                let (b, slope) = motion.start_state();
                interval.guess = b + 0.5 * slope * interval.length;
            }
        }
        let (mut last, mut is_again) = (None, false);

        for _ in 0..MAX_ROUNDS {
            let Some((stations, is_optimal)) = self.solve(&intervals, start, is_again) else { break };
            let motions = motions(&intervals, start, &stations);
            let is_within = self.reduce(first, &mut intervals, &motions);
            if is_within && is_optimal {
                self.accept(first, motions);
                return Ok(true);
            }
            (last, is_again) = (Some((stations, motions)), true);
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
        let motions = motions(&intervals, start, &stations);
        let is_valid = motions.iter().all(|motion| motion.duration.is_finite() && motion.duration > 0.0);
        if is_valid {
            self.accept(first, motions);
        }
        Ok(is_valid)
    }

    fn accept(&mut self, first: usize, motions: Vec<IntervalMotion>) {
        for (i, motion) in motions.into_iter().enumerate() {
            self.entries[first + i].motion = Some(motion);
        }
    }

    /// Returns the stations of the fastest motion, and true if it is optimal.
    fn solve(
        &mut self,
        intervals: &[Interval],
        start: WindowStart,
        is_again: bool,
    ) -> Option<(Stations, bool)> {
        let rest = [intervals[0].length, intervals[intervals.len() - 1].length];
        let window = Window { intervals, start, rest, joints: &self.model.joints };
        self.planned_intervals += intervals.len() as u64;
        let (stations, is_optimal) =
            if is_again { self.solver.solve_again(&window) } else { self.solver.solve(&window) }?;
        stations
            .iter()
            .all(|(b, slope)| *b > 0.0 && b.is_finite() && slope.is_finite())
            .then_some((stations, is_optimal))
    }

    /// Returns the factor on u̇² with which the joints keep their limits.
    fn slowdown(&self, first: usize, intervals: &[Interval], motions: &[IntervalMotion]) -> f64 {
        let mut factor = 1.0_f64;
        for (i, motion) in motions.iter().enumerate() {
            let entry = &self.entries[first + i];
            let Some(piece) = &entry.piece else { continue };
            for at in CHECKS {
                let [acceleration, jerk] = self.load(piece, entry.from, motion, at);
                let rate = motion.at_part(at).0.rate / intervals[i].cap;
                factor = factor.min(1.0 / acceleration).min(jerk.powf(-2.0 / 3.0)).min(1.0 / (rate * rate));
            }
        }
        RESERVE * factor
    }

    /// Returns true if the joints keep their limits inside all intervals; otherwise reduces the usable limits there.
    fn reduce(&self, first: usize, intervals: &mut [Interval], motions: &[IntervalMotion]) -> bool {
        let mut is_within = true;
        for (i, motion) in motions.iter().enumerate() {
            let entry = &self.entries[first + i];
            let Some(piece) = &entry.piece else { continue };
            let loads = CHECKS.iter().flat_map(|at| self.load(piece, entry.from, motion, *at));
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

    /// Returns the largest ratios of a joint's acceleration and jerk to its limits at [`IntervalMotion::at_part`] `at`.
    fn load(&self, piece: &Piece, from: f64, motion: &IntervalMotion, at: f64) -> [f64; 2] {
        let (state, jerk) = motion.at_part(at);
        let [_, q1, q2, q3] = self.model.joints(piece, from + state.u);
        let (v, a) = (state.rate, state.acceleration);
        let (square, product, cube) = (v * v, 3.0 * v * a, v * v * v);
        let mut worst = [0.0_f64; 2];
        for (j, [inverse_acceleration, inverse_jerk]) in self.model.inverses.iter().enumerate() {
            let acceleration = q1[j] * a + q2[j] * square;
            let jerk = q1[j] * jerk + q2[j] * product + q3[j] * cube;
            worst[0] = worst[0].max(acceleration.abs() * inverse_acceleration);
            worst[1] = worst[1].max(jerk.abs() * inverse_jerk);
        }
        worst
    }
}
