//! Programs in the manner of post-processors and shops: they run as they are, with the motions counted by hand.

use virtual_axes_core::config::Parameters;
use virtual_axes_nc::interpret::{Dialect, IgnoredCodes, InterpreterOptions, Tool};
use virtual_axes_nc::motion::{Feed, ProgramEvent, ProgramMotion, ProgramStep};

use crate::common::{events, motions, steps};

/// Program with its motions at feed, and axis positions at the end, mm and degrees, where they are closed forms.
struct Post {
    text: &'static str,
    cuts: usize,
    end: [Option<f64>; 6],
}

const NX_THREE_AXIS: Post = Post {
    text: "%_N_SETUP_1_MPF\n;$PATH=/_N_WKS_DIR/_N_SETUP_1_WPD\nN10 DEF REAL _camtolerance\nN20 DEF REAL _X_HOME, _Y_HOME, _Z_HOME\n\
        N30 ;\nN40 _X_HOME=0 _Y_HOME=0 _Z_HOME=0\nN50 G40 G17 G710 G94 G90 G60 G601 FNORM\nN60 ;Start of Path\nN70 _camtolerance=0.06\n\
        N80 TRAFOOF\nN90 SUPA G0 Z=_Z_HOME D0\nN100 SUPA G0 X=_X_HOME Y=_Y_HOME D1\nN110 T=\"ENDMILL_10\"\nN120 M6\nN130 MSG(\"METHOD:MILL_ROUGH\")\n\
        N140 CYCLE832(_camtolerance,_ROUGH,1)\nN150 COMPCAD\nN160 G54\nN170 G0 X-20. Y15. S2500 D1 M3\nN180 Z30.\nN190 G1 Z-2. F250. M8\n\
        N200 X20.\nN210 G3 X25. Y20. I0.0 J5.\nN220 G1 Y40.\nN230 G0 Z30.\nN240 CYCLE832(0,_OFF,1)\nN250 M9\nN260 TRAFOOF\n\
        N270 SUPA G0 Z=_Z_HOME D0\nN280 SUPA G0 X=_X_HOME Y=_Y_HOME\nN290 M5\nN300 M30\n",
    cuts: 4,
    end: [Some(0.0), Some(0.0), Some(0.0), None, None, None],
};

const FUSION_DRILLING: Post = Post {
    text: "; %_N_1001_MPF\n;PLATE\n; T3 D=8 CR=0 TAPER=118DEG - ZMIN=-12 - DRILL\nN10 G90 G94\nN11 G71\nN12 G64\nN13 G17\n\
        N14 WORKPIECE(,\"\",,\"BOX\",112,0,-20,-80,0,0,100,100)\nN15 G0 SUPA Z0 D0\nN16 T3 M6\nN17 ; DRILL1\nN18 S2400 M3\nN19 G54\nN20 M8\n\
        N21 D1\nN22 G0 X10 Y10\nN23 G0 Z15\nN24 F200\nN25 MCALL CYCLE81(15, 0, 5, -12, , 0, 0, 10)\nN26 X10 Y10\nN27 X40\nN28 X40 Y40\nN29 MCALL\n\
        N30 G0 Z15\nN31 M9\nN32 G0 SUPA Z0 D0\nN33 G0 SUPA X0 Y0\nN34 M30\n",
    cuts: 3,
    end: [Some(0.0), Some(0.0), Some(0.0), None, None, None],
};

const FUSION_FIVE_AXIS: Post = Post {
    text: "; FIVE AXIS SWARF\nN1 G90 G94 G17 G71\nN2 G642\nN3 FFWON\nN4 SOFT\nN5 G0 SUPA Z0 D0\nN6 T1 M6\nN7 S8000 M3\nN8 G54 D1\nN9 CYCLE800()\n\
        N10 G0 A10 C=DC(45)\nN11 TRAORI\nN12 ORIAXES\nN13 ORIWKS\nN14 G0 X5 Y0 Z60\nN15 G1 X5 Y0 Z20 A12 C50 F1200\nN16 X8 Y2 A14 C60\nN17 X9 Y5 Z19.5 C70\n\
        N18 G0 Z60\nN19 TRAFOOF\nN20 G0 SUPA Z0 D0\nN21 G0 A0 C0\nN22 M30\n",
    cuts: 3,
    end: [None, None, Some(0.0), Some(0.0), None, Some(0.0)],
};

