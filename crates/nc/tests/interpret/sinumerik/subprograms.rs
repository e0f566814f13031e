//! Subprograms in the same file and beside it.

use std::fs;
use std::path::PathBuf;

use super::{options, x_ends};
use crate::common::{motions, steps};

#[test]
fn subprograms_of_the_file_take_values() {
    let cases: [(&str, &[f64]); 10] = [
        (
            "%_N_MAIN_MPF\n;$PATH=/_N_WKS_DIR/_N_PART_WPD\nG0 X1\nHOLE\nX2\nHOLE P2\nM30\n%_N_HOLE_SPF\nG91 X10\nG90\nM17",
            &[1.0, 11.0, 2.0, 12.0, 22.0],
        ),
        ("G0 X1\nSTEP_(5)\nSTEP_(3,4)\nM30\nPROC STEP_(REAL A_, REAL B_=1)\nX=A_*B_\nRET", &[1.0, 5.0, 12.0]),
        ("DEF REAL V=2\nDOUBLE(V)\nG0 X=V\nM30\nPROC DOUBLE(VAR REAL P_)\nP_=P_*2\nRET", &[4.0]),
        ("R7=2\nDOUBLE(R7)\nG0 X=R7\nM30\nPROC DOUBLE(VAR REAL P_)\nP_=P_*2\nRET", &[4.0]),
        (
            "DEF REAL V[2]=SET(3,4)\nSWAP(V)\nG0 X=V[0]*10+V[1]\nM30\nPROC SWAP(VAR REAL P_[2])\nDEF REAL T_\nT_=P_[0]\nP_[0]=P_[1]\nP_[1]=T_\nRET",
            &[43.0],
        ),
        ("G91 G0\nADD_(2) P3\nM30\nPROC ADD_(REAL A_)\nX=A_\nRET", &[2.0, 4.0, 6.0]),
        ("L100 P3\nM30\n%_N_L100_SPF\nG91 G0 X1\nRET", &[1.0, 2.0, 3.0]),
        ("G0 X1\nSTEP_(5)\nX2\nM30\nPROC STEP_(REAL A_)\nX=A_\nENDPROC\nX9", &[1.0, 5.0, 2.0]),
        ("CALL \"/_N_SPF_DIR/_N_UP_SPF\"\nM30\n%_N_UP_SPF\nG0 X6\nM17", &[6.0]),
        ("MCALL UP\nG0 X1\nX2\nMCALL\nX3\nM30\n%_N_UP_SPF\nG91 X10\nG90\nRET", &[1.0, 11.0, 2.0, 12.0, 3.0]),
    ];
    for (text, expected) in cases {
        assert_eq!(x_ends(text), expected, "{text}");
    }
}

#[test]
fn a_procedure_follows_its_comments() {
    let folder = Folder::new(
        "proc_comment",
        &[
            ("CUBE.SPF", "; cube of a value\n; ------\n\nPROC CUBE(VAR REAL P_)\nP_=P_*P_*P_\nRET\n"),
            ("TWICE.SPF", "%_N_TWICE_SPF\n;$PATH=/_N_SPF_DIR\nPROC TWICE(VAR REAL P_)\nP_=P_*2\nRET\n"),
        ],
    );
    let text = "DEF REAL V_=3\nEXTERN CUBE(VAR REAL)\nG0 X1\nFOR R1=1 TO 2\nCUBE(V_)\nTWICE(V_)\nX=V_\nV_=2\nENDFOR\nM30";
    let mut options = options();
    options.subprogram_folder = Some(folder.0.clone());
    let ends = motions(text, options);
    let x: Vec<_> = ends.iter().map(|motion| (motion.end[0] * 1e3).round()).collect();
    assert_eq!(x, [1.0, 54.0, 16.0]);
}

#[test]
fn save_restores_modes_and_the_end_of_a_file_returns() {
    let text = "G0 G90 X1\nINNER\nX2\nM30\nPROC INNER SAVE DISPLOF\nG91 X5\nTRANS X100\nRET";
    assert_eq!(x_ends(text), [1.0, 6.0, 2.0]);
    assert_eq!(x_ends("G0 X1\nINNER\nX2\nM30\n%_N_INNER_SPF\nX9"), [1.0, 9.0, 2.0]);
}

/// Folder with files, which is removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, files: &[(&str, &str)]) -> Self {
        let path = std::env::temp_dir().join(format!("virtual_axes_{name}_{}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder");
        for (file, text) in files {
            fs::write(path.join(file), text).expect("a file");
        }
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn files_beside_the_program_are_subprograms() {
    let folder = Folder::new(
        "subprograms",
        &[
            (
                "Row.spf",
                "PROC ROW(REAL FIRST_, INT COUNT_)\nDEF INT I_\nFOR I_=1 TO COUNT_\nG0 X=FIRST_+I_\nSHIFT_\nENDFOR\nRET\n",
            ),
            ("SHIFT_.SPF", "G91 X0.5\nG90\nM17\n"),
            ("BROKEN.SPF", "G0 X1\nG0 X=NOTHING\n"),
        ],
    );
    let mut options = options();
    options.subprogram_folder = Some(folder.0.clone());
    let text = "EXTERN ROW(REAL, INT)\nG0 X1\nROW(10,2)\nX5\nROW(20,1)\nM30\n";
    let found = motions(text, options.clone());
    let ends: Vec<f64> = found.iter().map(|motion| (motion.end[0] * 1e6).round() / 1e3).collect();
    assert_eq!(ends, [1.0, 11.0, 11.5, 12.0, 12.5, 5.0, 21.0, 21.5]);
    // Motions of a file have the line of its call.
    let lines: Vec<usize> = found.iter().map(|motion| motion.line).collect();
    assert_eq!(lines, [2, 3, 3, 3, 3, 4, 5, 5]);
    let error = steps("G0 X2\nBROKEN\n", options.clone()).expect_err("an error").to_string();
    assert!(error.starts_with("BROKEN.SPF:2: NOTHING has no value"), "{error}");
    let error = steps("AGAIN\nM30\n%_N_AGAIN_SPF\nAGAIN\nRET\n", options).expect_err("an error").to_string();
    assert!(error.contains("nested more than 50 levels deep"), "{error}");
}
