//! Kinematics RRTTT: signs, comparison with homogeneous matrices, round trips.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::LazyLock;

use nalgebra::{Matrix4, Vector3, Vector4};
use proptest::prelude::*;
use virtual_axes_core::config::{KinematicsConfig, Parameters, RotaryChain, RotaryName, ValueSource};
use virtual_axes_core::kinematics::{AxisRole, Kinematics, KinematicsError, ToolPose};
use virtual_axes_verification::fixtures::machines::parameters;

/// Tolerance of round trips, m and rad.
const ROUND_TRIP: f64 = 1e-12;
/// Tool length of the default machine, m.
const TOOL: f64 = 0.1;

/// Geometry with distinct nonzero values, m.
const GEOMETRY: KinematicsConfig = KinematicsConfig {
    tool_length: 0.137,
    chain: RotaryChain { axes: [Some(RotaryName::C), Some(RotaryName::A)], tables: 2 },
    pivot_a: [0.021, -0.093],
    pivot_b: [0.047, 0.065],
    pivot_c: [-0.013, 0.034],
    workpiece: [0.055, -0.071, 0.112],
};

/// Returns the kinematics of the default machine with `geometry`.
fn with(geometry: &KinematicsConfig) -> Kinematics {
    let KinematicsConfig { tool_length, pivot_a, pivot_c, workpiece, .. } = *geometry;
    let values = [
        ("tool_length", tool_length),
        ("pivot_a_y", pivot_a[0]),
        ("pivot_a_z", pivot_a[1]),
        ("pivot_c_x", pivot_c[0]),
        ("pivot_c_y", pivot_c[1]),
        ("workpiece_x", workpiece[0]),
        ("workpiece_y", workpiece[1]),
        ("workpiece_z", workpiece[2]),
    ];
    let changes = values.map(|(name, value)| (format!("kinematics.{name}_mm"), value * 1e3));
    Kinematics::new(&parameters(&changes).machine_config().expect("a valid machine"))
}

/// Returns the kinematics of the default machine with [`GEOMETRY`].
fn displaced() -> &'static Kinematics {
    static DISPLACED: LazyLock<Kinematics> = LazyLock::new(|| with(&GEOMETRY));
    &DISPLACED
}

fn mikron() -> Kinematics {
    with(&KinematicsConfig { tool_length: TOOL, ..KinematicsConfig::default() })
}

/// Returns the kinematics of the default machine with the joints `joints`, in this order.
fn with_joints(joints: &str) -> Kinematics {
    let mut parameters = Parameters::embedded_default().expect("the built-in machine");
    parameters.set_text(&format!("joints={joints}"), &ValueSource::named("test")).expect("fewer joints");
    Kinematics::new(&parameters.machine_config().expect("a valid machine"))
}

#[track_caller]
fn assert_vector(what: &str, value: Vector3<f64>, wanted: [f64; 3], tolerance: f64) {
    let distance = (value - Vector3::from(wanted)).norm();
    assert!(distance <= tolerance, "{what}: {value:?}, wanted {wanted:?}, {distance:e} away");
}

#[track_caller]
fn assert_same(what: &str, value: &[f64], wanted: &[f64], tolerance: f64) {
    assert_eq!(value.len(), wanted.len());
    for (i, (value, wanted)) in value.iter().zip(wanted).enumerate() {
        assert!((value - wanted).abs() <= tolerance, "{what} {i}: {value:e}, wanted {wanted:e}");
    }
}

fn solve(kinematics: &Kinematics, pose: &ToolPose, near: &[f64]) -> Result<Vec<f64>, KinematicsError> {
    let mut out = vec![f64::NAN; near.len()];
    kinematics.inverse(pose, near, &mut out).map(|()| out)
}

