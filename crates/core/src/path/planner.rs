//! From moves to a program: limits, junctions, speeds, times, and again if a limit is exceeded.

use std::sync::Arc;

use super::block::Derivatives;
use super::cosine::{Cosine, ramps_length};
use super::curve::JointCurve;
use super::error::{PlanError, Quantity};
use super::junction::{Junction, share_jerk};
use super::profile::{Limits, ProfilePlanner, reachable};
use super::program::{Law, Move, Program, Span, SpanLaw};
use super::route::{Frame, Path};
use super::spans::{Divider, Draft, end_pieces, sample_block};
use super::verify::{Finding, Nature, verify};
use crate::config::LimitsConfig;
use crate::kinematics::Kinematics;
use crate::trajectory::JointLimits;
use crate::trajectory::limits::SPEED_TOLERANCE;
use crate::units::{Nanoseconds, seconds};

/// Plans that are made before a limit that is still exceeded is an error. Each is slower where it was,
/// by a part in ten at least in the end.
const MAX_ROUNDS: usize = 40;
/// Rounds after which whatever is near an excess is slowed, not only what is most likely its cause.
const PATIENT_ROUNDS: usize = 4;
/// Part of the largest speed at a junction from which on the jump of acceleration there matters.
const JUMP_MATTERS: f64 = 0.1;
/// Slowed by that much more than the excess asks for, so that the next round need not again.
const SLOWER: f64 = 1e-3;

/// What is known of a move besides its block.
struct Order {
    feed: f64,
    corner: Option<f64>,
    cap: Limits,
    law: Law,
    dwell: f64,
}

/// See [`Program::plan`].
pub(super) fn plan(
    kinematics: Kinematics,
    frame: Frame,
    limits: &[JointLimits],
    period: Nanoseconds,
    rest: f64,
    moves: Vec<Move>,
) -> Result<Program, PlanError> {
    if period <= 0 {
        return Err(PlanError::Period { found: period });
    }
    if !rest.is_finite() || rest < 0.0 {
        return Err(PlanError::Rest { found: rest });
    }
    let joints = check_limits(limits)?;
    let mut orders = Vec::with_capacity(moves.len());
    let mut blocks = Vec::with_capacity(moves.len());
    for (i, order) in moves.into_iter().enumerate() {
        check_move(i + 1, &order)?;
        let Move { block, feed, corner, limits, law, dwell } = order;
        let cap = Limits { velocity: feed, acceleration: limits.acceleration, jerk: limits.jerk };
        orders.push(Order { feed, corner, cap, law, dwell });
        blocks.push(block);
    }
    let path = Path::new(kinematics, frame, blocks)?;
    if path.joint_count() != joints.len() {
        return Err(PlanError::Joints { found: joints.len(), wanted: path.joint_count() });
    }
    check_cosines(&path, &orders, limits)?;
    let mut draft = Drafting::new(Arc::new(path), orders, joints, seconds(period), rest)?;
    let mut round = 0;
    loop {
        let program = draft.program()?;
        let finding = verify(&program, &draft.natures(), &draft.joints, period, round >= PATIENT_ROUNDS);
        let Some(worst) = &finding.worst else { return Ok(program) };
        round += 1;
        if round == MAX_ROUNDS {
            let joint = &limits[worst.joint];
            return Err(PlanError::Exceeds {
                index: program.spans[worst.span].block + 1,
                time: worst.time,
                joint: joint.name.clone(),
                unit: joint.unit(),
                quantity: worst.quantity,
                found: worst.ratio * worst.allowed,
                allowed: worst.allowed,
            });
        }
        draft.slow(&finding);
    }
}

fn check_limits(limits: &[JointLimits]) -> Result<Vec<LimitsConfig>, PlanError> {
    for joint in limits {
        let LimitsConfig { velocity, acceleration, jerk, .. } = joint.limits;
        let values =
            [(Quantity::Speed, velocity), (Quantity::Acceleration, acceleration), (Quantity::Jerk, jerk)];
        for (quantity, value) in values {
            if !value.is_finite() || value <= 0.0 {
                return Err(PlanError::Limit { joint: joint.name.clone(), quantity, value });
            }
        }
    }
    Ok(limits.iter().map(|joint| joint.limits).collect())
}

