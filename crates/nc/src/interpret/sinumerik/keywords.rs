//! Words without effect on the motions, and words that change the geometry and are rejected.

/// Keywords, addresses and calls that the programs of posts have, without effect on the path.
const ACCEPTED: &[&str] = &[
    // Acceleration, feedforward, compressors, feed profiles, dynamics.
    "SOFT",
    "BRISK",
    "DRIVE",
    "SOFTA",
    "BRISKA",
    "DRIVEA",
    "FFWON",
    "FFWOF",
    "COMPON",
    "COMPCURV",
    "COMPCAD",
    "COMPSURF",
    "COMPOF",
    "FENDNORM",
    "FNORM",
    "FLIN",
    "FCUB",
    "FPO",
    "CFC",
    "CFTCP",
    "CFIN",
    "DYNNORM",
    "DYNPOS",
    "DYNROUGH",
    "DYNSEMIFIN",
    "DYNFINISH",
    "DYNPREC",
    "RTLION",
    "RTLIOF",
    "CPRECON",
    "CPRECOF",
    "UPATH",
    "SPATH",
    "CP",
    // Compensation and orientation details.
    "CUT2D",
    "CUT2DF",
    "CUT2DD",
    "CUT2DFD",
    "CUTCONON",
    "CUTCONOF",
    "CDON",
    "CDOF",
    "CDOF2",
    "ORISON",
    "ORISOF",
    "ORIC",
    "ORID",
    "ORIAXPOS",
    "ORIRESET",
    "ORISOLH",
    "CUTMOD",
    "ISD",
    // Blocks, display, safety, synchronization.
    "STOPRE",
    "STARTFIFO",
    "STOPFIFO",
    "FIFOCTRL",
    "SBLON",
    "SBLOF",
    "DISPLON",
    "DISPLOF",
    "WALIMON",
    "WALIMOF",
    "WALCS0",
    "WALCS1",
    "MSG",
    "SETAL",
    "WORKPIECE",
    "GROUP_BEGIN",
    "GROUP_END",
    "GROUP_ADDEND",
    "WAITM",
    "WAITMC",
    "WAITE",
    "WAITP",
    "WAITS",
    "INIT",
    "START",
    "SETM",
    "CLEARM",
    "WRITE",
    "DELETE",
    "NEWCONF",
    "CANCEL",
    "LOCK",
    "UNLOCK",
    "GET",
    "GETD",
    "RELEASE",
    "PROCDISP",
    "EXTOPEN",
    "EXTCLOSE",
    "PROTA",
    "NPROT",
    "NPROTDEF",
    "EXECTAB",
    "STOPREOF",
    "DELDTG",
    "GFRAME0",
    "SAVE",
    "ACTBLOCNO",
    "ICYCON",
    "ICYCOF",
    "IPTRLOCK",
    "IPTRUNLOCK",
    "ASUP",
    "LFON",
    "LFOF",
    "LFTXT",
    "LFWP",
    "LFPOS",
    "SETINT",
    "ENABLE",
    "DISABLE",
    "CLRINT",
    "TOOLLIST",
    // Spindles and tools.
    "SETMS",
    "SPCON",
    "SPCOF",
    "SPOS",
    "SPOSA",
    "TCOABS",
    "TCOFR",
    "TCARR",
    "MPEROF",
    "MPERON",
    "DIAMOF",
    "DIAMCYCOF",
    "FGROUP",
    "FGREF",
    "TOFRAMEOF",
    "TOROTOF",
    "PAROTOF",
    "ROTSOF",
    "TANGOF",
    "TRAILOF",
    "LEADOF",
    "COUPOF",
    "TMON",
    "TMOF",
    "GETT",
    "SETPIECE",
    // Addresses.
    "H",
    "OVR",
    "OVRA",
    "OVRRAP",
    "ACC",
    "ACCLIMA",
    "VELOLIMA",
    "JERKLIMA",
    "JERKLIM",
    "FL",
    "FA",
    "FRC",
    "FRCM",
    "FZ",
    "STOLF",
    "SF",
    "LIMS",
    "SVC",
    "SCC",
    "VELOLIM",
    "ACCLIM",
    "ATOL",
    "PL",
    "SD",
    "SR",
    "ST",
    "PO",
    "PW",
    "DILF",
    "CONTPRON",
    "DL",
];

/// G codes without effect on the path.
const ACCEPTED_G: &[u32] = &[
    62, 290, 460, 461, 462, 601, 602, 603, 621, 810, 811, 812, 813, 814, 815, 816, 817, 818, 819, 820, 821,
    822, 823, 824, 825, 826, 827, 828, 829, 930, 931,
];

