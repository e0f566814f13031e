//! Points of the drilling cycles.

use virtual_axes_nc::motion::{Feed, ProgramEvent};

use super::{ends, options, path};
use crate::common::events;

/// Returns the coordinates Z at the ends of the motions from `skip` on, mm, rounded to a nanometer.
fn depths(text: &str, skip: usize) -> Vec<f64> {
    ends(text).iter().skip(skip).map(|end| (end[2] * 1e6).round() / 1e6).collect()
}

/// Start of each program: 100 mm above the part.
const START: &str = "G17 G90 G0 X0 Y0 Z100\nS500 M3 F200\n";

#[test]
fn cycles_move_between_their_planes() {
    let cases: [(&str, &[f64]); 10] = [
        // RTP 10, RFP 0, SDIS 2, DP -6.
        ("CYCLE81(10,0,2,-6)", &[2.0, -6.0, 10.0]),
        ("CYCLE81(10,0,2,,6)", &[2.0, -6.0, 10.0]),
        ("CYCLE81(10,1,2,,6)", &[3.0, -5.0, 10.0]),
        ("CYCLE82(10,0,2,-6,,0.5)", &[2.0, -6.0, 10.0]),
        ("CYCLE85(10,0,2,-6,,0,100,300)", &[2.0, -6.0, 2.0, 10.0]),
        ("CYCLE89(10,0,2,-6,,0)", &[2.0, -6.0, 2.0, 10.0]),
        ("CYCLE84(10,0,2,-6,,0,3,,1.5,,400,800)", &[2.0, -6.0, 2.0, 10.0]),
        ("CYCLE840(10,0,2,-6,,0,4,3,0,,1.25)", &[2.0, -6.0, 2.0, 10.0]),
        // Chip breaking by 1 mm, pecks of 5 mm: 5, 10, 12.
        ("CYCLE83(10,0,2,-12,,-5,,0,0,0,1,0)", &[2.0, -5.0, -4.0, -10.0, -9.0, -12.0, 10.0]),
        // Chip removal to 2, back to 0.6 mm above the last depth.
        ("CYCLE83(10,0,2,-12,,,5,0,0,0,1,1)", &[2.0, -5.0, 2.0, -4.4, -10.0, 2.0, -9.4, -12.0, 10.0]),
    ];
    for (cycle, expected) in cases {
        assert_eq!(depths(&format!("{START}{cycle}"), 1), expected, "{cycle}");
    }
}

#[test]
fn degression_shortens_the_pecks() {
    // 10, then 2 less each time: 8, 6, 4, 2, and what is left in equal parts.
    let text = format!("{START}CYCLE83(10,0,0,-30,,,10,2,0,0,1,1,,,,,1)");
    let bottoms: Vec<f64> = path(&text)
        .iter()
        .filter(|motion| motion.feed != Feed::Rapid)
        .map(|motion| (motion.end[2] * 1e6).round() / 1e3)
        .collect();
    assert_eq!(bottoms, [-10.0, -18.0, -24.0, -28.0, -30.0]);
}

#[test]
fn feeds_of_tapping_and_reaming_are_those_of_pitch_and_words() {
    let feeds = |cycle: &str| -> Vec<f64> {
        path(&format!("{START}{cycle}"))
            .iter()
            .filter_map(
                |motion| if let Feed::Linear(feed) = motion.feed { Some((feed * 6e4).round()) } else { None },
            )
            .collect()
    };
    assert_eq!(feeds("CYCLE84(10,0,2,-6,,0,3,,1.5,,400,800)"), [600.0, 1200.0]);
    // M8 has a pitch of 1.25 mm, at the active 500 rpm.
    assert_eq!(feeds("CYCLE84(10,0,2,-6,,0,3,8)"), [625.0, 625.0]);
    assert_eq!(feeds("CYCLE840(10,0,2,-6)"), [200.0, 200.0]);
    assert_eq!(feeds("CYCLE85(10,0,2,-6,,0,100,300)"), [100.0, 300.0]);
    assert_eq!(feeds("CYCLE81(10,0,2,-6)\nG1 X5"), [200.0, 200.0]);
    assert_eq!(feeds("G331 Z-5 K1 S300\nG332 Z5 K1"), [300.0, 300.0]);
}