fn check_move(index: usize, order: &Move) -> Result<(), PlanError> {
    let check = |what, found: f64, allowed, holds: bool| {
        if holds { Ok(()) } else { Err(PlanError::Value { index, what, allowed, found }) }
    };
    let Move { feed, dwell, limits, .. } = *order;
    check("feed, m/s or rad/s,", feed, "finite and larger than 0", feed.is_finite() && feed > 0.0)?;
    check("dwell, s,", dwell, "finite and not negative", dwell.is_finite() && dwell >= 0.0)?;
    check("acceleration, m/s² or rad/s²,", limits.acceleration, "larger than 0", limits.acceleration > 0.0)?;
    check("jerk, m/s³ or rad/s³,", limits.jerk, "larger than 0", limits.jerk > 0.0)?;
    if let Some(corner) = order.corner {
        check(
            "corner speed, m/s or rad/s,",
            corner,
            "finite and not negative",
            corner.is_finite() && corner >= 0.0,
        )?;
    }
    let Law::Cosine { ramp } = order.law else { return Ok(()) };
    check("ramp, s,", ramp, "finite and larger than 0", ramp.is_finite() && ramp > 0.0)?;
    let (length, needed) = (order.block.length(), ramps_length(feed, ramp));
    if needed > length { Err(PlanError::TooShort { index, length, needed }) } else { Ok(()) }
}

/// A cosine law is as prescribed, so its speed must be one that the joints can have.
fn check_cosines(path: &Path, orders: &[Order], limits: &[JointLimits]) -> Result<(), PlanError> {
    for (block, order) in orders.iter().enumerate() {
        if !matches!(order.law, Law::Cosine { .. }) {
            continue;
        }
        let samples = sample_block(&mut JointCurve::new(path, block));
        for row in samples.all().chunks_exact(limits.len()) {
            for (slopes, joint) in row.iter().zip(limits) {
                let (found, allowed) = (slopes[0] * order.feed, joint.limits.velocity);
                // Written so that NaN is too fast.
                let within = found <= allowed * (1.0 + SPEED_TOLERANCE);
                if !within {
                    let (unit, joint) = (joint.unit(), joint.name.clone());
                    return Err(PlanError::TooFast { index: block + 1, joint, unit, found, allowed });
                }
            }
        }
    }
    Ok(())
}

/// A program in the making.
struct Drafting {
    path: Arc<Path>,
    orders: Vec<Order>,
    joints: Vec<LimitsConfig>,
    rest: f64,
    drafts: Vec<Draft>,
    /// Between each draft and the next.
    junctions: Vec<Junction>,
    /// Speed at the end of each draft in the last program made.
    exits: Vec<f64>,
    planner: ProfilePlanner,
}

impl Drafting {
    fn new(
        path: Arc<Path>,
        orders: Vec<Order>,
        joints: Vec<LimitsConfig>,
        period: f64,
        rest: f64,
    ) -> Result<Self, PlanError> {
        let mut drafts: Vec<Draft> = Vec::with_capacity(orders.len());
        let mut junctions = Vec::with_capacity(orders.len());
        let count = path.joint_count();
        let mut before = Derivatives::new(count);
        let mut after = Derivatives::new(count);
        for (block, order) in orders.iter().enumerate() {
            let mut curve = JointCurve::new(&path, block);
            let length = curve.block().length();
            let pieces = end_pieces(&curve);
            let mut spans = if order.is_cosine() {
                vec![Draft { block, s_from: 0.0, s_to: length, limits: order.cap, straight: true }]
            } else {
                Divider { joints: &joints, cap: order.cap, length }.divide(&mut curve, block)
            };
            if let Some(previous) = block.checked_sub(1).map(|previous| &orders[previous]) {
                curve.derivatives(0.0, pieces[0], &mut after);
                let rests = previous.dwell > 0.0 || previous.is_cosine() || order.is_cosine();
                let mut junction = Junction::STOP;
                if let (false, Some(earlier), Some(later)) = (rests, drafts.last_mut(), spans.first_mut()) {
                    junction = Junction::new(&before, &after, &joints, period, previous.corner);
                    if junction.cap > 0.0 && !junction.corner {
                        let earlier = (&before, &mut earlier.limits);
                        share_jerk(&mut junction, earlier, (&after, &mut later.limits), &joints, period);
                    }
                }
                junctions.push(junction);
            }
            curve.derivatives(length, pieces[1], &mut before);
            for span in &spans {
                let Limits { velocity, acceleration, jerk } = span.limits;
                let usable = |limit: f64| limit.is_finite() && limit > 0.0;
                let usable = usable(velocity) && (order.is_cosine() || usable(acceleration) && usable(jerk));
                if !usable {
                    return Err(PlanError::Unmeasurable {
                        index: block + 1,
                        found: span.length() / velocity,
                    });
                }
            }
            junctions.extend(spans.iter().skip(1).map(|_| Junction::INSIDE));
            drafts.extend(spans);
        }
        let (exits, planner) = (Vec::new(), ProfilePlanner::default());
        Ok(Self { path, orders, joints, rest, drafts, junctions, exits, planner })
    }

