//! Lines, circles, frames, units and corners.

use std::f64::consts::{FRAC_1_SQRT_2, PI, SQRT_2};

use virtual_axes_nc::interpret::Tool;
use virtual_axes_nc::motion::{Feed, MotionKind, PathControl, ProgramEvent};

use super::{assert_arc, assert_ends, options, path, x_ends};
use crate::common::{events, motions};

#[test]
fn words_are_absolute_incremental_or_on_the_shortest_way() {
    assert_ends(
        "G0 X=AC(10) Y=IC(5)\nG91 X=AC(3) Y2\nG90 X=IC(-1) Y0 Z=2*3",
        &[[10.0, 5.0, 0.0], [3.0, 7.0, 0.0], [2.0, 0.0, 6.0]],
    );
    let angles = |text: &str| -> Vec<f64> {
        path(text).iter().map(|motion| motion.end[5].to_degrees().round()).collect()
    };
    let text = "G0 C350\nC=DC(10)\nC=DC(350)\nC=ACP(10)\nC=ACN(350)\nC=ACN(10)\nC=IC(720)";
    assert_eq!(angles(text), [350.0, 370.0, 350.0, 370.0, 350.0, 10.0, 730.0]);
}

#[test]
fn circles_have_the_centers_of_their_words() {
    let cut = |text: &str| path(&format!("G0 X0 Y0\nF500\n{text}")).pop().expect("a motion");
    // A quarter of a circle to (10, 10) about (0, 10), in five ways.
    for text in [
        "G3 X10 Y10 I0 J10",
        "G3 X10 Y10 I=AC(0) J=AC(10)",
        "G3 X10 Y10 CR=10",
        "G3 X10 Y10 AR=90",
        "G3 AR=90 I0 J10",
    ] {
        let motion = cut(text);
        assert_arc(&motion, [0.0, 10.0], 90.0);
        assert!((motion.end[0] - 0.01).abs() < 1e-12 && (motion.end[1] - 0.01).abs() < 1e-12, "{text}");
    }
    assert_arc(&cut("G3 X10 Y10 CR=-10"), [10.0, 0.0], 270.0);
    assert_arc(&cut("G2 X10 Y10 CR=10"), [10.0, 0.0], -90.0);
    let middle = 10.0 * FRAC_1_SQRT_2;
    assert_arc(&cut(&format!("CIP X10 Y10 I1={middle} J1={}", 10.0 - middle)), [0.0, 10.0], 90.0);
    assert_arc(&cut(&format!("CIP X10 Y10 I1={} J1={middle}", 10.0 - middle)), [10.0, 0.0], -90.0);
    // The tangent of the line is X, so that the circle is that about (0, 10).
    assert_arc(&cut("G1 X-5\nX0\nCT X10 Y10"), [0.0, 10.0], 90.0);
    assert_arc(&cut("G111 X0 Y10\nG3 AP=0"), [0.0, 10.0], 90.0);
}

#[test]
fn turn_adds_full_turns_to_a_helix() {
    let helix = path("G0 X10 Y0 Z0\nG3 X0 Y10 Z-6 I=AC(0) J=AC(0) TURN=2 F300").pop().expect("a helix");
    assert_arc(&helix, [0.0, 0.0], 90.0 + 720.0);
    assert_eq!((helix.start[2], helix.end[2]), (0.0, -0.006));
}

#[test]
fn polar_coordinates_refer_to_the_pole() {
    assert_ends(
        "G111 X20 Y10\nG0 AP=0 RP=5\nAP=90\nAP=IC(90)\nG110 X1 Y0\nAP=0 RP=2",
        &[[25.0, 10.0, 0.0], [20.0, 15.0, 0.0], [15.0, 10.0, 0.0], [18.0, 10.0, 0.0]],
    );
}

