//! Variables, jumps and structures.

use super::x_ends;

#[test]
fn loops_and_conditions_run_as_often_as_their_counters_say() {
    let cases: [(&str, &[f64]); 12] = [
        ("R3=0\nBACK: R3=R3+1\nG0 X=R3*2\nIF R3<4 GOTOB BACK\nM30", &[2.0, 4.0, 6.0, 8.0]),
        ("FOR R2=1 TO 3\nG0 X=R2\nENDFOR\nG0 X10", &[1.0, 2.0, 3.0, 10.0]),
        ("FOR R2=3 TO 1\nG0 X=R2\nENDFOR\nG0 X10", &[10.0]),
        ("WHILE R1<3\nR1=R1+1\nG0 X=R1\nENDWHILE", &[1.0, 2.0, 3.0]),
        ("REPEAT\nR1=R1+1 G0 X=R1\nUNTIL R1>=2", &[1.0, 2.0]),
        ("LOOP\nR1=R1+5\nIF R1>12 GOTOF OUT\nG0 X=R1\nENDLOOP\nOUT: G0 X=R1", &[5.0, 10.0, 15.0]),
        ("IF R1==0\nG0 X1\nELSE\nG0 X2\nENDIF", &[1.0]),
        ("R1=1\nIF R1==0\nG0 X1\nELSE\nIF R1==1\nG0 X3\nENDIF\nENDIF\nG0 X4", &[3.0, 4.0]),
        (
            "R1=2\nCASE(R1) OF 1 GOTOF A1_ 2 GOTOF B1_ DEFAULT GOTOF C1_\nA1_: G0 X1\nB1_: G0 X2\nC1_: G0 X3",
            &[2.0, 3.0],
        ),
        (
            "N10 R1=R1+1\nN20 G0 X=R1\nN30 IF R1<2 GOTOB N10\nN40 GOTOF N60\nN50 G0 X99\nN60 G0 X7",
            &[1.0, 2.0, 7.0],
        ),
        ("R1=3\nGOTOF \"STEP_\"<<R1\nSTEP_2: G0 X2\nSTEP_3: G0 X3", &[3.0]),
        ("GOTOC NOWHERE\nG0 X1 GOTOF OUT\nG0 X2\nOUT: M30", &[1.0]),
    ];
    for (text, expected) in cases {
        assert_eq!(x_ends(text), expected, "{text}");
    }
}

#[test]
fn sections_are_repeated() {
    let cases: [(&str, &[f64]); 4] = [
        ("G91 G0\nBEGIN_: X1\nX2\nREPEAT BEGIN_ P=2\nX10", &[1.0, 3.0, 4.0, 6.0, 7.0, 9.0, 19.0]),
        ("G91 G0\nPART_: X1\nX2\nENDLABEL:\nX10\nREPEAT PART_", &[1.0, 3.0, 13.0, 14.0, 16.0]),
        ("G91 G0\nA_: X1\nB_: X2\nX4\nREPEAT A_ B_ P1", &[1.0, 3.0, 7.0, 8.0, 10.0]),
        ("G91 G0\nA_: X1\nX2\nREPEATB A_ P=3", &[1.0, 3.0, 4.0, 5.0, 6.0]),
    ];
    for (text, expected) in cases {
        assert_eq!(x_ends(text), expected, "{text}");
    }
}

#[test]
fn variables_have_types_arrays_and_first_values() {
    let cases: [(&str, &[f64]); 9] = [
        ("DEF REAL DEPTH=-4.5, OTHER\nG0 X=DEPTH\nX=OTHER", &[-4.5, 0.0]),
        ("DEF INT N=2.6\nG0 X=N", &[3.0]),
        ("DEF BOOL ON=TRUE\nIF ON\nG0 X5\nENDIF", &[5.0]),
        ("DEF REAL P[2,3]\nP[1,2]=7\nG0 X=P[1,2]", &[7.0]),
        ("DEF REAL P[3]=SET(1,2,4)\nG0 X=P[0]+P[1]+P[2]", &[7.0]),
        ("DEF REAL P[3]\nP=REP(2)\nG0 X=P[0]+P[1]+P[2]", &[6.0]),
        ("R[R1+5]=3 R1=R5*2\nG0 X=R1", &[6.0]),
        ("DEFINE UPWARD AS G0 X\nUPWARD 3\nUPWARD=2*2", &[3.0, 4.0]),
        ("_X_HOME=12 _Y_HOME=1\nG0 X=_X_HOME", &[12.0]),
    ];
    for (text, expected) in cases {
        assert_eq!(x_ends(text), expected, "{text}");
    }
    // An axis in a variable, and the position of the axis.
    assert_eq!(x_ends("DEF AXIS AX=X\nG0 X4\nR1=$AA_IW[AX] R2=$P_EP[Y]\nX=R1*2+R2"), [4.0, 8.0]);
}
