//! Friction with presliding: bristles that deflect before the axis slides (LuGre model).

use crate::config::PreslidingConfig;
use crate::simd::{SimdReal, soa_struct};

soa_struct! {
    /// Bristle model of friction, scaled to the displacement by a torque over one tick (LuGre; Canudas de Wit et al.,
    /// IEEE Transactions on Automatic Control 40, 1995, eqs. 2 to 4).
    ///
    /// ```text
    /// dz/dt = ω − σ0 |ω| z / g(ω)          torque = σ0 z + σ1 dz/dt + σ2 ω
    /// ```
    ///
    /// z is the deflection of the bristles, rad (m for a linear motor) at the motor; g is the friction law without its
    /// viscous part σ2. At constant speed the torque is that of the law.
    ///
    /// A tick h solves the equations by the implicit Euler method over the displacement y of the motor, with g at the
    /// speed at the start of the tick:
    ///
    /// ```text
    /// z′ = z + y − σ0 |y| z′ / g           torque = σ0 z′ + σ1 (z′ − z)/h + σ2 y/h          y = y_free − q · torque
    /// ```
    ///
    /// y_free is the displacement without friction, q > 0 the displacement per torque. The equation of y is quadratic,
    /// with one solution in the direction of y₀ = y_free − q σ0 z. The work of the constant torque over the tick is
    /// torque · y: it is at least the change of σ0 z²/2, so that friction never supplies energy, if σ1 |y| ≤ 4 g h. σ1 is
    /// limited to that at |y₀|, which |y| does not exceed.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Presliding {
        /// q σ0.
        pub(super) stiffness: N,
        /// q σ1/h.
        damping: N,
        /// q σ2/h.
        viscosity: N,
    }
}

impl Presliding {
    /// Returns the model of an axis without presliding.
    pub fn none() -> Self {
        Presliding { stiffness: 0.0, damping: 0.0, viscosity: 0.0 }
    }

    /// Scales the model with viscosity σ2 (N·m·s/rad) to ticks of `period` seconds, in which a constant torque of 1 N·m
    /// displaces the motor by `angle_per_torque`, rad.
    pub fn new(config: &PreslidingConfig, viscosity: f64, period: f64, angle_per_torque: f64) -> Self {
        Presliding {
            stiffness: angle_per_torque * config.stiffness,
            damping: angle_per_torque * config.damping / period,
            viscosity: angle_per_torque * viscosity / period,
        }
    }

    /// Returns true if friction has presliding.
    #[inline]
    pub fn is_present(&self) -> bool {
        self.stiffness > 0.0
    }
}

impl<N: SimdReal> Presliding<N> {
    /// Returns the displacement by friction over a tick, q · torque, and the deflection at its end.
    ///
    /// `free` is the displacement without friction, `law` is q g (not negative), and `deflection` is that at the start of
    /// the tick; all in rad at the motor.
    #[inline(always)]
    pub fn step(&self, free: N, law: N, deflection: N) -> (N, N) {
        let zero = law.splat(0.0);
        let Presliding { stiffness, viscosity, .. } = *self;
        let largest = free - stiffness * deflection;
        let is_forward = zero.simd_lt(largest);
        // Sizes in the direction of y.
        let directed = |value: N| value.select(is_forward, -value);
        let (directed_free, bristle) = (directed(free), directed(deflection));
        let damping = (law.splat(4.0) * law / largest.abs()).min(self.damping);
        let rest = viscosity + law.splat(1.0);
        // a x² + b x − c = 0 for the size x of y, with a > 0 and c ≥ 0.
        let a = stiffness * rest;
        let sliding = stiffness * damping.mul_add(bristle, directed_free);
        let b = law.mul_add(rest + stiffness + damping, -sliding);
        let c = law * directed(largest);
        let root = (a * c).mul_add(law.splat(4.0), b * b).sqrt();
        // The form without cancellation.
        let size = ((c + c) / (b + root)).select(zero.simd_lt(b), (root - b) / (a + a));
        let displacement = directed(size);
        let divisor = stiffness.mul_add(size, law).max(law.splat(f64::MIN_POSITIVE));
        let next = (deflection + displacement) * law / divisor;
        (free - displacement, next)
    }
}
