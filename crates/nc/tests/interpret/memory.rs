//! Memory and order of long programs.

use std::io::Cursor;

use virtual_axes_nc::interpret::{Interpreter, InterpreterOptions};

/// Returns the largest number of bytes that the interpretation of a text has allocated at one time.
fn peak(text: &str) -> u64 {
    let measured = allocation_counter::measure(|| {
        let steps = Interpreter::new(Cursor::new(text), "part.nc", InterpreterOptions::default());
        assert!(steps.into_iter().all(|step| step.is_ok()));
    });
    measured.bytes_max
}

#[test]
fn memory_does_not_depend_on_the_length_of_the_program() {
    let program = |count: usize| {
        let lines = (0..count)
            .map(|index| format!("N{index:06} G1 X{:07.3} Y[#1+{:02}]\n", index as f64 * 0.02, index % 7));
        let text: String = lines.collect();
        format!("F3000\n{text}o1 repeat [9]\nG91 X1\no1 endrepeat\n")
    };
    assert_eq!(peak(&program(100)), peak(&program(20_000)));
}

#[test]
fn memory_of_a_native_sinumerik_program_does_not_depend_on_its_length() {
    let program = |count: usize| {
        let lines = (0..count)
            .map(|index| format!("N{index:06} G1 X{:07.3} Y=R1+{:02}\n", index as f64 * 0.02, index % 7));
        let text: String = lines.collect();
        format!("F3000\nG710\n{text}BACK: R2=R2+1\nG91 X1\nIF R2<9 GOTOB BACK\nM30\n")
    };
    assert_eq!(peak(&program(100)), peak(&program(20_000)));
}