#[test]
fn frames_move_turn_scale_and_mirror() {
    let (cosine, sine) = (0.5 * 3.0_f64.sqrt(), 0.5);
    let cases: [(&str, [f64; 3]); 12] = [
        ("TRANS X10 Y20\nG0 X1 Y2 Z3", [11.0, 22.0, 3.0]),
        ("TRANS X10\nATRANS X5 Z1\nG0 X1 Y2 Z3", [16.0, 2.0, 4.0]),
        ("TRANS X10\nTRANS Y1\nG0 X1 Y2 Z3", [1.0, 3.0, 3.0]),
        ("TRANS X10\nTRANS\nG0 X1 Y2 Z3", [1.0, 2.0, 3.0]),
        ("ROT RPL=30\nG0 X10 Y0", [10.0 * cosine, 10.0 * sine, 0.0]),
        ("TRANS X10\nAROT Z30\nG0 X10 Y0", [10.0 + 10.0 * cosine, 10.0 * sine, 0.0]),
        ("ROT X90\nG0 X1 Y2 Z3", [1.0, -3.0, 2.0]),
        // About Z first, then about the new X: Z(90) maps (1,2,3) turned by X(90), (1,-3,2), to (3,1,2).
        ("ROT X90 Z90\nG0 X1 Y2 Z3", [3.0, 1.0, 2.0]),
        ("SCALE X2 Y3\nG0 X1 Y2 Z3", [2.0, 6.0, 3.0]),
        ("MIRROR X0\nG0 X1 Y2 Z3", [-1.0, 2.0, 3.0]),
        ("TRANS X10 Y5\nG58 X3\nG59 X0.5\nG0 X1 Y2 Z3", [4.5, 7.0, 3.0]),
        ("G18\nROT RPL=90\nG0 X1 Z0", [0.0, 0.0, -1.0]),
    ];
    for (text, expected) in cases {
        assert_ends(text, &[expected]);
    }
    // A mirrored circle turns the other way, and a turned one keeps its sweep.
    let mirrored = path("MIRROR X0\nG0 X10 Y0\nG3 X0 Y10 CR=10 F100").pop().expect("an arc");
    assert_arc(&mirrored, [0.0, 0.0], -90.0);
    let turned = path("TRANS X5\nAROT RPL=90\nG0 X10 Y0\nG3 X0 Y10 CR=10 F100").pop().expect("an arc");
    assert_arc(&turned, [5.0, 0.0], 90.0);
    // Increments follow the rotation.
    assert_ends("ROT RPL=90\nG91 G0 X1\nX1", &[[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]]);
}

#[test]
fn settable_frames_and_machine_coordinates() {
    let mut options = options();
    options.work_offsets[0][0] = 0.1;
    options.work_offsets[1][0] = 0.2;
    options.work_offsets[4][0] = 0.5;
    options.tools.insert(1, Tool { length: 0.05, radius: 0.004, name: Some("MILL_8".into()) });
    let text = "G54 G0 X1\nG55 X1\nG505 X1\nG500 X1\nTRANS X2\nG54 X1\nG53 X1\nSUPA X3 Y1\nG153 X4\nX0";
    let found: Vec<f64> =
        motions(text, options.clone()).iter().map(|motion| (motion.end[0] * 1e3).round()).collect();
    assert_eq!(found, [101.0, 201.0, 501.0, 1.0, 103.0, 1.0, 3.0, 4.0, 102.0]);
    let written =
        "$P_UIFR[1,X,TR]=7\nG54 G0 X1\n$P_UIFR[1]=CTRANS(X,20,Y,3)\nX1 Y1\nR1=$P_UIFR[1,Y,TR]\nX=R1";
    let found: Vec<f64> =
        motions(written, options.clone()).iter().map(|motion| (motion.end[0] * 1e3).round()).collect();
    assert_eq!(found, [8.0, 21.0, 23.0]);
    // The tool length belongs to the cutting edge: D0 without it, and with D1 the tip is at the coordinate.
    let z = |text: &str| -> Vec<f64> {
        motions(text, options.clone()).iter().map(|motion| (motion.end[2] * 1e3).round()).collect()
    };
    let text =
        "T=\"MILL_8\" M6\nG0 Z10\nG0 SUPA Z0 D0\nG0 Z10\nG0 Z20 D1\nT1 M6 D0\nZ5\n$TC_DP3[1,1]=60\nD1 Z0";
    assert_eq!(z(text), [60.0, 0.0, 10.0, 70.0, 5.0, 60.0]);
}

#[test]
fn inches_apply_to_lengths_and_with_g700_to_feeds() {
    let feed = |text: &str| match path(text).pop().expect("a motion") {
        motion if (motion.end[0] * 1e3 - if text.starts_with("G70") { 25.4 } else { 1.0 }).abs() > 1e-9 => {
            panic!("{text}: {motion:?}")
        }
        motion => match motion.feed {
            Feed::Linear(feed) => (feed * 6e4 * 1e6).round() / 1e6,
            Feed::Duration(time) => time,
            feed => panic!("{text}: {feed:?}"),
        },
    };
    // mm/min, and the duration in s.
    assert_eq!(feed("G70 G1 X1 F100"), 100.0);
    assert_eq!(feed("G700 G1 X1 F100"), 2540.0);
    assert_eq!(feed("G710G1X=1F100"), 100.0);
    assert_eq!(feed("R2=20\nG1 X1 F=R2*10"), 200.0);
    assert_eq!(feed("G95 S600 M3\nG1 X1 F0.1"), 60.0);
    assert_eq!(feed("G93 G1 X1 F2"), 30.0);
}

#[test]
fn dwells_are_in_seconds_or_revolutions_and_keep_feed_and_speed() {
    let text = "S600 M3\nG1 X1 F300\nG4 F1.5\nG4 S30\nX2";
    let dwells: Vec<f64> = events(text, options())
        .iter()
        .filter_map(|(_, event)| if let ProgramEvent::Dwell(time) = event { Some(*time) } else { None })
        .collect();
    assert_eq!(dwells, [1.5, 3.0]);
    let is_kept = |feed: &Feed| matches!(feed, Feed::Linear(feed) if (feed - 0.005).abs() < 1e-12);
    assert!(path(text).iter().all(|motion| is_kept(&motion.feed)));
}

