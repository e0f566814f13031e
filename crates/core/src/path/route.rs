//! Blocks joined without gaps, and what the tool does along them.

use super::block::Block;
use super::error::PathError;
use crate::kinematics::{Kinematics, Role, ToolPose};

/// Largest gap between two blocks relative to the coordinate (or to 1 m, 1 rad): rounding.
const GAP_TOLERANCE: f64 = 1e-12;

/// What the coordinates of a path are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// Those of the joints.
    Joints,
    /// x, y and z are those of the tool tip in the workpiece frame, the others those of the joints
    /// ([`Kinematics::tip_to_joints`]).
    Workpiece,
}

/// A continuous path: blocks, the frame of their coordinates, and the kinematics of the machine.
///
/// Its parameter is the progress u, the sum of the lengths of the blocks passed: meters and, in
/// blocks that only turn, radians.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    kinematics: Kinematics,
    frame: Frame,
    blocks: Vec<Block>,
    /// Progress at the start of each block, and at the end of the last.
    starts: Vec<f64>,
}

impl Path {
    /// Joins `blocks`, which have one coordinate for each joint of the machine.
    ///
    /// # Errors
    /// [`PathError`]: no block; a block of another number of coordinates than the first; a gap, or a
    /// sum of lengths that no f64 holds.
    pub fn new(kinematics: Kinematics, frame: Frame, blocks: Vec<Block>) -> Result<Self, PathError> {
        let Some(first) = blocks.first() else { return Err(PathError::Empty) };
        let wanted = first.joints();
        if let Some(other) = blocks.iter().find(|block| block.joints() != wanted) {
            return Err(PathError::WrongSize { what: "a block", found: other.joints(), wanted });
        }
        for (i, pair) in blocks.windows(2).enumerate() {
            let ends = pair[0].end().iter().zip(pair[1].start()).enumerate();
            for (place, (&end, &start)) in ends {
                if (start - end).abs() > GAP_TOLERANCE * end.abs().max(1.0) {
                    return Err(PathError::Gap { block: i + 2, coordinate: place + 1, end, start });
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
            return Err(PathError::Unmeasurable { length });
        }
        Ok(Self { kinematics, frame, blocks, starts })
    }

    /// The blocks, in order.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// What their coordinates are.
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// The kinematics that turns them into joints.
    pub fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.blocks.first().map_or(0, Block::joints)
    }

    /// Largest progress.
    pub fn length(&self) -> f64 {
        self.starts.last().copied().unwrap_or(0.0)
    }

    /// Progress at the start of `block`, from 0; the length of the path from the last block on.
    pub fn start_of(&self, block: usize) -> f64 {
        self.starts[block.min(self.starts.len() - 1)]
    }

    /// The block, from 0, and the length in it at the progress `u`, clamped to the path. Where two
    /// blocks meet it is the start of the later one.
    pub fn locate(&self, u: f64) -> (usize, f64) {
        let last = self.blocks.len() - 1;
        let block = self.starts.partition_point(|start| *start <= u).saturating_sub(1).min(last);
        let s = (u - self.starts[block]).max(0.0);
        // The sum of lengths is rounded; the end of the path is the end of its last block.
        let s = if u >= self.length() { self.blocks[block].length() } else { s };
        (block, s.min(self.blocks[block].length()))
    }

    /// The joints at the progress `u`, clamped to the path, m or rad, into `out`.
    pub fn joints(&self, u: f64, out: &mut [f64]) {
        let (block, s) = self.locate(u);
        self.joints_in(block, s, out);
    }

    /// The joints at the length `s` of `block`, likewise.
    pub(super) fn joints_in(&self, block: usize, s: f64, out: &mut [f64]) {
        self.blocks[block].point(s, out);
        if self.frame == Frame::Workpiece {
            self.kinematics.tip_to_joints(out);
        }
    }

    /// Pose of the tool in the workpiece frame at the progress `u`, clamped to the path.
    pub fn tool(&self, u: f64) -> ToolPose {
        let mut joints = vec![0.0; self.joint_count()];
        self.tool_with(u, &mut joints)
    }

    /// Like [`tool`](Self::tool), in room for one value per joint, which then holds the joints.
    pub fn tool_with(&self, u: f64, joints: &mut [f64]) -> ToolPose {
        self.joints(u, joints);
        self.kinematics.forward(joints)
    }

    /// Whether the tables stand still along `block`, so that joints and tip differ by a fixed motion.
    pub fn keeps_tables(&self, block: usize) -> bool {
        let tables = [Role::A, Role::C].into_iter().filter_map(|role| self.kinematics.role(role));
        self.blocks.get(block).is_none_or(|block| block.keeps(tables))
    }
}
