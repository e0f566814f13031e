//! Built-in machines, scenarios and part programs: names and texts of the files in `config`.
//!
//! Programs and modules pass these tables to the libraries, which do not depend on this crate: a new scenario
//! recompiles none of them.

/// Machines: name and parameter file, the default first.
pub const MACHINES: &[(&str, &str)] = &[
    ("mikron_ucp710", include_str!("../config/mikron_ucp710.yaml")),
    ("linear_motor_center", include_str!("../config/linear_motor_center.yaml")),
    ("vmc", include_str!("../config/vmc.yaml")),
    ("hmc", include_str!("../config/hmc.yaml")),
    ("gantry_router", include_str!("../config/gantry_router.yaml")),
    ("bc_center", include_str!("../config/bc_center.yaml")),
    ("ac_center", include_str!("../config/ac_center.yaml")),
    ("vmc_a", include_str!("../config/vmc_a.yaml")),
    ("fork_head", include_str!("../config/fork_head.yaml")),
];

/// Scenarios: name and file, in the order of the figures in Prévost et al.
pub const SCENARIOS: &[(&str, &str)] = &[
    ("x-constant", include_str!("../config/scenarios/x-constant.yaml")),
    ("y-constant", include_str!("../config/scenarios/y-constant.yaml")),
    ("z-constant", include_str!("../config/scenarios/z-constant.yaml")),
    ("a-constant", include_str!("../config/scenarios/a-constant.yaml")),
    ("c-constant", include_str!("../config/scenarios/c-constant.yaml")),
    ("c-two-speeds", include_str!("../config/scenarios/c-two-speeds.yaml")),
    ("x-there-and-back", include_str!("../config/scenarios/x-there-and-back.yaml")),
    ("contour-a", include_str!("../config/scenarios/contour-a.yaml")),
    ("contour-b", include_str!("../config/scenarios/contour-b.yaml")),
    ("orientation-ac", include_str!("../config/scenarios/orientation-ac.yaml")),
    ("bspline-3d", include_str!("../config/scenarios/bspline-3d.yaml")),
    ("ballbar", include_str!("../config/scenarios/ballbar.yaml")),
    ("ballbar-both", include_str!("../config/scenarios/ballbar-both.yaml")),
    ("corner-90", include_str!("../config/scenarios/corner-90.yaml")),
    ("corner-45", include_str!("../config/scenarios/corner-45.yaml")),
    ("five-axis", include_str!("../config/scenarios/five-axis.yaml")),
    ("bspline-5x", include_str!("../config/scenarios/bspline-5x.yaml")),
];

/// Part programs: name and text in G code.
pub const PROGRAMS: &[(&str, &str)] = &[
    ("circle-diamond-square", include_str!("../config/programs/circle-diamond-square.nc")),
    ("s-path-five-axis", include_str!("../config/programs/s-path-five-axis.nc")),
    ("pocket", include_str!("../config/programs/pocket.nc")),
    ("finishing-raster", include_str!("../config/programs/finishing-raster.nc")),
];

/// Part programs: name and description, the motion and its purpose.
pub const PROGRAM_DESCRIPTIONS: &[(&str, &str)] = &[
    (
        "circle-diamond-square",
        "part program: outlines of a contouring test piece in the manner of ISO 10791-7",
    ),
    ("s-path-five-axis", "part program: S-shaped five-axis path with tool center point control"),
    ("pocket", "part program: rectangular pocket with a helix, rounded corners, a subroutine and loops"),
    ("finishing-raster", "part program: finishing raster of short lines on a curved surface"),
];
