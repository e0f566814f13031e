//! Circularity (ISO 230-4) of the ballbar test in both directions.

use virtual_axes_core::assess::{CircleAssessor, bidirectional};
use virtual_axes_verification::fixtures::machines::{Ballbar, assert_near, machine, run};

const MICROMETER: f64 = 1e-6;

/// Runs the ballbar test of Prévost et al. and returns its part at constant feed; the clockwise direction
/// has Y mirrored.
fn ballbar(counterclockwise: bool) -> CircleAssessor {
    let trial = Ballbar::paper();
    let mut assessor = CircleAssessor::new([-trial.radius, 0.0], trial.radius);
    let sign = if counterclockwise { 1.0 } else { -1.0 };
    let psec = |t| {
        let mut psec = trial.psec(t);
        psec[1] *= sign;
        psec
    };
    run(&mut machine(&[]), trial.duration(), psec, |t, machine| {
        if trial.window().contains(&t) {
            let [x, y] = [0, 1].map(|axis| machine.axes()[axis].sample().position);
            let deviation = assessor.push(x, y);
            assert_eq!(deviation, trial.radial_deviation(x, y), "contour error and radial deviation");
        }
    });
    assessor
}

#[test]
fn ballbar_radial_deviations_match_the_reference() {
    let paths = [false, true].map(ballbar);
    for path in &paths {
        let report = path.report().expect("points");
        assert_near("mean", report.mean / MICROMETER, 49.0, 0.2);
        assert_near("Fmin", report.min / MICROMETER, 47.7, 1.0);
        assert_near("Fmax", report.max / MICROMETER, 68.6, 1.0);
        let full = report.full.expect("a full circle");
        // The center is within a few micrometers of the nominal one, so G differs from Fmax − Fmin by that.
        let offset = full.center[0].hypot(full.center[1]);
        assert!((full.circular_deviation - (report.max - report.min)).abs() <= 2.0 * offset);
    }
    let both = bidirectional(&paths[0], &paths[1]).expect("two circles");
    assert_near("D", both.mean_radial_deviation / MICROMETER, 49.0, 0.2);
    for path in &paths {
        let full = path.report().and_then(|report| report.full).expect("a full circle");
        // Both lie between the two circles of G(b), about centers that differ by their offsets.
        let offset = full.center[0].hypot(full.center[1]);
        assert!(both.circular_deviation >= full.circular_deviation - 2.0 * offset);
    }
}