/// Words that change the geometry, with what to do.
const REJECTED: &[(&str, &str)] = &[
    ("ASPLINE", SPLINES),
    ("BSPLINE", SPLINES),
    ("CSPLINE", SPLINES),
    ("POLY", SPLINES),
    ("SPLINEPATH", SPLINES),
    ("INVCW", "post involutes as lines or arcs"),
    ("INVCCW", "post involutes as lines or arcs"),
    ("TRANSMIT", "post the operation in X, Y and Z"),
    ("TRACYL", "post the operation in X, Y, Z and the rotary axis"),
    ("TRAANG", "only TRAORI is supported"),
    ("TRACON", "only TRAORI is supported"),
    ("TRAFOON", "program TRAORI"),
    ("TOFRAME", FRAMES),
    ("TOFRAMEX", FRAMES),
    ("TOFRAMEY", FRAMES),
    ("TOFRAMEZ", FRAMES),
    ("TOROT", FRAMES),
    ("TOROTX", FRAMES),
    ("TOROTY", FRAMES),
    ("TOROTZ", FRAMES),
    ("PAROT", FRAMES),
    ("ROTS", FRAMES),
    ("AROTS", FRAMES),
    ("CROTS", FRAMES),
    ("MEAFRAME", FRAMES),
    ("CUT3DC", "post the path of the tool center (CUT2D), or program G40"),
    ("CUT3DF", "post the path of the tool center (CUT2D), or program G40"),
    ("CUT3DFF", "post the path of the tool center (CUT2D), or program G40"),
    ("KONTC", "program NORM, and an approach by lines and arcs"),
    ("KONTT", "program NORM, and an approach by lines and arcs"),
    ("LEAD", "post the direction A3= B3= C3= or the rotary axes"),
    ("TILT", "post the direction A3= B3= C3= or the rotary axes"),
    ("THETA", "remove the rotation of the tool about itself"),
    ("A4", VECTORS),
    ("B4", VECTORS),
    ("C4", VECTORS),
    ("A5", VECTORS),
    ("B5", VECTORS),
    ("C5", VECTORS),
    ("ORIVIRT1", VECTORS),
    ("ORIVIRT2", VECTORS),
    ("ORICURVE", VECTORS),
    ("ORIPATH", VECTORS),
    ("ORICONCW", VECTORS),
    ("ORICONCCW", VECTORS),
    ("ORICONIO", VECTORS),
    ("ORICONTO", VECTORS),
    ("ORIROTA", VECTORS),
    ("LCYC60", LCYC),
    ("LCYC61", LCYC),
    ("LCYC75", LCYC),
    ("LCYC82", LCYC),
    ("LCYC83", LCYC),
    ("LCYC84", LCYC),
    ("LCYC840", LCYC),
    ("LCYC85", LCYC),
    ("E_HEAD", SHOP),
    ("F_HEAD", SHOP),
    ("PTP", "program G0 without TRAORI"),
    ("DIAMON", "program radii (DIAMOF)"),
    ("DIAM90", "program radii (DIAMOF)"),
    ("POS", "program G0 with the axis"),
    ("POSA", "program G0 with the axis"),
    ("PRESETON", "program TRANS or a work offset"),
    ("PRESETONS", "program TRANS or a work offset"),
    ("TRAILON", "program both axes"),
    ("COUPON", "program both axes"),
    ("LEADON", "program both axes"),
    ("TANG", "program the rotary axis"),
    ("TANGON", "program the rotary axis"),
    ("TOFFL", "set the tool length in the tool table"),
    ("TOFFR", "set the tool radius in the tool table"),
    ("TOFFON", "set the tool length in the tool table"),
    ("MEAS", MEASURING),
    ("MEAW", MEASURING),
    ("MEASA", MEASURING),
    ("MEAWA", MEASURING),
    ("REPOSL", "remove the repositioning"),
    ("REPOSA", "remove the repositioning"),
    ("ADDFRAME", FRAMES),
    ("OSCILL", "program the strokes as lines"),
    ("OS", "program the strokes as lines"),
    ("PUNCHACC", "punching is not simulated"),
];
const SPLINES: &str = "post lines and arcs in place of splines and polynomials";
const LCYC: &str = "a cycle of 802S and 802C with values in R parameters: program CYCLE82, CYCLE83, CYCLE84, CYCLE840, CYCLE85 or HOLES1";
const SHOP: &str =
    "a program of steps of ShopMill or ShopTurn: convert it to G code in the control, or post it again";