/// Returns the pose by homogeneous matrices: the chain from the workpiece to the machine, inverted.
fn pose_by_matrices(geometry: &KinematicsConfig, joints: &[f64]) -> ToolPose {
    let KinematicsConfig { tool_length, pivot_a, pivot_c, workpiece, .. } = *geometry;
    let turn = |axis: Vector3<f64>, angle: f64, about: Vector3<f64>| {
        Matrix4::new_translation(&about)
            * Matrix4::from_axis_angle(&nalgebra::Unit::new_normalize(axis), angle)
            * Matrix4::new_translation(&-about)
    };
    // The tables rotate opposite to the joints (ISO 841).
    let machine_from_workpiece = turn(Vector3::x(), -joints[3], Vector3::new(0.0, pivot_a[0], pivot_a[1]))
        * turn(Vector3::z(), -joints[4], Vector3::new(pivot_c[0], pivot_c[1], 0.0))
        * Matrix4::new_translation(&Vector3::from(workpiece));
    let workpiece_from_machine = machine_from_workpiece.try_inverse().expect("a rigid motion");
    let tip = Vector4::new(joints[0], joints[1], joints[2] - tool_length, 1.0);
    ToolPose {
        tip: (workpiece_from_machine * tip).xyz(),
        axis: (workpiece_from_machine * Vector4::new(0.0, 0.0, 1.0, 0.0)).xyz(),
    }
}

#[test]
fn at_home_the_tip_is_below_the_origin_and_the_tool_axis_is_plus_z() {
    let pose = mikron().forward(&[0.0; 5]);
    assert_eq!(pose.tip, Vector3::new(0.0, 0.0, -TOOL));
    assert_eq!(pose.axis, Vector3::z());
}

#[test]
fn linear_joints_move_the_tool_in_their_positive_direction() {
    let pose = mikron().forward(&[0.01, 0.02, 0.03, 0.0, 0.0]);
    assert_vector("tip", pose.tip, [0.01, 0.02, 0.03 - TOOL], 1e-16);
}

/// A right-handed rotation about +X maps +Z to −Y: the tool axis in the workpiece frame. The table rotates in the opposite
/// direction and maps its +Z to +Y of the machine.
#[test]
fn a_of_plus_90_degrees_gives_the_tool_axis_minus_y() {
    let pose = mikron().forward(&[0.0, 0.0, 0.0, FRAC_PI_2, 0.0]);
    assert_vector("axis", pose.axis, [0.0, -1.0, 0.0], 1e-16);
    // The rotation maps the tip (0, 0, −0.1) from −Z to +Y.
    assert_vector("tip", pose.tip, [0.0, TOOL, 0.0], 1e-16);
    let mut joints = [0.0, 0.0, 0.2, FRAC_PI_2, 0.0];
    mikron().tip_to_joints(&mut joints);
    assert_same("a point 0.2 above", &joints, &[0.0, 0.2, TOOL, FRAC_PI_2, 0.0], 1e-16);
}

/// A right-handed rotation about +Z maps +X to +Y: at C = +90° a tool at +X of the machine is at +Y of the workpiece, and a
/// point at +X of the workpiece is at −Y of the machine.
#[test]
fn c_of_plus_90_degrees_rotates_the_tool_from_x_to_y_of_the_workpiece() {
    let pose = mikron().forward(&[0.3, 0.0, TOOL, 0.0, FRAC_PI_2]);
    assert_vector("tip", pose.tip, [0.0, 0.3, 0.0], 1e-16);
    assert_vector("axis", pose.axis, [0.0, 0.0, 1.0], 0.0);
    let mut joints = [0.3, 0.0, 0.0, 0.0, FRAC_PI_2];
    mikron().tip_to_joints(&mut joints);
    assert_same("a point at +X", &joints, &[0.0, -0.3, TOOL, 0.0, FRAC_PI_2], 1e-16);
}

/// The rotation by A gives −Y; the rotation by C about Z of the workpiece then gives +X.
#[test]
fn both_at_90_degrees_give_the_tool_axis_plus_x() {
    let pose = mikron().forward(&[0.0, 0.0, 0.0, FRAC_PI_2, FRAC_PI_2]);
    assert_vector("axis", pose.axis, [1.0, 0.0, 0.0], 1e-16);
}

