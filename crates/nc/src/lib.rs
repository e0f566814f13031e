//! Part programs in G code: from the text to motions of the axes.
//!
//! Two modules, each usable on its own, and a third for both:
//! - [`interpret`] reads a program (RS-274/NGC) and returns its [`motion`]s one by one, in constant memory.
//! - [`plan`] computes the feed along these motions within the limits of the axes.
//! - [`offline`] has the setpoints of a program for a simulation, and finds the lines with the largest errors.
//!
//! ```
//! use std::io::Cursor;
//!
//! use virtual_axes_nc::interpret::{InterpreterOptions, Interpreter};
//! use virtual_axes_nc::motion::{Feed, MotionKind, ProgramStep};
//!
//! let program = "G21 G90 G54\nG1 X10 F600\nG2 X20 I5 J0\nM2\n";
//! let options = InterpreterOptions::default();
//! let mut kinds = Vec::new();
//! for step in Interpreter::new(Cursor::new(program), "part.nc", options) {
//!     if let ProgramStep::Motion(motion) = step? {
//!         assert_eq!(motion.feed, Feed::Linear(0.01)); // 600 mm/min
//!         kinds.push(motion.kind);
//!     }
//! }
//! assert!(matches!(kinds[..], [MotionKind::Line, MotionKind::Arc(_)]));
//! # Ok::<(), virtual_axes_nc::interpret::ProgramError>(())
//! ```

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod builtin;
pub mod compile;
pub mod identify_control;
pub mod interpret;
pub mod motion;
pub mod offline;
pub mod plan;
mod start_line;

pub use start_line::{StartLine, StartLineError};