const POWERMILL_VECTORS: Post = Post {
    text: ";=======================\n; PROGRAM NAME : BLADE\n; POWERMILL\n;=======================\nG17 G40 G60 G90 G710\nTRAFOOF\nT=\"BALL_6\"\nM6\nD1\n\
        G54\nS12000 M3\nM8\nTRAORI(1)\nORIWKS\nORIVECT\nG645\nCTOL=0.01 OTOL=0.1\nUPATH\nG0 X0 Y0 Z50 A3=0 B3=0 C3=1\nG1 X1 Y0 Z10 A3=0 B3=0 C3=1 F2000\n\
        X2 A3=0 B3=0.001 C3=1\nX3 A3=0 B3=0.002 C3=1\nG0 Z50\nTRAFOOF\nM9\nM5\nG0 SUPA Z0 D0\nM30\n",
    cuts: 3,
    end: [None, None, Some(0.0), None, None, None],
};

const HYPERMILL_TILTED: Post = Post {
    text: "; --- hyperMILL ---\nN10 G710 G17 G90 G40\nN20 TRAFOOF\nN30 CYCLE800()\nN40 T=\"DRILL_5\"\nN50 M6\nN60 G54 D1\nN70 MSG(\"JOB 3: T DRILL_5\")\n\
        N80 CYCLE800(0,\"DMG\",200000,57,0,0,10,20,0,0,0,0,0,-1,100,1)\nN90 S1500 M3\nN100 G0 X10 Y5 Z50\nN110 F120\nN120 MCALL CYCLE83(50,0,2,-10,,,4,,0,0,1,0)\n\
        N130 X10 Y5\nN140 X20\nN150 MCALL\nN160 G0 Z80\nN170 CYCLE800()\nN180 CYCLE800(0,\"DMG\",200000,57,0,0,0,0,0,0,0,0,0,-1,100,1)\nN190 M30\n",
    // Two holes in three pecks, with two retractions each.
    cuts: 10,
    end: [None, None, None, Some(0.0), None, None],
};

const SHOP_POSITIONS: Post = Post {
    text: "WORKPIECE(,\"\",,\"RECTANGLE\",0,0,-20,-80,100,60)\nT=\"CENTERDRILL\"\nM6\nS3000M3\nG0 X0 Y0 Z20\nF300\nMCALL CYCLE82(5,0,1,,3,0.6,0,1,11)\n\
        CYCLE802(111111111,111111111,10,10,40,10,40,30,10,30,,,,,,,,,,,0,0,1)\nMCALL\nGROUP_BEGIN(0,\"ROUGH\",0,0)\nG1 Z-1\nX20\nGROUP_END(0,0)\nG0 Z50\nM30\n",
    cuts: 6,
    end: [Some(20.0), Some(30.0), None, None, None, None],
};

const R_PARAMETERS: Post = Post {
    text: "; steps of a slot\nR1=0 ;depth\nR2=1.5 ;step\nR3=-6\nG17 G90 G54 T1 D1\nM6\nG0 X0 Y0 Z5\nDOWN:\nR1=R1-R2\nG1 Z=R1 F100\nX30 F400\n\
        X0\nIF R1>R3 GOTOB DOWN\nG0 Z5\nM2\n",
    cuts: 12,
    end: [Some(0.0), Some(0.0), None, None, None, None],
};

const SUBPROGRAM_ARCHIVE: Post = Post {
    text: "%_N_PART_MPF\n;$PATH=/_N_WKS_DIR/_N_PART_WPD\nN10 G54 G17 G90 G71\nN20 T2 M6\nN30 G0 X0 Y0 Z2 D1\nN40 F500\nN50 TRANS X20 Y20\nN60 CONTOUR\n\
        N70 ATRANS X30\nN80 CONTOUR\nN90 TRANS\nN100 L10 P2\nN110 M30\n%_N_CONTOUR_SPF\n;$PATH=/_N_WKS_DIR/_N_PART_WPD\nG0 X0 Y0\nG1 Z-1\nX10\nY10\nX0\n\
        Y0\nG0 Z2\nM17\n%_N_L10_SPF\nG91 G1 X5\nG90\nRET\n",
    cuts: 12,
    end: [Some(60.0), Some(20.0), None, None, None, None],
};

