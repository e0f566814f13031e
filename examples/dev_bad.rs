#[path = "../tests/common/mod.rs"]
mod common;
use common::recordings::*;
use virtual_axes::identify::campaign::*;
use virtual_axes::identify::*;
use virtual_axes::recording::*;
fn main() {
    let p = truth();
    let m = common::recordings::feedforward(&p, "x", FeedforwardMode::Off);
    let c = Campaign::plan(
        &m,
        0,
        &[FeedforwardMode::Off],
        &campaign::Options { range: None, max_feed: Some(0.2) },
    )
    .unwrap();
    let base =
        Disturbance { every: Some(8), ..Disturbance::usual(virtual_axes::config::AxisKind::Linear, 6) };
    let cases = [
        ("gl", Disturbance { gaps: vec![30.0..30.5], current_lag: 3e-3, ..base.clone() }),
        ("js", Disturbance { jitter: 5e-5, stalls: vec![20.0..20.05, 41.0..41.2], ..base.clone() }),
        (
            "jgs",
            Disturbance {
                gaps: vec![30.0..30.5],
                jitter: 5e-5,
                stalls: vec![20.0..20.05, 41.0..41.2],
                ..base.clone()
            },
        ),
    ];
    for (name, d) in cases {
        let raw = record(&m, "x", c.psec(), &d);
        let q = ignorant("x").machine_config().unwrap();
        let axis = &q.axes()[0];
        let (s, f) = condition(&raw, axis, &q.periods(), &Conditioning::default()).unwrap();
        println!("== {name}");
        for f in f {
            println!("  {f}");
        }
        for sp in &s.spans {
            println!("  span {} {}", sp.start, sp.position.len());
        }
        let t = std::time::Instant::now();
        let id = identify(
            &[Input { signals: &s, feedforward: Some(FeedforwardMode::Off) }],
            axis,
            &q.periods(),
            &virtual_axes::identify::Options::default(),
        );
        println!(
            "  {:?} J {} eq5 {:?}",
            t.elapsed(),
            Parameter::Inertia.get(id.axis()),
            id.inertia.as_ref().map(|i| i.value)
        );
        for e in &id.agreements[0].experiments {
            println!("  exp {} {}", e.start, e.position.len());
        }
        for d in &id.delays {
            println!("  {:?} {:?}", d.delay, d.interval);
        }
        for c in &id.agreements[0].comparisons {
            println!("  {:?} {:?} {:?}", c.constant_velocity, c.elsewhere, c.current_determination);
        }
        for f in &id.findings {
            println!("  {} {}", f.code, f);
        }
    }
}
