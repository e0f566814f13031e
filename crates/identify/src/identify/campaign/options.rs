//! Options of a campaign.

/// Share of Vmax and of the motor speed that is used; the rest is control reserve.
pub(super) const SPEED_RESERVE: f64 = 0.95;

/// Limits of a campaign in addition to the axis limits.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CampaignOptions {
    /// Permitted setpoint range, m or rad; the travel limits by default.
    pub range: Option<[f64; 2]>,
    /// Highest speed, m/s or rad/s; by default 20 m/min or 20 rev/min, limited by the axis.
    pub max_feed: Option<f64>,
}
