//! Random programs: each is interpreted or rejected with one line, with finite coordinates.

use std::io::Cursor;
use std::sync::LazyLock;

use proptest::prelude::*;
use virtual_axes_core::config::Parameters;
use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions};
use virtual_axes_nc::motion::ProgramStep;

/// Pieces of programs.
const PIECES: &[&str] = &[
    "\n",
    "\n",
    "\n",
    "\n",
    " ",
    "N10 ",
    "G0 ",
    "G1 ",
    "G2 ",
    "G3 ",
    "CIP ",
    "CT ",
    "X10 ",
    "Y=AC(5) ",
    "Z-3.5 ",
    "X=IC(R1) ",
    "A10 ",
    "C=DC(90) ",
    "C=ACN(-10) ",
    "I5 ",
    "J=AC(3) ",
    "I1=3 ",
    "J1=4 ",
    "CR=7 ",
    "CR=-7 ",
    "AR=90 ",
    "AP=30 ",
    "RP=5 ",
    "TURN=3 ",
    "RND=1 ",
    "RNDM=2 ",
    "CHF=1 ",
    "CHR=0.5 ",
    "F500 ",
    "F=R2 ",
    "FB=3 ",
    "S1000 M3 ",
    "T1 M6 D1 ",
    "T=\"MILL\" ",
    "D0 ",
    "D1 ",
    "G17 ",
    "G18 ",
    "G19 ",
    "G40 ",
    "G41 ",
    "G42 ",
    "G54 ",
    "G505 ",
    "G500 ",
    "G599 ",
    "G53 ",
    "SUPA ",
    "G60 ",
    "G64 ",
    "G641 ADIS=0.1 ",
    "G642 ",
    "G70 ",
    "G710 ",
    "G90 ",
    "G91 ",
    "G93 ",
    "G95 ",
    "G110 ",
    "G111 ",
    "G4 F1 ",
    "G4 S3 ",
    "G58 ",
    "G59 ",
    "G74 ",
    "G75 FP=2 ",
    "G331 K1 ",
    "TRANS ",
    "ATRANS ",
    "ROT ",
    "AROT ",
    "RPL=30 ",
    "SCALE ",
    "ASCALE ",
    "MIRROR ",
    "TRAORI ",
    "TRAFOOF ",
    "ORIVECT ",
    "ORIAXES ",
    "ORIMKS ",
    "ORIRPY ",
    "A3=1 ",
    "B3=-0.5 ",
    "C3=2 ",
    "A2=10 ",
    "C2=400 ",
    "CYCLE800(1,\"T\",0,57,1,2,3,10,20,30,0,0,0,-1) ",
    "CYCLE800() ",
    "CYCLE800(0,\"\",1,192,0,0,0,30,0) ",
    "CYCLE81(10,0,2,-6) ",
    "MCALL ",
    "CYCLE83(10,0,2,-12,,,5,1,0.1,0,1,1) ",
    "CYCLE84(10,0,2,-6,,0,3,8) ",
    "CYCLE86(10,0,2,-6,,0,3,1,1,1) ",
    "HOLES1(0,0,0,10,20,3) ",
    "HOLES2(0,0,10,0,0,4) ",
    "CYCLE832(0.01,1) ",
    "R1=R1+1 ",
    "R2=R1*3-(2) ",
    "R[R1]=5 ",
    "R1=1EX9 ",
    "DEF REAL V=2, W[2] ",
    "V=SIN(R1) ",
    "W[R1]=3 ",
    "DEFINE M_ AS G0 X ",
    "M_ ",
    "IF R1<3 ",
    "GOTOB L1 ",
    "GOTOF L2 ",
    "GOTO N10 ",
    "ELSE ",
    "ENDIF ",
    "LOOP ",
    "ENDLOOP ",
    "FOR R3=1 TO 3 ",
    "ENDFOR ",
    "WHILE R1<5 ",
    "ENDWHILE ",
    "REPEAT ",
    "UNTIL R1>2 ",
    "REPEAT L1 P=2 ",
    "REPEATB L2 P2 ",
    "CASE(R1) OF 1 GOTOF L2 DEFAULT GOTOB L1 ",
    "L1: ",
    "L2: ",
    "SUB_ ",
    "SUB_(1,R1) P2 ",
    "L5 P2 ",
    "%_N_SUB__SPF\n",
    "PROC SUB_(REAL P_, VAR REAL Q_) SAVE ",
    "RET ",
    "M17 ",
    "M30 ",
    "MSG(\"A\"<<R1) ",
    "$P_UIFR[1,X,TR]=3 ",
    "$P_UIFR[2]=CTRANS(X,5):CROT(Z,30) ",
    "$P_PFRAME=CROT(X,10) ",
    "$TC_DP6[1,1]=2 ",
    "R4=$AA_IM[X] ",
    "(",
    ")",
    "=",
    "\"",
    ";",
    "[",
    "'HFF'",
    "-",
    "1e400",
    "99999999999999999999",
    "%",
    "/1 ",
    ":",
    "é",
];

static OPTIONS: LazyLock<InterpreterOptions> = LazyLock::new(|| {
    let machine =
        Parameters::embedded_default().and_then(|parameters| parameters.machine_config()).expect("a machine");
    InterpreterOptions {
        dialect: Some(Dialect::Sinumerik),
        repeated_lines: 300,
        ..InterpreterOptions::for_machine(&machine)
    }
});

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, ..ProptestConfig::default() })]

    #[test]
    fn random_programs_are_interpreted_or_rejected(
        pieces in prop::collection::vec(prop::sample::select(PIECES), 1..80),
        reports_all_errors: bool,
    ) {
        let options = InterpreterOptions { reports_all_errors, ..OPTIONS.clone() };
        let mut steps = Interpreter::new(Cursor::new(pieces.concat()), "part.mpf", options);
        for step in steps.by_ref().take(2000) {
            match step {
                Ok(ProgramStep::Motion(motion)) => {
                    prop_assert!(motion.start.iter().chain(&motion.end).all(|value| value.is_finite()), "{motion:?}");
                }
                Ok(ProgramStep::Event { .. }) => {}
                Err(error) => {
                    let error = error.to_string();
                    prop_assert!(error.starts_with("part.mpf:") && !error.contains('\n') && error.len() < 2000, "{error}");
                }
            }
        }
    }
}
