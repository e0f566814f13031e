//! TRAORI and CYCLE800 against the tool pose of the kinematics.

use nalgebra::{Rotation3, Vector3};
use virtual_axes_core::config::{MachineConfig, Parameters, ValueSource};
use virtual_axes_core::kinematics::{Kinematics, ToolPose};
use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions, TipTransform};
use virtual_axes_nc::motion::{MotionKind, ProgramMotion, ProgramStep};

use crate::common::{motions, steps};

/// Returns a machine with pivots and workpiece off the machine zero.
pub fn machine() -> MachineConfig {
    let mut parameters = Parameters::embedded_default().expect("the machine");
    let values = [
        ("kinematics.pivot_a_y_mm", "7.0"),
        ("kinematics.pivot_a_z_mm", "-40.0"),
        ("kinematics.pivot_c_x_mm", "3.0"),
        ("kinematics.workpiece_x_mm", "20.0"),
        ("kinematics.workpiece_y_mm", "-10.0"),
        ("kinematics.workpiece_z_mm", "15.0"),
    ];
    for (key, value) in values {
        let source = ValueSource::Named("test".into());
        parameters.set_text(&format!("{key}={value}"), &source).expect("a valid value");
    }
    parameters.machine_config().expect("a valid machine")
}

fn options() -> InterpreterOptions {
    InterpreterOptions { dialect: Some(Dialect::Sinumerik), ..InterpreterOptions::for_machine(&machine()) }
}

/// Returns the tool pose in the workpiece at a part of a straight motion.
fn pose(motion: &ProgramMotion, part: f64) -> ToolPose {
    let position =
        std::array::from_fn(|axis| motion.start[axis] + part * (motion.end[axis] - motion.start[axis]));
    let joints = TipTransform::new(&machine()).joints(&position, motion.tcp_length);
    Kinematics::new(&machine()).forward(&joints)
}

fn assert_pose(found: &ToolPose, tip: [f64; 3], axis: Vector3<f64>) {
    let tip = Vector3::from(tip) * 1e-3;
    assert!((found.tip - tip).norm() < 1e-11, "{found:?}, expected tip {tip:?}");
    assert!(
        found.axis.cross(&axis.normalize()).norm() < 1e-11 && found.axis.dot(&axis) > 0.0,
        "{found:?}, expected axis {axis:?}"
    );
}

#[test]
fn vectors_are_the_tool_axis_in_the_workpiece() {
    let cases = [
        ("A3=0 B3=0.5 C3=0.8660254", Vector3::new(0.0, 0.5, 0.866_025_4)),
        ("A3=-1 B3=2 C3=5", Vector3::new(-1.0, 2.0, 5.0)),
        // RPY: Rz(30) Ry(20) Rx(10) ez.
        (
            "ORIRPY A2=10 B2=20 C2=30",
            Rotation3::from_euler_angles(10_f64.to_radians(), 20_f64.to_radians(), 30_f64.to_radians())
                * Vector3::z(),
        ),
        // Euler: the second rotation tilts the tool about the X axis that the first one turned by 90°: to +X.
        ("ORIEULER A2=90 B2=30 C2=0", Vector3::new(0.5, 0.0, 0.75_f64.sqrt())),
        ("ORIAXES A3=1 B3=0 C3=2", Vector3::new(1.0, 0.0, 2.0)),
    ];
    for (words, axis) in cases {
        let text = format!("G0 X0 Y0 Z50 D1\nTRAORI\nG1 X5 Y6 Z20 {words} F900\nTRAFOOF\nM30\n");
        let motions = motions(&text, options());
        let last = motions.last().expect("a motion");
        assert_pose(&pose(last, 1.0), [5.0, 6.0, 20.0], axis);
    }
}

