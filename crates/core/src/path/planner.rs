//! Feed planning with look-ahead: limits of spans, junction speeds, feed profiles, and iteration while
//! sampled setpoints exceed a limit.

use std::sync::Arc;

use super::curve::JointCurve;
use super::derivatives::Derivatives;
use super::error::PlanError;
use super::geometry::{Frame, Path};
use super::junction::{Junction, share_jerk};
use super::limit_use::LimitUse;
use super::profile::{FeedLimits, SpeedProfile, both_ramps_length, max_reachable_speed};
use super::program::{FeedProfile, Move, PathLimits, Program, TimedSpan};
use super::spans::{SpanDivider, SpanDraft, end_pieces, sample_block};
use super::verify::{LimitViolations, SpanProperties, verify};
use crate::config::LimitsConfig;
use crate::kinematics::Kinematics;
use crate::trajectory::JointLimits;
use crate::trajectory::limits::SPEED_TOLERANCE;
use crate::units::{Nanoseconds, seconds};

/// Planning rounds before a limit that is still exceeded becomes an error. In later rounds each reduction
/// is at least a tenth.
const MAX_ROUNDS: usize = 40;
/// Rounds that reduce only the likely cause of a violation; later rounds reduce everything near it.
const TARGETED_ROUNDS: usize = 4;
/// Fraction of the largest junction speed from which on its acceleration jump matters.
const JUMP_THRESHOLD: f64 = 0.1;
/// Additional relative reduction, which avoids another round.
const EXTRA_REDUCTION: f64 = 1e-3;

impl Program {
    /// Plans the feed profiles of `moves` for joints with `limits`.
    ///
    /// The first move starts after `rest` seconds; setpoints are sampled every `period` nanoseconds. Travel limits
    /// are not checked: this is left to the caller that runs the program on a machine.
    ///
    /// # Errors
    /// Returns [`PlanError`] with the move, counted from 1, the value found and the value allowed.
    pub fn plan(
        kinematics: Kinematics,
        frame: Frame,
        limits: &[JointLimits],
        period: Nanoseconds,
        rest: f64,
        moves: Vec<Move>,
    ) -> Result<Self, PlanError> {
        check(|| "the position cycle, ns,".to_owned(), "larger than 0", period as f64, period > 0)?;
        check_time(|| "the rest before the first move, s,".to_owned(), rest)?;
        check_limits(limits)?;
        let joints: Vec<LimitsConfig> = limits.iter().map(|joint| joint.limits).collect();
        (1..).zip(&moves).try_for_each(|(index, planned)| check_move(index, planned))?;
        let blocks = moves.iter().map(|planned| planned.block.clone()).collect();
        let path = Path::new(kinematics, frame, blocks)?;
        if path.joint_count() != joints.len() {
            return Err(PlanError::JointCount { found: joints.len(), wanted: path.joint_count() });
        }
        check_cosines(&path, &moves, limits)?;
        let mut draft = ProgramDraft::new(Arc::new(path), moves, joints, seconds(period), rest)?;
        let mut round = 0;
        loop {
            let program = draft.program()?;
            let strict = round >= TARGETED_ROUNDS;
            let violations = verify(&program, &draft.properties(), &draft.joints, period, strict);
            let Some(worst) = &violations.worst else { return Ok(program) };
            round += 1;
            if round == MAX_ROUNDS {
                let (joint, LimitUse { quantity, allowed, .. }) = (&limits[worst.joint], worst.found);
                return Err(PlanError::LimitExceeded {
                    index: program.spans[worst.span].block + 1,
                    time: worst.time,
                    joint: joint.name.clone(),
                    unit: joint.unit(),
                    quantity,
                    found: worst.found.ratio() * allowed,
                    allowed,
                });
            }
            draft.reduce(&violations);
        }
    }
}

fn check(
    what: impl FnOnce() -> String,
    allowed: &'static str,
    found: f64,
    holds: bool,
) -> Result<(), PlanError> {
    if holds { Ok(()) } else { Err(PlanError::InvalidValue { what: what(), allowed, found }) }
}

fn check_positive(what: impl FnOnce() -> String, found: f64) -> Result<(), PlanError> {
    check(what, "finite and larger than 0", found, found.is_finite() && found > 0.0)
}

fn check_time(what: impl FnOnce() -> String, found: f64) -> Result<(), PlanError> {
    check(what, "finite and not negative", found, found.is_finite() && found >= 0.0)
}

fn check_limits(limits: &[JointLimits]) -> Result<(), PlanError> {
    for joint in limits {
        let LimitsConfig { velocity, acceleration, jerk, .. } = joint.limits;
        for (quantity, value) in [("speed", velocity), ("acceleration", acceleration), ("jerk", jerk)] {
            check_positive(|| format!("joint {}: the largest {quantity}", joint.name), value)?;
        }
    }
    Ok(())
}

