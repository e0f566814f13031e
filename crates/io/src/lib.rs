//! ROS messages, setpoint files, recordings, traces and URDF of the virtual axes.
//!
//! - [`messages`] contains ROS messages as plain structs and converts them from and to the types of the core.
//! - [`files`] reads and writes position setpoints (PSEC), recordings and traces in CSV, YAML and MCAP.
//! - [`mod@urdf`] describes a machine as a URDF for robot_state_publisher, RViz and MoveIt.
//!
//! The crate depends on no ROS middleware.
//!
//! # Example
//! ```
//! use virtual_axes_core::config::Parameters;
//! use virtual_axes_core::simulation::joint_limits;
//! use virtual_axes_io::files::PsecCsvReader;
//! use virtual_axes_io::urdf::urdf;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let machine = Parameters::embedded_default()?.machine_config()?;
//!
//! // Position setpoints of the X axis, m, one row per position cycle of 6 ms.
//! let text = "time,x\n0,0\n0.006,0.001\n0.012,0.002\n";
//! let joints = joint_limits(&machine, "");
//! let mut psec = PsecCsvReader::new(text.as_bytes(), "example.csv", machine.periods().position, &joints)?;
//! let (mut row, mut positions) = ([0.0], Vec::new());
//! while psec.next(&mut row)? {
//!     positions.push(row[0]);
//! }
//! assert_eq!(positions, [0.0, 0.001, 0.002]);
//!
//! let description = urdf(&machine, "")?;
//! assert!(description.contains(r#"<joint name="x" type="prismatic">"#));
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod files;
pub mod messages;
pub mod urdf;
