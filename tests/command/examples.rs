//! The numbered examples, run as functions.

// Its main function reads the argument of the process, which is that of the test here.
#[allow(dead_code)]
#[path = "../../examples/01_simulate_csv.rs"]
mod simulate_csv;

#[path = "../../examples/02_switch_controller.rs"]
mod switch_controller;

#[path = "../../examples/03_design_gpc.rs"]
mod design_gpc;

#[path = "../../examples/04_own_controller.rs"]
mod own_controller;

#[path = "../../examples/05_sweep.rs"]
mod sweep;

#[test]
fn setpoints_of_a_csv_are_followed() {
    let csv = "time,x\n0,0\n1,0.1\n2,0.1\n";
    // At 0.1 m/s the position lags by the delay of 12 ms, and more while X accelerates at once.
    let error = simulate_csv::run(csv).unwrap();
    assert!((1.2e-3..3e-3).contains(&error), "{error}");
    let unknown = simulate_csv::run("time,w\n0,0\n").unwrap_err().to_string();
    assert!(unknown.contains('w'), "{unknown}");
}

#[test]
fn predictive_control_is_nearer_to_the_circle() {
    switch_controller::main().unwrap();
    let [cascade, gpc] = ["cascade", "gpc"].map(|name| switch_controller::run(name).unwrap());
    // The paper's figure 10: some 50 µm, and almost 0 but for reversal spikes.
    assert!(cascade > 48e-6 && gpc < cascade / 3.0, "{cascade}, {gpc}");
}

#[test]
fn a_longer_horizon_is_more_robust() {
    design_gpc::main().unwrap();
    let margins = [8, 12, 20].map(|n2| design_gpc::run(n2, 0.1).unwrap());
    assert!(
        margins.windows(2).all(|pair| pair[0].modulus < pair[1].modulus && pair[0].delay < pair[1].delay)
    );
    assert!(design_gpc::run(0, 0.1).is_err());
}

#[test]
fn an_own_law_has_the_following_error_of_its_type() {
    own_controller::main().unwrap();
    // v / Kp of a proportional law; none with an integral part.
    let proportional = own_controller::run(own_controller::OwnLaw::new(20.0, 0.0)).unwrap();
    assert!((proportional / (0.1 / 20.0) - 1.0).abs() < 1e-4, "{proportional}");
    let integral = own_controller::run(own_controller::OwnLaw::new(20.0, 100.0)).unwrap();
    assert!(integral.abs() < 1e-5, "{integral}");
}

#[test]
fn a_variant_of_a_sweep_has_the_bits_of_its_own_run() {
    sweep::main().unwrap();
    let gains = [1.0, 1.4, 1.9];
    let together = sweep::run(&gains).unwrap();
    let alone: Vec<f64> = gains.iter().map(|gain| sweep::run(&[*gain]).unwrap()[0]).collect();
    assert_eq!(together, alone);
    assert!(together[0] != together[2]);
}
