//! stub
#![allow(missing_docs, unused)]
use crate::kinematics::ToolPose;
use crate::path::*;
use nalgebra::Vector3;
use std::sync::Arc;
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    pub progress: f64,
    pub point: Vector3<f64>,
    pub axis: Vector3<f64>,
    pub distance: f64,
    pub within_ends: f64,
    pub orientation: f64,
}
pub struct PathTracker;
impl PathTracker {
    pub fn new(p: Arc<Path>) -> Self {
        PathTracker
    }
    pub fn nearest(&mut self, p: &ToolPose, u: f64) -> Nearest {
        Nearest { progress: 0., point: p.tip, axis: p.axis, distance: 0., within_ends: 0., orientation: 0. }
    }
}
