//! Elements of the friction of the axes of a block (generalized Maxwell-slip model).

use std::sync::Arc;

use pulp::Simd;

use crate::drive::{MaxwellSlip, MaxwellSlipState};
use crate::simd::{Aligned, LANES, SimdLoad, soa_struct};
use crate::state_codec::StateCodec;

soa_struct! {
    /// Step of the elements of several axes: inputs and results.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    struct ElementsStep {
        /// Speed of the motor at the start of the tick, rad/s.
        speed: N,
        /// Displacement without friction, rad.
        free: N,
        /// Displacement by the friction law, rad.
        law: N,
        /// Displacement by friction, rad.
        by_friction: N,
        /// Deflection of the bristles at the end of the tick, rad; 0 with elements.
        deflection: N,
    }
}

/// Elements of the friction of the axes of a block, and their states.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Elements {
    /// Models of the axes with elements.
    models: [Option<Arc<MaxwellSlip>>; LANES],
    pub states: [MaxwellSlipState; LANES],
    /// True if any axis has elements.
    pub is_present: bool,
}

impl Elements {
    /// Creates the elements of a block whose axes have none.
    pub fn none() -> Self {
        Elements {
            models: [const { None }; LANES],
            states: [MaxwellSlipState::default(); LANES],
            is_present: false,
        }
    }

    /// Sets the model of a lane; the forces of the elements that it has remain.
    pub fn set(&mut self, lane: usize, model: Option<Arc<MaxwellSlip>>) {
        self.states[lane].truncate(model.as_ref().map_or(0, |model| model.elements().len()));
        self.models[lane] = model;
        self.is_present = self.models.iter().any(Option::is_some);
    }

    /// Writes or replaces the state of a lane.
    pub fn code(&mut self, lane: usize, codec: &mut StateCodec<'_>) {
        if let Some(model) = &self.models[lane] {
            self.states[lane].code(model.elements().len(), codec);
        }
    }

    /// Steps the lanes with elements by one tick, each by itself; returns displacement by friction and deflection,
    /// those of `bristles` in the other lanes. See [`MaxwellSlip::step`].
    #[inline(always)]
    pub fn step<S: Simd, N: SimdLoad<S>>(
        &mut self,
        simd: S,
        index: usize,
        speed: N,
        [free, law]: [N; 2],
        (by_friction, deflection): (N, N),
    ) -> (N, N) {
        let mut rows: Aligned<ElementsStep<[f64; LANES]>> = Aligned(ElementsStep::default().fill());
        rows.0.store(index, &ElementsStep { speed, free, law, by_friction, deflection });
        for lane in index * N::LANES..(index + 1) * N::LANES {
            if let Some(model) = &self.models[lane] {
                let ElementsStep { speed, free, law, .. } = rows.0.lane(lane);
                rows.0.by_friction[lane] = model.step(free, law, speed, &mut self.states[lane]);
                rows.0.deflection[lane] = 0.0;
            }
        }
        let step: ElementsStep<N> = rows.0.load(simd, index);
        (step.by_friction, step.deflection)
    }
}