#[test]
fn a_vector_turns_on_a_great_circle_and_the_tip_on_a_line() {
    let text = "G0 X0 Y0 Z50 D1\nTRAORI\nG1 X0 Y0 Z20 A3=1 B3=0 C3=1 F900\nX30 Y10 A3=0 B3=1 C3=1\nM30\n";
    let motions = motions(text, options());
    let (first, last) = (Vector3::new(1.0, 0.0, 1.0).normalize(), Vector3::new(0.0, 1.0, 1.0).normalize());
    let normal = first.cross(&last).normalize();
    let turn: Vec<&ProgramMotion> = motions.iter().filter(|motion| motion.line == 4).collect();
    assert!(turn.len() > 10, "{}", turn.len());
    for motion in turn {
        for part in [0.0, 0.5, 1.0] {
            let pose = pose(motion, part);
            assert!(pose.axis.dot(&normal).abs() < 0.02_f64.to_radians(), "{pose:?}");
            // On the line from (0, 0, 20) to (30, 10, 20), mm.
            assert!(
                (pose.tip.x - 3.0 * pose.tip.y).abs() < 1e-11 && (pose.tip.z - 0.02).abs() < 1e-11,
                "{pose:?}"
            );
        }
    }
    // Rotary axes are interpolated with ORIAXES: one line.
    let text = text.replace("TRAORI", "TRAORI\nORIAXES");
    assert_eq!(motions_of_line(&text, 5), 1);
}

fn motions_of_line(text: &str, line: usize) -> usize {
    motions(text, options()).iter().filter(|motion| motion.line == line).count()
}

#[test]
fn frames_turn_vectors_and_tips_with_traori() {
    // TRANS and ROT about Z by 90° map (1, 0, 0) to (10, 1, 0), and the direction X to Y.
    let text = "G0 Z50 D1\nTRAORI\nTRANS X10\nAROT Z90\nG1 X1 Y0 Z20 A3=1 B3=0 C3=1 F900\nM30\n";
    let motions = motions(text, options());
    assert_pose(
        &pose(motions.last().expect("a motion"), 1.0),
        [10.0, 1.0, 20.0],
        Vector3::new(0.0, 1.0, 1.0),
    );
}

#[test]
fn rotary_axis_words_keep_the_tip() {
    let text = "G0 X0 Y0 Z50 A10 C20 D1\nTRAORI\nG1 X1 Y2 Z3 A30 C=IC(40) F900\nTRAFOOF\nG0 Z100\nM30\n";
    let motions = motions(text, options());
    let [_, turn, retraction] = &motions[..] else { panic!("{motions:?}") };
    let (a, c) = (30_f64.to_radians(), 60_f64.to_radians());
    let axis = Vector3::new(a.sin() * c.sin(), -a.sin() * c.cos(), a.cos());
    assert_pose(&pose(turn, 1.0), [1.0, 2.0, 3.0], axis);
    assert!(turn.tcp_length.is_some() && retraction.tcp_length.is_none());
    assert_pose(&pose(retraction, 0.0), [1.0, 2.0, 3.0], axis);
}

#[test]
fn a_swiveled_plane_has_its_origin_and_normal() {
    let angle = 30_f64.to_radians();
    let (sine, cosine) = angle.sin_cos();
    let cases = [
        // Modes: 57 is X, Y, Z; 27 is Z, Y, X; 39 is Z, X, Y. The origin is (4, 5, 6).
        ("57,4,5,6,30,0,0", Rotation3::from_axis_angle(&Vector3::x_axis(), angle)),
        ("57,4,5,6,0,30,0", Rotation3::from_axis_angle(&Vector3::y_axis(), angle)),
        (
            "27,4,5,6,30,0,20",
            Rotation3::from_axis_angle(&Vector3::z_axis(), angle)
                * Rotation3::from_axis_angle(&Vector3::x_axis(), 20_f64.to_radians()),
        ),
        (
            "39,4,5,6,30,20,0",
            Rotation3::from_axis_angle(&Vector3::z_axis(), angle)
                * Rotation3::from_axis_angle(&Vector3::x_axis(), 20_f64.to_radians()),
        ),
        (
            "64,4,5,6,30,20,0",
            Rotation3::from_axis_angle(&Vector3::z_axis(), angle)
                * Rotation3::from_axis_angle(&Vector3::y_axis(), 20_f64.to_radians()),
        ),
    ];
    for (values, rotation) in cases {
        let text =
            format!("D1\nCYCLE800(1,\"TC1\",0,{values},0,0,0,-1,0,1)\nG0 X1 Y2 Z40\nG1 Z3 F300\nM30\n");
        let motions = motions(&text, options());
        let origin = Vector3::new(4.0, 5.0, 6.0);
        let [above, hole] = [Vector3::new(1.0, 2.0, 40.0), Vector3::new(1.0, 2.0, 3.0)]
            .map(|point| origin + rotation * point);
        let last = motions.last().expect("a motion");
        assert_pose(&pose(last, 0.0), above.into(), rotation * Vector3::z());
        assert_pose(&pose(last, 1.0), hole.into(), rotation * Vector3::z());
        // The hole is along the spindle: Z alone.
        assert!((0..2).all(|axis| (last.start[axis] - last.end[axis]).abs() < 1e-12), "{last:?}");
    }
    // A circle in the plane remains one, in the plane of the machine.
    let text = "D1\nCYCLE800(0,\"\",0,57,0,0,0,30,0,0,0,0,0,-1)\nG0 X10 Y0 Z0\nG3 X0 Y10 CR=10 F300\nCYCLE800()\nG0 X0\nM30\n";
    let found = motions(text, options());
    let arc = found.iter().find(|motion| motion.line == 4).expect("an arc");
    assert!(matches!(arc.kind, MotionKind::Arc(_)), "{arc:?}");
    assert_pose(&pose(arc, 1.0), [0.0, 10.0 * cosine, 10.0 * sine], Vector3::new(0.0, -sine, cosine));
}