/// Tool axis by u = (sin a sin c, −sin a cos c, cos a).
#[test]
fn a_of_30_and_c_of_60_degrees_give_the_tool_axis_of_the_equation() {
    let pose = mikron().forward(&[0.0, 0.0, 0.0, PI / 6.0, PI / 3.0]);
    let root = 3.0_f64.sqrt();
    assert_vector("axis", pose.axis, [root / 4.0, -0.25, root / 2.0], 1e-15);
}

#[test]
fn points_on_a_pivot_do_not_move() {
    let pivots = KinematicsConfig { workpiece: [0.0; 3], ..GEOMETRY };
    let kinematics = with(&pivots);
    for angle in [-0.5, 0.3, 2.0] {
        let [y, z] = pivots.pivot_a;
        let mut joints = [0.04, y, z, angle, 0.0];
        kinematics.tip_to_joints(&mut joints);
        assert_same("on A", &joints, &[0.04, y, z + pivots.tool_length, angle, 0.0], 1e-15);
        let [x, y] = pivots.pivot_c;
        let mut joints = [x, y, 0.04, 0.0, angle];
        kinematics.tip_to_joints(&mut joints);
        assert_same("on C", &joints, &[x, y, 0.04 + pivots.tool_length, 0.0, angle], 1e-15);
    }
}

/// The origin of the workpiece is 0.1 above the axis of A; the table at −90° about X moves it to 0.1 in +Y of the axis.
#[test]
fn a_point_above_the_pivot_of_a_moves_to_plus_y() {
    let geometry = KinematicsConfig { pivot_a: [0.0, -0.1], ..KinematicsConfig::default() };
    let mut joints = [0.0, 0.0, 0.0, FRAC_PI_2, 0.0];
    with(&geometry).tip_to_joints(&mut joints);
    assert_same("joints", &joints, &[0.0, 0.1, -0.1, FRAC_PI_2, 0.0], 1e-16);
}

#[test]
fn the_workpiece_origin_is_subtracted_at_home() {
    let geometry = KinematicsConfig { workpiece: [0.01, 0.02, 0.03], ..KinematicsConfig::default() };
    let pose = with(&geometry).forward(&[0.0; 5]);
    assert_eq!(pose.tip, Vector3::new(-0.01, -0.02, -0.03));
}

#[test]
fn a_path_through_the_singularity_keeps_c_and_changes_the_sign_of_a() {
    let kinematics = displaced();
    let tilts =
        [0.2, 1e-2, 1e-4, 1e-7, 1e-10, 1e-12, 1e-14, 0.0, -1e-14, -1e-12, -1e-10, -1e-7, -1e-4, -1e-2, -0.2];
    for turns in [0.0, 0.7, -3.0, 40.0] {
        let mut near = vec![0.1, -0.1, 0.2, 0.25, turns];
        for a in tilts {
            let joints = [0.1 + a, -0.1, 0.2, a, turns];
            let found = solve(kinematics, &kinematics.forward(&joints), &near).expect("reachable");
            assert_same("joints", &found, &joints, ROUND_TRIP);
            near = found;
        }
    }
}

#[test]
fn at_the_singularity_c_keeps_its_reference_value() {
    let pose = ToolPose { tip: Vector3::new(0.3, 0.1, -0.2), axis: Vector3::z() };
    for c in [-100.0, -0.1, 0.0, 2.0, 7.5] {
        // Rounding of the tool axis must not rotate the table.
        for noise in [0.0, 3e-16, -2e-15, 5e-14] {
            let axis = Vector3::new(noise, -noise / 3.0, 1.0);
            let found =
                solve(displaced(), &ToolPose { axis, ..pose }, &[0.0, 0.0, 0.0, 0.1, c]).expect("reachable");
            assert_eq!(found[4], c);
            let back = displaced().forward(&found);
            assert_vector("tip", back.tip, pose.tip.into(), ROUND_TRIP);
            assert_vector("axis", back.axis, axis.into(), ROUND_TRIP);
        }
    }
}

