//! Campaign setpoints: they keep all limits and contain the excitation that the identification needs.

use proptest::prelude::*;
use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::units::{DEGREE, MILLIMETER, RPM, seconds};
use virtual_axes_identify::identify::FeedforwardMode;
use virtual_axes_identify::identify::campaign::{Campaign, CampaignError, CampaignOptions};
use virtual_axes_verification::fixtures::machines::{M_MIN, TSP, parameters};
use virtual_axes_verification::fixtures::recordings::{
    Disturbance, axis_index, machine_with_feedforward, record,
};

const MACHINES: [&str; 2] = ["mikron_ucp710", "linear_motor_center"];
const AXES: [&str; 5] = ["x", "y", "z", "a", "c"];
/// Relative tolerance of the limits, as for every path of this crate.
const TOLERANCE: f64 = 1e-6;

fn shipped(machine: &str) -> MachineConfig {
    Parameters::load(machine, virtual_axes_builtin::MACHINES)
        .expect("shipped")
        .machine_config()
        .expect("valid")
}

fn plan(
    machine: &MachineConfig,
    axis: &str,
    parts: &[FeedforwardMode],
    options: &CampaignOptions,
) -> Campaign {
    Campaign::plan(machine, axis_index(machine, axis), parts, options)
        .unwrap_or_else(|error| panic!("{} {axis}: {error}", machine.name()))
}

/// Returns the largest first, second and third difference quotient of the setpoints; at rest before the first
/// one.
fn differences(campaign: &Campaign) -> [f64; 3] {
    let psec = campaign.psec();
    let period = seconds(campaign.period());
    let at = |k: i64| psec[k.clamp(0, psec.len() as i64 - 1) as usize];
    let mut largest = [0.0_f64; 3];
    for k in 0..psec.len() as i64 + 3 {
        let [a, b, c, d] = std::array::from_fn(|i| at(k - 3 + i as i64));
        let found = [
            (d - c) / period,
            (d - 2.0 * c + b) / period.powi(2),
            (d - 3.0 * c + 3.0 * b - a) / period.powi(3),
        ];
        for (largest, found) in largest.iter_mut().zip(found) {
            *largest = largest.max(found.abs());
        }
    }
    largest
}

/// Checks the properties of every campaign within `range`.
fn check(campaign: &Campaign, limits: &JointLimits, range: [f64; 2], top: f64) -> Result<(), String> {
    let psec = campaign.psec();
    let [speed, acceleration, jerk] = differences(campaign);
    let l = &limits.limits;
    for (what, found, allowed) in [
        ("speed", speed, top),
        ("Vmax", speed, l.velocity),
        ("Amax", acceleration, l.acceleration),
        ("Jmax", jerk, l.jerk),
    ] {
        if found > allowed * (1.0 + TOLERANCE) {
            return Err(format!("{what}: {found} of {allowed}"));
        }
    }
    // Only home may be closer to the end than the margin.
    let margin = if (range[1] - range[0]).is_finite() { 0.05 * (range[1] - range[0]) } else { 0.0 };
    let slack = 1e-12;
    let (low, high) = (range[0] + margin - slack, range[1] - margin + slack);
    let start = campaign.start();
    let between = |value: f64| value >= low.min(start) && value <= high.max(start);
    if let Some(outside) = psec.iter().find(|value| !between(**value)) {
        return Err(format!("{outside} outside {low} … {high}, start {start}"));
    }
    let home = range[0] <= 0.0 && range[1] >= 0.0;
    let nearest = if range[0] > 0.0 { range[0] + margin } else { range[1] - margin };
    if home != (start == 0.0) || !home && (start - nearest).abs() > slack {
        return Err(format!("starts at {start}"));
    }
    let rest = (1.0 / seconds(campaign.period())) as usize;
    for run in campaign.runs() {
        let rows = &psec[run.rows.clone()];
        let ends = rows[..rest].iter().chain(&rows[rows.len() - rest..]);
        if let Some(moved) = ends.into_iter().find(|value| **value != start) {
            return Err(format!("{}: {moved} while at rest at {start}", run.part.name()));
        }
    }
    Ok(())
}

