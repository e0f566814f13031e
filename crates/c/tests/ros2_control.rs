//! Hardware component of ros2_control, in a host that makes the calls of the controller manager (`ros2_control/test`).

#[path = "c_program/library.rs"]
mod library;

use std::path::PathBuf;
use std::process::{Command, Output};

use library::{folder, library};

/// Update period at 167 Hz, s.
const PERIOD: f64 = 5.988023e-3;
/// Angular frequency of the commanded motion in host.cpp, rad/s.
const FREQUENCY: f64 = 3.0;
/// Amplitudes of the commanded motion in host.cpp, m or rad.
const AMPLITUDES: [f64; 5] = [0.02, 0.01, 0.02 / 3.0, 0.2, 0.1];

/// Argument of `on_init` in releases of ros2_control.
#[derive(Clone, Copy, Debug)]
enum InitArgument {
    /// HardwareComponentInterfaceParams.
    Params,
    /// HardwareInfo, in older releases.
    Info,
}

/// Compiles plugin and host with g++ and the sanitizers of gcc, and runs it in one mode.
fn host(mode: &str, argument: InitArgument) -> Output {
    let root = folder().join("../../ros2_control");
    let program =
        PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("ros2_control_{mode}_{argument:?}"));
    let mut compiler = Command::new("g++");
    compiler.args(["-std=c++17", "-Wall", "-Wextra", "-Werror", "-O1"]);
    compiler.args(["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]);
    for include in [root.join("include"), root.join("test/standin"), folder().join("include")] {
        compiler.arg("-I").arg(include);
    }
    if matches!(argument, InitArgument::Params) {
        compiler.arg("-I").arg(root.join("test/standin_params"));
    }
    compiler.arg(root.join("src/virtual_axes_system.cpp")).arg(root.join("test/host.cpp")).arg(library());
    compiler.args(["-lpthread", "-ldl", "-lm", "-o"]).arg(&program);
    assert!(compiler.status().expect("g++ is installed").success());
    let output = Command::new(program).arg(mode).output().expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

#[test]
#[ignore = "compiles with sanitizers: ./test.sh --all"]
fn a_minute_at_three_update_rates_is_the_same_motion() {
    let output = host("motion", InitArgument::Params);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("comparison, times, different states, differences of setpoints and positions by axis:\n{text}");
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(' ').collect()).collect();
    assert_eq!(rows.len(), 3, "{text}");
    // At 500 Hz and 1 kHz a command is given at each position cycle: bit-identical to va_step with these setpoints.
    assert_eq!(rows[0][..3], ["1000_and_c", "10000", "0"], "{text}");
    assert_eq!(rows[1][..3], ["500_and_1000", "10000", "0"], "{text}");
    // At 167 Hz the setpoints are on chords of the commanded motion: below it by at most a h^2 / 8.
    assert_eq!(rows[2][..2], ["167_and_1000", "9999"], "{text}");
    let number = |index: usize| -> f64 { rows[2][index].parse().expect("a number") };
    for (axis, amplitude) in AMPLITUDES.iter().enumerate() {
        let bound = amplitude * FREQUENCY.powi(2) * PERIOD.powi(2) / 8.0;
        let (setpoint, position) = (number(3 + axis), number(8 + axis));
        assert!(setpoint <= bound * (1.0 + 1e-6), "axis {axis}: setpoint {setpoint}, bound {bound}");
        assert!(setpoint > 0.9 * bound, "axis {axis}: setpoint {setpoint}, bound {bound}");
        // The drives follow this slow difference; a loop may amplify its kinks, but not to twice.
        assert!(position <= 2.0 * bound, "axis {axis}: position {position}, bound {bound}");
    }
}

#[test]
#[ignore = "compiles with sanitizers: ./test.sh --all"]
fn invalid_hardware_blocks_are_rejected_with_name_value_and_allowed_values() {
    let expected = [
        "parameter machine is missing; allowed: name of a built-in machine",
        "nowhere.yaml: cannot be read",
        "parameter controller is pid; allowed: cascade, gpc, rst",
        "parameter joints has 2 names; allowed: one for each of the axes x, y, z, a, c",
        "parameter joints has x twice; allowed: each name once",
        "joint x is no axis of the machine; allowed: left_x, left_y, left_z, left_a, left_c",
        "joint y has the command interfaces [velocity]; allowed: position alone",
        "joint z has the state interface acceleration; allowed: position, velocity, effort, current, following_error",
        "joint x is given twice; allowed: each joint once",
        "the hardware has no joints; allowed: at least one",
        "parameter controler = gpc is not read; this plugin reads machine, controller, joints, joint_prefix",
        "command interface x/velocity is not available; allowed: x/position",
        "x.position_loop.rst.r is missing",
    ];
    for argument in [InitArgument::Params, InitArgument::Info] {
        let output = host("errors", argument);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), expected.len(), "{argument:?}: {text}");
        for (line, wanted) in lines.iter().zip(expected) {
            assert!(line.contains(wanted), "{argument:?}: {line}: {wanted}");
        }
    }
}
