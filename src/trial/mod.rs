//! One trial, offline: set-points through the simulation, its figures and its recording.