#[test]
fn campaigns_of_the_shipped_machines_keep_the_limits_of_their_axes() {
    for machine in MACHINES {
        let config = shipped(machine);
        for axis in AXES {
            let campaign = plan(&config, axis, &FeedforwardMode::ALL, &CampaignOptions::default());
            let limits = JointLimits::from_axis(&config.axes()[axis_index(&config, axis)]);
            let range = [limits.limits.travel_min, limits.limits.travel_max];
            let checked = check(&campaign, &limits, range, 0.95 * limits.limits.velocity);
            assert_eq!(checked, Ok(()), "{machine} {axis}");
            let lasts: Vec<f64> =
                campaign.runs().iter().map(|run| campaign.times(run)).map(|[from, to]| to - from).collect();
            println!("{machine} {axis}: {lasts:.1?} s");
            assert!(lasts[0] < 200.0 && lasts[1] < 20.0 && lasts[2] < 20.0, "{machine} {axis}: {lasts:?}");
        }
    }
    let x = plan(&shipped(MACHINES[0]), "x", &[FeedforwardMode::Off], &CampaignOptions::default());
    assert!(x.psec().len() as f64 * TSP < 120.0);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_campaign_of_any_linear_axis_keeps_its_limits(
        velocity in 0.5..120.0f64, acceleration in 0.2..20.0f64, jerk in 5.0..800.0f64,
        motor in 100.0..6000.0f64, gain in 0.3..6.0f64,
        travel in (-800.0..0.0f64, 0.1..800.0f64),
        range in prop::option::of((0.0..1.0f64, 0.0..1.0f64)),
        feed in prop::option::of(0.01..1.0f64),
    ) {
        let changes = [
            ("x.limits.velocity_m_min", velocity),
            ("x.limits.acceleration_m_s2", acceleration),
            ("x.limits.jerk_m_s3", jerk),
            ("x.limits.travel_min_mm", travel.0),
            ("x.limits.travel_max_mm", travel.1),
            ("x.motor.max_speed_rpm", motor),
            ("x.position_loop.gain", gain),
        ];
        // Screw lead 20 mm.
        let top = 0.95 * velocity.min(motor * 0.020) * M_MIN;
        let travel = [travel.0 * MILLIMETER, travel.1 * MILLIMETER];
        any_axis("x", &changes, travel, range, feed, top)?;
    }

    #[test]
    fn a_campaign_of_any_rotary_axis_keeps_its_limits(
        velocity in 0.5..100.0f64, acceleration in 0.05..20.0f64, jerk in 1.0..500.0f64,
        motor in 100.0..20000.0f64, gain in 0.3..6.0f64,
        travel in (-800.0..0.0f64, 1.0..800.0f64),
        range in prop::option::of((0.0..1.0f64, 0.0..1.0f64)),
        feed in prop::option::of(0.02..1.0f64),
    ) {
        let changes = [
            ("a.limits.velocity_rpm", velocity),
            ("a.limits.acceleration_rev_s2", acceleration),
            ("a.limits.jerk_rev_s3", jerk),
            ("a.limits.travel_min_deg", travel.0),
            ("a.limits.travel_max_deg", travel.1),
            ("a.motor.max_speed_rpm", motor),
            ("a.position_loop.gain", gain),
        ];
        // Gear ratio 180 : 1.
        let top = 0.95 * velocity.min(motor / 180.0) * RPM;
        let travel = [travel.0 * DEGREE, travel.1 * DEGREE];
        any_axis("a", &changes, travel, range, feed, top)?;
    }
}

