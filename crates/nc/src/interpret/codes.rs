//! G and M codes: number, dialects, name and meaning, in modal groups of which a line has at most one code.
//!
//! Each group is an enum, so that the compiler points to the places where a new code must be executed. The same number
//! may have another meaning in another dialect.

use super::dialect::{self, ALL, Dialect, FANUC, HAAS, LINUXCNC, MACH3, MARLIN, OKUMA};
use super::error::Outcome;

/// Dialects with codes of production controls.
const FH: u8 = FANUC | HAAS;
/// Dialects that share codes with these.
const FHM: u8 = FH | MACH3;
/// Firmware of small machines.
const GRBL: u8 = dialect::GRBL | MARLIN;
/// Dialects on the base of RS-274/NGC.
const NGC: u8 = LINUXCNC | MACH3 | GRBL;
/// Dialects except grbl.
const CYCLES: u8 = LINUXCNC | FHM | OKUMA;
/// Dialects except Okuma, where these codes have another meaning.
const OTHERS: u8 = ALL & !OKUMA;

/// Declares groups of codes: an enum for each, and a struct with the code of each group in a line.
macro_rules! codes {
    (
        $(#[$doc:meta])* $codes:ident, $name:path;
        $($field:ident: $group:ident, $group_doc:literal {
            $($code:ident = $number:literal in $dialects:expr, $code_doc:literal;)+
        })+
    ) => {
        $(#[doc = concat!($group_doc, ".")]
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u16)]
        pub(super) enum $group {
            $(#[doc = concat!($code_doc, ".")] $code = $number,)+
        }

        impl $group {
            /// Returns the number; of a G code in tenths.
            pub(super) fn number(self) -> u16 {
                self as u16
            }
        })+

        $(#[$doc])*
        #[derive(Debug, Default)]
        pub(super) struct $codes {
            $(pub $field: Option<$group>,)+
        }

        impl $codes {
            /// Adds a code; returns false if the dialect lacks it.
            fn add(&mut self, number: u16, dialect: Dialect) -> Outcome<bool> {
                match number {
                    $($($number if $dialects & dialect.bit() != 0 => {
                        let other = self.$field.map($group::number);
                        if is_in_effect(other, number, $name, dialect)? {
                            self.$field = Some($group::$code);
                        }
                    })+)+
                    _ => return Ok(false),
                }
                Ok(true)
            }

            /// Returns the dialects that have a code, as bits.
            fn dialects(number: u16) -> u8 {
                let rows = [$($(($number, $dialects)),+),+];
                rows.iter().filter(|(known, _)| *known == number).fold(0, |bits, (_, dialects)| bits | dialects)
            }
        }
    };
}

codes! {
    /// G codes of one line. Their numbers are in tenths: 431 is G43.1.
    GCodes, g_name;

    motion: Motion, "Motion mode" {
        Rapid = 0 in ALL, "G0: rapid traverse";
        Line = 10 in ALL, "G1: straight line at feed";
        ClockwiseArc = 20 in ALL, "G2: clockwise arc";
        CounterclockwiseArc = 30 in ALL, "G3: counterclockwise arc";
        CubicSpline = 50 in LINUXCNC, "G5: cubic spline";
        QuadraticSpline = 51 in LINUXCNC, "G5.1: quadratic spline";
        Nurbs = 52 in LINUXCNC, "G5.2: start of a NURBS";
        NurbsEnd = 53 in LINUXCNC, "G5.3: end of a NURBS";
        Synchronous = 330 in LINUXCNC, "G33: straight line with a pitch per revolution";
        SynchronousTapping = 331 in LINUXCNC, "G33.1: tapping to a point and back";
        ChipBreaking = 730 in CYCLES, "G73: deep-hole drilling with short retractions";
        LeftTapping = 740 in CYCLES, "G74: left-hand tapping";
        FineBoring = 760 in FHM | OKUMA, "G76: boring with a lateral shift before retraction";
        BackBoring77 = 770 in HAAS, "G77: back boring from below";
        Cancel = 800 in ALL, "G80: end of the motion mode";
        Drilling = 810 in ALL, "G81: drilling";
        DwellDrilling = 820 in ALL, "G82: drilling with dwell";
        PeckDrilling = 830 in ALL, "G83: deep-hole drilling with retractions to the plane R";
        Tapping = 840 in CYCLES, "G84: tapping";
        Boring = 850 in CYCLES, "G85: boring with retraction at feed";
        StopBoring = 860 in CYCLES, "G86: boring with spindle stop and retraction at rapid traverse";
        BackBoring = 870 in FHM | OKUMA, "G87: back boring from below";
        ManualBoring = 880 in FHM | OKUMA, "G88: boring with dwell, spindle stop and retraction";
        DwellBoring = 890 in CYCLES, "G89: boring with dwell and retraction at feed";
        Skip = 310 in FHM | OKUMA, "G31: probing to the end of a straight line";
        Probe382 = 382 in NGC, "G38.2: probing to the end of a straight line";
        Probe383 = 383 in NGC, "G38.3: probing to the end of a straight line";
        Probe384 = 384 in NGC, "G38.4: probing to the end of a straight line";
        Probe385 = 385 in NGC, "G38.5: probing to the end of a straight line";
        RigidTapping = 842 in FANUC, "G84.2: tapping";
        LeftRigidTapping = 843 in FANUC, "G84.3: left-hand tapping";
        LeftTapping174 = 1740 in HAAS, "G174: left-hand tapping";
        Tapping184 = 1840 in HAAS, "G184: tapping";
        LeftTapping274 = 2740 in OKUMA, "G274: left-hand tapping";
        Tapping284 = 2840 in OKUMA, "G284: tapping";
    }
    action: Action, "Code that acts in its line only" {
        Dwell = 40 in ALL, "G4: dwell";
        ClockwisePocket = 120 in HAAS | MACH3, "G12: clockwise circular pocket";
        CounterclockwisePocket = 130 in HAAS | MACH3, "G13: counterclockwise circular pocket";
        Data = 100 in OTHERS, "G10: sets offsets and tools";
        ReferenceCheck = 270 in FH, "G27: moves to a point";
        ToReference = 280 in ALL, "G28: moves to the first reference";
        StoreReference = 281 in NGC, "G28.1: stores the first reference; of Mach3, homes axes";
        FromReference = 290 in FH, "G29: moves through the point of the last G28";
        ToSecondReference = 300 in ALL & !MARLIN, "G30: moves to the second reference";
        StoreSecondReference = 301 in LINUXCNC | GRBL, "G30.1: stores the second reference";
        Shift = 520 in OTHERS, "G52: shifts all coordinate systems";
        MachineCoordinates = 530 in OTHERS, "G53: line in machine coordinates";
        TiltTool = 531 in FH, "G53.1: turns the tool axis normal to the tilted plane";
        TiltTool253 = 2530 in HAAS, "G253: turns the tool axis normal to the tilted plane";
        MacroCall = 650 in FHM, "G65: calls a macro";
        ShiftToPosition = 920 in ALL, "G92: shifts all coordinate systems to coordinates of the position";
        ClearShift = 921 in ALL, "G92.1: clears the shift";
        SuspendShift = 922 in NGC, "G92.2: suspends the shift";
        RestoreShift = 923 in NGC, "G92.3: restores the shift";
        ReturnLevel = 710 in OKUMA, "G71: level to which canned cycles with M53 retract";
        ToolChange111 = 1110 in OKUMA, "G111: tool change";
        ToolChange116 = 1160 in OKUMA, "G116: tool change";
    }
    pattern: HolePattern, "Holes of the canned cycle in a pattern" {
        Circle = 700 in HAAS | OKUMA, "G70: on a circle about the position";
        Arc = 710 in HAAS, "G71: on an arc about the position";
        Row = 720 in HAAS, "G72: in a row from the position";
    }
    modal_macro: ModalMacro, "Macro after each motion" {
        Call = 660 in FH, "G66: calls a macro after each motion";
        Cancel = 670 in FH, "G67: ends the calls";
    }
    plane: PlaneCode, "Plane of arcs and canned cycles" {
        Xy = 170 in ALL, "G17"; Zx = 180 in ALL, "G18"; Yz = 190 in ALL, "G19";
    }
    distance: Distance, "Meaning of axis words" {
        Absolute = 900 in ALL, "G90"; Incremental = 910 in ALL, "G91";
    }
    arc_distance: ArcDistance, "Meaning of the centers of arcs" {
        Absolute = 901 in NGC & !dialect::GRBL, "G90.1"; Incremental = 911 in NGC, "G91.1";
    }
    feed_mode: FeedMode, "Meaning of the F word" {
        InverseTime = 930 in ALL, "G93: inverse of the duration";
        PerMinute = 940 in ALL, "G94: feed per minute";
        PerRevolution = 950 in ALL, "G95: feed per revolution";
    }
    units: Units, "Length unit" {
        Inch = 200 in ALL, "G20"; Millimeter = 210 in ALL, "G21";
        Inch70 = 700 in FANUC | MACH3 | GRBL, "G70"; Millimeter71 = 710 in FANUC | MACH3 | GRBL, "G71";
    }
    cutter_compensation: CutterCompensation, "Cutter radius compensation" {
        Off = 400 in ALL, "G40: none";
        Left = 410 in ALL & !dialect::GRBL, "G41: tool left of the path";
        LeftDiameter = 411 in LINUXCNC, "G41.1: tool left of the path, D is its diameter";
        Right = 420 in ALL & !dialect::GRBL, "G42: tool right of the path";
        RightDiameter = 421 in LINUXCNC, "G42.1: tool right of the path, D is its diameter";
    }
    tool_length: ToolLength, "Tool length" {
        OfTool = 430 in ALL, "G43: length of a tool";
        Given = 431 in LINUXCNC | GRBL | MACH3, "G43.1: given length";
        Additional = 432 in LINUXCNC, "G43.2: adds the length of a tool";
        CenterPoint = 434 in ALL, "G43.4: tool center point control";
        CenterPointVector = 435 in FH, "G43.5: tool center point control with tool directions I J K";
        Negative = 440 in FHM, "G44: negative length of a tool";
        Off = 490 in ALL, "G49: no length";
        CenterPoint234 = 2340 in HAAS, "G234: tool center point control";
        AlongZ = 560 in OKUMA, "G56: length of a tool along Z";
        OffByG53 = 530 in OKUMA, "G53: no length";
        CenterPoint169 = 1690 in OKUMA, "G169: tool center point control";
        CenterPointOff = 1700 in OKUMA, "G170: end of tool center point control";
    }
    coordinates: CoordinateSystem, "Work coordinate system" {
        First = 540 in OTHERS, "G54"; Second = 550 in OTHERS, "G55"; Third = 560 in OTHERS, "G56";
        Fourth = 570 in OTHERS, "G57"; Fifth = 580 in OTHERS, "G58"; Sixth = 590 in OTHERS, "G59";
        Seventh = 591 in NGC, "G59.1"; Eighth = 592 in NGC, "G59.2"; Ninth = 593 in NGC, "G59.3";
        Additional = 541 in FH, "G54.1 P: additional systems";
        Additional154 = 1540 in HAAS, "G154 P: additional systems";
    }
    work_system: WorkSystem, "Work coordinate system by its number" {
        Modal = 150 in OKUMA, "G15 H: modal"; Once = 160 in OKUMA, "G16 H: in its line";
    }
    path_control: PathControlCode, "Path control" {
        ExactPath = 610 in ALL, "G61: exact path";
        ExactStop = 611 in NGC, "G61.1: exact stop";
        Blend = 640 in ALL, "G64: blending";
    }
    exact_stop: ExactStop, "Exact stop of one line" {
        Line = 90 in FH | OKUMA, "G9";
    }
    surface: SurfaceCode, "Interpolation on a surface" {
        Cylinder = 71 in FANUC, "G7.1: cylindrical interpolation";
        Polar = 121 in FANUC, "G12.1: polar coordinate interpolation";
        PolarOff = 131 in FANUC, "G13.1: end of polar coordinate interpolation";
        Cylinder107 = 1070 in FANUC, "G107: cylindrical interpolation";
        Polar112 = 1120 in FANUC, "G112: polar coordinate interpolation";
        PolarOff113 = 1130 in FANUC, "G113: end of polar coordinate interpolation";
    }
    retraction: Retraction, "Retraction of canned cycles" {
        ToInitial = 980 in ALL, "G98: to the position before the cycle";
        ToPlane = 990 in ALL, "G99: to the plane R";
    }
    spindle_mode: SpindleMode, "Mode of the spindle" {
        SurfaceSpeed = 960 in CYCLES, "G96: constant surface speed";
        ConstantSpeed = 970 in CYCLES, "G97: constant speed";
    }
    polar: Polar, "Polar coordinates" {
        Off = 150 in FHM, "G15: end of polar coordinates";
        On = 160 in FHM, "G16: polar coordinates";
    }
    scaling: Scaling, "Scaling and mirroring" {
        Off = 500 in FHM, "G50: end of scaling";
        On = 510 in FHM, "G51: scaling";
        MirrorOff = 501 in FH, "G50.1: end of mirroring";
        Mirror = 511 in FH, "G51.1: mirroring";
        MirrorOff100 = 1000 in HAAS, "G100: end of mirroring";
        Mirror101 = 1010 in HAAS, "G101: mirroring";
        MirrorByFlags = 620 in OKUMA, "G62: mirroring of the axes with a value other than 0";
    }
    rotation: Rotation, "Rotation of coordinates" {
        On = 680 in FHM, "G68: rotation in the plane";
        Tilted = 682 in FH, "G68.2: tilted plane";
        ByTool = 683 in FH, "G68.3: plane normal to the tool axis";
        Feature = 2680 in HAAS, "G268: tilted plane by roll, pitch and yaw";
        FeatureOff = 2690 in HAAS, "G269: end of the tilted plane";
        Off = 690 in FHM, "G69: end of rotation and tilted plane";
        ShiftAndTurn = 110 in OKUMA, "G11: shift and rotation of coordinates";
        OffByG10 = 100 in OKUMA, "G10: end of the rotation";
    }
}

codes! {
    /// M codes of one line.
    MCodes, m_name;

    stop: Stop, "Stop" {
        Program = 0 in ALL, "M0"; Optional = 1 in ALL, "M1"; End = 2 in ALL, "M2";
        EndAndRewind = 30 in ALL, "M30"; Pallet = 60 in LINUXCNC, "M60";
    }
    spindle: Spindle, "Spindle" {
        Clockwise = 3 in ALL, "M3"; Counterclockwise = 4 in ALL, "M4"; Off = 5 in ALL, "M5";
    }
    spindle_with_coolant: SpindleWithCoolant, "Spindle and coolant" {
        Clockwise = 13 in FH, "M13"; Counterclockwise = 14 in FH, "M14";
    }
    tool_change: ToolChange, "Tool change" {
        Change = 6 in ALL, "M6"; SetNumber = 61 in LINUXCNC, "M61";
    }
    coolant: Coolant, "Coolant" {
        Mist = 7 in ALL, "M7"; Flood = 8 in ALL, "M8"; Off = 9 in ALL, "M9";
    }
    subprogram: Subprogram, "Subprogram by number" {
        Call = 98 in ALL, "M98"; Return = 99 in ALL, "M99"; Local = 97 in HAAS, "M97";
        External = 198 in FANUC, "M198: from another memory";
    }
    kinematics: KinematicsSwitch, "Kinematics" {
        CenterPoint = 428 in LINUXCNC, "M428: tool center point control";
        Axes = 429 in LINUXCNC, "M429: positions of the axes"; User = 430 in LINUXCNC, "M430";
    }
    modes: SavedModes, "Saved modes" {
        Save = 70 in LINUXCNC, "M70"; Discard = 71 in LINUXCNC, "M71"; Restore = 72 in LINUXCNC, "M72";
        SaveForCall = 73 in LINUXCNC, "M73";
    }
    return_level: ReturnLevel, "Level to which canned cycles retract" {
        UpperLimit = 52 in OKUMA, "M52"; Specified = 53 in OKUMA, "M53"; Point = 54 in OKUMA, "M54";
    }
}

/// G codes without effect on the motion, in tenths: dialects and the letters of their words.
const WITHOUT_EFFECT: &[(u16, u8, &str)] = &[
    (50, FH, "PQRXYZABC"),
    (51, FH, "PQRXYZABC"),
    (70, LINUXCNC, ""),
    (80, LINUXCNC, ""),
    (80, FH | OKUMA, "P"),
    (54, FH, "Q"),
    (110, FH, ""),
    (131, HAAS, ""),
    (220, FH | OKUMA, "XYZIJK"),
    (230, FH | OKUMA, ""),
    (250, FH, ""),
    (260, FH, "PQRI"),
    (290, MARLIN, "ABDEFHIJKLPQRSTUVWXY"),
    (291, FH | NGC, ""),
    (401, FH, ""),
    // PathPilot ends the scaling that no program of this dialect begins.
    (500, LINUXCNC, ""),
    (491, FH, ""),
    (501, MACH3, ""),
    (502, FH, ""),
    (542, FH, "P"),
    (544, FH, "P"),
    (611, FH, ""),
    (620, FH, ""),
    (630, FH, ""),
    (970, GRBL, ""),
    (1030, HAAS, "P"),
    (1070, HAAS, ""),
    (1130, HAAS, ""),
    // M codes beside the motions, of Mazak.
    (1170, FANUC, ""),
    (1300, OKUMA, ""),
    (1310, OKUMA, "DEFIJKLPR"),
    (1320, OKUMA, "DEFIJKLPR"),
    (1870, HAAS, "PEQ"),
    (2540, HAAS, ""),
    (2550, HAAS, ""),
    (2910, FH, ""),
];

/// Codes that change the geometry and are known, with their remedies.
const REMEDIES: &[(u16, &str)] = &[
    (410, "grbl has no cutter compensation (error 20): let the CAM system output the offset path"),
    (420, "grbl has no cutter compensation (error 20): let the CAM system output the offset path"),
    (901, "grbl has relative arc centers only (error 20): post the program with relative I, J, K"),
    (300, "a probing of the bed, which moves Z until it touches: remove it"),
    (71, "cylindrical interpolation: program the motions of the axes"),
    (121, "polar coordinate interpolation: program the motions of the axes"),
    (320, "threading on a lathe: no axis of the machine turns the workpiece"),
    (542, "dynamic fixture offset of a turned table: program a work offset for each position"),
    (544, "compensation of the workpiece setting error: program a work offset"),
    (600, "unidirectional positioning: program G0"),
    (661, "a macro call in each line: program G65 in the lines"),
    (
        870,
        "LinuxCNC leaves the motion of G87 undefined: program G0 and G1, or G87 in --dialect fanuc, haas, mach3 or okuma",
    ),
    (
        880,
        "LinuxCNC leaves the motion of G88 undefined: program G0 and G1, or G88 in --dialect fanuc, haas, mach3 or okuma",
    ),
    (350, "measuring of a tool, whose motions are not simulated: remove it"),
    (360, "measuring of a work offset, whose motions are not simulated: set it with G10 L2"),
    (370, "measuring of a tool, whose motions are not simulated: remove it"),
    (470, "engraving of text: let the CAM system output the motions"),
    (760, "threading on a lathe: no axis of the machine turns the workpiece"),
    (1000, "the end of mirroring on Haas; of Brother, a tool change with motions: program T, M6 and G0"),
    (1070, "cylindrical mapping: let the CAM system output the motions of the axes"),
    (1120, "polar coordinate interpolation: program the motions of the axes"),
    (1410, "3D cutter compensation: program the offset path"),
    (1430, "tool length along the tool axis: program G43.4 or G234"),
    (1500, "pocket milling: let the CAM system output the motions"),
];

impl CoordinateSystem {
    /// Returns the index in the work offsets; `None` for the additional systems.
    pub(super) fn index(self) -> Option<usize> {
        match self {
            Self::First => Some(0),
            Self::Second => Some(1),
            Self::Third => Some(2),
            Self::Fourth => Some(3),
            Self::Fifth => Some(4),
            Self::Sixth => Some(5),
            Self::Seventh => Some(6),
            Self::Eighth => Some(7),
            Self::Ninth => Some(8),
            Self::Additional | Self::Additional154 => None,
        }
    }
}

/// Codes of one line.
#[derive(Debug, Default)]
pub(super) struct Codes {
    pub g: GCodes,
    pub m: MCodes,
    /// Codes without effect on the motion, and the letters of their words.
    pub without_effect: Vec<(String, &'static str)>,
    /// Letters of words that belong to an auxiliary function if nothing else in the line has them.
    pub auxiliary_letters: &'static str,
    /// Codes that are not supported, and their remedies.
    pub unsupported: Vec<(String, String)>,
}

impl Codes {
    /// Sorts the G codes, in tenths, and M codes of a line into their groups. `has_mapping` is true if the line has words
    /// of G107, `has_p0` if it has the word P0.
    ///
    /// # Errors
    ///
    /// Two codes of one group, if the dialect does not allow them.
    pub(super) fn new(
        g: &[u16],
        m: &[u32],
        has_mapping: bool,
        has_p0: bool,
        dialect: Dialect,
    ) -> Outcome<Self> {
        let mut codes = Codes::default();
        for &code in g {
            if code == Motion::NurbsEnd.number() && dialect == Dialect::LinuxCnc {
                return Err("G5.3 without G5.2".to_owned());
            }
            if codes.g.add(code, dialect)? {
                continue;
            }
            // G110 to G129 are the additional systems 1 to 20 of Haas.
            if dialect == Dialect::Haas && matches!(code, 1100..=1290) && code % 10 == 0 {
                codes.g.coordinates = Some(CoordinateSystem::Additional154);
                continue;
            }
            let is_without_effect = |row: &&(u16, u8, &str)| row.0 == code && row.1 & dialect.bit() != 0;
            let is_in_effect = match code {
                // Without words, G107 ends the mapping.
                1070 => has_mapping,
                542 | 544 => !has_p0,
                _ => false,
            };
            match WITHOUT_EFFECT.iter().find(is_without_effect).filter(|_| !is_in_effect) {
                Some((_, _, letters)) => codes.without_effect.push((g_name(code), letters)),
                None => codes.unsupported.push((g_name(code), remedy(code, dialect))),
            }
        }
        for &code in m {
            let number = u16::try_from(code).unwrap_or(u16::MAX);
            if codes.m.add(number, dialect)? {
                continue;
            }
            match is_auxiliary(code, dialect) {
                // The axis words of such a line of Marlin are values of the setting.
                true if dialect == Dialect::Marlin => {
                    codes.without_effect.push((format!("M{code}"), "ABCDEFHIJKLOPQRSTUVWXYZ"));
                }
                true => {
                    codes.without_effect.push((format!("M{code}"), ""));
                    codes.auxiliary_letters = auxiliary_letters(dialect);
                }
                false => codes.unsupported.push((format!("M{code}"), m_remedy(number))),
            }
        }
        Ok(codes)
    }
}

/// Returns the letters that can belong to an auxiliary function, S of a fan or heater where the control has no other.
fn auxiliary_letters(dialect: Dialect) -> &'static str {
    if matches!(dialect, Dialect::Grbl | Dialect::Mach3) { "PQRSELIJK" } else { "PQRELIJK" }
}

/// Returns true for an auxiliary function of a machine builder or user, which moves no axis.
fn is_auxiliary(code: u32, dialect: Dialect) -> bool {
    let last = if dialect == Dialect::LinuxCnc { 199 } else { 9999 };
    // M206, M218 and M290 of firmware shift the coordinates.
    let shifts = dialect == Dialect::Marlin && matches!(code, 206 | 218 | 290);
    (10..=last).contains(&code) && !matches!(code, 96 | 97) && !shifts
}

fn remedy(code: u16, dialect: Dialect) -> String {
    if let Some((_, remedy)) = REMEDIES.iter().find(|(known, _)| *known == code) {
        return (*remedy).to_owned();
    }
    let without_effect = WITHOUT_EFFECT.iter().filter(|(known, ..)| *known == code);
    let others = without_effect.fold(GCodes::dialects(code), |bits, (_, dialects, _)| bits | dialects);
    let others: Vec<_> = Dialect::ALL
        .into_iter()
        .filter(|other| *other != dialect && *other != Dialect::Sinumerik && others & other.bit() != 0)
        .map(Dialect::name)
        .collect();
    let name = g_name(code);
    match others.is_empty() {
        true => format!("skip it with --ignore {name} if it moves no axis"),
        false => format!("known in --dialect {}; or skip it with --ignore {name}", others.join(" or ")),
    }
}

fn m_remedy(code: u16) -> String {
    match MCodes::dialects(code) {
        0 if matches!(code, 206 | 218 | 290) => {
            format!(
                "it shifts the coordinates: set a work offset in its place, or skip it with --ignore M{code}"
            )
        }
        0 => format!("skip it with --ignore M{code}"),
        _ => format!("known in --dialect haas; or skip it with --ignore M{code}"),
    }
}

/// Returns true if a code takes effect beside the `other` one of its group in the line. On most controls the last one does.
///
/// # Errors
///
/// Two codes that exclude each other.
fn is_in_effect(other: Option<u16>, code: u16, name: fn(u16) -> String, dialect: Dialect) -> Outcome<bool> {
    const CANCEL: u16 = Motion::Cancel as u16;
    match other {
        // Beside another motion code, G80 has no effect.
        None | Some(CANCEL) => Ok(true),
        Some(_) if code == CANCEL => Ok(false),
        Some(other) if other == code && dialect == Dialect::Grbl => Ok(true),
        Some(_) if !matches!(dialect, Dialect::LinuxCnc | Dialect::Grbl) => Ok(true),
        Some(other) => Err(format!("{} and {} exclude each other in one line", name(other), name(code))),
    }
}

/// Returns the name of a G code in tenths: `G43.4`.
pub(super) fn g_name(code: u16) -> String {
    match code % 10 {
        0 => format!("G{}", code / 10),
        tenth => format!("G{}.{tenth}", code / 10),
    }
}

/// Returns the name of an M code: `M30`.
pub(super) fn m_name(code: u16) -> String {
    format!("M{code}")
}
