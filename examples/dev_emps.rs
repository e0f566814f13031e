//! dev
use virtual_axes::config::*;
use virtual_axes::files::{RecordingOptions, read_recording};
use virtual_axes::identify::*;
fn main() {
    let name = std::env::args().nth(1).unwrap();
    let mut p = Parameters::builtin(&name).unwrap();
    for (k, v) in
        [("motor.mass_kg", 50.0), ("motor.force_constant_n_a", 35.15065), ("motor.max_current_a", 10.0)]
    {
        p.set(&format!("x.{k}"), Value::Double(v), &Source::named("t")).unwrap();
    }
    let c = p.machine_config().unwrap();
    let axis = &c.axes()[0];
    let read = |f: &str| {
        let (raw, n) = read_recording(std::path::Path::new(f), axis, &RecordingOptions::default()).unwrap();
        for n in n {
            println!("{n}");
        }
        let (s, n) = condition(&raw, axis, &c.periods(), &Conditioning::default()).unwrap();
        for n in n {
            println!("{n}");
        }
        s
    };
    let s = read("/work/shared/data/emps_identification.csv");
    let t = std::time::Instant::now();
    let id = identify(&[Input { signals: &s, feedforward: None }], axis, &c.periods(), &Options::default());
    println!("{:?}", t.elapsed());
    for l in &id.steady.levels {
        println!(
            "{:.5} {:.4} N {:.4} ± {:.4} {}",
            l.velocity,
            l.current * 35.15065,
            l.friction * 35.15065,
            l.error * 35.15065,
            l.duration
        );
    }
    println!("{:?}", id.gravity);
    if let Some(f) = &id.friction {
        println!("{:?} {:?}\n asym {}", f.law, f.law.line(), f.asymmetry);
        for d in f.directions.iter().flatten() {
            println!("  dir {:?} N, N/(m/s)", d.line().map(|(a, b)| (a * 35.15065, b * 35.15065 * 60.0)));
            for l in &id.steady.levels {
                println!("    {} {}", l.velocity, d.at(l.velocity * 60.0) / l.friction);
            }
        }
    }
    if let Some(i) = &id.inertia {
        println!(
            "inertia {} +- {} spread {} n {} phases {}",
            i.value,
            i.error,
            i.spread,
            i.instants.len(),
            i.accelerations
        );
    }
    for f in &id.findings {
        println!("{:?} {} {}", f.severity, f.code, f);
    }
    for v in id.values(&p, "x") {
        println!("{} {} {} {}", v.key, v.value, v.unit, v.comment());
    }
    println!("R2 own {:?}", id.agreements[0].inverse.as_ref().map(|i| (i.determination, i.current)));
    let v = read("/work/shared/data/emps_validation.csv");
    println!(
        "R2 val {:?}",
        validate(&Input { signals: &v, feedforward: None }, id.axis(), &c.periods())
            .unwrap()
            .inverse
            .map(|i| (i.determination, i.current))
    );
}