fn check_move(index: usize, parameters: &Move) -> Result<(), PlanError> {
    let Move { feed, dwell, limits, .. } = *parameters;
    let of_move = |what: &'static str| move || format!("move {index}: {what}");
    check_positive(of_move("feed, m/s or rad/s,"), feed)?;
    check_time(of_move("dwell, s,"), dwell)?;
    let PathLimits { acceleration, jerk } = limits;
    check(of_move("acceleration, m/s² or rad/s²,"), "larger than 0", acceleration, acceleration > 0.0)?;
    check(of_move("jerk, m/s³ or rad/s³,"), "larger than 0", jerk, jerk > 0.0)?;
    if let Some(corner) = parameters.corner {
        check_time(of_move("corner speed, m/s or rad/s,"), corner)?;
    }
    let FeedProfile::Cosine { ramp } = parameters.profile else { return Ok(()) };
    check_positive(of_move("ramp, s,"), ramp)?;
    let (length, needed) = (parameters.block.length(), both_ramps_length(feed, ramp));
    if needed > length { Err(PlanError::TooShort { index, length, needed }) } else { Ok(()) }
}

/// Checks that cosine profiles, which are not adapted, keep the joints within Vmax.
fn check_cosines(path: &Path, moves: &[Move], limits: &[JointLimits]) -> Result<(), PlanError> {
    for (block, parameters) in moves.iter().enumerate() {
        if !parameters.is_cosine() {
            continue;
        }
        let samples = sample_block(&mut JointCurve::new(path, block));
        let rows = samples.chunks_exact(limits.len());
        let speeds = rows.flat_map(|row| row.iter().zip(limits)).map(|(slopes, joint)| {
            let (found, allowed) = (slopes[0] * parameters.feed, joint.limits.velocity);
            (found / allowed, found, joint)
        });
        // In this order, and in the comparison, NaN is the largest ratio.
        let Some((ratio, found, joint)) = speeds.max_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        let within = ratio <= 1.0 + SPEED_TOLERANCE;
        if !within {
            let (unit, allowed) = (joint.unit(), joint.limits.velocity);
            let joint = joint.name.clone();
            return Err(PlanError::TooFast { index: block + 1, joint, unit, found, allowed });
        }
    }
    Ok(())
}

/// A program during planning.
struct ProgramDraft {
    path: Arc<Path>,
    moves: Vec<Move>,
    joints: Vec<LimitsConfig>,
    rest: f64,
    drafts: Vec<SpanDraft>,
    /// Junctions between consecutive drafts.
    junctions: Vec<Junction>,
    /// Speed at the end of each draft in the latest program.
    exits: Vec<f64>,
}

impl ProgramDraft {
    fn new(
        path: Arc<Path>,
        moves: Vec<Move>,
        joints: Vec<LimitsConfig>,
        period: f64,
        rest: f64,
    ) -> Result<Self, PlanError> {
        let mut drafts: Vec<SpanDraft> = Vec::with_capacity(moves.len());
        let mut junctions = Vec::with_capacity(moves.len());
        let count = path.joint_count();
        let mut before = Derivatives::new(count);
        let mut after = Derivatives::new(count);
        for (block, parameters) in moves.iter().enumerate() {
            let mut curve = JointCurve::new(&path, block);
            let length = curve.block().length();
            let pieces = end_pieces(&curve);
            let mut spans = if parameters.is_cosine() {
                vec![SpanDraft {
                    block,
                    s_from: 0.0,
                    s_to: length,
                    limits: parameters.cap(),
                    is_straight: true,
                }]
            } else {
                SpanDivider { joints: &joints, cap: parameters.cap(), length }.divide(&mut curve, block)
            };
            if let Some(previous) = block.checked_sub(1).map(|previous| &moves[previous]) {
                curve.derivatives(0.0, pieces[0], &mut after);
                let stops = previous.dwell > 0.0 || previous.is_cosine() || parameters.is_cosine();
                let mut junction = Junction::STOP;
                if let (false, Some(earlier), Some(later)) = (stops, drafts.last_mut(), spans.first_mut()) {
                    junction = Junction::new(&before, &after, &joints, period, previous.corner);
                    if junction.cap > 0.0 && !junction.is_corner {
                        let earlier = (&before, &mut earlier.limits);
                        share_jerk(&mut junction, earlier, (&after, &mut later.limits), &joints, period);
                    }
                }
                junctions.push(junction);
            }
            curve.derivatives(length, pieces[1], &mut before);
            for span in &spans {
                let FeedLimits { velocity, acceleration, jerk } = span.limits;
                let is_usable = |limit: f64| limit.is_finite() && limit > 0.0;
                let is_usable = is_usable(velocity)
                    && (parameters.is_cosine() || is_usable(acceleration) && is_usable(jerk));
                if !is_usable {
                    return Err(PlanError::NotComputable {
                        index: block + 1,
                        found: span.length() / velocity,
                    });
                }
            }
            junctions.extend(spans.iter().skip(1).map(|_| Junction::INSIDE));
            drafts.extend(spans);
        }
        Ok(Self { path, moves, joints, rest, drafts, junctions, exits: Vec::new() })
    }

