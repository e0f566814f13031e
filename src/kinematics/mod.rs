//! Kinematics of the chain RRTTT: joints to the pose of the tool in the workpiece frame, and back.