/// Plans for an axis of the default machine with `changes`, in a part of `travel`, at a part of its speed
/// `top`.
fn any_axis(
    axis: &str,
    changes: &[(&str, f64)],
    travel: [f64; 2],
    range: Option<(f64, f64)>,
    feed: Option<f64>,
    top: f64,
) -> Result<(), TestCaseError> {
    let config = parameters(changes).machine_config().expect("valid");
    let index = axis_index(&config, axis);
    let limits = JointLimits::from_axis(&config.axes()[index]);
    let at = |part: f64| travel[0] + part * (travel[1] - travel[0]);
    let range = range.map(|(a, b)| [at(a.min(b)), at(a.max(b))]).filter(|range| range[0] < range[1]);
    let within = range.unwrap_or(travel);
    let mut options = CampaignOptions { range, max_feed: feed.map(|part| part * top) };
    let unit = if axis == "x" { M_MIN } else { RPM };
    let mut found = Campaign::plan(&config, index, &FeedforwardMode::ALL, &options);
    if let Err(CampaignError::TooShort { possible, .. }) = found {
        // The feed of the message is valid.
        options.max_feed = Some(possible * unit);
        found = Campaign::plan(&config, index, &FeedforwardMode::ALL, &options);
        prop_assert!(!matches!(found, Err(CampaignError::TooShort { .. })), "{found:?}");
    }
    match found {
        Ok(campaign) => {
            let top = options.max_feed.unwrap_or(top.min(20.0 * unit));
            let checked = check(&campaign, &limits, within, top);
            prop_assert!(checked.is_ok(), "{checked:?}");
            for run in campaign.runs() {
                let highest = run.speeds.last().copied().unwrap_or(0.0);
                prop_assert!((highest / top - 1.0).abs() < 1e-9, "{highest} {top}");
            }
        }
        Err(error) => prop_assert!(matches!(error, CampaignError::TooLong { .. }), "{error}"),
    }
    Ok(())
}

#[test]
fn the_range_in_the_rejection_is_sufficient() {
    let config = shipped(MACHINES[0]);
    let planned = |millimeters: f64| {
        let range = Some([0.0, millimeters * MILLIMETER]);
        Campaign::plan(&config, 0, &[FeedforwardMode::Off], &CampaignOptions { range, max_feed: None })
    };
    let Err(CampaignError::TooShort { found, needed, .. }) = planned(100.0) else { panic!("100 mm do") };
    assert_eq!(found, 100.0);
    // v/a + a/j for both ramps, 8/Kp + α to settle (Kp 25 1/s) and 0.4 s at 20 m/min, in nine tenths.
    let speed = 20.0 * M_MIN;
    let wanted = (speed * (speed / 2.5 + 2.5 / 50.0) + speed * (8.0 / 25.0 + 0.009 + 0.4)) / 0.9 / MILLIMETER;
    assert!(needed >= wanted && needed < wanted + 0.1, "{needed} {wanted}");
    assert!(planned(needed).is_ok());
    assert!(planned(needed - 0.2).is_err());
}

#[test]
fn ranges_and_feeds_beyond_the_axis_are_rejected() {
    let config = shipped(MACHINES[0]);
    let rejected = |axis: usize, range: Option<[f64; 2]>, max_feed: Option<f64>| {
        let error =
            Campaign::plan(&config, axis, &FeedforwardMode::ALL, &CampaignOptions { range, max_feed })
                .unwrap_err();
        println!("{error}");
        error
    };
    for range in [[-0.4, 0.1], [0.1, 0.4], [0.1, -0.1], [0.1, 0.1], [f64::NAN, 0.1], [0.0, f64::INFINITY]] {
        assert!(matches!(rejected(0, Some(range), None), CampaignError::Range { .. }), "{range:?}");
    }
    for feed in [0.0, -1.0, f64::NAN, f64::INFINITY, 28.6 * M_MIN] {
        assert!(matches!(rejected(0, None, Some(feed)), CampaignError::Feed { .. }), "{feed}");
    }
    assert_eq!(rejected(5, None, None), CampaignError::NoAxis { number: 6, count: 5 });
    // The campaign would take days.
    let slow = CampaignOptions { range: None, max_feed: Some(1e-4 * RPM) };
    let error = Campaign::plan(&config, 4, &[FeedforwardMode::Off], &slow).unwrap_err();
    assert!(matches!(error, CampaignError::TooLong { part: "off", .. }), "{error}");
}

