//! G and M codes with their modal groups.

use std::fmt::Write;

use super::error::Outcome;
use super::line_words::LineWords;

/// Modal group of a G code: one line has at most one code of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Group {
    Motion,
    NonModal,
    Plane,
    Distance,
    ArcDistance,
    FeedMode,
    Units,
    CutterCompensation,
    ToolLength,
    Coordinates,
    PathControl,
    Retract,
    SpindleMode,
}

/// Number of groups of G codes.
const GROUPS: usize = Group::SpindleMode as usize + 1;

/// Supported G codes in tenths, with their groups.
const G_CODES: [(Group, &[u16]); GROUPS] = [
    (Group::Motion, &[0, 10, 20, 30, 50, 51, 52, 730, 800, 810, 820, 830, 850, 890]),
    (Group::NonModal, &[40, 100, 280, 281, 300, 301, 520, 530, 920, 921, 922, 923]),
    (Group::Plane, &[170, 180, 190]),
    (Group::Distance, &[900, 910]),
    (Group::ArcDistance, &[901, 911]),
    (Group::FeedMode, &[930, 940, 950]),
    (Group::Units, &[200, 210]),
    (Group::CutterCompensation, &[400]),
    (Group::ToolLength, &[430, 431, 434, 490]),
    (Group::Coordinates, &[540, 550, 560, 570, 580, 590, 591, 592, 593]),
    (Group::PathControl, &[610, 611, 640]),
    (Group::Retract, &[980, 990]),
    (Group::SpindleMode, &[970]),
];

/// Modal group of an M code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MGroup {
    Stop,
    Spindle,
    ToolChange,
    Coolant,
    Subprogram,
}

/// Number of groups of M codes.
const M_GROUPS: usize = MGroup::Subprogram as usize + 1;

/// Supported M codes with their groups.
const M_CODES: [(MGroup, &[u32]); M_GROUPS] = [
    (MGroup::Stop, &[0, 1, 2, 30]),
    (MGroup::Spindle, &[3, 4, 5]),
    (MGroup::ToolChange, &[6]),
    (MGroup::Coolant, &[7, 8, 9]),
    (MGroup::Subprogram, &[98, 99]),
];

/// Codes of one line by group.
#[derive(Debug, Default)]
pub(super) struct Codes {
    g: [Option<u16>; GROUPS],
    m: [Option<u32>; M_GROUPS],
}

impl Codes {
    /// Sorts the codes of a line into their groups.
    ///
    /// # Errors
    ///
    /// A code that is not supported, or two codes of one group.
    pub(super) fn new(block: &LineWords) -> Outcome<Self> {
        let mut codes = Codes::default();
        for &code in &block.g {
            let group = G_CODES.iter().find(|(_, codes)| codes.contains(&code));
            let Some((group, _)) = group else {
                if code == 53 {
                    return Err("G5.3 without G5.2".to_owned());
                }
                return Err(format!("{} is not supported; supported: {}", g_name(code), supported_g()));
            };
            let slot = &mut codes.g[*group as usize];
            match *slot {
                // Beside another motion code, G80 has no effect.
                None | Some(800) => *slot = Some(code),
                Some(_) if code == 800 => {}
                Some(other) => {
                    return Err(format!(
                        "{} and {} exclude each other in one line",
                        g_name(other),
                        g_name(code)
                    ));
                }
            }
        }
        for &code in &block.m {
            let group = M_CODES.iter().find(|(_, codes)| codes.contains(&code));
            let Some((group, _)) = group else {
                let supported = supported_m();
                return Err(format!(
                    "M{code} is not supported and not in the list of ignored M codes; {supported}"
                ));
            };
            if let Some(other) = codes.m[*group as usize].replace(code) {
                return Err(format!("M{other} and M{code} exclude each other in one line"));
            }
        }
        Ok(codes)
    }

    /// Returns the G code of a group, in tenths.
    pub(super) fn g(&self, group: Group) -> Option<u16> {
        self.g[group as usize]
    }

    /// Returns the M code of a group.
    pub(super) fn m(&self, group: MGroup) -> Option<u32> {
        self.m[group as usize]
    }
}

/// Returns the name of a G code in tenths: `G43.4`.
pub(super) fn g_name(code: u16) -> String {
    match code % 10 {
        0 => format!("G{}", code / 10),
        tenth => format!("G{}.{tenth}", code / 10),
    }
}

/// Returns the names of the supported G codes.
fn supported_g() -> String {
    let mut codes: Vec<u16> =
        G_CODES.iter().flat_map(|(_, codes)| codes.iter().copied()).chain([53]).collect();
    codes.sort_unstable();
    codes.into_iter().map(g_name).collect::<Vec<_>>().join(" ")
}

/// Returns the supported M codes for a message.
fn supported_m() -> String {
    let mut text = "supported:".to_owned();
    for code in M_CODES.iter().flat_map(|(_, codes)| codes.iter()) {
        let _ = write!(text, " M{code}");
    }
    text
}