#[test]
fn at_a_tool_axis_of_minus_z_c_keeps_its_reference_value() {
    let pose = ToolPose { tip: Vector3::new(0.1, 0.1, 0.0), axis: -Vector3::z() };
    let found = solve(displaced(), &pose, &[0.0, 0.0, 0.0, 3.0, 1.25]).expect("reachable");
    assert_same("a and c", &found[3..], &[PI, 1.25], 1e-15);
    let found = solve(displaced(), &pose, &[0.0, 0.0, 0.0, -3.0, 1.25]).expect("reachable");
    assert_same("a and c", &found[3..], &[-PI, 1.25], 1e-15);
}

#[test]
fn the_nearer_of_the_two_solutions_is_selected() {
    let kinematics = mikron();
    let pose = kinematics.forward(&[0.0, 0.0, 0.0, 0.4, 0.1]);
    for (near, wanted) in [
        ([0.3, 0.0], [0.4, 0.1]),
        ([0.0, 3.0], [-0.4, 0.1 + PI]),
        ([0.0, -3.0], [-0.4, 0.1 - PI]),
        ([0.3, 5.0 * TAU], [0.4, 0.1 + 5.0 * TAU]),
        ([-0.3, -8.0 * TAU + 3.0], [-0.4, 0.1 + PI - 8.0 * TAU]),
    ] {
        let found = solve(&kinematics, &pose, &[0.0, 0.0, 0.0, near[0], near[1]]).expect("reachable");
        assert_same("a and c", &found[3..], &wanted, 1e-14);
    }
}

#[test]
fn solutions_inside_the_travel_limits_of_a_take_precedence() {
    // Travel limits of A of the default machine: −30° and 120°.
    let kinematics = mikron();
    let degrees = |a: f64, c: f64| [0.0, 0.0, 0.0, a.to_radians(), c.to_radians()];
    for (a, near, wanted) in [
        (40.0, degrees(0.0, 170.0), degrees(40.0, 0.0)),
        (20.0, degrees(0.0, 170.0), degrees(-20.0, 180.0)),
        // At a travel limit: rounding must not switch the solution.
        (30.0, degrees(-30.0, 180.0), degrees(-30.0, 180.0)),
        // Both outside: the nearer one.
        (150.0, degrees(-100.0, 170.0), degrees(-150.0, 180.0)),
    ] {
        let pose = kinematics.forward(&degrees(a, 0.0));
        let found = solve(&kinematics, &pose, &near).expect("reachable");
        assert_same("a and c", &found[3..], &wanted[3..], 1e-14);
    }
}

#[test]
fn the_length_of_the_tool_axis_is_irrelevant() {
    let joints = [0.1, 0.2, 0.0, 0.5, -0.5];
    let pose = displaced().forward(&joints);
    for factor in [1e-3, 7.0] {
        let scaled = ToolPose { axis: pose.axis * factor, ..pose };
        assert_same("joints", &solve(displaced(), &scaled, &joints).expect("reachable"), &joints, ROUND_TRIP);
    }
}