const SMOOTHED: Post = Post {
    text: "N1 G0 G17 G40 G90 G94\nN2 G641 ADIS=0.02 ADISPOS=0.5\nN3 COMPON SOFT\nN4 T4\nN5 M6\nN6 G54 G0 X0 Y0 S6000 M3\nN7 D1 Z20 M8\nN8 G1 Z0 F1000\n\
        N9 X10 Y.5\nN10 X20 Y1.5\nN11 X30 Y3.\nN12 COMPOF\nN13 G0 Z20\nN14 STOPRE\nN15 M30\n",
    cuts: 4,
    end: [Some(30.0), Some(3.0), None, None, None, None],
};

const POLAR_BOLTS: Post = Post {
    text: "; 6 holes on a circle of 40 mm\nG17 G90 G54 G0 Z10\nG111 X0 Y0\nF150\nR1=0\nREPEAT\nG0 AP=R1*60 RP=20\nG1 Z-3\nG0 Z10\nR1=R1+1\nUNTIL R1==6\n\
        G0 X0 Y0\nM30\n",
    cuts: 6,
    end: [Some(0.0), Some(0.0), None, None, None, None],
};

const THREAD_MILLING: Post = Post {
    text: "N10 T=\"THREADMILL_M20\" M6\nN20 G17 G90 G54 D1 S1800 M3\nN30 G0 X0 Y-5 Z5\nN40 G0 Z-15\nN50 G41 G1 X5 Y-5 F300\nN60 G3 X10 Y0 Z-14.5 CR=5\n\
        N70 G3 X10 Y0 Z-2 I=AC(0) J=AC(0) TURN=4\nN80 G3 X5 Y5 Z-1.5 CR=5\nN90 G40 G1 X0 Y5\nN100 G0 Z50\nN110 M30\n",
    cuts: 5,
    end: [Some(0.0), Some(5.0), None, None, None, None],
};

const RAMP: Post = Post {
    text: "DEF REAL DEPTH=0, STEP_=-0.5, LENGTH=24\nDEF INT SIDE_=1\nG17 G90 G54 G0 X0 Y0 Z1\nG1 Z0 F200\nWHILE DEPTH>-2\nDEPTH=DEPTH+STEP_\n\
        IF SIDE_==1\nX=LENGTH Z=DEPTH\nELSE\nX0 Z=DEPTH\nENDIF\nSIDE_=-SIDE_\nENDWHILE\nG0 Z50\nM30\n",
    cuts: 5,
    end: [Some(0.0), Some(0.0), None, None, None, None],
};

const MIRRORED: Post = Post {
    text: "N10 G54 G17 G90 G71 F400 T2 M6\nN20 HALF\nN30 MIRROR X0\nN40 HALF\nN50 MIRROR\nN60 G0 X0 Y-20\nN70 M30\nPROC HALF\nG0 X5 Y0 Z2\nG1 Z-1\nX20\n\
        Y15 RND=4\nX5\nG0 Z2\nRET\n",
    // Each half: plunge, two sides with their rounding, one side.
    cuts: 10,
    end: [Some(0.0), Some(-20.0), None, None, None, None],
};

const TAPPING: Post = Post {
    text: "N5 T=\"TAP_M6\" M6\nN10 G54 G17 G90 D1\nN15 S500 M3\nN20 G0 X0 Y0 Z20\nN25 MCALL CYCLE84(20,0,3,-12,,0.2,3,6,,0,500,500,0,1,0,0,,1.4)\n\
        N30 HOLES1(0,0,0,10,15,4)\nN35 MCALL\nN40 G0 Z100\nN45 M30\n",
    cuts: 8,
    end: [Some(55.0), Some(0.0), None, None, None, None],
};

const HORIZONTAL: Post = Post {
    text: "N1 ;FIXTURE ON B TABLE\nN2 DEF REAL X_B0=5,Z_B0=7,X_B90=-3\nN3 DEFINE RETRACT AS G0 G53 Z930 D0 M9 M5\nN4 RETRACT\nN5 M193\nN6 T=\"17.1\" M6\n\
        N7 G0 G54 B0\nN8 TRANS X=X_B0 Z=Z_B0\nN9 G0 X=110+80/2 Y=80/2-2.5 D1 M3 S600\nN10 Z1.5 M8\nN11 G1 X0 F=600*8*0.06\nN12 RETRACT\n\
        N13 G0 B90\nN14 TRANS X=X_B90\nN15 G0 X10 Y0\nN16 G1 Z2\nN17 RETRACT\nN18 M30\n",
    cuts: 2,
    end: [Some(7.0), Some(0.0), Some(930.0), None, Some(90.0), None],
};

