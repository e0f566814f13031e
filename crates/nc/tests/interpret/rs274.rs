//! Comparison with rs274 of LinuxCNC: tools/golden_rs274.py writes its canonical commands.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions, ProgramError, Tool, ToolTable};
use virtual_axes_nc::motion::ProgramStep;

use crate::canonical::{Item, from_canon, from_steps};

/// Feeds of rs274 are rounded twice, and those of G93 contain an arc length.
const RELATIVE: f64 = 1e-6;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rs274")
}

fn programs() -> Vec<PathBuf> {
    let entries = fs::read_dir(folder()).expect("the folder of programs");
    let mut programs: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    programs.retain(|path| path.extension().is_some_and(|extension| extension == "ngc"));
    let shipped = folder().join("../../../../config/programs");
    programs.extend(["circle-diamond-square.nc", "pocket.nc"].map(|name| shipped.join(name)));
    programs.sort();
    programs
}

/// Returns the tools of tools.tbl, which are in inches.
fn tools() -> ToolTable {
    let text = fs::read_to_string(folder().join("tools.tbl")).expect("the tool table");
    let mut tools = ToolTable::default();
    for line in text.lines() {
        let word = |letter: char| line.split(' ').find_map(|word| word.strip_prefix(letter));
        let inches =
            |letter: char| word(letter).map_or(0.0, |word| word.parse::<f64>().expect("a number") * 0.0254);
        let tool = Tool { length: inches('Z'), radius: 0.5 * inches('D'), name: None };
        tools.insert(word('T').expect("T").parse().expect("a number"), tool);
    }
    tools
}

fn interpreted(path: &Path) -> Result<Vec<ProgramStep>, ProgramError> {
    let options = InterpreterOptions {
        dialect: Some(Dialect::LinuxCnc),
        tools: tools(),
        default_tool_length: None,
        ..InterpreterOptions::default()
    };
    let name = path.file_name().and_then(|name| name.to_str()).expect("a name");
    Interpreter::new(Cursor::new(fs::read(path).expect("a program")), name, options).collect()
}

fn agree(found: &Item, expected: &Item) -> bool {
    let close = |(found, expected): (&(f64, f64), &(f64, f64))| {
        (found.0 - expected.0).abs() <= expected.1 + RELATIVE * expected.0.abs() + 1e-9
    };
    found.kind == expected.kind
        && found.numbers.len() == expected.numbers.len()
        && found.numbers.iter().zip(&expected.numbers).all(close)
}

#[test]
fn steps_agree_with_the_canonical_commands_of_rs274() {
    let programs = programs();
    assert!(programs.len() >= 40, "{} programs", programs.len());
    let (mut motions, mut faults) = (0, Vec::new());
    for path in &programs {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let canon = fs::read_to_string(folder().join(format!("{name}.canon"))).expect("the golden output");
        let expected = from_canon(&canon);
        let found = match interpreted(path) {
            Ok(steps) => from_steps(&steps),
            Err(error) => {
                faults.push(error.to_string());
                continue;
            }
        };
        motions += expected.iter().filter(|item| item.numbers.len() >= 6).count();
        let different = found.iter().zip(&expected).find(|(found, expected)| !agree(found, expected));
        if let Some((found, expected)) = different {
            faults.push(format!("{name}: {found:?}, rs274: {expected:?}"));
        } else if found.len() != expected.len() {
            let longer = if found.len() > expected.len() { &found } else { &expected };
            let first = &longer[found.len().min(expected.len())];
            faults.push(format!("{name}: {} items, rs274: {}; first {first:?}", found.len(), expected.len()));
        }
    }
    assert!(faults.is_empty(), "{} of {} programs:\n{}", faults.len(), programs.len(), faults.join("\n"));
    assert!(motions >= 300, "{motions} motions");
}
