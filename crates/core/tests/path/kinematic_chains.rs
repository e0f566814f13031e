//! Kinematic chains with tables and heads: comparison with homogeneous matrices, round trips, hand-worked poses, errors.

use std::f64::consts::FRAC_PI_2;
use std::sync::LazyLock;

use nalgebra::{Matrix4, Unit, Vector3, Vector4};
use proptest::prelude::*;
use virtual_axes_core::config::{Parameters, ValueSource};
use virtual_axes_core::kinematics::{AxisRole, Kinematics, ToolPose};

/// Tolerance of round trips, m and rad.
const ROUND_TRIP: f64 = 1e-12;
const TOOL: f64 = 0.137;
const WORKPIECE: [f64; 3] = [0.055, -0.071, 0.112];
/// Points on the axes of A, B and C, m.
const PIVOTS: [[f64; 3]; 3] = [[0.0, 0.021, -0.093], [0.047, 0.0, 0.065], [-0.013, 0.034, 0.0]];
const CHAINS: [&str; 9] = [
    "[c, a, xyz]",
    "[c, b, xyz]",
    "[b, a, xyz]",
    "[a, b, xyz]",
    "[c, xyz, a]",
    "[c, xyz, b]",
    "[a, xyz, b]",
    "[xyz, c, a]",
    "[xyz, c, b]",
];

/// Returns the parameters of the default machine with X, Y, Z and three rotary joints, and the geometry of the constants.
fn machine() -> Parameters {
    let file = include_str!("../../../../config/mikron_ucp710.yaml");
    let (_, c) = file.split_once("\n    c:\n").expect("the joint c");
    let text = format!("{}\n\n    b:\n{c}", file.replace("\"c\"]", "\"b\", \"c\"]"));
    let mut parameters = Parameters::from_yaml(&text, "six.yaml").expect("a machine with six joints");
    let mut set = |key: &str, value: f64| {
        let text = format!("kinematics.{key}_mm={}", value * 1e3);
        parameters.set_text(&text, &ValueSource::named("test")).expect("a valid value");
    };
    set("tool_length", TOOL);
    for (name, value) in ["x", "y", "z"].iter().zip(WORKPIECE) {
        set(&format!("workpiece_{name}"), value);
    }
    for (axis, pivot) in ["a", "b", "c"].iter().zip(PIVOTS) {
        for (name, value) in ["x", "y", "z"].iter().zip(pivot).filter(|(_, value)| *value != 0.0) {
            set(&format!("pivot_{axis}_{name}"), value);
        }
    }
    parameters
}

fn set_chain(chain: &str) -> Result<Parameters, String> {
    let mut parameters = machine();
    let text = format!("kinematics.chain={chain}");
    parameters.set_text(&text, &ValueSource::named("test")).map_err(|error| error.to_string())?;
    Ok(parameters)
}

/// Kinematics of each of [`CHAINS`].
static KINEMATICS: LazyLock<Vec<Kinematics>> = LazyLock::new(|| {
    let machine = |chain| set_chain(chain).expect("a valid chain").machine_config().expect("a valid machine");
    CHAINS.iter().map(|chain| Kinematics::new(&machine(chain))).collect()
});

/// Returns the pose by homogeneous matrices. Joints: x, y, z, a, b, c.
fn pose_by_matrices(chain: &str, joints: &[f64; 6]) -> ToolPose {
    let turn = |name: &str, sign: f64| {
        let index = ["a", "b", "c"].iter().position(|axis| *axis == name).expect("a rotary joint");
        let axis = [Vector3::x(), Vector3::y(), Vector3::z()][index];
        let pivot = Vector3::from(PIVOTS[index]);
        Matrix4::new_translation(&pivot)
            * Matrix4::from_axis_angle(&Unit::new_normalize(axis), sign * joints[3 + index])
            * Matrix4::new_translation(&-pivot)
    };
    let names: Vec<&str> = chain.trim_matches(['[', ']']).split(", ").collect();
    let linear = names.iter().position(|name| *name == "xyz").expect("the linear axes");
    // From the base outwards: the table next to the workpiece is the last of its side.
    let workpiece: Matrix4<f64> =
        names[..linear].iter().rev().fold(Matrix4::<f64>::identity(), |chain, name| chain * turn(name, -1.0))
            * Matrix4::new_translation(&Vector3::from(WORKPIECE));
    let tool: Matrix4<f64> = names[linear + 1..]
        .iter()
        .fold(Matrix4::new_translation(&Vector3::new(joints[0], joints[1], joints[2])), |chain, name| {
            chain * turn(name, 1.0)
        });
    let from_workpiece = workpiece.try_inverse().expect("a rigid motion") * tool;
    ToolPose {
        tip: (from_workpiece * Vector4::new(0.0, 0.0, -TOOL, 1.0)).xyz(),
        axis: (from_workpiece * Vector4::new(0.0, 0.0, 1.0, 0.0)).xyz(),
    }
}

