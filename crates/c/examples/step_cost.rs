//! Compares position cycles through the C interface with those of the library, in turns: prints the median ratio.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use virtual_axes_c::{VaMachine, VaStatus, va_create, va_destroy, va_positions, va_step};
use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::{Machine, MachineParameters};

const AXES: usize = 5;
const CYCLES: usize = 20_000;
const ROUNDS: usize = 15;

fn psec(cycle: usize) -> [f64; AXES] {
    std::array::from_fn(|axis| 0.01 * (1.0 - (0.01 * cycle as f64 * (axis + 1) as f64).cos()))
}

/// Returns the time of the steps through the C interface, s.
fn through_c(machine: *mut VaMachine) -> f64 {
    let begin = Instant::now();
    let mut positions = [0.0; AXES];
    for cycle in 0..CYCLES {
        // SAFETY: the machine is live, and the arrays have the given lengths.
        unsafe {
            assert_eq!(va_step(machine, psec(cycle).as_ptr(), AXES), VaStatus::VaOk);
            assert_eq!(va_positions(machine, positions.as_mut_ptr(), AXES), VaStatus::VaOk);
        }
        black_box(&positions);
    }
    begin.elapsed().as_secs_f64()
}

/// Returns the time of the steps of the library, s.
fn in_rust(machine: &mut Machine) -> f64 {
    let begin = Instant::now();
    for cycle in 0..CYCLES {
        machine.advance(&psec(cycle), &[]);
        let positions: [f64; AXES] = std::array::from_fn(|axis| machine.motion_at_end(axis)[0]);
        black_box(&positions);
    }
    begin.elapsed().as_secs_f64()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = Parameters::embedded_default()?.machine_config()?;
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config)?));
    let mut handle: *mut VaMachine = std::ptr::null_mut();
    // SAFETY: the text ends with a null character, and the pointer is that of a local.
    assert_eq!(unsafe { va_create(c"mikron_ucp710".as_ptr(), &mut handle) }, VaStatus::VaOk);
    let mut ratios: Vec<f64> = (0..ROUNDS).map(|_| through_c(handle) / in_rust(&mut machine)).collect();
    // SAFETY: the machine is live and not used any more.
    unsafe { va_destroy(handle) };
    ratios.sort_by(f64::total_cmp);
    println!(
        "{CYCLES} position cycles of five axes through C, relative to the library: median {:.3}, {:.3} … {:.3}",
        ratios[ROUNDS / 2],
        ratios[0],
        ratios[ROUNDS - 1]
    );
    Ok(())
}
