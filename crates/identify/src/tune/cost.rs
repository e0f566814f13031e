//! What a run costs: one number from its figures.

use std::fmt;
use std::str::FromStr;

use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::trial::{AxisFigures, Figures};
use virtual_axes_core::units::{DEGREE, MILLIMETER, Told};

/// m in µm.
const MICROMETER: f64 = 1e-3 * MILLIMETER;
/// rad in mdeg.
const MILLIDEGREE: f64 = 1e-3 * DEGREE;

/// A figure of a run that can be part of a cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Term {
    /// Largest contour error, µm; where there is no contour to be off, as [`Term::Tracking`].
    Contour,
    /// RMS contour error, µm; where there is no contour to be off, as [`Term::Rms`].
    ContourRms,
    /// Largest synchronized tracking error of any axis, µm or mdeg.
    Tracking,
    /// RMS synchronized tracking error of the worst axis, µm or mdeg.
    Rms,
    /// Largest current of any axis, part of its limit.
    Current,
    /// Control activity of the liveliest axis, A.
    Activity,
}

impl Term {
    /// All of them.
    pub const ALL: [Term; 6] =
        [Term::Contour, Term::ContourRms, Term::Tracking, Term::Rms, Term::Current, Term::Activity];

    /// As it is written in a cost.
    pub fn name(self) -> &'static str {
        match self {
            Term::Contour => "contour",
            Term::ContourRms => "contour-rms",
            Term::Tracking => "tracking",
            Term::Rms => "rms",
            Term::Current => "current",
            Term::Activity => "activity",
        }
    }

    /// Its unit on a path that has `figures`.
    pub fn unit(self, figures: &Figures) -> &'static str {
        let moves = |kind: AxisKind| figures.axes.iter().any(|axis| axis.moves && axis.kind == kind);
        match self {
            Term::Current => "of the limit",
            Term::Activity => "A",
            Term::Contour | Term::ContourRms if has_contour(figures) => "µm",
            _ => match (moves(AxisKind::Linear), moves(AxisKind::Rotary)) {
                (true, true) => "µm or mdeg",
                (false, true) => "mdeg",
                _ => "µm",
            },
        }
    }

    /// Its value in a run of `machine`, in its unit; of the axes that move.
    pub fn of(self, figures: &Figures, machine: &MachineConfig) -> f64 {
        let worst = |value: &dyn Fn(&AxisFigures) -> f64| {
            figures.axes.iter().filter(|axis| axis.moves).map(value).fold(0.0, f64::max)
        };
        let unit = |axis: &AxisFigures| match axis.kind {
            AxisKind::Linear => MICROMETER,
            AxisKind::Rotary => MILLIDEGREE,
        };
        match (self, figures.contour.filter(|_| has_contour(figures))) {
            (Term::Contour, Some(contour)) => contour.max / MICROMETER,
            (Term::ContourRms, Some(contour)) => contour.rms / MICROMETER,
            (Term::Contour | Term::Tracking, _) => {
                worst(&|axis| axis.report.max_synchronized_tracking_error / unit(axis))
            }
            (Term::ContourRms | Term::Rms, _) => {
                worst(&|axis| axis.report.rms_synchronized_tracking_error / unit(axis))
            }
            (Term::Activity, _) => worst(&|axis| axis.report.control_activity),
            (Term::Current, _) => {
                let limited = machine.axes().iter().zip(&figures.axes).filter(|(_, axis)| axis.moves);
                let parts = limited.map(|(config, axis)| axis.report.peak_current / config.motor.max_current);
                parts.fold(0.0, f64::max)
            }
        }
    }
}

/// Whether the axes can be off a contour: one axis alone never leaves its line but at the ends, and without
/// a linear axis the tool turns in place.
fn has_contour(figures: &Figures) -> bool {
    let moving = || figures.axes.iter().filter(|axis| axis.moves);
    figures.contour.is_some() && moving().count() > 1 && moving().any(|axis| axis.kind == AxisKind::Linear)
}

/// Of a term: beside each other they leave room for any ratio, and a sum of figures stays a number.
const LARGEST_WEIGHT: f64 = 1e9;

/// A weighted sum of figures, to be as small as possible.
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    terms: Vec<(Term, f64)>,
}

/// A cost that cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CostError {
    /// No such figure.
    #[error("unknown term {term}; there are {}", Term::ALL.map(Term::name).join(", "))]
    UnknownTerm {
        /// What was found.
        term: String,
    },
    /// A weight that is none.
    #[error("{term}={weight}: the weight must be a number from 0 to {LARGEST_WEIGHT:e}")]
    Weight {
        /// Of which figure.
        term: &'static str,
        /// What was found.
        weight: String,
    },
    /// A figure that stands twice.
    #[error("{term} stands twice")]
    Twice {
        /// Which.
        term: &'static str,
    },
    /// Every weight is zero.
    #[error("no term has a weight: every tuning would cost the same")]
    Nothing,
}

impl Default for Cost {
    /// The largest contour error.
    fn default() -> Self {
        Cost { terms: vec![(Term::Contour, 1.0)] }
    }
}

impl Cost {
    /// The cost with these weights.
    ///
    /// # Errors
    /// [`CostError`].
    pub fn new(terms: &[(Term, f64)]) -> Result<Self, CostError> {
        for (place, (term, weight)) in terms.iter().enumerate() {
            if !(0.0..=LARGEST_WEIGHT).contains(weight) {
                return Err(CostError::Weight { term: term.name(), weight: Told(*weight).to_string() });
            }
            if terms[..place].iter().any(|(before, _)| before == term) {
                return Err(CostError::Twice { term: term.name() });
            }
        }
        if terms.iter().all(|(_, weight)| *weight == 0.0) {
            return Err(CostError::Nothing);
        }
        Ok(Cost { terms: terms.to_vec() })
    }

    /// Its terms with their weights.
    pub fn terms(&self) -> &[(Term, f64)] {
        &self.terms
    }

    /// What a run of `machine` costs.
    pub fn of(&self, figures: &Figures, machine: &MachineConfig) -> f64 {
        self.terms.iter().map(|(term, weight)| weight * term.of(figures, machine)).sum()
    }

    /// Unit of the cost on a path that has `figures`; empty for a sum of terms, and for one with a weight.
    pub fn unit(&self, figures: &Figures) -> &'static str {
        match self.terms.as_slice() {
            [(term, 1.0)] => term.unit(figures),
            _ => "",
        }
    }
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, (term, weight)) in self.terms.iter().enumerate() {
            let comma = if place > 0 { "," } else { "" };
            write!(f, "{comma}{}", term.name())?;
            if *weight != 1.0 {
                write!(f, "={weight}")?;
            }
        }
        Ok(())
    }
}

impl FromStr for Cost {
    type Err = CostError;

    /// Reads `contour=1,rms=0.5`; a term without a weight has 1.
    fn from_str(text: &str) -> Result<Self, CostError> {
        let terms = text.split(',').map(|part| {
            let (name, weight) = part.split_once('=').map_or((part, "1"), |(name, weight)| (name, weight));
            let (name, weight) = (name.trim(), weight.trim());
            let term = Term::ALL.into_iter().find(|term| term.name() == name);
            let term = term
                .ok_or_else(|| CostError::UnknownTerm { term: virtual_axes_core::config::shortened(name) })?;
            let refused = || CostError::Weight {
                term: term.name(),
                weight: virtual_axes_core::config::shortened(weight),
            };
            Ok((term, weight.parse().map_err(|_| refused())?))
        });
        Cost::new(&terms.collect::<Result<Vec<_>, _>>()?)
    }
}