fn solve(kinematics: &Kinematics, pose: &ToolPose, near: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; near.len()];
    kinematics.inverse(pose, near, &mut out).expect("a reachable pose");
    out
}

#[test]
fn a_fork_head_swings_the_tip_about_its_pivot() {
    // Pivot of A 200 mm above the spindle nose, tool 100 mm: A of +90° swings the tip by 300 mm to +Y.
    let mut parameters =
        Parameters::load("fork_head", virtual_axes_builtin::MACHINES).expect("it is shipped");
    parameters
        .set_text("kinematics.tool_length_mm=100", &ValueSource::named("test"))
        .expect("a valid length");
    let kinematics = Kinematics::new(&parameters.machine_config().expect("a valid machine"));
    let pose = kinematics.forward(&[0.0, 0.0, 0.0, FRAC_PI_2, 0.0]);
    // Workpiece zero at Z −700 mm: the pivot is at 900 mm. A tool that tilts about +X points up to −Y.
    assert!((pose.tip - Vector3::new(0.0, 0.3, 0.9)).norm() < 1e-15, "{pose:?}");
    assert!((pose.axis - Vector3::new(0.0, -1.0, 0.0)).norm() < 1e-15, "{pose:?}");
    // C of +90° turns it to −X, since it is behind the pivot of C.
    let pose = kinematics.forward(&[0.0, 0.0, 0.0, FRAC_PI_2, FRAC_PI_2]);
    assert!((pose.tip - Vector3::new(-0.3, 0.0, 0.9)).norm() < 1e-15, "{pose:?}");
}

#[test]
fn an_a_c_center_turns_the_workpiece_against_the_tool() {
    let parameters = Parameters::load("ac_center", virtual_axes_builtin::MACHINES).expect("it is shipped");
    let kinematics = Kinematics::new(&parameters.machine_config().expect("a valid machine"));
    // Z −200 mm with a tool of 120 mm: the tip is 160 mm above the axis of A, and the workpiece zero 30 mm above it.
    let z = -0.2;
    let pose = kinematics.forward(&[0.0, 0.0, z, 0.0, 0.0]);
    assert!((pose.tip - Vector3::new(0.0, 0.0, 0.13)).norm() < 1e-15, "{pose:?}");
    // A of +90°: seen from the workpiece, the tool turns about +X to its side −Y.
    let pose = kinematics.forward(&[0.0, 0.0, z, FRAC_PI_2, 0.0]);
    assert!((pose.tip - Vector3::new(0.0, -0.16, -0.03)).norm() < 1e-15, "{pose:?}");
    assert!((pose.axis - Vector3::new(0.0, -1.0, 0.0)).norm() < 1e-15, "{pose:?}");
    // C of +90° turns it about +Z to +X.
    let pose = kinematics.forward(&[0.0, 0.0, z, FRAC_PI_2, FRAC_PI_2]);
    assert!((pose.tip - Vector3::new(0.16, 0.0, -0.03)).norm() < 1e-15, "{pose:?}");
    assert!((pose.axis - Vector3::new(1.0, 0.0, 0.0)).norm() < 1e-15, "{pose:?}");
}

#[test]
fn an_a_table_shows_the_tool_its_lower_side() {
    let parameters = Parameters::load("vmc_a", virtual_axes_builtin::MACHINES).expect("it is shipped");
    let kinematics = Kinematics::new(&parameters.machine_config().expect("a valid machine"));
    // 10 mm behind the axis of A and 30 mm above it, with A at 0 and at 180°.
    let joints = |a: f64| [-0.381, -0.203 + 0.01, -0.4 + 0.03 + 0.1, a];
    let upper = kinematics.forward(&joints(0.0));
    let lower = kinematics.forward(&joints(std::f64::consts::PI));
    assert!((upper.tip - Vector3::new(0.0, 0.01, 0.03)).norm() < 1e-15, "{upper:?}");
    assert!((lower.tip - Vector3::new(0.0, -0.01, -0.03)).norm() < 1e-15, "{lower:?}");
    assert!((lower.axis + Vector3::z()).norm() < 1e-15, "{lower:?}");
}

