//! Elements of a published model of hysteresis: first loading, loops and work of a cycle in closed form.

use virtual_axes_core::drive::{MAX_ELEMENTS, MaxwellSlipElement};

use crate::gms::MovedElements;

/// Elements of the four-parameter Iwan model, a continuum of Maxwell-slip elements: D. J. Segalman, "A four-parameter
/// Iwan model for lap-type joints", Journal of Applied Mechanics 72 (2005), 752–760.
struct Iwan {
    /// Stiffness K_T of the first loading.
    stiffness: f64,
    /// Largest force F_S.
    largest: f64,
    /// Exponent χ of the density of the elements, R φ^χ over the displacement φ at which they slip.
    exponent: f64,
    /// Ratio β of the stiffness of the elements that slip last, all at φ_max, to that of the others.
    ratio: f64,
}

impl Iwan {
    /// Returns φ_max.
    fn last_slip(&self) -> f64 {
        let Iwan { stiffness, largest, exponent: chi, ratio: beta } = self;
        largest * (1.0 + beta) / (stiffness * (beta + (chi + 1.0) / (chi + 2.0)))
    }

    /// Returns R.
    fn density(&self) -> f64 {
        let Iwan { largest, exponent: chi, ratio: beta, .. } = self;
        largest * (chi + 1.0) / (self.last_slip().powf(chi + 2.0) * (beta + (chi + 1.0) / (chi + 2.0)))
    }

    /// Returns the force of the first loading at a displacement.
    fn first_loading(&self, displacement: f64) -> f64 {
        let chi = self.exponent;
        let softening = self.density() * displacement.powf(chi + 2.0) / ((chi + 1.0) * (chi + 2.0));
        if displacement < self.last_slip() { self.stiffness * displacement - softening } else { self.largest }
    }

    /// Returns the work that a cycle between two displacements of this size, less than φ_max, dissipates.
    fn work_of_cycle(&self, size: f64) -> f64 {
        let chi = self.exponent;
        4.0 * self.density() * size.powf(chi + 3.0) / ((chi + 2.0) * (chi + 3.0))
    }

    /// Returns `MAX_ELEMENTS` elements: one for each of equal parts of 0 … φ_max, with the stiffness and the force of
    /// the continuum there, and the one at φ_max.
    fn elements(&self) -> Vec<MaxwellSlipElement> {
        let (chi, parts) = (self.exponent, MAX_ELEMENTS - 1);
        let part = |j: usize, power: f64| {
            let edge = |j: usize| (self.last_slip() * j as f64 / parts as f64).powf(chi + power);
            self.density() * (edge(j) - edge(j - 1)) / (chi + power)
        };
        let mut elements: Vec<MaxwellSlipElement> = (1..=parts)
            .map(|j| MaxwellSlipElement { stiffness: part(j, 1.0), share: part(j, 2.0) / self.largest })
            .collect();
        let rest = self.stiffness * self.ratio / (1.0 + self.ratio);
        elements.push(MaxwellSlipElement { stiffness: rest, share: rest * self.last_slip() / self.largest });
        elements
    }
}

/// The first loading, the stiffness at its start, and the hysteresis loops of the published model, for values of a
/// test of Tribomechadynamics' TMDSimPy (K_T = 2, F_S = 3, χ = −0.1, β = 0.1) and for the range of χ of the paper.
#[test]
fn a_discretized_iwan_model_has_the_published_hysteresis_loops() {
    for (exponent, ratio) in [(-0.1, 0.1), (-0.8, 0.0), (-0.5, 1.0), (-0.2, 5.0)] {
        let iwan = Iwan { stiffness: 2.0, largest: 3.0, exponent, ratio };
        let elements = iwan.elements();
        let stiffness: f64 = elements.iter().map(|e| e.stiffness).sum();
        let share: f64 = elements.iter().map(|e| e.share).sum();
        assert!((stiffness - 2.0).abs() < 1e-14 && (share - 1.0).abs() < 1e-14, "{stiffness}, {share}");
        let new = || MovedElements::of(&elements, iwan.largest);
        let edge = |j: usize| iwan.last_slip() * j as f64 / (MAX_ELEMENTS - 1) as f64;
        let mut worst = 0.0_f64;
        for most in 1..MAX_ELEMENTS {
            let mut moved = new();
            for j in 1..=most {
                worst = worst.max((moved.move_to(edge(j)) - iwan.first_loading(edge(j))).abs());
            }
            // Masing's rule, to the opposite reversal and back.
            for direction in [-1.0, 1.0] {
                for j in 1..=most {
                    let force = moved.move_to(direction * (2.0 * edge(j) - edge(most)));
                    let exact = 2.0 * iwan.first_loading(edge(j)) - iwan.first_loading(edge(most));
                    worst = worst.max((force - direction * exact).abs());
                }
            }
        }
        assert!(worst < 1e-9, "χ = {exponent}, β = {ratio}: {worst:e}");
        // The loops run through the same points, and between them beside those of the continuum.
        let size = iwan.last_slip();
        let mut moved = new();
        moved.move_to(size);
        let before = moved.work;
        for to in [-size, size] {
            moved.move_to(to);
        }
        let work = moved.work - before;
        let difference = work / iwan.work_of_cycle(size) - 1.0;
        println!(
            "χ = {exponent}, β = {ratio}: force {worst:.1e}, work of a cycle {:+.2} %",
            100.0 * difference
        );
        assert!(difference.abs() < 0.02, "{difference}");
    }
}