#[test]
fn dwells_stand_at_the_depth() {
    let dwells = |cycle: &str| -> Vec<f64> {
        events(&format!("{START}{cycle}"), options())
            .iter()
            .filter_map(|(_, event)| if let ProgramEvent::Dwell(time) = event { Some(*time) } else { None })
            .collect()
    };
    assert_eq!(dwells("CYCLE82(10,0,2,-6,,0.5)"), [0.5]);
    // Ten revolutions at 500 rpm.
    assert_eq!(dwells("CYCLE82(10,0,2,-6,,-10)"), [1.2]);
    assert_eq!(dwells("CYCLE83(10,0,2,-12,,-6,,0,0.1,0.2,1,1)"), [0.1, 0.2, 0.1]);
}

#[test]
fn a_modal_cycle_drills_at_each_position() {
    let text = format!("{START}MCALL CYCLE81(10,0,2,-6)\nX10 Y10\nX20\nMCALL\nX30");
    let holes: Vec<[f64; 3]> = ends(&text).into_iter().filter(|end| end[2] == -6.0).collect();
    assert_eq!(holes, [[10.0, 10.0, -6.0], [20.0, 10.0, -6.0]]);
    assert_eq!(ends(&text).last(), Some(&[30.0, 10.0, 10.0]));
}

#[test]
fn patterns_have_their_positions_in_order() {
    let holes = |pattern: &str| -> Vec<[f64; 2]> {
        ends(&format!("{START}MCALL CYCLE81(10,0,2,-6)\n{pattern}\nMCALL"))
            .into_iter()
            .filter(|end| end[2] == -6.0)
            .map(|end| [end[0], end[1]].map(|value| (value * 1e6).round() / 1e6))
            .collect()
    };
    assert_eq!(holes("HOLES1(0,0,90,10,20,3)"), [[0.0, 10.0], [0.0, 30.0], [0.0, 50.0]]);
    // The nearer end of the row comes first.
    assert_eq!(holes("HOLES1(-50,0,0,10,20,3)"), [[0.0, 0.0], [-20.0, 0.0], [-40.0, 0.0]]);
    assert_eq!(holes("HOLES2(5,5,10,0,0,4)"), [[15.0, 5.0], [5.0, 15.0], [-5.0, 5.0], [5.0, -5.0]]);
    assert_eq!(holes("HOLES2(0,0,10,0,90,2)"), [[10.0, 0.0], [0.0, 10.0]]);
    assert_eq!(
        holes("CYCLE801(0,0,0,10,20,2,2,0,0,0)"),
        [[0.0, 0.0], [10.0, 0.0], [10.0, 20.0], [0.0, 20.0]]
    );
    assert_eq!(holes("CYCLE802(11,11,1,2,3,4)"), [[1.0, 2.0], [3.0, 4.0]]);
}

#[test]
fn cycles_follow_plane_and_frame() {
    // In G18 the hole is along Y.
    let text = "G18 G0 X1 Y50 Z2\nF100\nCYCLE81(10,0,2,-6)";
    assert_eq!(ends(text)[1..], [[1.0, 2.0, 2.0], [1.0, -6.0, 2.0], [1.0, 10.0, 2.0]]);
    let turned = "TRANS Z5\nAROT RPL=90\nG0 X10 Y0 Z50\nF100\nCYCLE81(10,0,2,-6)";
    let depths: Vec<[f64; 3]> =
        ends(turned)[1..].iter().map(|end| end.map(|value| (value * 1e6).round() / 1e6)).collect();
    assert_eq!(depths, [[0.0, 10.0, 7.0], [0.0, 10.0, -1.0], [0.0, 10.0, 15.0]]);
}