#[test]
fn name_and_type_of_a_joint_determine_its_role() {
    let kinematics = with_joints("[c, z, x]");
    let roles =
        [AxisRole::X, AxisRole::Y, AxisRole::Z, AxisRole::A, AxisRole::C].map(|role| kinematics.role(role));
    assert_eq!(roles, [Some(2), None, Some(1), None, Some(0)]);
    let pose = kinematics.forward(&[FRAC_PI_2, TOOL, 0.3]);
    assert_vector("tip", pose.tip, [0.0, 0.3, 0.0], 1e-16);
    assert!(kinematics.has_linear_axis() && kinematics.has_rotary_axis());
    assert!(!with_joints("[x, y]").has_rotary_axis());
    assert!(!with_joints("[c]").has_linear_axis());

    // A rotary axis b has no role.
    let mut parameters = Parameters::embedded_default().expect("the built-in machine");
    let text = include_str!("../../../../config/mikron_ucp710.yaml")
        .replace("\"c\"]", "\"b\"]")
        .replace("\n    c:\n", "\n    b:\n");
    parameters.overlay_yaml(&text, "b.yaml", None).expect("a machine with b");
    let kinematics = Kinematics::new(&parameters.machine_config().expect("a valid machine"));
    assert_eq!(kinematics.role(AxisRole::C), None);
    let pose = ToolPose { tip: Vector3::zeros(), axis: Vector3::z() };
    let found = solve(&kinematics, &pose, &[0.0, 0.0, 0.0, 0.0, 0.77]).expect("reachable");
    assert_eq!(found, [0.0, 0.0, TOOL, 0.0, 0.77], "b keeps its value");
}

#[test]
fn upper_case_names_have_roles() {
    let text = include_str!("../../../../config/mikron_ucp710.yaml")
        .replace("\"x\",", "\"X\",")
        .replace("\n    x:\n", "\n    X:\n");
    let parameters = Parameters::from_yaml(&text, "upper.yaml").expect("a machine with X");
    let kinematics = Kinematics::new(&parameters.machine_config().expect("a valid machine"));
    assert_eq!(kinematics.role(AxisRole::X), Some(0));
}

#[test]
fn without_c_only_tool_axes_in_the_plane_of_a_are_reachable() {
    let kinematics = with_joints("[x, y, z, a]");
    let axis = Vector3::new(0.0, -0.6, 0.8);
    let pose = ToolPose { tip: Vector3::new(0.1, 0.0, 0.0), axis };
    let found = solve(&kinematics, &pose, &[0.0; 4]).expect("reachable");
    assert_same("a", &found[3..], &[0.6_f64.asin()], 1e-15);
    assert_vector("tip", kinematics.forward(&found).tip, [0.1, 0.0, 0.0], ROUND_TRIP);
    // tan = 0.1 / 1 out of the plane.
    let pose = ToolPose { axis: Vector3::new(0.1, 0.6, 0.8), ..pose };
    let error = solve(&kinematics, &pose, &[0.0; 4]).expect_err("out of the plane");
    let KinematicsError::AxisUnreachable { axis, missing, angle } = error else { panic!("{error}") };
    assert_eq!((axis, missing), ([0.1, 0.6, 0.8], AxisRole::C));
    assert!((angle - 0.1_f64.atan()).abs() < 1e-15, "{angle}");
}

#[test]
fn without_a_only_the_tool_axis_plus_z_is_reachable() {
    for joints in ["[x, y, z, c]", "[x, y, z]"] {
        let kinematics = with_joints(joints);
        let mut near = vec![0.0, 0.0, 0.0, 4.0];
        near.truncate(joints.split(',').count());
        let pose = ToolPose { tip: Vector3::new(0.1, 0.2, 0.3), axis: Vector3::z() };
        let found = solve(&kinematics, &pose, &near).expect("reachable");
        assert_eq!(found.get(3), near.get(3));
        assert_vector("tip", kinematics.forward(&found).tip, [0.1, 0.2, 0.3], ROUND_TRIP);
        let error = solve(&kinematics, &ToolPose { axis: Vector3::y(), ..pose }, &near).expect_err("no A");
        assert_eq!(
            error.to_string(),
            "tool axis [0, 1, 0] is unreachable without a rotary axis a; the nearest reachable direction differs by \
             90 deg"
        );
        let tilted = Vector3::new(0.0, -0.5, 0.75_f64.sqrt());
        let error = solve(&kinematics, &ToolPose { axis: tilted, ..pose }, &near).expect_err("no A");
        assert!(error.to_string().starts_with("tool axis [0, -0.5, 0.866025] is"), "{error}");
    }
}

