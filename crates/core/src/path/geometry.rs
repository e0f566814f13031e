//! Continuous paths: blocks joined without gaps, and the tool pose along them.

use serde::Deserialize;

use super::block::Block;
use super::error::PathError;
use crate::kinematics::{Kinematics, ToolPose};

/// Largest gap between two blocks, relative to the coordinate (or to 1 m, 1 rad).
const GAP_TOLERANCE: f64 = 1e-12;

/// Coordinate system of a path.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Frame {
    /// Joint positions.
    #[default]
    Joints,
    /// Tool tip in the workpiece frame for x, y and z, joint positions for the others
    /// ([`Kinematics::tip_to_joints`]).
    Workpiece,
}

/// A continuous path: blocks, the frame of their coordinates, and the machine kinematics.
///
/// Its parameter is the progress u, the sum of the arc lengths of the blocks: meters and, in purely rotary
/// blocks, radians.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    kinematics: Kinematics,
    frame: Frame,
    blocks: Vec<Block>,
    /// Progress at the start of each block, followed by the length of the path.
    starts: Vec<f64>,
}

impl Path {
    /// Joins `blocks`, which have one coordinate for each joint of the machine.
    ///
    /// # Errors
    /// Returns [`PathError`] if there is no block, if the blocks differ in their number of coordinates, if
    /// there is a gap, or if the total length overflows.
    pub fn new(kinematics: Kinematics, frame: Frame, blocks: Vec<Block>) -> Result<Self, PathError> {
        let Some(first) = blocks.first() else { return Err(PathError::Empty) };
        let wanted = first.joints();
        if let Some(other) = blocks.iter().find(|block| block.joints() != wanted) {
            return Err(PathError::WrongSize { what: "a block", found: other.joints(), wanted });
        }
        for (i, pair) in blocks.windows(2).enumerate() {
            let ends = pair[0].end().iter().zip(pair[1].start()).enumerate();
            for (index, (&end, &start)) in ends {
                if (start - end).abs() > GAP_TOLERANCE * end.abs().max(1.0) {
                    return Err(PathError::Gap { block: i + 2, coordinate: index + 1, end, start });
                }
            }
        }
        let mut starts = Vec::with_capacity(blocks.len() + 1);
        let mut length = 0.0;
        starts.push(length);
        for block in &blocks {
            length += block.length();
            starts.push(length);
        }
        if !length.is_finite() {
            return Err(PathError::NotComputable { length });
        }
        Ok(Self { kinematics, frame, blocks, starts })
    }

    /// Returns the blocks in order.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Returns the coordinate system of the blocks.
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// Returns the kinematics that transforms the coordinates into joints.
    pub fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// Returns the number of joints.
    pub fn joint_count(&self) -> usize {
        self.blocks.first().map_or(0, Block::joints)
    }

    /// Returns the total length: the largest progress.
    pub fn length(&self) -> f64 {
        self.starts.last().copied().unwrap_or(0.0)
    }

    /// Returns the progress at the start of `block`, counted from 0, or the length of the path beyond the
    /// last block.
    pub fn start_of(&self, block: usize) -> f64 {
        self.starts[block.min(self.starts.len() - 1)]
    }

    /// Returns the block, counted from 0, and the arc length in it at progress `u`, clamped to the path.
    /// At a junction this is the start of the later block.
    pub fn locate(&self, u: f64) -> (usize, f64) {
        let last = self.blocks.len() - 1;
        let block = self.starts.partition_point(|start| *start <= u).saturating_sub(1).min(last);
        let s = (u - self.starts[block]).max(0.0);
        // The sum of lengths is rounded; the end of the path is the end of its last block.
        let s = if u >= self.length() { self.blocks[block].length() } else { s };
        (block, s.min(self.blocks[block].length()))
    }

    /// Writes the joint positions at progress `u`, clamped to the path, m or rad, into `out`.
    pub fn joints(&self, u: f64, out: &mut [f64]) {
        let (block, s) = self.locate(u);
        self.joints_in(block, s, out);
    }

    /// Writes the joint positions at arc length `s` of `block`, m or rad, into `out`.
    pub(super) fn joints_in(&self, block: usize, s: f64, out: &mut [f64]) {
        self.blocks[block].point(s, out);
        if self.frame == Frame::Workpiece {
            self.kinematics.tip_to_joints(out);
        }
    }

    /// Returns the tool pose in the workpiece frame at progress `u`, clamped to the path.
    pub fn tool(&self, u: f64) -> ToolPose {
        let mut joints = vec![0.0; self.joint_count()];
        self.joints(u, &mut joints);
        self.kinematics.forward(&joints)
    }

    /// Returns true if the rotary tables are fixed along `block`, so that joints and tip differ by a rigid
    /// transformation.
    pub fn has_fixed_rotary_axes(&self, block: usize) -> bool {
        self.blocks.get(block).is_none_or(|block| block.is_constant(self.kinematics.rotary_joints()))
    }
}
