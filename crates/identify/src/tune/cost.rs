//! Cost of a run: weighted sum of its figures.

use std::fmt;
use std::str::FromStr;

use virtual_axes_core::config::{AxisKind, AxisUnits, MachineConfig};
use virtual_axes_core::trial::{AxisFigures, Figures};
use virtual_axes_core::units::{MICROMETER, Rounded};

/// Figure of a run that can be part of a cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CostTerm {
    /// Largest contour error of the motions at feed, µm; without contour error the same as [`CostTerm::Following`].
    Contour,
    /// RMS contour error of the motions at feed, µm; without contour error the same as [`CostTerm::FollowingRms`].
    ContourRms,
    /// Largest delay-compensated following error of any axis, µm or mdeg: of the motions at feed, where there are any.
    Following,
    /// Largest RMS delay-compensated following error of any axis, µm or mdeg: of the motions at feed, where there are any.
    FollowingRms,
    /// Largest current of any axis relative to its limit.
    Current,
    /// Largest control activity of any axis, A.
    Activity,
}

impl CostTerm {
    /// All terms.
    pub const ALL: [CostTerm; 6] = [
        CostTerm::Contour,
        CostTerm::ContourRms,
        CostTerm::Following,
        CostTerm::FollowingRms,
        CostTerm::Current,
        CostTerm::Activity,
    ];

    /// Returns the name in the text form of a cost.
    pub fn name(self) -> &'static str {
        match self {
            CostTerm::Contour => "contour",
            CostTerm::ContourRms => "contour-rms",
            CostTerm::Following => "following",
            CostTerm::FollowingRms => "rms",
            CostTerm::Current => "current",
            CostTerm::Activity => "activity",
        }
    }

    /// Returns the unit on a path with `figures`.
    pub fn unit(self, figures: &Figures) -> &'static str {
        let moves = |kind: AxisKind| figures.axes.iter().any(|axis| axis.moves && axis.kind == kind);
        match self {
            CostTerm::Current => "of the limit",
            CostTerm::Activity => "A",
            CostTerm::Contour | CostTerm::ContourRms if has_contour(figures) => "µm",
            _ => match (moves(AxisKind::Linear), moves(AxisKind::Rotary)) {
                (true, true) => "µm or mdeg",
                (false, true) => "mdeg",
                _ => "µm",
            },
        }
    }

    /// Returns the value in a run of `machine` over the moving axes, in the unit of the term.
    pub fn of(self, figures: &Figures, machine: &MachineConfig) -> f64 {
        let worst = |value: &dyn Fn(&AxisFigures) -> f64| {
            figures.axes.iter().filter(|axis| axis.moves).map(value).fold(0.0, f64::max)
        };
        let unit = |axis: &AxisFigures| AxisUnits::for_kind(axis.kind).error;
        let at_feed = |axis: &AxisFigures| axis.cuts.unwrap_or(axis.report);
        match (self, figures.contour.filter(|_| has_contour(figures))) {
            (CostTerm::Contour, Some(contour)) => contour.max / MICROMETER,
            (CostTerm::ContourRms, Some(contour)) => contour.rms / MICROMETER,
            (CostTerm::Contour | CostTerm::Following, _) => {
                worst(&|axis| at_feed(axis).max_delay_compensated_following_error / unit(axis))
            }
            (CostTerm::ContourRms | CostTerm::FollowingRms, _) => {
                worst(&|axis| at_feed(axis).rms_delay_compensated_following_error / unit(axis))
            }
            (CostTerm::Activity, _) => worst(&|axis| axis.report.control_activity),
            (CostTerm::Current, _) => {
                let limited = machine.axes().iter().zip(&figures.axes).filter(|(_, axis)| axis.moves);
                let parts = limited.map(|(config, axis)| axis.report.peak_current / config.motor.max_current);
                parts.fold(0.0, f64::max)
            }
        }
    }
}