#[test]
fn a_b_table_shows_the_tool_its_other_side() {
    let parameters = Parameters::load("hmc", virtual_axes_builtin::MACHINES).expect("it is shipped");
    let kinematics = Kinematics::new(&parameters.machine_config().expect("a valid machine"));
    assert_eq!(
        [AxisRole::B, AxisRole::A, AxisRole::C].map(|role| kinematics.role(role)),
        [Some(3), None, None]
    );
    // 100 mm before the axis of B with B at 0 and at 180°: on opposite sides of the workpiece.
    let [x, z] = [-0.4, -0.9 + 0.1 + 0.15];
    let front = kinematics.forward(&[x, -0.55, z, 0.0]);
    let back = kinematics.forward(&[x, -0.55, z, std::f64::consts::PI]);
    assert!((front.tip - Vector3::new(0.0, 0.0, 0.1)).norm() < 1e-15, "{front:?}");
    assert!((back.tip - Vector3::new(0.0, 0.0, -0.1)).norm() < 1e-15, "{back:?}");
    assert!((back.axis + Vector3::z()).norm() < 1e-15, "{back:?}");
}

#[test]
fn chains_that_are_impossible_are_rejected_with_the_reason() {
    for (chain, reason) in [
        ("[c, a]", "contain xyz once"),
        ("[xyz, c, xyz]", "contain xyz once"),
        ("[x, xyz]", "rotary joints of the machine named a, b, c only, found x"),
        ("[c, c, xyz]", "contain each joint once, found c twice"),
        ("[a, b, xyz, c]", "at most two rotary joints"),
        ("[a, c, xyz]", "not have c as the second rotary joint"),
    ] {
        let error = set_chain(chain).and_then(|set| set.machine_config().map_err(|error| error.to_string()));
        let error = error.expect_err("an impossible chain");
        assert!(error.contains(reason) && error.contains("kinematics.chain"), "{chain}: {error}");
    }
}

#[test]
fn built_in_machines_reach_their_workpiece() {
    for (name, _) in virtual_axes_builtin::MACHINES {
        let machine = Parameters::load(name, virtual_axes_builtin::MACHINES).expect("it is shipped");
        let machine = machine.machine_config().expect("a valid machine");
        let pose = ToolPose { tip: Vector3::new(0.01, 0.02, 0.03), axis: Vector3::z() };
        let joints = solve(&Kinematics::new(&machine), &pose, &vec![0.0; machine.axes().len()]);
        for (axis, joint) in machine.axes().iter().zip(joints) {
            let limits = axis.limits();
            assert!(
                (limits.travel_min..=limits.travel_max).contains(&joint),
                "{name} {}: {joint}",
                axis.name()
            );
        }
    }
}

fn joints() -> impl Strategy<Value = [f64; 6]> {
    let linear = prop::array::uniform3(-0.5..0.5f64);
    let angle = || prop_oneof![1 => Just(0.0), 1 => -1e-7..1e-7f64, 4 => -4.0..4.0f64];
    (linear, angle(), angle(), angle()).prop_map(|([x, y, z], a, b, c)| [x, y, z, a, b, c])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn every_chain_agrees_with_homogeneous_matrices_both_ways(joints in joints(), near in joints()) {
        for (chain, kinematics) in CHAINS.into_iter().zip(KINEMATICS.iter()) {
            let wanted = pose_by_matrices(chain, &joints);
            let pose = kinematics.forward(&joints);
            prop_assert!((pose.tip - wanted.tip).norm() <= ROUND_TRIP, "{}: {:?}, {:?}", chain, pose, wanted);
            prop_assert!((pose.axis - wanted.axis).norm() <= ROUND_TRIP, "{}: {:?}, {:?}", chain, pose, wanted);
            let tool_axis = kinematics.orientation(&joints) * Vector3::z();
            prop_assert!((tool_axis - wanted.axis).norm() <= ROUND_TRIP, "{}: {:?}", chain, tool_axis);
            // The inverse for a pose computed by matrices, from any reference.
            let back = pose_by_matrices(chain, &solve(kinematics, &wanted, &near).try_into().expect("six joints"));
            prop_assert!((back.tip - wanted.tip).norm() <= ROUND_TRIP, "{}: tip {:?}", chain, back);
            prop_assert!((back.axis - wanted.axis).norm() <= ROUND_TRIP, "{}: axis {:?}", chain, back);
            let mut coordinates = joints;
            kinematics.tip_to_joints(&mut coordinates);
            let tip = pose_by_matrices(chain, &coordinates).tip;
            prop_assert!((tip - Vector3::new(joints[0], joints[1], joints[2])).norm() <= ROUND_TRIP, "{}", chain);
        }
    }
}