const FRAMES: &str = "program TRANS, ROT or CYCLE800";
const VECTORS: &str = "post the direction A3= B3= C3= at the end of each block";
const MEASURING: &str = "remove the measurement, or skip it with /";

/// Cycles of the control that are not simulated, beside those of `MILLING`.
const CYCLES: &[&str] = &[
    "CYCLE73", "CYCLE74", "CYCLE75", "CYCLE830", "CYCLE92", "CYCLE93", "CYCLE94", "CYCLE95", "CYCLE96",
    "CYCLE97", "CYCLE98", "CYCLE99", "CYCLE930", "CYCLE940", "CYCLE951", "CYCLE952", "CYCLE961", "CYCLE971",
    "CYCLE976", "CYCLE977", "CYCLE978", "CYCLE979", "CYCLE982", "CYCLE995", "CYCLE996", "CYCLE997",
    "CYCLE998",
];

/// Declares milling cycles that are not simulated, with what they mill.
macro_rules! milling {
    ($($($name:literal)+ = $what:literal),+ $(,)?) => {
        &[$($((
            $name,
            concat!($what, " is not simulated: post its motions as G1, G2 and G3"),
        )),+),+]
    };
}

const MILLING: &[(&str, &str)] = milling!(
    "POCKET1" "POCKET3" = "the cycle of a rectangular pocket",
    "POCKET2" "POCKET4" = "the cycle of a circular pocket",
    "SLOT1" = "the cycle of slots on a circle",
    "SLOT2" = "the cycle of circular slots",
    "LONGHOLE" "CYCLE899" = "the cycle of slots",
    "CYCLE61" "CYCLE71" = "the face milling cycle",
    "CYCLE62" "CYCLE63" "CYCLE64" "CYCLE72" = "the cycle along a contour",
    "CYCLE70" "CYCLE78" "CYCLE90" = "the thread milling cycle",
    "CYCLE76" = "the cycle of a rectangular spigot",
    "CYCLE77" = "the cycle of a circular spigot",
    "CYCLE79" = "the cycle of a polygon",
    "CYCLE60" = "the engraving cycle",
);

/// Returns true for a keyword, address or call without effect on the path.
pub(super) fn is_accepted(name: &str) -> bool {
    ACCEPTED.contains(&name)
}

/// Returns true for a G code that is executed.
pub(super) fn is_executed_g(code: u32) -> bool {
    matches!(
        code,
        0..=4 | 9 | 17..=19 | 25 | 26 | 40..=42 | 53..=60 | 63 | 64 | 70 | 71 | 74 | 75 | 90 | 91 | 93..=97
            | 110..=112 | 140 | 147 | 148 | 153 | 247 | 248 | 331 | 332 | 340 | 341 | 347 | 348 | 450 | 451 | 500 | 505..=599 | 641..=645 | 700 | 710 | 961 | 962 | 971..=973
    )
}

/// Returns true for a G code without effect on the path.
pub(super) fn is_accepted_g(code: u32) -> bool {
    ACCEPTED_G.contains(&code)
}

/// Returns what to do in place of a word that is not supported.
pub(super) fn remedy(name: &str) -> Option<&'static str> {
    let cycle =
        || CYCLES.contains(&name).then_some("the cycle is not simulated: post its motions as G1, G2 and G3");
    let found = REJECTED.iter().chain(MILLING).find(|(word, _)| *word == name);
    found.map(|(_, remedy)| *remedy).or_else(cycle)
}

/// Returns what to do in place of a G code that is not supported.
pub(super) fn g_remedy(code: u32) -> &'static str {
    match code {
        33..=35 | 335 | 336 => "threads are cut on a lathe: program G331 or CYCLE84",
        141..=143 => "the side of the approach is that of the compensation: program G140",
        291 => "the ISO mode is read with --dialect fanuc: give the program without G290 and G291",
        158 | 258 | 259 => {
            "of 802S and 802C: program TRANS X Y Z in place of G158, ROT RPL= of G258 and AROT RPL= of G259"
        }
        5 | 7 => "inclined axes are not supported",
        _ => "no such G code of this control, or none for milling",
    }
}

/// Returns true for a cycle of the control, executed or not.
pub(in crate::interpret) fn is_name_of_cycle(name: &str) -> bool {
    let is_numbered = ["CYCLE", "POCKET", "SLOT", "HOLES"].iter().any(|start| {
        let number = name.strip_prefix(start).unwrap_or_default();
        !number.is_empty() && number.bytes().all(|digit| digit.is_ascii_digit())
    });
    is_numbered || name == "LONGHOLE"
}
