//! C interface: header, calls from a C program, bits against the library.

mod c_program;

use std::process::Command;
use std::sync::Arc;

use c_program::{compile, folder, hexadecimal};

use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::{Machine, MachineParameters};

const AXES: usize = 5;
const CYCLES: usize = 300;

/// Returns the positions of the motion of smoke.c.
fn positions() -> Vec<[f64; AXES]> {
    let config = Parameters::load("mikron_ucp710", virtual_axes_builtin::MACHINES)
        .and_then(|p| p.machine_config())
        .expect("valid");
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
    let setpoint = |cycle: usize, axis: usize| {
        (if axis < 3 { 0.01 } else { 0.2 }) * (if cycle < 150 { cycle as f64 / 150.0 } else { 1.0 })
            / (axis + 1) as f64
    };
    let step = |cycle| {
        machine.advance(&std::array::from_fn::<_, AXES, _>(|axis| setpoint(cycle, axis)), &[]);
        std::array::from_fn(|axis| machine.motion_at_end(axis)[0])
    };
    (0..CYCLES).map(step).collect()
}

#[test]
fn a_c_program_gets_the_bits_of_the_library_and_an_error_for_each_bad_call() {
    let output = Command::new(compile("tests/smoke.c", "smoke", &[])).output().expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("numbers");
    let found: Vec<Vec<f64>> = text.lines().map(|line| line.split(' ').map(hexadecimal).collect()).collect();
    assert_eq!(found.len(), CYCLES);
    assert!(found.last().is_some_and(|row| row[0] > 0.009), "X arrives");
    for (cycle, (found, wanted)) in found.iter().zip(positions()).enumerate() {
        assert_eq!(found, &wanted, "cycle {cycle}");
    }
}

/// Options of gcc that make leaks, invalid accesses and undefined behavior of a program an error.
const SANITIZERS: [&str; 3] = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

#[test]
#[ignore = "compiles with sanitizers: ./test.sh --all"]
fn sanitizers_find_no_leak_and_no_invalid_access() {
    let output = Command::new(compile("tests/smoke.c", "sanitized", &SANITIZERS)).output().expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
#[ignore = "compiles with sanitizers: ./test.sh --all"]
fn random_calls_in_any_order_return_a_status() {
    let program = compile("tests/random_calls.c", "random_calls", &SANITIZERS);
    for seed in ["1", "2", "3"] {
        let output = Command::new(&program).args([seed, "10000"]).output().expect("it runs");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "seed {seed}: {}", String::from_utf8_lossy(&output.stderr));
        // The calls reach the machines: many are valid.
        let done: u32 = text.split(' ').next().and_then(|word| word.parse().ok()).expect("a number");
        assert!(done > 3000, "{text}");
    }
}

#[test]
fn a_spring_computed_every_half_millisecond_has_the_position_of_the_library() {
    let program = compile("examples/spring.c", "spring", &[]);
    let output = Command::new(program).output().expect("it runs");
    let config = Parameters::load("mikron_ucp710", virtual_axes_builtin::MACHINES)
        .and_then(|p| p.machine_config())
        .expect("valid");
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
    for _ in 0..2000 {
        machine.set_load(0, -1e6 * machine.motion_at_end(0)[0]);
        machine.advance_ticks(4, &[0.001, 0.0, 0.0, 0.0, 0.0], &[]);
    }
    let position = 1000.0 * machine.motion_at_end(0)[0];
    assert_eq!(String::from_utf8_lossy(&output.stdout), format!("{position:.9} mm\n"));
    // The loop has an integral part in the velocity loop only: a constant force of 1 kN leaves an error.
    // The velocity controller has an integral part: after a second, no error is left under a constant force.
    assert!((position - 1.0).abs() < 1e-9, "{position}");
}

#[test]
fn the_page_shows_the_program() {
    let page = std::fs::read_to_string(folder().join("../../docs/how-to/c-interface.md")).expect("a page");
    let program = std::fs::read_to_string(folder().join("examples/spring.c")).expect("a program");
    assert!(
        page.contains(&format!("```c\n{program}```")),
        "docs/how-to/c-interface.md shows another spring.c"
    );
}

#[test]
fn the_header_is_that_of_the_source() {
    let mut made = Vec::new();
    cbindgen::generate(folder()).expect("the source can be read").write(&mut made);
    let header = std::fs::read(folder().join("include/virtual_axes.h")).expect("it is in the repository");
    assert!(
        made == header,
        "include/virtual_axes.h is out of date: cargo run -p virtual_axes_c --example header"
    );
}