/// Returns the velocity setpoint before each row, m/s or rad/s.
fn velocities(psec: &[f64], period: f64) -> Vec<f64> {
    std::iter::once(0.0).chain(psec.windows(2).map(|pair| (pair[1] - pair[0]) / period)).collect()
}

#[test]
fn the_long_part_accelerates_dozens_of_times_at_half_and_at_full_acceleration() {
    for machine in MACHINES {
        let config = shipped(machine);
        let period = seconds(config.periods().position);
        for axis in AXES {
            let limits = JointLimits::from_axis(&config.axes()[axis_index(&config, axis)]).limits;
            let campaign = plan(&config, axis, &[FeedforwardMode::Off], &CampaignOptions::default());
            let velocity = velocities(campaign.psec(), period);
            // A ramp from rest with jerk j reaches at most the acceleration √(v j).
            let top = campaign.runs()[0].speeds.last().copied().expect("speeds");
            let full = (top * limits.jerk).sqrt().min(limits.acceleration);
            let half = 0.5 * limits.acceleration;
            // Peak acceleration of each phase; a phase ends where the acceleration falls to half of the
            // smaller one.
            let mut peaks = Vec::new();
            let mut peak = 0.0_f64;
            for pair in velocity.windows(2) {
                let acceleration = (pair[1] - pair[0]).abs() / period;
                if acceleration > 0.5 * half {
                    peak = peak.max(acceleration);
                } else if peak > 0.0 {
                    peaks.push(std::mem::take(&mut peak));
                }
            }
            // Differences flatten the peaks of short ramps.
            let count = |wanted: f64| peaks.iter().filter(|peak| (*peak / wanted - 1.0).abs() < 0.03).count();
            println!("{machine} {axis}: {} at {half:.2}, {} at {full:.2}", count(half), count(full));
            assert!(count(half) >= 36 && count(full) >= 36, "{machine} {axis}: {peaks:.2?}");
        }
    }
}

#[test]
fn standstills_are_approached_from_both_sides_over_the_whole_range() {
    for machine in MACHINES {
        let config = shipped(machine);
        let period = seconds(config.periods().position);
        for axis in AXES {
            let campaign = plan(&config, axis, &[FeedforwardMode::Off], &CampaignOptions::default());
            let psec = campaign.psec();
            let velocity = velocities(psec, period);
            // Positions of standstills of at least 0.75 s, and the side of approach.
            let mut positions: Vec<(f64, bool)> = Vec::new();
            let mut from = false;
            let mut since = 0;
            for (position, velocity) in psec.iter().zip(&velocity) {
                since = if *velocity == 0.0 { since + 1 } else { 0 };
                if *velocity != 0.0 {
                    from = *velocity > 0.0;
                }
                if since == (0.75 / period) as usize {
                    positions.push((*position, from));
                }
            }
            let both = |(position, from): &&(f64, bool)| {
                *from && positions.iter().any(|(other, from)| !from && (other - position).abs() < 1e-9)
            };
            let both: Vec<f64> = positions.iter().filter(both).map(|(position, _)| *position).collect();
            let [low, high] = campaign.range();
            let spread = both.iter().fold(f64::NEG_INFINITY, |m, p| m.max(*p))
                - both.iter().fold(f64::INFINITY, |m, p| m.min(*p));
            assert!(both.len() >= 5 && spread > 0.7 * (high - low), "{machine} {axis}: {both:?}");
        }
    }
}