#[test]
fn additive_swivels_chain_and_rotary_axes_are_given_directly() {
    let text = "D1\nCYCLE800(0,\"\",0,57,0,0,0,20,0,0,0,0,0,-1)\nCYCLE800(0,\"\",1,57,0,0,0,10,0,0,0,0,0,-1)\nG0 X0 Y0 Z10\nM30\n";
    let (sine, cosine) = 30_f64.to_radians().sin_cos();
    let last = motions(text, options()).pop().expect("a motion");
    assert_pose(&pose(&last, 1.0), [0.0, -10.0 * sine, 10.0 * cosine], Vector3::new(0.0, -sine, cosine));
    let text = "D1\nCYCLE800(0,\"\",0,192,0,0,0,30,0,0,0,0,0,-1)\nG0 X0 Y0 Z10\nM30\n";
    let last = motions(text, options()).pop().expect("a motion");
    assert_pose(&pose(&last, 1.0), [0.0, -10.0 * sine, 10.0 * cosine], Vector3::new(0.0, -sine, cosine));
}

#[test]
fn the_sign_of_a_swivel_belongs_to_the_first_rotary_axis() {
    // A plane that tilts by −15° about X: the table A turns by +15° with half a turn of C, or by −15° without.
    let (sine, cosine) = 15_f64.to_radians().sin_cos();
    for (direction, a, c) in [(1, 15.0, 180.0), (-1, -15.0, 0.0)] {
        let text = format!("D1\nCYCLE800(1,\"\",0,57,0,0,0,-15,0,0,0,0,0,{direction})\nG0 X0 Y0 Z10\nM30\n");
        let last = motions(&text, options()).pop().expect("a motion");
        let angles = [3, 4, 5].map(|axis| last.end[axis].to_degrees());
        assert!((angles[0] - a).abs() < 1e-9 && (angles[2].abs() - c).abs() < 1e-9, "{angles:?}");
        assert_eq!(angles[1], 0.0, "a machine without B");
        assert_pose(&pose(&last, 1.0), [0.0, 10.0 * sine, 10.0 * cosine], Vector3::new(0.0, sine, cosine));
    }
}

