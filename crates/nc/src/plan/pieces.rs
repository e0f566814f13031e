//! Sequence of the pieces of a program: exact curves between stops, and blended runs.

use std::collections::VecDeque;

use super::blended_path::BlendedPath;
use super::error::FeedPlanError;
use super::motion_curve::{CurveEnd, MotionCurve};
use super::piece::{CapSpan, Piece, PieceCurve};
use super::source::{Part, PartSource};
use super::vector::difference;

/// Change of the tangent or of the curvature times 1 mm below which an exact path continues without a stop.
const SMOOTH: f64 = 1e-9;

/// Largest number of lines that become one.
const MAX_MERGED: usize = 100;

/// Lines and feeds along the path, in order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    /// Path parameter at the end of the motion.
    pub end: f64,
    pub line: usize,
    pub tool: Option<u32>,
    /// Programmed feed; infinite at rapid traverse.
    pub feed: f64,
}

/// Source of the pieces of a program.
pub(super) struct PieceSource<'a> {
    parts: PartSource<'a>,
    ahead: Option<Part<MotionCurve>>,
    blended: Option<BlendedPath>,
    /// Path parameter at the end of the curves read.
    end: f64,
    largest: f64,
    /// Lines and feeds of the motions read.
    pub marks: VecDeque<Mark>,
    /// Curves read with their path parameters at the start, if they are kept.
    pub programmed: Option<Vec<(f64, MotionCurve)>>,
    /// Duration of the motions read at their programmed feed, s.
    pub programmed_time: f64,
}

impl<'a> PieceSource<'a> {
    pub fn new(parts: PartSource<'a>, largest: f64) -> Self {
        Self {
            parts,
            ahead: None,
            blended: None,
            end: 0.0,
            largest,
            marks: VecDeque::new(),
            programmed: None,
            programmed_time: 0.0,
        }
    }

    /// Reads the first motion.
    pub fn fill(&mut self) -> Result<(), FeedPlanError> {
        if self.ahead.is_none() {
            self.ahead = self.parts.next()?;
        }
        Ok(())
    }

    /// Returns the next piece or standstill, or `None` at the end of the program.
    pub fn next(&mut self) -> Result<Option<Part<Piece>>, FeedPlanError> {
        loop {
            if let Some(piece) = self.next_blended()? {
                return Ok(Some(Part::Path(piece)));
            }
            self.fill()?;
            let curve = match self.ahead.take() {
                None => return Ok(None),
                Some(Part::Stop(standstill)) => return Ok(Some(Part::Stop(standstill))),
                Some(Part::Path(curve)) => curve,
            };
            if is_blended(&curve) {
                let mut blended = BlendedPath::new(self.end, self.largest);
                self.mark(&curve);
                blended.push(curve, self.parts.kinds());
                self.blended = Some(blended);
            } else {
                self.fill()?;
                let is_smooth = curve.at_end == CurveEnd::ExactPath
                    && matches!(&self.ahead, Some(Part::Path(next)) if !is_blended(next) && is_continued(&curve, next));
                return Ok(Some(Part::Path(self.exact(curve, is_smooth))));
            }
        }
    }

    /// Returns the next motion as programmed, or a standstill, or `None` at the end of the program. Lines in a row are one
    /// where the points between them are within its tolerance.
    pub fn next_exact(&mut self) -> Result<Option<Part<Piece>>, FeedPlanError> {
        self.fill()?;
        let mut curve = match self.ahead.take() {
            None => return Ok(None),
            Some(Part::Stop(standstill)) => return Ok(Some(Part::Stop(standstill))),
            Some(Part::Path(curve)) => curve,
        };
        let start = self.end;
        self.mark(&curve);
        let mut between = Vec::new();
        while between.len() < MAX_MERGED {
            self.fill()?;
            let Some(Part::Path(next)) = &self.ahead else { break };
            between.push(curve.to);
            if !self.parts.is_merged(&curve, next, &between) {
                break;
            }
            if let Some(Part::Path(next)) = self.ahead.take() {
                self.mark(&next);
                let length = curve.length + next.length;
                curve = MotionCurve { from: curve.from, length, ..next };
            }
        }
        Ok(Some(Part::Path(piece(curve, start, false))))
    }

    fn exact(&mut self, curve: MotionCurve, is_smooth: bool) -> Piece {
        let start = self.end;
        self.mark(&curve);
        piece(curve, start, is_smooth)
    }

    fn mark(&mut self, curve: &MotionCurve) {
        if let Some(programmed) = &mut self.programmed {
            programmed.push((self.end, curve.clone()));
        }
        self.end += curve.length;
        self.programmed_time += curve.programmed_time();
        self.marks.push_back(Mark { end: self.end, line: curve.line, tool: curve.tool, feed: curve.feed });
    }

    fn next_blended(&mut self) -> Result<Option<Piece>, FeedPlanError> {
        let Some(mut blended) = self.blended.take() else { return Ok(None) };
        while !blended.is_ready() {
            self.extend(&mut blended)?;
        }
        let piece = blended.next(self.parts.kinds());
        self.blended = piece.is_some().then_some(blended);
        Ok(piece)
    }

    /// Appends the next curve to `blended`, or closes it.
    fn extend(&mut self, blended: &mut BlendedPath) -> Result<(), FeedPlanError> {
        self.fill()?;
        match self.ahead.take() {
            Some(Part::Path(curve)) if curve.tcp_length == blended.tcp_length() => {
                self.mark(&curve);
                let is_last = !is_blended(&curve);
                blended.push(curve, self.parts.kinds());
                if is_last {
                    blended.close();
                }
            }
            other => {
                blended.close();
                self.ahead = other;
            }
        }
        Ok(())
    }
}

/// Returns the piece of a curve at a path parameter.
fn piece(curve: MotionCurve, start: f64, is_smooth: bool) -> Piece {
    Piece {
        length: curve.length,
        start,
        caps: vec![CapSpan { from: 0.0, to: curve.length, cap: curve.cap }],
        changes: Vec::new(),
        line: curve.line,
        is_graded: false,
        tcp_length: curve.tcp_length,
        to_stop: (!is_smooth).then_some(0.0),
        end: None,
        is_stop: !is_smooth,
        feed_factor: 1.0,
        curve: PieceCurve::Exact(curve),
    }
}

fn is_blended(curve: &MotionCurve) -> bool {
    matches!(curve.at_end, CurveEnd::Blend(_))
}

/// Returns true if `after` continues `before` with the same tangent and curvature.
fn is_continued(before: &MotionCurve, after: &MotionCurve) -> bool {
    let (end, start) = (before.jet(before.length), after.jet(0.0));
    let largest = |order: usize| {
        difference(&end[order], &start[order]).into_iter().fold(0.0, |largest: f64, x| largest.max(x.abs()))
    };
    before.tcp_length == after.tcp_length && largest(1) < SMOOTH && 1e-3 * largest(2) < SMOOTH
}