#[test]
fn a_rotary_axis_sweeps_its_range_or_a_full_turn_at_two_speeds() {
    for machine in MACHINES {
        let config = shipped(machine);
        let period = seconds(config.periods().position);
        for (axis, wanted) in [("a", 0.8), ("c", 0.0)] {
            let campaign = plan(&config, axis, &[FeedforwardMode::Off], &CampaignOptions::default());
            let velocity = velocities(campaign.psec(), period);
            let top = campaign.runs()[0].speeds.last().copied().expect("speeds");
            let [low, high] = campaign.range();
            let wanted = if axis == "c" { 360.0 * DEGREE } else { wanted * (high - low) };
            for part in [0.25, 0.5] {
                for sign in [1.0, -1.0] {
                    let steady = |v: f64| (v / (sign * part * top) - 1.0).abs() < 1e-6;
                    let mut longest = 0.0_f64;
                    let mut way = 0.0;
                    for &v in &velocity {
                        way = if steady(v) { way + v.abs() * period } else { 0.0 };
                        longest = longest.max(way);
                    }
                    assert!(longest >= wanted, "{machine} {axis} {part} {sign}: {}°", longest / DEGREE);
                }
            }
        }
    }
}

#[test]
fn parts_set_the_feedforward_of_their_name() {
    let parameters = Parameters::load("mikron_ucp710", virtual_axes_builtin::MACHINES).expect("shipped");
    let assigned = |part: FeedforwardMode| -> Vec<String> {
        let list = part.assignments(&parameters, "x");
        list.iter().map(|assignment| format!("{}={}", assignment.key, assignment.value)).collect()
    };
    let friction = "x.feedforward.friction=0";
    assert_eq!(
        assigned(FeedforwardMode::Off),
        ["x.feedforward.velocity=0", "x.feedforward.torque_kg_m2=0", friction]
    );
    assert_eq!(
        assigned(FeedforwardMode::Velocity),
        ["x.feedforward.velocity=1", "x.feedforward.torque_kg_m2=0", friction]
    );
    assert_eq!(
        assigned(FeedforwardMode::Both),
        ["x.feedforward.velocity=1", "x.feedforward.torque_kg_m2=0.002034", friction]
    );
}

/// Returns the friction current of the default X axis (Prévost eq. 3 and Appendix 2), V in m/min.
fn friction_of_x(velocity: f64) -> f64 {
    let v = velocity.abs();
    (1.576 * (0.01965 * v).exp() - 0.5332 * (-0.2801 * v).exp()).copysign(velocity)
}

#[test]
fn legs_of_the_long_part_settle_at_twelve_speeds_in_both_directions() {
    let parameters = Parameters::load("mikron_ucp710", virtual_axes_builtin::MACHINES).expect("shipped");
    let machine = machine_with_feedforward(&parameters, "x", FeedforwardMode::Off);
    let campaign = plan(&machine, "x", &[FeedforwardMode::Off], &CampaignOptions::default());
    let recording = record(&machine, "x", campaign.psec(), &Disturbance::default());
    let current = recording.current.expect("recorded");
    let velocity = velocities(recording.psec.as_deref().expect("recorded"), TSP);
    // 8/Kp + α: 0.03 % of a setpoint step remain.
    let settling = ((8.0 / 25.0 + 0.009) / TSP) as usize;
    for &speed in &campaign.runs()[0].speeds {
        for direction in [1.0, -1.0] {
            let wanted = friction_of_x(direction * speed / M_MIN);
            let mut since = 0;
            let mut settled = 0;
            let mut worst = 0.0_f64;
            for (v, current) in velocity.iter().zip(&current) {
                since = if (v / (direction * speed) - 1.0).abs() < 1e-6 { since + 1 } else { 0 };
                if since > settling {
                    settled += 1;
                    worst = worst.max((current / wanted - 1.0).abs());
                }
            }
            let time = settled as f64 * TSP;
            println!(
                "{:7.3} m/min: {time:.2} s settled, {wanted:.4} A ± {:.3} %",
                direction * speed / M_MIN,
                100.0 * worst
            );
            assert!(time > 1.4, "{speed} m/s {direction}: settled for {time} s");
            assert!(worst < 0.005, "{speed} m/s {direction}: {worst}");
        }
    }
}
