//! Damaged scenarios: refused with file and reason, or a path whose positions are numbers (strokes are looked at
//! by whoever moves the machine).

use proptest::prelude::*;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::scenario::Scenario;
use virtual_axes_verification::fixtures::common::AXES;

/// Instants at which a path is looked at.
const LOOKS: u32 = 50;

fn names() -> impl Strategy<Value = &'static str> {
    // Those with few moves: planning is what takes time.
    prop::sample::select(vec!["x-constant", "c-two-speeds", "corner-45", "ballbar", "bspline-3d"])
}

#[test]
fn a_refusal_names_a_key_in_one_line() {
    let long = "k".repeat(1 << 20);
    let machine = Parameters::embedded_default().expect("shipped").machine_config().expect("shipped");
    for key in ["\"a\\nb\"", &format!("? {long}\n  ")] {
        for (limits, line) in [(key, "x_mm"), ("jerk_m_s3", key)] {
            let text = format!(
                "description: a\nfeed_m_min: 1\nlimits:\n  {limits}: 5\nmoves:\n- line:\n    {}: 1\n",
                line.replace("\n  ", "\n    ")
            );
            let refused = Scenario::from_yaml(&text, "my.yaml").and_then(|s| s.program(&machine, None));
            let refused = refused.expect_err("must be refused").to_string();
            assert!(!refused.contains(char::is_control) && refused.len() < 2000, "{} bytes", refused.len());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_scenario_is_refused_in_a_line_or_is_a_path(
        name in names(),
        place: prop::sample::Index,
        length in 0..12usize,
        patch in prop_oneof![
            "[-0-9.e]{1,6}", "[-:\\[\\]{}, \n#&*a-z_0-9]{0,10}",
            prop::sample::select(vec!["1e300", "1e-300", "-0.0", ".nan", ".inf", "turns: 1e9", "ramp_s: 0.1", "dwell_s: 1", "corner_m_min: 1"]).prop_map(str::to_owned),
        ],
    ) {
        let mut bytes = Scenario::builtin_text(name).expect("shipped").as_bytes().to_vec();
        let at = place.index(bytes.len());
        bytes.splice(at..(at + length).min(bytes.len()), patch.into_bytes());
        let text = String::from_utf8_lossy(&bytes);
        let machine = Parameters::embedded_default().expect("shipped").machine_config().expect("shipped");
        match Scenario::from_yaml(&text, "my.yaml").and_then(|scenario| scenario.program(&machine, None)) {
            Ok(program) => {
                let mut psec = [0.0; AXES];
                for look in 0..=LOOKS {
                    program.psec(program.duration() * f64::from(look) / f64::from(LOOKS), &mut psec);
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