#[test]
fn path_control_has_the_tolerance_of_its_words() {
    let tolerance =
        |text: &str| match path(&format!("{text}\nG1 X1 F100")).pop().expect("a motion").path_control {
            PathControl::Blend(blend) => {
                Some(blend.tolerance.map(|tolerance| (tolerance * 1e9).round() / 1e6))
            }
            _ => None,
        };
    assert_eq!(tolerance("G60"), None);
    assert_eq!(tolerance("G9"), Some(None));
    assert_eq!(tolerance("G64"), Some(None));
    assert_eq!(tolerance("G642"), Some(Some(0.01)));
    assert_eq!(tolerance("G642 CTOL=0.05"), Some(Some(0.05)));
    assert_eq!(tolerance("DEF REAL _camtol=0.02\nCYCLE832(_camtol,_ROUGH,1)"), Some(Some(0.02)));
    assert_eq!(tolerance("CYCLE832(0.02,112003)\nG645"), Some(Some(0.02)));
    assert_eq!(tolerance("CYCLE832(0.02,1,1)\nCYCLE832()"), Some(None));
    assert_eq!(tolerance("G641 ADIS=0.5"), Some(Some(0.177)));
    let exact = path("G64 G1 X1 F100\nG9 X2\nX3");
    assert_eq!(exact[1].path_control, PathControl::ExactStop);
    assert!(matches!(exact[2].path_control, PathControl::Blend(_)));
}

#[test]
fn a_rounding_is_tangent_to_both_lines() {
    // From (40, 45) over (0, 45) to (0, 0), as a wall of a pocket.
    let motions = path("G0 X40 Y45\nG1 X0 F600 RND=3\nY0");
    let [_, first, corner, last] = &motions[..] else { panic!("{motions:?}") };
    assert!((first.end[0] - 0.003).abs() < 1e-12 && (first.end[1] - 0.045).abs() < 1e-12);
    assert_arc(corner, [3.0, 42.0], 90.0);
    assert!((last.start[0]).abs() < 1e-12 && (last.start[1] - 0.042).abs() < 1e-12);
    assert_eq!(last.end[1], 0.0);
    assert_eq!((first.kind.clone(), last.kind.clone()), (MotionKind::Line, MotionKind::Line));
}

#[test]
fn chamfers_have_their_length_or_width() {
    let length = path("G1 F100 X10 CHF=2\nY10");
    assert!((length[0].end[0] * 1e3 - (10.0 - SQRT_2)).abs() < 1e-9, "{:?}", length[0].end);
    let width = path("G1 F100 X10 CHR=2\nY10");
    assert!((width[0].end[0] * 1e3 - 8.0).abs() < 1e-9 && (width[1].end[1] * 1e3 - 2.0).abs() < 1e-9);
    // RNDM rounds each corner until RNDM=0.
    let modal = path("G1 F100 X10 RNDM=1\nY10\nX0\nY0 RNDM=0\nX-5");
    assert_eq!(modal.iter().filter(|motion| matches!(motion.kind, MotionKind::Arc(_))).count(), 3);
    let total: f64 = modal
        .iter()
        .filter_map(|motion| if let MotionKind::Arc(arc) = &motion.kind { Some(arc.sweep) } else { None })
        .sum();
    assert!((total - 1.5 * PI).abs() < 1e-9);
}

#[test]
fn cutter_compensation_takes_the_radius_of_the_edge() {
    let mut options = options();
    options.tools.insert(3, Tool { length: 0.0, radius: 0.005, name: None });
    let text = "T3 M6 D1\nG0 X-20 Y-20\nG1 G42 X0 Y0 F500\nX50\nY40\nG40 X70 Y60";
    let motions = motions(text, options);
    // Right of the side Y = 0 in the direction of X the center is at Y = −5, right of X = 50 at X = 55.
    let on = |axis: usize, value: f64| {
        motions
            .iter()
            .filter(|motion| [motion.start, motion.end].iter().all(|end| (end[axis] - value).abs() < 1e-9))
            .count()
    };
    assert!(on(1, -0.005) > 0 && on(0, 0.055) > 0, "{motions:?}");
}

#[test]
fn blocks_of_posts_keep_their_geometry() {
    assert_eq!(x_ends("N10G0X5Y5\n/N20 G0 X99\nN30 G1X-2.5F200.\n:40 X 7"), [5.0, 99.0, -2.5, 7.0]);
    assert_ends("G1 F100 ANG=45 X10", &[[10.0, 10.0, 0.0]]);
}

#[test]
fn remarks_in_parentheses_follow_words() {
    let text = "N1 R1=5 (COUNT)\nN2 G0 X5 (START)\nN3 M0 (CHECK THE TOOL)\nN4 G1 X7 F600 (SLOW)\nN5 X8(LAST)\nN6 X=R1+4 (SUM)\nN7 X=R1 (AGAIN)\nN8 M30 (END)\n";
    assert_eq!(x_ends(text), [5.0, 7.0, 8.0, 9.0, 5.0]);
}
