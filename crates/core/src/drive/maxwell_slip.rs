//! Friction with presliding by elements in parallel (generalized Maxwell-slip model, GMS).

use super::Friction;
use crate::config::AxisConfig;
use crate::state_codec::StateCodec;

/// Largest number of elements of a [`MaxwellSlip`].
pub const MAX_ELEMENTS: usize = 10;
/// Distance of the last two knots of the first loading curve in lengths g/σ0.
const LAST_SEGMENT: f64 = 2.0;

/// Element of a [`MaxwellSlip`]: a spring in series with a slider.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MaxwellSlipElement {
    /// Stiffness k, N·m/rad (N/m for a linear motor).
    pub stiffness: f64,
    /// Share α of the friction law; those of all elements have the sum 1.
    pub share: f64,
}

impl MaxwellSlipElement {
    /// Returns `count` elements (at most [`MAX_ELEMENTS`]) with the first loading curve of the LuGre model with a
    /// stiffness σ0.
    ///
    /// The curve over the displacement x is the polygon with the knots
    ///
    /// ```text
    /// xⱼ = ξⱼ g/σ0                      F(xⱼ) = g j/N                        j = 1 … N
    /// ξⱼ = −ln(1 − j/N) for j < N       ξ_N = ξ_(N−1) + 2
    /// ```
    ///
    /// The first N − 1 knots are points of the curve of the LuGre model, g (1 − exp(−σ0 x/g)). Beyond them both curves
    /// have the same area below g, hence the same work. With the slopes mⱼ of the segments and m_(N+1) = 0, element
    /// j has
    ///
    /// ```text
    /// kⱼ = mⱼ − m_(j+1)                 αⱼ = ξⱼ kⱼ/σ0
    /// ```
    ///
    /// so that it slips at xⱼ for every g. The total force is g (Σ α = 1), the stiffness at the start is Σ k = m₁ =
    /// σ0/(−N ln(1 − 1/N)): 0.72 σ0 with 2 elements, 0.87 σ0 with 4, 0.95 σ0 with 10. One element has σ0/2.
    pub fn of_loading_curve(count: usize, stiffness: f64) -> Vec<Self> {
        let count = count.min(MAX_ELEMENTS);
        let number = count as f64;
        let knot = |j: usize| match j {
            0 => 0.0,
            j if j < count => -(1.0 - j as f64 / number).ln(),
            _ => number.ln() + LAST_SEGMENT,
        };
        // Slope of segment j, relative to σ0.
        let slope = |j: usize| if j > count { 0.0 } else { 1.0 / (number * (knot(j) - knot(j - 1))) };
        let element = |j: usize| {
            let relative = slope(j) - slope(j + 1);
            MaxwellSlipElement { stiffness: stiffness * relative, share: relative * knot(j) }
        };
        (1..=count).map(element).collect()
    }
}

/// State of a [`MaxwellSlip`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MaxwellSlipState {
    /// Forces of the elements, N·m (N for a linear motor).
    pub forces: [f64; MAX_ELEMENTS],
    /// True for the elements that have slipped over the last tick, in the direction of their force.
    pub is_slipping: [bool; MAX_ELEMENTS],
}

impl MaxwellSlipState {
    /// Writes or replaces the state of the first `count` elements.
    pub(crate) fn code(&mut self, count: usize, codec: &mut StateCodec<'_>) {
        codec.numbers(&mut self.forces[..count]);
        self.is_slipping[..count].iter_mut().for_each(|is_slipping| codec.flag(is_slipping));
    }

    /// Sets the state of the elements from `count` on to 0.
    pub(crate) fn truncate(&mut self, count: usize) {
        self.forces[count..].fill(0.0);
        self.is_slipping[count..].fill(false);
    }
}