    /// Returns entry and exit speed of each draft: a forward pass limits by reachable speed, a backward
    /// pass by stopping distance.
    fn speeds(&self) -> Vec<(f64, f64)> {
        let count = self.drafts.len();
        let mut speeds = vec![(0.0, 0.0); count];
        for i in 0..count.saturating_sub(1) {
            let (draft, next, junction) = (&self.drafts[i], &self.drafts[i + 1], &self.junctions[i]);
            let cap = junction.cap.min(draft.limits.velocity).min(next.limits.velocity / junction.ratio);
            let exit = max_reachable_speed(draft.length(), speeds[i].0, cap, &draft.limits).min(cap);
            speeds[i].1 = exit;
            speeds[i + 1].0 = exit * junction.ratio;
        }
        for i in (0..count).rev() {
            let draft = &self.drafts[i];
            let entry = max_reachable_speed(draft.length(), speeds[i].1, speeds[i].0, &draft.limits);
            if entry < speeds[i].0 {
                speeds[i].0 = entry;
                if let Some(previous) = i.checked_sub(1) {
                    speeds[previous].1 = entry / self.junctions[previous].ratio;
                }
            }
        }
        speeds
    }

    fn program(&mut self) -> Result<Program, PlanError> {
        let speeds = self.speeds();
        self.exits = speeds.iter().map(|(_, exit)| *exit).collect();
        let mut spans: Vec<TimedSpan> = Vec::with_capacity(self.drafts.len());
        let mut t = self.rest;
        for (i, (draft, (entry, exit))) in self.drafts.iter().zip(speeds).enumerate() {
            let SpanDraft { block, s_from, s_to, limits, .. } = *draft;
            let parameters = &self.moves[block];
            let profile = match parameters.profile {
                FeedProfile::Cosine { ramp } => SpeedProfile::cosine(draft.length(), parameters.feed, ramp),
                FeedProfile::JerkLimited => SpeedProfile::new(draft.length(), entry, exit, &limits),
            };
            let duration = profile.duration();
            let end = t + duration;
            if !end.is_finite() {
                return Err(PlanError::NotComputable { index: block + 1, found: duration });
            }
            spans.push(TimedSpan { block, s_from, s_to, start: t, end, profile });
            let last = self.drafts.get(i + 1).is_none_or(|next| next.block != block);
            t = if last { end + parameters.dwell } else { end };
        }
        if !t.is_finite() {
            return Err(PlanError::NotComputable { index: self.moves.len(), found: t });
        }
        let mut programmed_feeds = [0.0; 2];
        for (block, parameters) in self.path.blocks().iter().zip(&self.moves) {
            let highest: &mut f64 = &mut programmed_feeds[block.kind() as usize];
            *highest = highest.max(parameters.feed);
        }
        Ok(Program { path: Arc::clone(&self.path), spans, duration: t, programmed_feeds })
    }

    /// Returns the properties of each span that the verification needs.
    fn properties(&self) -> Vec<SpanProperties> {
        let property = |(i, draft): (usize, &SpanDraft)| {
            let junction = self.junctions.get(i).unwrap_or(&Junction::STOP);
            // A jump below the junction's own speed limit has no effect.
            let has_jump =
                self.exits.get(i).is_some_and(|exit| *exit > 0.0 && *exit >= JUMP_THRESHOLD * junction.cap);
            SpanProperties {
                is_straight: draft.is_straight,
                is_exempt: self.moves[draft.block].is_cosine(),
                has_jump: has_jump && !junction.is_corner,
                is_corner: junction.is_corner,
            }
        };
        self.drafts.iter().enumerate().map(property).collect()
    }

    /// Reduces the limits of the spans and junctions that cause violations.
    fn reduce(&mut self, violations: &LimitViolations) {
        for (draft, factor) in self.drafts.iter_mut().zip(&violations.span_factors) {
            if *factor < 1.0 {
                draft.limits = draft.limits.slowed(factor * (1.0 - EXTRA_REDUCTION));
            }
        }
        for ((junction, exit), factor) in
            self.junctions.iter_mut().zip(&self.exits).zip(&violations.junction_factors)
        {
            if *factor < 1.0 {
                // The jump causes only part of the violation, so it is reduced further.
                junction.cap = junction.cap.min(*exit) * factor * factor * (1.0 - EXTRA_REDUCTION);
            }
        }
    }
}

impl Move {
    fn is_cosine(&self) -> bool {
        matches!(self.profile, FeedProfile::Cosine { .. })
    }

    /// Returns the feed and the limits of the move.
    fn cap(&self) -> FeedLimits {
        FeedLimits { velocity: self.feed, acceleration: self.limits.acceleration, jerk: self.limits.jerk }
    }
}