#[test]
fn a_tip_that_requires_a_missing_linear_axis_is_rejected() {
    let kinematics = with_joints("[x, z]");
    let pose = ToolPose { tip: Vector3::new(0.1, 0.25, 0.0), axis: Vector3::z() };
    let mut out = [7.0; 2];
    let error = kinematics.inverse(&pose, &[0.0; 2], &mut out);
    assert_eq!(
        error,
        Err(KinematicsError::TipUnreachable { tip: [0.1, 0.25, 0.0], missing: AxisRole::Y, position: 0.25 })
    );
    assert_eq!(out, [7.0; 2], "nothing is written");
}

#[test]
fn invalid_poses_are_rejected() {
    let kinematics = mikron();
    let good = kinematics.forward(&[0.0; 5]);
    let rejection =
        |pose: ToolPose, near: &[f64]| solve(&kinematics, &pose, near).expect_err("an invalid pose");
    let nan = ToolPose { tip: Vector3::new(0.0, f64::NAN, 0.0), ..good };
    assert!(matches!(rejection(nan, &[0.0; 5]), KinematicsError::NotFinite { .. }));
    let infinite = ToolPose { axis: Vector3::new(f64::INFINITY, 0.0, 0.0), ..good };
    assert!(matches!(rejection(infinite, &[0.0; 5]), KinematicsError::NotFinite { .. }));
    let near = [0.0, 0.0, 0.0, 0.0, f64::NAN];
    assert!(matches!(rejection(good, &near), KinematicsError::NotFinite { .. }));
    let zero = ToolPose { axis: Vector3::zeros(), ..good };
    assert_eq!(rejection(zero, &[0.0; 5]), KinematicsError::NoDirection { axis: [0.0; 3] });
    assert_eq!(rejection(good, &[0.0; 4]), KinematicsError::WrongSize { found: 4, wanted: 5 });
}

#[test]
fn the_orientation_error_is_accurate_at_small_and_large_angles() {
    for angle in [0.0, 1e-12, 1e-9, 1e-3, 1.0, FRAC_PI_2, 3.0, PI - 1e-9] {
        let (sin, cos) = f64::sin_cos(angle);
        let error = Kinematics::orientation_error(&Vector3::z(), &Vector3::new(sin * 0.6, sin * 0.8, cos));
        assert!((error - angle).abs() <= 1e-15, "{angle}: {error}");
    }
}

/// Zero, tiny and large tilts of both signs.
fn tilt() -> impl Strategy<Value = f64> {
    prop_oneof![
        1 => Just(0.0),
        2 => away_from_the_singularity(),
        1 => (-20.0..-12.0f64).prop_map(|exponent| 10f64.powf(exponent)),
    ]
}

fn away_from_the_singularity() -> impl Strategy<Value = f64> {
    let tiny = ((-12.0..-3.0f64), any::<bool>())
        .prop_map(|(exponent, plus)| if plus { 10f64.powf(exponent) } else { -(10f64.powf(exponent)) });
    // Inside the travel limits of A.
    prop_oneof![1 => tiny, 1 => -0.52..2.09f64]
}