/// Friction as a sum of elements that stick or slip (generalized Maxwell-slip model; Lampaert, Al-Bender and Swevers,
/// Physics and Control 2003; Al-Bender, Lampaert and Swevers, IEEE Transactions on Automatic Control 50 (11), 2005).
///
/// ```text
/// sticking:  dFᵢ/dt = kᵢ ω                        until Fᵢ reaches αᵢ g(ω) in the direction of motion
/// slipping:  dFᵢ/dt = sgn(ω) C (αᵢ − |Fᵢ|/g(ω))   until ω changes its sign
/// torque = Σ Fᵢ + σ2 ω
/// ```
///
/// g is the friction law without its viscous part σ2, C the attraction, N·m/s. Without C a slipping element follows
/// αᵢ g at once. Below breakaway the torque is a function of the displacements at the reversals that are not yet
/// wiped out (nonlocal memory): closed loops of the displacement are closed loops of the torque, and an axis does not
/// creep.
///
/// A tick h solves the equations by the implicit Euler method over the displacement y of the motor, with g and the
/// direction of slip at the speed at the start of the tick:
///
/// ```text
/// Fᵢ′ = P(Fᵢ + kᵢ y)                 torque = Σ Fᵢ′ + σ2 y/h             y = y_free − q · torque
/// ```
///
/// P limits to the range −Lᵢ⁻ … Lᵢ⁺. An element that sticks has Lᵢ = αᵢ g; one that slips has the force of the law of
/// C at the end of the tick, Lᵢ = Fᵢ + (αᵢ g − Fᵢ) h C/(g + h C) in its direction. y_free is the displacement without
/// friction, q > 0 the displacement per torque. The torque is piecewise linear and does not decrease with y, and the
/// equation of y is concave in the direction of motion: Newton's method from y = 0 ends at the exact solution after
/// at most N + 1 steps.
///
/// Friction never supplies energy. Fᵢ′ is the point of a range with 0 in it that is next to Fᵢ + kᵢ y, so that
/// Fᵢ′ (Fᵢ + kᵢ y − Fᵢ′) ≥ 0. Hence the work Fᵢ′ y ≥ Fᵢ′ (Fᵢ′ − Fᵢ)/kᵢ = (Fᵢ′² − Fᵢ²)/(2 kᵢ) + (Fᵢ′ − Fᵢ)²/(2 kᵢ), at
/// least the change of the energy of the spring; this holds for all limits Lᵢ ≥ 0, and a force that is limited before
/// y is known only loses energy.
#[derive(Debug, Clone, PartialEq)]
pub struct MaxwellSlip {
    elements: [MaxwellSlipElement; MAX_ELEMENTS],
    count: usize,
    /// h C, N·m; infinite if a slipping element follows the law at once.
    attraction: f64,
    /// q σ2/h.
    viscosity: f64,
    /// q, rad/(N·m).
    angle_per_torque: f64,
    /// 1/q.
    torque_per_angle: f64,
}

/// Element over a tick, with signs in one direction.
#[derive(Clone, Copy, Default)]
struct Directed {
    stiffness: f64,
    force: f64,
    /// Largest force in the direction.
    limit: f64,
    /// Largest force in the opposite direction.
    opposite_limit: f64,
    /// True for an element that goes on to slip.
    slips: bool,
    /// True for an element at its limit at the end of the tick.
    is_limited: bool,
}

impl MaxwellSlip {
    /// Creates the model of at most [`MAX_ELEMENTS`] elements with an attraction C (N·m/s; `None` if slipping
    /// elements follow the law at once) and a viscosity σ2 (N·m·s/rad) for ticks of `period` seconds, in which a
    /// constant torque of 1 N·m displaces the motor by `angle_per_torque`, rad. Further elements are left out.
    pub fn new(
        elements: &[MaxwellSlipElement],
        attraction: Option<f64>,
        viscosity: f64,
        period: f64,
        angle_per_torque: f64,
    ) -> Self {
        let count = elements.len().min(MAX_ELEMENTS);
        let mut own = [MaxwellSlipElement::default(); MAX_ELEMENTS];
        own[..count].copy_from_slice(&elements[..count]);
        MaxwellSlip {
            elements: own,
            count,
            attraction: attraction.map_or(f64::INFINITY, |attraction| attraction * period),
            viscosity: angle_per_torque * viscosity / period,
            angle_per_torque,
            torque_per_angle: 1.0 / angle_per_torque,
        }
    }

