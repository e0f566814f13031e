//! Damaged scenarios: rejected with file and reason, or planned with finite positions. Travel limits are checked when
//! the path runs on a machine.

use proptest::prelude::*;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::scenario::Scenario;
use virtual_axes_verification::fixtures::machines::AXES;

/// Number of samples of a path.
const SAMPLES: u32 = 50;

fn names() -> impl Strategy<Value = &'static str> {
    // Scenarios with few moves, since planning dominates the run time.
    prop::sample::select(vec!["x-constant", "c-two-speeds", "corner-45", "ballbar", "bspline-3d"])
}

#[test]
fn a_rejection_contains_the_key_in_one_line() {
    let long = "k".repeat(1 << 20);
    let machine = Parameters::embedded_default().expect("built-in").machine_config().expect("built-in");
    for key in ["\"a\\nb\"", &format!("? {long}\n  ")] {
        for (limits, line) in [(key, "x_mm"), ("jerk_m_s3", key)] {
            let text = format!(
                "description: a\nfeed_m_min: 1\nlimits:\n  {limits}: 5\nmoves:\n- line:\n    {}: 1\n",
                line.replace("\n  ", "\n    ")
            );
            let rejection = Scenario::from_yaml(&text, "my.yaml").and_then(|s| s.program(&machine, None));
            let rejection = rejection.expect_err("must be rejected").to_string();
            assert!(
                !rejection.contains(char::is_control) && rejection.len() < 2000,
                "{} bytes",
                rejection.len()
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_scenario_is_rejected_in_one_line_or_planned(
        name in names(),
        position: prop::sample::Index,
        length in 0..12usize,
        patch in prop_oneof![
            "[-0-9.e]{1,6}", "[-:\\[\\]{}, \n#&*a-z_0-9]{0,10}",
            prop::sample::select(vec!["1e300", "1e-300", "-0.0", ".nan", ".inf", "turns: 1e9", "ramp_s: 0.1", "dwell_s: 1", "corner_m_min: 1"]).prop_map(str::to_owned),
        ],
    ) {
        let mut bytes = Scenario::builtin_text(name, virtual_axes_builtin::SCENARIOS).expect("built-in").as_bytes().to_vec();
        let at = position.index(bytes.len());
        bytes.splice(at..(at + length).min(bytes.len()), patch.into_bytes());
        let text = String::from_utf8_lossy(&bytes);
        let machine = Parameters::embedded_default().expect("built-in").machine_config().expect("built-in");
        match Scenario::from_yaml(&text, "my.yaml").and_then(|scenario| scenario.program(&machine, None)) {
            Ok(program) => {
                let mut psec = [0.0; AXES];
                for sample in 0..=SAMPLES {
                    program.psec(program.duration() * f64::from(sample) / f64::from(SAMPLES), &mut psec);
                    prop_assert!(psec.iter().all(|position| position.is_finite()), "{:?}", psec);
                }
            }
            Err(error) => {
                let text = error.to_string();
                prop_assert!(text.starts_with("my.yaml") && !text.contains('\n') && text.len() < 2000, "{}", text);
            }
        }
    }
}
