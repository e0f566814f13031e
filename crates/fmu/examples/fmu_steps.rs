//! Measures steps of one FMU instance through the functions of FMI: set the setpoints, step, get positions and currents.

use std::ffi::{CString, c_uint};
use std::path::Path;
use std::time::Instant;

use virtual_axes_core::config::Parameters;
use virtual_axes_fmu::*;

const AXES: usize = 5;
const STEPS: usize = 50_000;
const ROUNDS: usize = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let parameters = Parameters::embedded_default()?;
    let machine = parameters.to_yaml("", |_| None);
    let variables = FmuVariables::new(&parameters)?;
    let reference = |name: &str| {
        let index = variables.list().iter().position(|variable| variable.name == name);
        index.map(|index| index as c_uint).ok_or(format!("{name} is missing"))
    };
    let axes = ["x", "y", "z", "a", "c"];
    let references = |signals: &[&str]| -> Result<Vec<c_uint>, String> {
        axes.iter()
            .flat_map(|axis| signals.iter().map(move |signal| format!("{axis}.{signal}")))
            .map(|name| reference(&name))
            .collect()
    };
    let (inputs, outputs) = (references(&["setpoint"])?, references(&["position", "current"])?);
    let period = parameters.machine_config()?.periods().position as f64 / 1e9;

    let folder = std::env::temp_dir().join(format!("fmu_steps_{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(MACHINE_FILE), &machine)?;
    let rates = measure(&folder, &machine, &inputs, &outputs, period);
    std::fs::remove_dir_all(&folder)?;
    let mut rates = rates?;
    rates.sort_by(f64::total_cmp);
    println!(
        "{STEPS} steps of {} ms, five axes, 5 inputs and 10 outputs each: median {:.0} steps/s, {:.0} … {:.0}",
        1000.0 * period,
        rates[ROUNDS / 2],
        rates[0],
        rates[ROUNDS - 1]
    );
    Ok(())
}

fn measure(
    folder: &Path,
    machine: &str,
    inputs: &[c_uint],
    outputs: &[c_uint],
    period: f64,
) -> Result<Vec<f64>, Box<dyn std::error::Error>> {
    let identifier = CString::new(guid(machine)?)?;
    let location = CString::new(format!("file://{}", folder.display()))?;
    let callbacks = Fmi2Callbacks {
        logger: None,
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: std::ptr::null_mut(),
    };
    // SAFETY: the texts end with a null character, and the callbacks are live.
    let c = unsafe {
        fmi2Instantiate(c"axes".as_ptr(), 1, identifier.as_ptr(), location.as_ptr(), &callbacks, 0, 0)
    };
    if c.is_null() {
        return Err("the instance is not created".into());
    }
    // SAFETY: the instance is live.
    unsafe {
        assert_eq!(fmi2EnterInitializationMode(c), Fmi2Status::Ok);
        assert_eq!(fmi2ExitInitializationMode(c), Fmi2Status::Ok);
    }
    let mut found = vec![0.0; outputs.len()];
    let mut step = 0_usize;
    let mut rates = Vec::new();
    for _ in 0..ROUNDS {
        let begin = Instant::now();
        for _ in 0..STEPS {
            let psec: [f64; AXES] =
                std::array::from_fn(|axis| 0.01 * (1.0 - (0.01 * step as f64 * (axis + 1) as f64).cos()));
            // SAFETY: the instance is live, and the arrays have the given lengths.
            unsafe {
                assert_eq!(fmi2SetReal(c, inputs.as_ptr(), inputs.len(), psec.as_ptr()), Fmi2Status::Ok);
                assert_eq!(fmi2DoStep(c, step as f64 * period, period, 1), Fmi2Status::Ok);
                assert_eq!(
                    fmi2GetReal(c, outputs.as_ptr(), outputs.len(), found.as_mut_ptr()),
                    Fmi2Status::Ok
                );
            }
            step += 1;
        }
        rates.push(STEPS as f64 / begin.elapsed().as_secs_f64());
    }
    // SAFETY: the instance is live and not used any more.
    unsafe { fmi2FreeInstance(c) };
    Ok(rates)
}
