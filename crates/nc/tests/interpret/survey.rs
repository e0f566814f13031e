//! Surveys of whole programs: all errors, travel excess with the work offset that fits, and files of subprograms.

use std::fs;
use std::path::PathBuf;

use virtual_axes_core::config::{DEFINITIONS, MachineConfig, ParameterKind, Parameters};
use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions, WorkOffset};
use virtual_axes_nc::offline::{PartProgramOptions, ProgramSurvey};

/// Folder that is removed at the end of its test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("virtual_axes_{name}_{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        Self(folder)
    }

    fn file(&self, name: &str, text: &str) -> String {
        let path = self.0.join(name);
        fs::write(&path, text).expect("a file");
        path.to_str().expect("UTF-8").to_owned()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn machine() -> MachineConfig {
    Parameters::embedded_default().expect("the default").machine_config().expect("a machine")
}

/// Returns the page of a program without its folder.
fn page(folder: &Folder, text: &str, options: &PartProgramOptions) -> Option<String> {
    let name = folder.file("part.nc", text);
    let survey = ProgramSurvey::new::<String>(&name, &[], &machine(), options, |_| Ok(())).expect("a file");
    survey.page(&name, &machine()).map(|page| page.replace(&name, "part.nc"))
}

#[test]
fn a_single_error_is_one_line_and_several_are_a_page() {
    let folder = Folder::new("survey_errors");
    let options = PartProgramOptions::default();
    assert_eq!(page(&folder, "G0 X1\nM2\n", &options), None);
    let one = page(&folder, "G0 X1\nG1 F100 X2 Q5\nM2\n", &options).expect("an error");
    assert_eq!(
        one,
        "part.nc:2: word Q has no effect in this line with G1: remove it, or program the code that it belongs to"
    );
    let linuxcnc = PartProgramOptions { dialect: Some(Dialect::LinuxCnc), ..PartProgramOptions::default() };
    let many = page(&folder, "G16\nG0 X1 B5\nG16\nM200\nM2\n", &linuxcnc).expect("errors");
    let lines: Vec<&str> = many.lines().collect();
    assert_eq!(lines[0], "part.nc: 3 errors, read in the dialect linuxcnc");
    assert!(
        lines[1].starts_with("part.nc:1: G16 is not supported") && lines[1].ends_with("(2 times)"),
        "{many}"
    );
    assert!(lines[2].starts_with("part.nc:2: word B: the machine has no axis B"), "{many}");
    assert!(lines[3].starts_with("part.nc:4: M200 is not supported"), "{many}");
}

#[test]
fn travel_excess_names_the_work_offset_that_fits() {
    let folder = Folder::new("survey_travel");
    let machine = machine();
    let limits = machine.axes().iter().find(|axis| axis.name() == "y").expect("y").limits();
    let (least, most) = (limits.travel_min * 1e3, limits.travel_max * 1e3);
    let options = PartProgramOptions::default();
    let text = "G54 G0 X10\nG1 F100 Y-300\nY-200\nM2\n";
    let found = page(&folder, text, &options).expect("beyond the travel");
    let rows: Vec<Vec<&str>> = found
        .lines()
        .skip(1)
        .map(|row| row.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect())
        .collect();
    assert!(found.starts_with("part.nc:2: y at -0.3 m (-300 mm) is outside of its travel limits"), "{found}");
    assert_eq!(rows[0], ["axis", "program", "travel", "work offset that fits"]);
    let fit = format!("G54 Y: {} mm to {} mm (now 0 mm)", least + 300.0, most + 200.0);
    assert_eq!(rows[1], ["y", "-300 mm to -200 mm", &format!("{least} mm to {most} mm"), fit.as_str()]);
    // With an offset within this range the program is valid.
    let offset = format!("G54=0,{},0", least + 300.0);
    let work_offsets = vec![offset.parse::<WorkOffset>().expect("an offset")];
    assert_eq!(page(&folder, text, &PartProgramOptions { work_offsets, ..options.clone() }), None);
    let machine_coordinates = page(&folder, "G53 G0 Y-300\nM2\n", &options).expect("beyond the travel");
    assert!(
        machine_coordinates
            .contains("machine coordinates (G53), or the point of G28 or G30: change the program"),
        "{machine_coordinates}"
    );
    // Increments count from where the axis starts, and G92 from where it stands: no offset moves these positions.
    for text in ["G54 G91\nG1 F100 Y-300\nM2\n", "G54 G92 Y5\nG1 F100 Y-295\nM2\n"] {
        let found = page(&folder, text, &options).expect("beyond the travel");
        assert!(found.contains(" -300 mm  "), "{found}");
        assert!(
            found.contains("none: G91 or G92 counts from where the axis starts: program a motion"),
            "{found}"
        );
    }
    // Behind a line with G90 the offset moves them.
    let found = page(&folder, "G54 G0 Y-100\nG91 G1 F100 Y-200\nM2\n", &options).expect("beyond the travel");
    assert!(
        found.contains(&format!("G54 Y: {} mm to {} mm (now 0 mm)", least + 300.0, most + 100.0)),
        "{found}"
    );
    // The offset of the program takes effect in place of a given one.
    let set =
        page(&folder, "G10 L2 P1 Y-300\nG54 G0 X10\nG1 F100 Y1\nM2\n", &options).expect("beyond the travel");
    assert!(set.contains("(now -300 mm), which the program sets by G10: change it there"), "{set}");
}

#[test]
fn subprograms_stand_in_files_beside_the_program() {
    let folder = Folder::new("survey_files");
    folder.file("drill.ngc", "o<drill> sub\nG0 X#1\nG0 X0\no<drill> endsub\nM2\n");
    folder.file("O0020.nc", "%\nO0020 (SUB)\nG91 G0 Y1.\nG90\nM99\n%\n");
    folder.file("OBORE.SSB", "OBORE\nG0 X=PX\nX0\nRTS\n");
    folder.file("OO30.SSB", "OO30\nG0 Y=PY\nRTS\n");
    folder.file("row.tap", "G91 G0 X1\nG90\nM99\n");
    folder.file("faulty.ngc", "o<faulty> sub\nG0 X1 Q7\no<faulty> endsub\n");
    let run = |text: &str, dialect: Dialect| -> Result<usize, String> {
        let options = InterpreterOptions {
            dialect: Some(dialect),
            subprogram_folder: Some(folder.0.clone()),
            ..InterpreterOptions::default()
        };
        let steps: Result<Vec<_>, _> =
            Interpreter::new(std::io::Cursor::new(text), "part.nc", options).collect();
        steps.map(|steps| steps.len()).map_err(|error| error.to_string())
    };
    assert_eq!(run("o<drill> call [5]\no<drill> call [7]\nG0 Y1\nM2\n", Dialect::LinuxCnc), Ok(6));
    assert_eq!(run("O1\nM98 P20 L3\nG0 X1.\nM30\n", Dialect::Fanuc), Ok(5));
    assert_eq!(run("O1\nM198 P20 L3\nM198\n#5201=0\nG0 X1.\nM30\n", Dialect::Fanuc), Ok(5));
    assert_eq!(run("$A.MIN%\nCALL OBORE PX=5\nCALL OO30 PY=4\nM2\n", Dialect::Okuma), Ok(4));
    assert_eq!(run("M98 (row.tap) L3\nG0 Y1\nM30\n", Dialect::Mach3), Ok(5));
    assert_eq!(run("O1\nM98 (/Memory/ROW.TAP)\nG0 Y1.\nM30\n", Dialect::Haas), Ok(3));
    let error = run("G0 X1\no<faulty> call\nM2\n", Dialect::LinuxCnc).expect_err("a fault");
    assert!(error.starts_with("faulty.ngc:2: word Q has no effect"), "{error}");
    // A value, and an error behind the return.
    folder.file("O0021.nc", "O0021\nG0 X1.\nG1 X2. F-1.\nM99\n");
    let error = run("O1\nM98 P21\nM30\n", Dialect::Haas).expect_err("a fault");
    assert!(error.starts_with("O0021.nc:3: word F: -1 is invalid"), "{error}");
    let error = run("O1\nM98 P20\nG0 X1. Q7\nM30\n", Dialect::Fanuc).expect_err("a fault");
    assert!(error.starts_with("part.nc:3: word Q has no effect"), "{error}");
    let error = run("o<none> call\nM2\n", Dialect::LinuxCnc).expect_err("no file");
    assert_eq!(
        error,
        "part.nc:1: Onone: no such subprogram in this file, and no file with its name beside it"
    );
}

#[test]
fn messages_name_the_file_of_a_subprogram() {
    let folder = Folder::new("survey_lines");
    folder.file("O77.nc", "O77\nG0 X1.\nM777\nG888\nG1 Y-300. F100. M98 P78\nM99\n");
    folder.file("O78.nc", "O78\nG1 X2. Q7\nM99\n");
    let options = PartProgramOptions { dialect: Some(Dialect::Haas), ..PartProgramOptions::default() };
    let found = page(&folder, "O1\nG0 Y1. Q8\nM98 P77\nM98 P77\nM30\n", &options).expect("errors");
    let lines: Vec<&str> = found.lines().collect();
    assert!(lines[1].starts_with("part.nc:2: word Q has no effect in this line with G0"), "{found}");
    assert!(
        found.contains("O77.nc:4: G888 is not supported") && found.matches("(2 times)").count() == 2,
        "{found}"
    );
    assert!(found.contains("O78.nc:2: word Q has no effect in this line with G1"), "{found}");
    assert!(
        found.contains("part.nc:3: y at -0.3 m (-300 mm) is outside of its travel limits")
            && found.contains("; this line calls O77.nc"),
        "{found}"
    );
    let name = folder.file("part.nc", "O1\nM98 P77\nM30\n");
    let survey = ProgramSurvey::new::<String>(&name, &[], &machine(), &options, |_| Ok(())).expect("a file");
    let notes = survey.notes();
    assert!(
        notes.iter().any(|note| *note == (2, "M777 is ignored, 1 in all (O77.nc:3)".to_owned())),
        "{notes:?}"
    );

    folder.file("LORENZ.SPF", "PROC LORENZ\nG0 X1\nSPLINE_X(3)\nRET\n");
    let options = PartProgramOptions { dialect: Some(Dialect::Sinumerik), ..PartProgramOptions::default() };
    for call in ["LORENZ", "CALL \"LORENZ\""] {
        let found = page(&folder, &format!("G0 X5\n{call}\nX=1+\nM30\n"), &options).expect("errors");
        let lines: Vec<&str> = found.lines().collect();
        assert!(lines[1].starts_with("LORENZ.SPF:3: "), "{found}");
        assert!(lines[2].starts_with("part.nc:3: "), "{found}");
    }
}

#[test]
fn a_machine_file_may_choose_every_dialect() {
    let definition = DEFINITIONS.iter().find(|definition| definition.key == "part_program.dialect");
    let Some(ParameterKind::Choice(names)) = definition.map(|definition| definition.kind) else {
        panic!("{definition:?}");
    };
    assert_eq!(names, Dialect::ALL.map(Dialect::name));
}

#[test]
fn axes_that_the_machine_lacks_are_a_set() {
    let folder = Folder::new("survey_axes");
    let survey = |text: &str| {
        let name = folder.file("part.nc", text);
        let options = PartProgramOptions::default();
        ProgramSurvey::new::<String>(&name, &[], &machine(), &options, |_| Ok(())).expect("a file")
    };
    let missing = |text: &str| survey(text).missing_axes.into_iter().collect::<String>();
    // The machine has X, Y, Z, A and C.
    assert_eq!(missing("G0 X1 A1\nM2\n"), "");
    assert_eq!(missing("G0 X1 B5\nG0 U3 B6 W1\nM2\n"), "BUW");
    assert_eq!(missing("G710 G54\nG0 X1 B=DC(90)\nM30\n"), "B");
}

#[test]
fn windings_beyond_the_travel_have_no_work_offset_that_fits() {
    let folder = Folder::new("survey_windings");
    let options = PartProgramOptions::default();
    // A of the machine turns from −30° to 120°.
    let found = page(&folder, "G54 G91\nG0 X1\nG1 F1000 A7200\nM2\n", &options).expect("beyond the travel");
    assert!(found.contains("none: a turns more than its travel: it must be continuous"), "{found}");
    let found = page(&folder, "G54\nG0 X1\nG1 F1000 A200\nM2\n", &options).expect("beyond the travel");
    assert!(found.contains("G54 A: -230° to -80° (now 0°), which turns workpiece or tool"), "{found}");
    for (text, dialect) in [
        ("G54\nT1 M6\nG43.4 H1\nG0 X1.\nG1 F1000. A130.\nM30\n", Dialect::Fanuc),
        ("G54\nTRAORI\nG0 X1\nG1 F1000 A=130\nM30\n", Dialect::Sinumerik),
    ] {
        let options = PartProgramOptions { dialect: Some(dialect), ..options.clone() };
        let found = page(&folder, text, &options).expect("beyond the travel");
        assert!(found.contains("none: an offset of A turns the tool: post the other solution"), "{found}");
    }
}