    /// Entry and exit speeds of each draft: forward, what can be reached; backward, what can be left.
    fn speeds(&self) -> Vec<(f64, f64)> {
        let count = self.drafts.len();
        let mut speeds = vec![(0.0, 0.0); count];
        for i in 0..count.saturating_sub(1) {
            let (draft, next, junction) = (&self.drafts[i], &self.drafts[i + 1], &self.junctions[i]);
            let cap = junction.cap.min(draft.limits.velocity).min(next.limits.velocity / junction.ratio);
            let exit = reachable(draft.length(), speeds[i].0, cap, &draft.limits).min(cap);
            speeds[i].1 = exit;
            speeds[i + 1].0 = exit * junction.ratio;
        }
        for i in (0..count).rev() {
            let draft = &self.drafts[i];
            let entry = reachable(draft.length(), speeds[i].1, speeds[i].0, &draft.limits);
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
        let mut spans: Vec<Span> = Vec::with_capacity(self.drafts.len());
        let mut first = Vec::with_capacity(self.orders.len() + 1);
        let mut t = self.rest;
        for (i, (draft, (entry, exit))) in self.drafts.iter().zip(speeds).enumerate() {
            let Draft { block, s_from, s_to, limits, .. } = *draft;
            let order = &self.orders[block];
            if first.len() == block {
                first.push(i);
            }
            let law = match order.law {
                Law::Cosine { ramp } => SpanLaw::Cosine(Cosine::new(draft.length(), order.feed, ramp)),
                Law::JerkLimited => SpanLaw::Jerk(self.planner.plan(draft.length(), entry, exit, &limits)),
            };
            let duration = law.duration();
            let end = t + duration;
            if !end.is_finite() {
                return Err(PlanError::Unmeasurable { index: block + 1, found: duration });
            }
            spans.push(Span { block, s_from, s_to, start: t, end, law });
            let last = self.drafts.get(i + 1).is_none_or(|next| next.block != block);
            t = if last { end + order.dwell } else { end };
        }
        if !t.is_finite() {
            return Err(PlanError::Unmeasurable { index: self.orders.len(), found: t });
        }
        first.push(spans.len());
        Ok(Program { path: Arc::clone(&self.path), spans, first, duration: t })
    }

    /// What the verification must know.
    fn natures(&self) -> Vec<Nature> {
        let nature = |(i, draft): (usize, &Draft)| {
            let junction = self.junctions.get(i).unwrap_or(&Junction::STOP);
            // A jump that limits nothing is none.
            let jumps =
                self.exits.get(i).is_some_and(|exit| *exit > 0.0 && *exit >= JUMP_MATTERS * junction.cap);
            Nature {
                straight: draft.straight,
                exempt: self.orders[draft.block].is_cosine(),
                jumps: jumps && !junction.corner,
                corner: junction.corner,
            }
        };
        self.drafts.iter().enumerate().map(nature).collect()
    }

    /// Slows what makes limits exceeded.
    fn slow(&mut self, finding: &Finding) {
        for (draft, pace) in self.drafts.iter_mut().zip(&finding.spans) {
            if *pace < 1.0 {
                draft.limits = draft.limits.slowed(pace * (1.0 - SLOWER));
            }
        }
        for ((junction, exit), pace) in self.junctions.iter_mut().zip(&self.exits).zip(&finding.junctions) {
            if *pace < 1.0 {
                // Only part of an excess is the jump's, so more of the jump must go.
                junction.cap = junction.cap.min(*exit) * pace * pace * (1.0 - SLOWER);
            }
        }
    }
}

impl Order {
    fn is_cosine(&self) -> bool {
        matches!(self.law, Law::Cosine { .. })
    }
}