/// Joints: X, Y and Z beyond their travel limits, C over several turns.
fn joints(a: impl Strategy<Value = f64>) -> impl Strategy<Value = [f64; 5]> {
    let c = prop_oneof![1 => Just(0.0), 4 => -4.0..4.0f64, 1 => -60.0..60.0f64];
    (-0.5..0.5f64, -0.5..0.5f64, -0.5..0.5f64, a, c).prop_map(|(x, y, z, a, c)| [x, y, z, a, c])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn forward_kinematics_agrees_with_homogeneous_matrices(joints in joints(tilt())) {
        let (pose, wanted) = (displaced().forward(&joints), pose_by_matrices(&GEOMETRY, &joints));
        prop_assert!((pose.tip - wanted.tip).norm() <= ROUND_TRIP);
        prop_assert!((pose.axis - wanted.axis).norm() <= ROUND_TRIP);
        prop_assert!((pose.axis.norm() - 1.0).abs() <= 1e-15);
    }

    #[test]
    fn pose_to_joints_to_pose_is_the_identity(joints in joints(tilt()), near in joints(-3.0..3.0f64)) {
        // Poses computed independently of the code under test.
        let pose = pose_by_matrices(&GEOMETRY, &joints);
        let found = solve(displaced(), &pose, &near);
        prop_assert!(found.is_ok());
        let back = displaced().forward(&found.unwrap_or_default());
        prop_assert!((back.tip - pose.tip).norm() <= ROUND_TRIP, "tip {:e}", (back.tip - pose.tip).norm());
        prop_assert!((back.axis - pose.axis).norm() <= ROUND_TRIP, "axis {:e}", (back.axis - pose.axis).norm());
    }

    #[test]
    fn poses_with_any_axis_are_reached(
        tip in prop::array::uniform3(-0.5..0.5f64),
        (across, up) in (prop::array::uniform2(-1.0..1.0f64), any::<bool>()),
        exponent in -18.0..0.0f64,
        near in joints(-3.0..3.0f64),
    ) {
        let scale = 10f64.powf(exponent);
        let axis = Vector3::new(across[0] * scale, across[1] * scale, if up { 1.0 } else { -1.0 }).normalize();
        let pose = ToolPose { tip: tip.into(), axis };
        let found = solve(displaced(), &pose, &near);
        prop_assert!(found.is_ok());
        let back = pose_by_matrices(&GEOMETRY, &found.unwrap_or_default());
        prop_assert!((back.tip - pose.tip).norm() <= ROUND_TRIP, "tip {:e}", (back.tip - pose.tip).norm());
        prop_assert!((back.axis - pose.axis).norm() <= ROUND_TRIP, "axis {:e}", (back.axis - pose.axis).norm());
    }

    #[test]
    fn joints_to_pose_to_joints_is_the_identity_away_from_the_singularity(
        joints in joints(away_from_the_singularity()),
        offset in prop::array::uniform2(-0.3..0.3f64),
    ) {
        let near = [9.0, 9.0, 9.0, joints[3] + offset[0], joints[4] + offset[1]];
        let found = solve(displaced(), &displaced().forward(&joints), &near).unwrap_or_default();
        prop_assert_eq!(found.len(), 5);
        for (found, wanted) in found.iter().zip(&joints) {
            prop_assert!((found - wanted).abs() <= ROUND_TRIP, "{} for {}", found, wanted);
        }
    }

    #[test]
    fn tip_coordinates_to_joints_to_tip_is_the_identity(coordinates in joints(tilt())) {
        let mut joints = coordinates;
        displaced().tip_to_joints(&mut joints);
        let tip = pose_by_matrices(&GEOMETRY, &joints).tip;
        for i in 0..3 {
            prop_assert!((tip[i] - coordinates[i]).abs() <= ROUND_TRIP);
        }
        prop_assert_eq!(&joints[3..], &coordinates[3..]);
        displaced().joints_to_tip(&mut joints);
        for (back, wanted) in joints.iter().zip(&coordinates) {
            prop_assert!((back - wanted).abs() <= ROUND_TRIP);
        }
    }

    #[test]
    fn small_steps_of_the_pose_are_small_steps_of_the_joints(
        start in joints(0.05..2.0f64),
        step in prop::array::uniform2(-0.01..0.01f64),
    ) {
        let mut near = start.to_vec();
        for k in 1..20 {
            let f = f64::from(k);
            let next = [start[0], start[1], start[2], (start[3] + f * step[0]).max(0.01), start[4] + f * step[1]];
            let found = solve(displaced(), &displaced().forward(&next), &near).unwrap_or_default();
            prop_assert_eq!(found.len(), 5);
            for (found, wanted) in found.iter().zip(&next) {
                prop_assert!((found - wanted).abs() <= ROUND_TRIP);
            }
            near = found;
        }
    }
}
