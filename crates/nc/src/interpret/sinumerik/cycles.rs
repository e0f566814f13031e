//! Drilling cycles: CYCLE81 to CYCLE89 and CYCLE840.

use super::super::codes::FeedMode;
use super::super::error::Outcome;
use super::super::state::State;
use super::cycle_values::{CycleValues, Dwell, feed_to, pause, rapid};
use super::deep_hole::DeepHole;
use super::tapping::Tapping;
use super::value::ProgramValue;
use crate::motion::{PathControl, ProgramEvent};

/// Drilling cycle with its values in m and s, in programmed coordinates along the normal of the plane.
#[derive(Debug, Clone)]
pub(super) struct DrillingCycle {
    kind: DrillingKind,
    /// Plane of retraction RTP, to which the cycle returns.
    retract: f64,
    /// Reference plane RFP.
    reference: f64,
    /// Reference plane with the safety distance, RFP + SDIS.
    start: f64,
    /// Depth.
    bottom: f64,
    /// Dwell at the depth.
    dwell: Option<Dwell>,
}

#[derive(Debug, Clone)]
enum DrillingKind {
    /// CYCLE81, CYCLE82: retraction at rapid traverse.
    Drilling,
    /// CYCLE83.
    DeepHole(DeepHole),
    /// CYCLE84.
    Tapping(Tapping),
    /// CYCLE840: pitch, m, or the programmed feed.
    FloatingTapping { pitch: Option<f64> },
    /// CYCLE85: feeds in and out, in units of the program; `None` for the active one.
    Reaming { feeds: [Option<f64>; 2] },
    /// CYCLE86: lift-off along the axes of the plane and the normal, m.
    Boring { lift: [f64; 3] },
    /// CYCLE87, CYCLE88: spindle and program stop at the depth.
    StoppedBoring,
    /// CYCLE89: retraction at feed.
    FeedBoring,
}

impl DrillingCycle {
    /// Creates a cycle from the values of its call; `None` for other names.
    pub(super) fn new(name: &str, values: &[Option<ProgramValue>], state: &State) -> Outcome<Option<Self>> {
        let values = CycleValues { cycle: name, values, length: state.modal.length };
        let kind = match name {
            "CYCLE81" | "CYCLE82" | "CYCLE83" => DrillingKind::Drilling,
            "CYCLE84" => DrillingKind::Tapping(Tapping::new(&values)?),
            "CYCLE840" => DrillingKind::FloatingTapping { pitch: values.pitch(9, 10, None)? },
            "CYCLE85" => {
                let feeds = [values.get(6)?, values.get(7)?];
                DrillingKind::Reaming { feeds: feeds.map(|feed| feed.filter(|feed| *feed > 0.0)) }
            }
            "CYCLE86" => {
                DrillingKind::Boring { lift: [values.length(7)?, values.length(8)?, values.length(9)?] }
            }
            "CYCLE87" | "CYCLE88" => DrillingKind::StoppedBoring,
            "CYCLE89" => DrillingKind::FeedBoring,
            _ => return Ok(None),
        };
        let retract = values.required(0, "RTP, the plane of retraction")?;
        let reference = values.required(1, "RFP, the reference plane")?;
        let down = if retract >= reference { -1.0 } else { 1.0 };
        let start = reference - down * values.length(2)?.abs();
        let depth = values.get(4)?.filter(|depth| *depth != 0.0).map(|depth| depth.abs() * values.length);
        let bottom = match (values.get(3)?, depth) {
            // The depth below the reference plane takes effect if both are given, as the control reports.
            (_, Some(depth)) => reference + down * depth,
            (Some(bottom), None) => bottom * values.length,
            (None, None) => return Err(format!("{name} requires DP or DPR, its value 4 or 5: the depth")),
        };
        if matches!(name, "CYCLE81" | "CYCLE82") && values.get(6)?.is_some_and(|mode| mode != 0.0) {
            return Err(format!(
                "{name}: _GMODE, its value 7, is not supported above 0 (depth of the shank, diameter of the centering): \
                 program the depth of the tip"
            ));
        }
        if down * (bottom - start) < 0.0 {
            return Err(format!("{name}: the depth is above the reference plane"));
        }
        let kind = match name {
            "CYCLE83" => DrillingKind::DeepHole(DeepHole::new(&values, reference, bottom)?),
            _ => kind,
        };
        let dwell = match name {
            "CYCLE83" => values.dwell(8)?,
            "CYCLE87" => None,
            _ => values.dwell(5)?,
        };
        Ok(Some(Self { kind, retract, reference, start, bottom, dwell }))
    }
}

impl DrillingCycle {
    /// Drills a hole at the present position of the plane.
    pub(super) fn drill(&self, state: &mut State) -> Outcome<()> {
        if state.modal.feed_mode == FeedMode::InverseTime {
            return Err("drilling cycles require G94 or G95".to_owned());
        }
        let path_control = std::mem::replace(&mut state.modal.path_control, PathControl::ExactPath);
        let feed = (state.modal.feed, state.modal.feed_mode);
        let result = drill(self, state);
        state.modal.path_control = path_control;
        (state.modal.feed, state.modal.feed_mode) = feed;
        result
    }
}

fn drill(cycle: &DrillingCycle, state: &mut State) -> Outcome<()> {
    let DrillingCycle { kind, retract, reference, start, bottom, dwell } = cycle;
    rapid(*start, state)?;
    let reference_feed = state.modal.feed;
    match kind {
        DrillingKind::Drilling => {
            feed_to(*bottom, state)?;
            pause(*dwell, state)?;
        }
        DrillingKind::DeepHole(hole) => hole.drill([*reference, *start, *bottom], *dwell, state)?,
        DrillingKind::Tapping(tapping) => tapping.tap([*reference, *start, *bottom], *dwell, state)?,
        DrillingKind::FloatingTapping { pitch } => {
            if let Some(pitch) = pitch {
                if state.modal.spindle_speed <= 0.0 {
                    return Err("CYCLE840 with a pitch requires the spindle speed S".to_owned());
                }
                state.modal.feed_mode = FeedMode::PerMinute;
                state.modal.feed = Some([pitch * state.modal.spindle_speed; 2]);
            }
            feed_to(*bottom, state)?;
            pause(*dwell, state)?;
            feed_to(*start, state)?;
        }
        DrillingKind::Reaming { feeds } => {
            let length = state.modal.length;
            state.modal.feed = feeds[0].map(|feed| [feed * length; 2]).or(reference_feed);
            feed_to(*bottom, state)?;
            pause(*dwell, state)?;
            state.modal.feed = feeds[1].map(|feed| [feed * length; 2]).or(reference_feed);
            feed_to(*start, state)?;
        }
        DrillingKind::Boring { lift } => {
            feed_to(*bottom, state)?;
            pause(*dwell, state)?;
            let [first, second, normal] = state.modal.plane.axes();
            let hole = state.programmed();
            let mut lifted = hole;
            for (axis, lift) in [first, second, normal].into_iter().zip(lift) {
                lifted[axis] += lift;
            }
            state.rapid_to(&lifted)?;
            rapid(*start, state)?;
            let mut back = state.programmed();
            (back[first], back[second]) = (hole[first], hole[second]);
            state.rapid_to(&back)?;
        }
        DrillingKind::StoppedBoring => {
            feed_to(*bottom, state)?;
            pause(*dwell, state)?;
            state.push_event(ProgramEvent::Stop);
        }
        DrillingKind::FeedBoring => {
            feed_to(*bottom, state)?;
            pause(*dwell, state)?;
            feed_to(*start, state)?;
        }
    }
    rapid(*retract, state)
}