const ENGRAVING: Post = Post {
    text: "G17 G90 G54 G64 F800\nG0 X0 Y0 Z1\nG1 Z-0.2\nX10\nCT X20 Y10\nCIP X10 Y20 I1=17.0710678118655 J1=17.0710678118655\nG1 X0\nG2 X0 Y0 CR=10\nG0 Z5\nM30\n",
    cuts: 6,
    end: [Some(0.0), Some(0.0), Some(5.0), None, None, None],
};

const WARM_UP: Post = Post {
    text: "; SPINDLE WARM-UP, INCH\nG70 G90 G17\nG0 SUPA Z0\nG0 SUPA X0 Y0\nMSG(\"1200 RPM\")\nS1200 M3\nFOR R1=1 TO 2\nG0 SUPA X5 Y5\nG0 SUPA X0 Y0\nG4 F2\nENDFOR\n\
        M5\nMSG()\nM30\n",
    cuts: 0,
    end: [Some(0.0), Some(0.0), Some(0.0), None, None, None],
};

const FAMILY: Post = Post {
    text: "DEF INT VARIANT=2\nDEF STRING[16] NAME=\"BRACKET\"\nMSG(\"PART \"<<NAME<<\" VARIANT \"<<VARIANT)\nG54 G17 G90 G0 X0 Y0 Z5\nF300\n\
        CASE(VARIANT) OF 1 GOTOF SHORT_ 2 GOTOF LONG_ DEFAULT GOTOF FAULT_\nSHORT_: R10=20 GOTOF CUT_\nLONG_: R10=45\nCUT_:\nG1 Z-1\nX=R10\nG0 Z5\nGOTOF END_\n\
        FAULT_: SETAL(65000)\nM0\nEND_: M30\n",
    cuts: 2,
    end: [Some(45.0), Some(0.0), None, None, None, None],
};

const CHAMFERED_PLATE: Post = Post {
    text: "N10 G17 G90 G54 G71\nN20 T5 M6\nN30 G0 X-10 Y-10 Z5 D1 S3000 M3\nN40 G1 Z-3 F300\nN50 G1 X0 Y0\nN60 X40 CHF=2\nN70 Y30 CHR=3\nN80 X0 RND=5 FRC=100\n\
        N90 Y0\nN100 G0 Z50\nN110 G75 Z1=0\nN120 M30\n",
    // Plunge, approach, four sides, three corners.
    cuts: 9,
    end: [Some(0.0), Some(0.0), Some(0.0), None, None, None],
};

const SYNCHRONIZED: Post = Post {
    text: "N10 G290\nN20 EXTERN AIR_(INT)\nN30 ID=1 WHENEVER $AA_IW[Z]<5 DO M8\nN40 SETMS(1)\nN50 G26 S8000\nN60 FGROUP(X,Y,Z)\nN70 T1 D1 M6\nN80 S1=1500 M1=3\n\
        N90 G54 G0 X0 Y0 Z5\nN100 SPOS=0\nN110 G1 Z-1 F100\nN120 X5 FB=50\nN130 X10 G9\nN140 H100 M123\nN150 DYNFINISH FL[X]=2000\nN160 CANCEL(1)\nN170 G0 Z50 M5 M9\nN180 M30\n",
    cuts: 3,
    end: [Some(10.0), Some(0.0), None, None, None, None],
};

/// Returns the options of a machine with nine axes and tools, or of the built-in machine for programs with TRAORI.
fn options(text: &str) -> InterpreterOptions {
    let machine =
        Parameters::embedded_default().and_then(|parameters| parameters.machine_config()).expect("a machine");
    let mut options = match text.contains("TRAORI") || text.contains("CYCLE800(") {
        true => InterpreterOptions::for_machine(&machine),
        false => InterpreterOptions::default(),
    };
    options.tools.insert(1, Tool { length: 0.05, radius: 0.002, name: Some("ENDMILL_10".into()) });
    options.tools.insert(7, Tool { length: 0.04, radius: 0.001, name: Some("THREADMILL_M20".into()) });
    options
}