/// The table A of the machine turns from −30° to 120°.
#[test]
fn a_swivel_beyond_the_travel_names_limit_and_solution() {
    let swivel = |angle: i32, direction: i32| {
        let text =
            format!("D1\nCYCLE800(1,\"\",0,57,0,0,0,{angle},0,0,0,0,0,{direction})\nG0 X0 Y0 Z10\nM30\n");
        let mut interpreter = Interpreter::new(std::io::Cursor::new(text), "part.nc", options());
        let steps: Result<Vec<_>, _> = interpreter.by_ref().collect();
        let notes: Vec<_> = interpreter.report().assumptions.keys().cloned().collect();
        (steps.map_err(|error| error.to_string()), notes.join("\n"))
    };
    // −60° about X: A is 60° with half a turn of C, or −60°, which is beyond the travel.
    let (steps, notes) = swivel(-60, -1);
    let end = steps.expect("the other solution").into_iter().rev().find_map(|step| match step {
        ProgramStep::Motion(motion) => Some(motion.end),
        ProgramStep::Event { .. } => None,
    });
    assert!((end.expect("a motion")[3].to_degrees() - 60.0).abs() < 1e-9);
    let (_, rest) =
        notes.split_once("CYCLE800 with _DIR=-1: A -60° is beyond its travel of -30° to 120°").expect(&notes);
    assert!(rest.contains("the other solution A 60° C") && rest.contains("_DIR=1"), "{notes}");
    let (steps, notes) = swivel(-60, 1);
    assert!(steps.is_ok() && !notes.contains("CYCLE800"), "{notes}");
    // Both solutions are beyond it.
    for direction in [-1, 1] {
        let error = swivel(-130, direction).0.expect_err("no solution");
        for part in [
            "part.nc:2: CYCLE800: the rotary axes do not reach this plane",
            "A -130° is beyond its travel of -30° to 120°",
            "A 130° is beyond its travel of -30° to 120°",
            "no work offset helps",
        ] {
            assert!(error.contains(part), "{part}: {error}");
        }
    }
    // Without a motion of the rotary axes the frame alone is turned.
    assert!(swivel(-130, 0).0.is_ok());
}

#[test]
fn axis_positions_interrupt_traori() {
    let text = "G0 X0 Y0 Z50 D1\nTRAORI\nG1 X5 Y6 Z20 A10 F900\nG0 SUPA Z150\nG1 X5 Y6 Z20\nM30\n";
    let motions = motions(text, options());
    let [.., away, back] = motions.as_slice() else { panic!("{motions:?}") };
    // The tool of 100 mm is above the position of Z; A keeps its angle.
    assert_eq!(away.tcp_length, None);
    assert!((away.end[2] - 0.25).abs() < 1e-12 && (away.end[3].to_degrees() - 10.0).abs() < 1e-9, "{away:?}");
    let (sine, cosine) = 10_f64.to_radians().sin_cos();
    assert_pose(&pose(back, 1.0), [5.0, 6.0, 20.0], Vector3::new(0.0, -sine, cosine));
}

#[test]
fn orientations_require_a_machine_and_traori() {
    let mut three_axes = options();
    three_axes.kinematics = None;
    let error = |text: &str, options: InterpreterOptions| steps(text, options).expect_err(text).to_string();
    assert!(error("TRAORI\n", three_axes.clone()).contains("TRAORI requires a machine with rotary axes"));
    assert!(
        error("CYCLE800(0,\"\",0,57,0,0,0,30,0,0,0,0,0,-1)\n", three_axes)
            .contains("CYCLE800 requires a machine with rotary axes")
    );
    assert!(error("G1 X1 A3=0 B3=0 C3=1 F100\n", options()).contains("require TRAORI"));
    assert!(error("CYCLE800(0,\"\",0,128,0,0,0,30,0,0)\n", options()).contains("projection angles"));
}

#[test]
fn all_parts_of_a_turn_have_the_solution_of_its_end() {
    // −30° of A is the limit of the machine: the tool reaches the tilt with A positive and half a turn of C.
    let text = "G0 X0 Y0 Z50 D1\nTRAORI\nG1 X5 Y6 Z20 A3=0 B3=0.6 C3=1 F900\nM30\n";
    let motions = motions(text, options());
    let (first, last) = (&motions[1], motions.last().expect("a motion"));
    assert!((last.end[3].tan() - 0.6).abs() < 1e-12, "{last:?}");
    assert!(
        motions[1..].iter().all(|motion| (motion.end[5].abs().to_degrees() - 180.0).abs() < 1e-9),
        "{motions:?}"
    );
    assert!(first.end[3].to_degrees().abs() < 2.0 && motions.len() > 3, "{first:?}");
}
