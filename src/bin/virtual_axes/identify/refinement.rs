//! Parameters that the refinement adjusts: option `--refine`.

use virtual_axes_identify::identify::RefinementScope;

/// Group of parameters that the refinement adjusts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum RefinedGroup {
    /// Equivalent inertia Jeq.
    Inertia,
    /// Friction law.
    Friction,
    /// Weight, or gravity torque and phase of a tilting axis.
    Gravity,
    /// VFFW and TFFW, if their signals were not recorded.
    Feedforward,
    /// Position-loop gain, where it is fitted jointly with the delays.
    Gain,
}

/// Returns the parameters that the refinement adjusts.
pub fn refined_groups(no_refine: bool, groups: &[RefinedGroup]) -> RefinementScope {
    let has = |group: RefinedGroup| groups.contains(&group);
    match (no_refine, groups.is_empty()) {
        (true, _) => RefinementScope::NONE,
        (false, true) => RefinementScope::ALL,
        (false, false) => RefinementScope {
            inertia: has(RefinedGroup::Inertia),
            friction: has(RefinedGroup::Friction),
            gravity: has(RefinedGroup::Gravity),
            feedforward: has(RefinedGroup::Feedforward),
            gain: has(RefinedGroup::Gain),
            position_cycle: true,
        },
    }
}
