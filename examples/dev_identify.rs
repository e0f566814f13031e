//! dev
use std::sync::Arc;
use virtual_axes::config::*;
use virtual_axes::identify::campaign::{self, Campaign, Part};
use virtual_axes::identify::*;
use virtual_axes::machine::*;

fn gk(s: f64, der: usize, dt: f64) -> Vec<f64> {
    let n = (5.0 * s).ceil() as i64;
    let g: Vec<f64> = (-n..=n).map(|k| (-(k * k) as f64 / 2.0 / s / s).exp()).collect();
    let sum: f64 = g.iter().sum();
    let g: Vec<f64> = g.iter().map(|x| x / sum).collect();
    let k: Vec<f64> = (-n..=n).map(|k| k as f64).collect();
    match der {
        0 => g,
        1 => {
            let d: Vec<f64> = g.iter().zip(&k).map(|(g, k)| k / s / s * g).collect();
            let m: f64 = d.iter().zip(&k).map(|(d, k)| d * k).sum();
            d.iter().map(|d| d / m / dt).collect()
        }
        _ => {
            let d: Vec<f64> = g.iter().zip(&k).map(|(g, k)| (k * k / s.powi(4) - 1.0 / s / s) * g).collect();
            let t: f64 = d.iter().sum();
            let d: Vec<f64> = d.iter().zip(&g).map(|(d, g)| d - g * t).collect();
            let m: f64 = d.iter().zip(&k).map(|(d, k)| d * k * k).sum();
            d.iter().map(|d| 2.0 * d / m / dt / dt).collect()
        }
    }
}
fn conv(x: &[f64], k: &[f64]) -> Vec<f64> {
    let n = (k.len() / 2) as i64;
    let l = x.len() as i64;
    (0..l)
        .map(|i| {
            (-n..=n)
                .map(|j| {
                    let p = i + j;
                    let v = if p < 0 {
                        2.0 * x[0] - x[(-p).min(l - 1) as usize]
                    } else if p >= l {
                        2.0 * x[(l - 1) as usize] - x[(2 * (l - 1) - p).max(0) as usize]
                    } else {
                        x[p as usize]
                    };
                    k[(j + n) as usize] * v
                })
                .sum()
        })
        .collect()
}
struct Rng(u64);
impl Rng {
    fn u(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn n(&mut self) -> f64 {
        (-2.0 * (self.u() + 1e-300).ln()).sqrt() * (6.283185307179586 * self.u()).cos()
    }
}

fn main() {
    let name = std::env::args().nth(1).unwrap_or("x".into());
    let p = Parameters::embedded_default().unwrap();
    let m = p.machine_config().unwrap();
    let place = m.axes().iter().position(|a| a.name() == name).unwrap();
    let mut signals = vec![];
    for part in Part::ALL {
        let c = Campaign::plan(&m, place, &[part], &campaign::Options::default()).unwrap();
        let mut q = p.clone();
        q.set_all(part.assignments(&p, &name)).unwrap();
        let mc = q.machine_config().unwrap();
        let mut mach = Machine::new(Arc::new(MachineParameters::new(&mc).unwrap()));
        let mut start = vec![0.0; 5];
        start[place] = c.psec()[0];
        mach.reset(&start);
        let (mut psec, mut pos, mut cur, mut vf, mut tf) = (vec![], vec![], vec![], vec![], vec![]);
        for s in c.psec() {
            start[place] = *s;
            let mut first = true;
            mach.advance_with(&start, &[], |m| {
                if first {
                    first = false;
                    let s = m.axis(place).sample();
                    psec.push(s.psec);
                    pos.push(s.position);
                    cur.push(s.current);
                    vf.push(s.velocity_feedforward);
                    tf.push(s.torque_feedforward);
                }
            });
        }
        let lsb = if place < 3 { 1e-6 } else { 1e-3_f64.to_radians() };
        let peak = cur.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let mut r = Rng(7 + part as u64);
        let clean = std::env::args().nth(2).is_some();
        if !clean {
            for x in &mut pos {
                *x = (*x / lsb).round() * lsb;
            }
            for x in &mut cur {
                *x += 0.02 * peak * r.n();
            }
        }
        let dt = 6e-3;
        let s = 0.1324962 / 26.0 / dt;
        println!("{part:?} {} s, peak {peak}", psec.len() as f64 * dt);
        let span = Span {
            start: 0.0,
            velocity: conv(&pos, &gk(s, 1, dt)),
            acceleration: conv(&pos, &gk(s, 2, dt)),
            smooth_current: Some(conv(&cur, &gk(s, 0, dt))),
            current: Some(cur),
            psec: Some(psec),
            position: pos,
            recorded_velocity: None,
            velocity_feedforward: Some(vf),
            torque_feedforward: Some(tf),
        };
        signals.push(Signals {
            name: format!("{part:?}"),
            period: dt,
            cutoff: 26.0,
            current_lag: 0.0,
            spans: vec![span],
        });
    }
    // forget what is to be found
    let mut q = p.clone();
    for (k, v) in [
        ("motor.inertia_kg_m2", 0.02 * if place > 2 { 0.1 } else { 1.0 }),
        ("friction.a", 1.0),
        ("friction.b", 0.01),
        ("friction.c", 0.0),
        ("friction.d", -1.0),
        ("friction.i0", 1.0),
        ("feedforward.velocity", 0.9),
        ("feedforward.torque_kg_m2", if place > 2 { 0.0 } else { 0.001 }),
        ("delays.alpha_ms", 20.0),
        ("delays.beta_ms", 20.0),
        ("delays.gamma_ms", 20.0),
    ] {
        q.set(&format!("{name}.{k}"), Value::Double(v), &Source::named("t")).unwrap();
    }
    let qc = q.machine_config().unwrap();
    let inputs: Vec<Input> = signals.iter().map(|s| Input { signals: s, feedforward: None }).collect();
    let ex: Vec<Experiment> = inputs
        .iter()
        .enumerate()
        .flat_map(|(k, i)| experiments(i.signals, k, 6e-3, FeedforwardMode::Both))
        .collect();
    for n in 1..=3 {
        let t = std::time::Instant::now();
        let _ = simulate_all(&m.axes()[place], &m.periods(), &ex[..n]);
        println!("sim {n}: {:?}", t.elapsed());
    }
    let t = std::time::Instant::now();
    let id = identify(&inputs, &qc.axes()[place], &qc.periods(), &Options::default());
    println!("{:?}", t.elapsed());
    for l in &id.steady.levels {
        println!("{:?}", l);
    }
    println!("{:?}", id.gravity);
    if let Some(f) = &id.friction {
        println!("{:?}\n asym {}", f.law, f.asymmetry);
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
    for r in [&id.feedforward.velocity, &id.feedforward.torque].into_iter().flatten() {
        println!("ff {} {} {} {:?}", r.value, r.error, r.determination, r.delay);
    }
    for d in &id.delays {
        println!("{:?} {:?} {} {}", d.delay, d.interval, d.value, d.left);
        let m = d.profile.iter().map(|x| x.1).fold(1e9, f64::min);
        println!("   {:?}", d.profile.iter().filter(|x| x.1 < 1.5 * m).collect::<Vec<_>>());
    }
    if let Some(r) = &id.refinement {
        for p in &r.parameters {
            println!("{:?}", p);
        }
        println!("{:?} {:?}", r.position, r.current);
        println!("{:?}", r.correlated());
    }
    println!("{:?}", id.axis());
    for c in &id.comparisons {
        println!("{c:?}");
    }
    for c in id.inverse.iter().flatten() {
        println!("inverse r2 {} {:?}", c.determination, c.current);
    }
    for f in &id.findings {
        println!("{:?} {} {}", f.severity, f.code, f);
    }
    let truth = &m.axes()[place];
    let cur = |a: &AxisConfig, v: f64| {
        let s = format!("{a:?}");
        let g = |k: &str| -> f64 {
            let i = s.find("FrictionConfig").unwrap();
            let t = &s[i..];
            let j = t.find(k).unwrap() + k.len();
            t[j..].split([',', ' ', '}']).next().unwrap().parse().unwrap()
        };
        g(" a: ") * (g(" b: ") * v).exp() + g(" c: ") * (g(" d: ") * v).exp()
    };
    let worst = (1..=40)
        .map(|k| k as f64 * 0.5)
        .map(|v| (cur(id.axis(), v) / cur(truth, v) - 1.0).abs())
        .fold(0.0, f64::max);
    println!("friction worst {:.3} %, i0 {} vs {}", 100.0 * worst, cur(id.axis(), 1e-9), cur(truth, 1e-9));
}
