//! Sequence of the pieces of a program: exact curves between stops, and blended runs.

use std::collections::VecDeque;

use super::element::Element;
use super::error::{FeedPlanError, StepError};
use super::piece::{CapSpan, Piece, PieceCurve};
use super::run::Run;
use super::source::{Part, PartSource};
use super::vector::difference;
use crate::motion::ProgramStep;

/// Change of the tangent or of the curvature times 1 mm below which an exact path continues without a stop.
const SMOOTH: f64 = 1e-9;

/// Lines and feeds along the path, in order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    /// Path parameter at the end of the motion.
    pub end: f64,
    pub line: usize,
    /// Programmed feed; infinite at rapid traverse.
    pub feed: f64,
}

/// Source of the pieces of a program.
pub(super) struct PieceSource<I> {
    parts: PartSource<I>,
    ahead: Option<Part>,
    run: Option<Run>,
    /// Path parameter at the end of the curves read.
    end: f64,
    largest: f64,
    marks: VecDeque<Mark>,
    programmed_time: f64,
}

impl<I, E> PieceSource<I>
where
    I: Iterator<Item = Result<ProgramStep, E>>,
    E: Into<StepError>,
{
    pub fn new(parts: PartSource<I>, largest: f64) -> Self {
        Self {
            parts,
            ahead: None,
            run: None,
            end: 0.0,
            largest,
            marks: VecDeque::new(),
            programmed_time: 0.0,
        }
    }

    /// Returns the duration of the motions read at their programmed feed, s.
    pub fn programmed_time(&self) -> f64 {
        self.programmed_time
    }

    /// Returns lines and feeds of the motions read.
    pub fn marks(&mut self) -> &mut VecDeque<Mark> {
        &mut self.marks
    }

    /// Reads the first motion.
    pub fn fill(&mut self) -> Result<(), FeedPlanError> {
        if self.ahead.is_none() {
            self.ahead = self.parts.next()?;
        }
        Ok(())
    }

    /// Returns the next piece, or a standstill of length 0 with its duration, or `None` at the end of the program.
    pub fn next(&mut self) -> Result<Option<Next>, FeedPlanError> {
        loop {
            if let Some(piece) = self.next_of_run()? {
                return Ok(Some(Next::Piece(piece)));
            }
            self.fill()?;
            match self.ahead.take() {
                None => return Ok(None),
                Some(Part::Stop(dwell)) => return Ok(Some(Next::Dwell(dwell))),
                Some(Part::Curve { element, blend: Some(tolerance), .. }) => {
                    let mut run = Run::new(self.end, self.largest);
                    self.mark(&element);
                    run.push(element, Some(tolerance));
                    self.run = Some(run);
                }
                Some(Part::Curve { element, blend: None, is_exact_path }) => {
                    self.fill()?;
                    let is_smooth = is_exact_path
                        && matches!(&self.ahead, Some(Part::Curve { element: next, blend: None, .. })
                            if is_continued(&element, next));
                    return Ok(Some(Next::Piece(self.exact(element, is_smooth))));
                }
            }
        }
    }

    fn exact(&mut self, element: Element, is_smooth: bool) -> Piece {
        let start = self.end;
        self.mark(&element);
        Piece {
            length: element.length,
            start,
            caps: vec![CapSpan { from: 0.0, to: element.length, cap: element.cap }],
            changes: Vec::new(),
            line: element.line,
            is_graded: false,
            tcp_length: element.tcp_length,
            to_stop: (!is_smooth).then_some(0.0),
            end: None,
            stop: (!is_smooth).then_some(0.0),
            curve: PieceCurve::Exact(element),
        }
    }

    fn mark(&mut self, element: &Element) {
        self.end += element.length;
        self.programmed_time += element.programmed_time();
        self.marks.push_back(Mark { end: self.end, line: element.line, feed: element.feed });
    }

    fn next_of_run(&mut self) -> Result<Option<Piece>, FeedPlanError> {
        let Some(mut run) = self.run.take() else { return Ok(None) };
        while !run.is_ready() {
            self.extend(&mut run)?;
        }
        let piece = run.next(self.parts.kinds());
        self.run = piece.is_some().then_some(run);
        Ok(piece)
    }

    /// Appends the next curve to `run`, or closes it.
    fn extend(&mut self, run: &mut Run) -> Result<(), FeedPlanError> {
        self.fill()?;
        match self.ahead.take() {
            Some(Part::Curve { element, blend, is_exact_path }) => {
                if run.tcp_length() != element.tcp_length {
                    run.close(0.0);
                    self.ahead = Some(Part::Curve { element, blend, is_exact_path });
                    return Ok(());
                }
                self.mark(&element);
                run.push(element, blend);
                if blend.is_none() {
                    run.close(0.0);
                }
            }
            Some(Part::Stop(dwell)) => {
                run.close(0.0);
                self.ahead = Some(Part::Stop(dwell));
            }
            None => run.close(0.0),
        }
        Ok(())
    }
}

/// Next part of the path.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "nearly all parts are pieces")]
pub(super) enum Next {
    Piece(Piece),
    /// Standstill, s.
    Dwell(f64),
}

/// Returns true if `after` continues `before` with the same tangent and curvature.
fn is_continued(before: &Element, after: &Element) -> bool {
    let (end, start) = (before.jet(before.length), after.jet(0.0));
    let largest = |order: usize| {
        difference(&end[order], &start[order]).into_iter().fold(0.0, |largest: f64, x| largest.max(x.abs()))
    };
    before.tcp_length == after.tcp_length && largest(1) < SMOOTH && 1e-3 * largest(2) < SMOOTH
}