    /// Creates the model of an axis with its deviation over ticks of `period` seconds, in which a constant torque of 1 N·m
    /// displaces the motor by `angle_per_torque`, rad. Returns `None` for an axis without elements.
    pub fn of_axis(axis: &AxisConfig, angle_per_torque: f64, period: f64) -> Option<Self> {
        let presliding = axis.presliding.filter(|presliding| presliding.elements > 0)?;
        let deviation = axis.deviation.friction;
        // After a reversal the curve has twice the length of the first loading curve, with the same slope (Masing's rule), that
        // of the LuGre model the slope 2 σ0: with twice the stiffness both have the same curve after a reversal.
        let stiffness = 2.0 * presliding.stiffness * deviation;
        let elements = MaxwellSlipElement::of_loading_curve(presliding.elements, stiffness);
        let (_, viscosity) = Friction::of_axis(axis, axis.motor.torque_constant * deviation).of_presliding();
        let attraction = presliding.attraction.map(|attraction| attraction * deviation);
        Some(MaxwellSlip::new(&elements, attraction, viscosity, period, angle_per_torque))
    }

    /// Returns the elements.
    pub fn elements(&self) -> &[MaxwellSlipElement] {
        &self.elements[..self.count]
    }

    /// Returns the energy of the springs, J.
    pub fn energy(&self, state: &MaxwellSlipState) -> f64 {
        let energy = |(element, force): (&MaxwellSlipElement, &f64)| match element.stiffness {
            0.0 => 0.0,
            stiffness => force * force / (2.0 * stiffness),
        };
        self.elements().iter().zip(&state.forces).map(energy).sum()
    }

    /// Steps the elements by one tick; returns the displacement by friction, q · torque.
    ///
    /// `free` is the displacement without friction, `law` is q g (not negative), both in rad at the motor; `speed` is
    /// that of the motor at the start of the tick, rad/s.
    #[inline]
    pub fn step(&self, free: f64, law: f64, speed: f64, state: &mut MaxwellSlipState) -> f64 {
        let law = law * self.torque_per_angle;
        let weight = match self.attraction {
            attraction if attraction.is_infinite() => 1.0,
            attraction => attraction / (law + attraction),
        };
        // Signs in the direction of the motion. An axis at rest has none, and its elements stick.
        let (along, moves) = (if speed < 0.0 { -1.0 } else { 1.0 }, speed != 0.0);
        let mut elements = [Directed::default(); MAX_ELEMENTS];
        let elements = &mut elements[..self.count];
        let mut sum = 0.0;
        for (k, directed) in elements.iter_mut().enumerate() {
            let MaxwellSlipElement { stiffness, share } = self.elements[k];
            let (level, force) = (share * law, along * state.forces[k]);
            let relaxed = force + (level - force) * weight;
            let is_above = force > level;
            let slips = moves && state.is_slipping[k] && force > 0.0;
            *directed = Directed {
                stiffness,
                force: if moves && is_above { relaxed } else { force },
                limit: if moves && (is_above || slips) { relaxed } else { level.max(force) },
                opposite_limit: level.max(-force),
                slips,
                is_limited: false,
            };
            sum += directed.force;
        }
        let is_along = along * free > self.angle_per_torque * sum;
        if !is_along {
            for element in elements.iter_mut() {
                *element = Directed {
                    force: -element.force,
                    limit: element.opposite_limit,
                    slips: false,
                    ..*element
                };
            }
        }
        let direction = if is_along { along } else { -along };
        let size = self.solve(elements, direction * free);
        for (k, element) in elements.iter().enumerate() {
            let spring = element.force + element.stiffness * size;
            let force = if element.is_limited { element.limit } else { spring.min(element.limit) };
            state.forces[k] = direction * force;
            state.is_slipping[k] = element.is_limited || element.slips;
        }
        free - direction * size
    }

    /// Returns the size of the displacement, and marks the elements at their limit; `free` is the displacement without
    /// friction, in the direction of the displacement.
    #[inline]
    fn solve(&self, elements: &mut [Directed], free: f64) -> f64 {
        let q = self.angle_per_torque;
        loop {
            let (mut force, mut stiffness) = (0.0, 0.0);
            for element in &*elements {
                force += if element.is_limited { element.limit } else { element.force };
                stiffness += if element.is_limited { 0.0 } else { element.stiffness };
            }
            let size = ((free - q * force) / (1.0 + self.viscosity + q * stiffness)).max(0.0);
            let mut is_solved = true;
            for element in elements.iter_mut() {
                let is_beyond = element.limit - element.force < element.stiffness * size;
                is_solved &= element.is_limited || !is_beyond;
                element.is_limited |= is_beyond;
            }
            if is_solved {
                return size;
            }
        }
    }
}
