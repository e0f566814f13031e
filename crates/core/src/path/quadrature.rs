//! Gauss–Legendre quadrature.

/// Positive nodes of the eight-point rule on [−1, 1] (Abramowitz and Stegun, table 25.4).
const NODES: [f64; 4] =
    [0.183_434_642_495_649_8, 0.525_532_409_916_329, 0.796_666_477_413_626_7, 0.960_289_856_497_536_2];
/// Weights of these nodes.
const WEIGHTS: [f64; 4] =
    [0.362_683_783_378_362, 0.313_706_645_877_887_3, 0.222_381_034_453_374_48, 0.101_228_536_290_376_26];

/// Integrates a function from `from` to `to` by the eight-point Gauss–Legendre rule, exact for polynomials of degree
/// 15; `f` returns the values of the function at all nodes.
#[inline]
pub(super) fn integrate(from: f64, to: f64, f: impl Fn([f64; 8]) -> [f64; 8]) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let [a, b, c, d] = NODES.map(|x| half * x);
    let nodes = [-a, -b, -c, -d, a, b, c, d].map(|offset| middle + offset);
    let values = f(nodes);
    let (before, behind) = values.split_at(WEIGHTS.len());
    let pairs = WEIGHTS.iter().zip(before.iter().zip(behind));
    half * pairs.map(|(w, (before, behind))| w * (before + behind)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_degree_15_are_integrated_exactly() {
        for degree in 0..=15 {
            let exact = 2.0_f64.powi(degree + 1) / f64::from(degree + 1);
            let found = integrate(0.0, 2.0, |nodes| nodes.map(|x| x.powi(degree)));
            assert!((found / exact - 1.0).abs() < 1e-14, "degree {degree}: {found}, wanted {exact}");
        }
    }
}
