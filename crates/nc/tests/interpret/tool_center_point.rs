//! Tool center point control (G43.4) against the kinematics of the machine.

use virtual_axes_core::config::{MachineConfig, Parameters, ValueSource};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_nc::interpret::{InterpreterOptions, Tool};
use virtual_axes_nc::motion::{Coordinates, Feed, MotionKind};

use crate::common::{error, motions};

/// Largest error of a position, m.
const TOLERANCE: f64 = 1e-12;

/// Returns a machine with pivots and workpiece off the machine zero.
fn machine() -> MachineConfig {
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
        parameters
            .set_text(&format!("{key}={value}"), &ValueSource::Named("test".into()))
            .expect("a valid value");
    }
    parameters.machine_config().expect("a valid machine")
}

/// Returns the joints x, y, z, a, c of axis positions.
fn joints(position: &Coordinates) -> [f64; 5] {
    [position[0], position[1], position[2], position[3], position[5]]
}

fn assert_close(found: &[f64], expected: &[f64]) {
    let is_close = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= TOLERANCE);
    assert!(is_close && found.len() == expected.len(), "{found:?}, expected {expected:?}");
}

#[test]
fn the_tip_of_the_programmed_point_is_that_of_the_kinematics() {
    let machine = machine();
    let kinematics = Kinematics::new(&machine);
    let program = "G0 X0 Y0 Z50 A30 C45 G43\nG43.4 H1\nG1 F1000 X10 Y-5 Z2 A40 C90\nG49\nG0 X1\n";
    let motions = motions(program, InterpreterOptions::for_machine(&machine));
    let [approach, cut, after] = &motions[..] else { panic!("{motions:?}") };
    assert_eq!((approach.tcp_length, cut.tcp_length, after.tcp_length), (None, Some(0.1), None));
    assert_eq!((cut.kind.clone(), cut.feed), (MotionKind::Line, Feed::Linear(1.0 / 60.0)));

    // G54 is the origin of the workpiece frame: the tip of the approach is where the cut starts.
    let workpiece = machine.kinematics().workpiece;
    let tip = kinematics.forward(&joints(&approach.end)).tip;
    let start: Vec<f64> = (0..3).map(|axis| cut.start[axis] - workpiece[axis]).collect();
    assert_close(&start, tip.as_slice());
    let end: Vec<f64> = (0..3).map(|axis| cut.end[axis] - workpiece[axis]).collect();
    assert_close(&end, &[0.010, -0.005, 0.002]);

    // After G49, the axes stand where the tip has ended.
    let mut expected = [0.010, -0.005, 0.002, 40_f64.to_radians(), 90_f64.to_radians()];
    kinematics.tip_to_joints(&mut expected);
    assert_close(&joints(&after.start), &expected);
    assert_close(&joints(&after.end)[1..], &expected[1..]);
    assert_close(&[after.end[0]], &[0.001 + workpiece[0]]);
}

#[test]
fn another_tool_length_moves_the_tip_along_the_tool() {
    let machine = machine();
    let kinematics = Kinematics::new(&machine);
    let mut options = InterpreterOptions::for_machine(&machine);
    options.tools.insert(5, Tool { length: 0.130, ..Tool::default() });
    let motions = motions("G0 A20 C-30\nG43.4 H5\nG0 X1\nG43.4 H2\nG0 X2\n", options);
    let [approach, long, short] = &motions[..] else { panic!("{motions:?}") };
    assert_eq!((long.tcp_length, short.tcp_length), (Some(0.130), Some(0.1)));
    let pose = kinematics.forward(&joints(&approach.end));
    let workpiece = machine.kinematics().workpiece;
    let tip: Vec<f64> = (0..3).map(|axis| long.start[axis] - workpiece[axis]).collect();
    assert_close(&tip, (pose.tip - 0.030 * pose.axis).as_slice());
    // The shorter tool has its tip at the same axis positions.
    let moved: Vec<f64> = (0..3).map(|axis| short.start[axis] - long.end[axis]).collect();
    assert_close(&moved, (0.030 * pose.axis).as_slice());
}

#[test]
fn without_rotation_tool_length_and_tool_center_point_agree() {
    let options = InterpreterOptions::for_machine(&machine());
    let path = "G0 X10 Y20 Z30\nG1 F500 X12\nG3 X20 Y28 R8\n";
    let plain = motions(&format!("G43 H1\n{path}"), options.clone());
    let tcp = motions(&format!("G43.4 H1\n{path}"), options);
    assert_eq!(plain.len(), 3);
    for (plain, tcp) in plain.iter().zip(&tcp) {
        let mut tip = plain.end;
        tip[2] -= 0.1;
        assert_close(&tcp.end, &tip);
    }
}

#[test]
fn axis_positions_interrupt_tool_center_point_control() {
    let options = InterpreterOptions::for_machine(&machine());
    for line in ["G53 G0 Z0", "G28 Z0", "G30"] {
        let text = format!("G90 G43.4 H1\nG0 X10 Y5 Z40\nA20 C30\n{line}\nG0 X10 Y5 Z40 A20 C30\n");
        let found = motions(&text, options.clone());
        let axis_motions: Vec<_> = found.iter().filter(|motion| motion.tcp_length.is_none()).collect();
        assert!(!axis_motions.is_empty(), "{line}");
        assert!(axis_motions.iter().all(|motion| motion.end[2] == 0.0), "{line}: {axis_motions:?}");
        let last = found.last().expect("a motion");
        assert!(last.tcp_length.is_some(), "{line}");
    }
    assert!(error("G43.4").contains("requires a machine with kinematics"));
}
