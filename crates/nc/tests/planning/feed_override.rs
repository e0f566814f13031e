//! Feed override and feed hold at random times in random programs.

use proptest::prelude::*;
use virtual_axes_nc::motion::PathControl;
use virtual_axes_nc::plan::{FeedPlanError, PlanOptions};

use crate::deviation::to_program;
use crate::limits::{Outcome, plan, plan_with};
use crate::programs::{Program, blend};
use crate::random::{controls, draws, program, tolerance};

/// Feed overrides with their number of cycles; afterwards 100 %.
fn overrides() -> impl Strategy<Value = Vec<(f64, usize)>> {
    let value = prop_oneof![Just(0.0), Just(1.0), 0.0..1.0f64, 1.0..2.0f64];
    prop::collection::vec((value, 1usize..80), 1..12)
}

fn sequence(overrides: &[(f64, usize)]) -> impl FnMut(usize) -> f64 + use<> {
    let values: Vec<f64> =
        overrides.iter().flat_map(|&(value, cycles)| std::iter::repeat_n(value, cycles)).collect();
    move |cycle| values.get(cycle).copied().unwrap_or(1.0)
}

fn deviation(program: &Program, outcome: &Outcome) -> f64 {
    let motions: Vec<_> = program.motions().collect();
    let distances = outcome.setpoints.iter().map(|s| to_program(&motions, s.place.line, s.psec()));
    distances.fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, max_shrink_iters: 200, ..ProptestConfig::default() })]

    #[test]
    fn limits_and_path_are_kept(
        draws in draws(12), feed in -2.5..-0.5f64, control in controls(), overrides in overrides(),
    ) {
        let program = program(&draws, 10f64.powf(feed), control);
        let outcome = plan_with(&program, PlanOptions::default(), sequence(&overrides)).unwrap();
        outcome.audit.assert_kept();
        let worst = deviation(&program, &outcome);
        prop_assert!(worst <= tolerance(control) + 1e-12, "deviation {worst}");
        let positions: Vec<f64> = outcome.setpoints.iter().map(|s| s.place.path_position).collect();
        prop_assert!(positions.windows(2).all(|pair| pair[1] >= pair[0]), "no motion backward");
        if let Some(last) = outcome.setpoints.last() {
            prop_assert!(last.psec().iter().zip(&program.at).all(|(a, b)| a == b));
        }
    }
}

fn square(control: PathControl) -> Program {
    let mut program = Program::new(0.1, control);
    program.line(0.05, 0.0, 0.0).line(0.05, 0.05, 0.0).arc([0.025, 0.05], std::f64::consts::PI, 0.0);
    program
}

#[test]
fn a_feed_hold_stops_and_resumes() {
    for control in [PathControl::ExactStop, blend(50e-6)] {
        let program = square(control);
        let total = plan(&program).setpoints.len();
        for start in (1..total - 2).step_by(7) {
            let hold = 150;
            let held = |cycle: usize| if (start..start + hold).contains(&cycle) { 0.0 } else { 1.0 };
            let outcome = plan_with(&program, PlanOptions::default(), held).unwrap();
            outcome.audit.assert_kept();
            // Vmax / Amax + Amax / Jmax of the slowest axis is 0.29 s, 48 cycles of 6 ms.
            let stopped = &outcome.setpoints[(start + 100).min(outcome.setpoints.len() - 1)..];
            let standstill = stopped.iter().take(hold - 100).all(|s| s.psec() == stopped[0].psec());
            assert!(standstill, "{control:?}: moves 100 cycles after a hold at cycle {start}");
            let last = outcome.setpoints.last().unwrap();
            assert!(last.psec().iter().zip(&program.at).all(|(a, b)| a == b));
        }
    }
}

#[test]
fn the_feed_follows_the_override() {
    let mut program = Program::new(0.05, PathControl::ExactStop);
    program.line(0.2, 0.0, 0.0);
    for (feed_override, expected) in [(0.5, 0.025), (1.0, 0.05), (2.0, 0.1)] {
        let outcome = plan_with(&program, PlanOptions::default(), |_| feed_override).unwrap();
        outcome.audit.assert_kept();
        let fastest = outcome.setpoints.iter().map(|s| s.place.path_rate).fold(0.0, f64::max);
        assert!((fastest - expected).abs() < 1e-12, "{feed_override}: {fastest}");
    }
}

#[test]
fn an_override_outside_its_range_is_an_error() {
    let program = square(PathControl::ExactStop);
    for value in [-0.1, 2.1, f64::NAN] {
        let result = plan_with(&program, PlanOptions::default(), |_| value);
        assert!(matches!(result, Err(FeedPlanError::InvalidOverride(_))));
    }
}