/// Returns true if the axes can have a contour error. A single axis leaves its line only at the ends, and
/// without a linear axis the tool tip does not move.
pub(crate) fn has_contour(figures: &Figures) -> bool {
    let moving = || figures.moving_tool_axes();
    figures.contour.is_some() && moving().count() > 1 && moving().any(|axis| axis.kind == AxisKind::Linear)
}

/// Largest weight of a term; permits any useful ratio and keeps the sum finite.
const LARGEST_WEIGHT: f64 = 1e9;

/// Weighted sum of figures that a search minimizes.
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    terms: Vec<(CostTerm, f64)>,
}

/// Error of parsing a cost.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CostError {
    /// Unknown term.
    #[error("unknown term {term}; available terms: {}", CostTerm::ALL.map(CostTerm::name).join(", "))]
    UnknownTerm {
        /// Name of the term.
        term: String,
    },
    /// Weight out of range.
    #[error("{term}={weight}: the weight must be a number from 0 to {LARGEST_WEIGHT:e}")]
    Weight {
        /// Name of the term.
        term: &'static str,
        /// Weight.
        weight: String,
    },
    /// Duplicate term.
    #[error("{term} is given twice")]
    Duplicate {
        /// Name of the term.
        term: &'static str,
    },
    /// Cost whose weights are all zero.
    #[error("all weights are 0; at least one must be above 0")]
    AllZero,
}

impl Default for Cost {
    /// Returns the largest contour error with weight 1.
    fn default() -> Self {
        Cost { terms: vec![(CostTerm::Contour, 1.0)] }
    }
}

impl Cost {
    /// Creates a cost from terms and weights.
    ///
    /// # Errors
    /// [`CostError`] if a weight is out of range, a term is duplicate or all weights are zero.
    pub fn new(terms: &[(CostTerm, f64)]) -> Result<Self, CostError> {
        for (index, (term, weight)) in terms.iter().enumerate() {
            if !(0.0..=LARGEST_WEIGHT).contains(weight) {
                return Err(CostError::Weight { term: term.name(), weight: Rounded(*weight).to_string() });
            }
            if terms[..index].iter().any(|(before, _)| before == term) {
                return Err(CostError::Duplicate { term: term.name() });
            }
        }
        if terms.iter().all(|(_, weight)| *weight == 0.0) {
            return Err(CostError::AllZero);
        }
        Ok(Cost { terms: terms.to_vec() })
    }

    /// Returns the terms and weights.
    pub fn terms(&self) -> &[(CostTerm, f64)] {
        &self.terms
    }

    /// Returns the cost of a run of `machine`.
    pub fn of(&self, figures: &Figures, machine: &MachineConfig) -> f64 {
        self.terms.iter().map(|(term, weight)| weight * term.of(figures, machine)).sum()
    }

    /// Returns the unit on a path with `figures`; empty for several terms or a weight other than 1.
    pub fn unit(&self, figures: &Figures) -> &'static str {
        match self.terms.as_slice() {
            [(term, 1.0)] => term.unit(figures),
            _ => "",
        }
    }
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (term, weight)) in self.terms.iter().enumerate() {
            let comma = if index > 0 { "," } else { "" };
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

    /// Parses `contour=1,rms=0.5`; the default weight is 1.
    fn from_str(text: &str) -> Result<Self, CostError> {
        let terms = text.split(',').map(|part| {
            let (name, weight) = part.split_once('=').map_or((part, "1"), |(name, weight)| (name, weight));
            let (name, weight) = (name.trim(), weight.trim());
            let term = CostTerm::ALL.into_iter().find(|term| term.name() == name);
            let term = term
                .ok_or_else(|| CostError::UnknownTerm { term: virtual_axes_core::text::shortened(name) })?;
            let rejected = || CostError::Weight {
                term: term.name(),
                weight: virtual_axes_core::text::shortened(weight),
            };
            Ok((term, weight.parse().map_err(|_| rejected())?))
        });
        Cost::new(&terms.collect::<Result<Vec<_>, _>>()?)
    }
}