fn check(post: &Post) {
    // The dialect is detected from the content.
    let motions = motions(post.text, options(post.text));
    let is_cut = |motion: &&ProgramMotion| motion.feed != Feed::Rapid;
    assert_eq!(motions.iter().filter(is_cut).count(), post.cuts, "{}: {motions:#?}", post.text);
    let last = motions.last().expect("a motion");
    for (axis, expected) in post.end.iter().enumerate() {
        let found = if axis < 3 { last.end[axis] * 1e3 } else { last.end[axis].to_degrees() };
        assert!(
            expected.is_none_or(|expected| (found - expected).abs() < 1e-9),
            "{}: axis {axis} at {found}",
            post.text
        );
    }
    let steps = steps(post.text, options(post.text)).expect("steps");
    assert!(matches!(steps.last(), Some(ProgramStep::Event { .. })));
}

macro_rules! posts {
    ($($test:ident: $post:ident;)+) => {
        $(#[test]
        fn $test() {
            check(&$post);
        })+

        #[test]
        fn all_posts_are_detected() {
            for post in [$(&$post),+] {
                let options = options(post.text);
                let interpreter =
                    virtual_axes_nc::interpret::Interpreter::new(std::io::Cursor::new(post.text), "part.mpf", options);
                assert_eq!(interpreter.dialect().dialect, Dialect::Sinumerik, "{}", post.text);
            }
        }
    };
}

posts! {
    nx_three_axis: NX_THREE_AXIS;
    fusion_drilling: FUSION_DRILLING;
    fusion_five_axis: FUSION_FIVE_AXIS;
    powermill_vectors: POWERMILL_VECTORS;
    hypermill_tilted: HYPERMILL_TILTED;
    shop_positions: SHOP_POSITIONS;
    r_parameters: R_PARAMETERS;
    subprogram_archive: SUBPROGRAM_ARCHIVE;
    smoothed: SMOOTHED;
    polar_bolts: POLAR_BOLTS;
    thread_milling: THREAD_MILLING;
    ramp: RAMP;
    mirrored: MIRRORED;
    tapping: TAPPING;
    horizontal: HORIZONTAL;
    engraving: ENGRAVING;
    warm_up: WARM_UP;
    family: FAMILY;
    chamfered_plate: CHAMFERED_PLATE;
    synchronized: SYNCHRONIZED;
}

#[test]
fn tool_changes_of_machine_builders_and_shopmill_groups_are_accepted() {
    let text = "GROUP_BEGIN(0,\"HEAD\",0,0)\nWORKPIECE(,\"\",,\"BOX\",0,2,-30,-80,-2,-2,184,170)\nG54 G71 G90 G94\n\
                GROUP_END(0,0)\nT=\"MILL_10\"\nL6\nT2\nTC\nL6_TC(1,2)\nG0 X28 Y-55\nG1 Y221 F500\nM30\n";
    let options = InterpreterOptions { dialect: Some(Dialect::Sinumerik), ..InterpreterOptions::default() };
    let changes = events(text, options.clone());
    let changes = changes.iter().filter(|(_, event)| matches!(event, ProgramEvent::ToolChange(_))).count();
    assert_eq!(changes, 3);
    let last = motions(text, options).last().map(|motion| motion.end).expect("a motion");
    assert!((last[1] - 0.221).abs() < 1e-12);
}

#[test]
fn absent_subprograms_are_skipped_on_request() {
    let text = "N10 G0 X5\nL9010\nN20 TOOLCHECK(1,2)\nN30 X7\nM30\n";
    let mut options =
        InterpreterOptions { dialect: Some(Dialect::Sinumerik), ..InterpreterOptions::default() };
    let error = steps(text, options.clone()).expect_err("an absent subprogram").to_string();
    assert!(error.ends_with("or skip it with --ignore L9010"), "{error}");
    let patterns = ["L9010", "TOOLCHECK"].map(|name| name.parse().expect("a name"));
    options.ignored = IgnoredCodes::new(patterns.to_vec());
    assert_eq!(motions(text, options).len(), 2);
}
