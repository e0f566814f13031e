//! Axes whose programmed position at the start of a line follows from the lines before it, whatever the offsets, the tool, the
//! touch point of a probe and the optional lines are.

use super::super::words::WordLine;
use crate::interpret::code_of;
use crate::motion::{AXIS_COUNT, AXIS_LETTERS};

/// G codes in tenths beside which axis words are positions that the program reaches: motions and modes.
const MODES: [u32; 30] = [
    0, 10, 20, 30, 40, 170, 180, 190, 200, 210, 400, 610, 611, 640, 700, 710, 800, 900, 901, 910, 911, 930,
    940, 950, 960, 970, 980, 990, 490, 430,
];
/// Tool length offsets, which shift Z.
const LENGTHS: [u32; 3] = [430, 440, 490];
/// References without axis words, which move all axes.
const REFERENCES: [u32; 4] = [280, 281, 300, 301];
/// Codes that move, turn or scale the coordinates.
const SHIFTS: [u32; 23] = [
    100, 150, 160, 431, 434, 435, 500, 510, 520, 531, 680, 682, 683, 684, 690, 691, 920, 921, 922, 923, 501,
    511, 2340,
];
/// M codes without motion, and without another place in the program.
const AUXILIARY: [u32; 16] = [0, 1, 3, 4, 5, 7, 8, 9, 10, 11, 13, 14, 19, 29, 48, 49];

/// Position and compensation that are known at the start of a line.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct LineStart {
    /// Axes whose programmed position is known.
    pub known: [bool; AXIS_COUNT],
    /// True between G41 or G42 and the end of the line with G40.
    pub is_compensated: bool,
}

/// Returns what is known at the start of each line.
pub(super) fn line_starts(lines: &[String]) -> Vec<LineStart> {
    let has_jumps = lines.iter().any(|line| code_of(&line.to_uppercase()).contains("GOTO"));
    let mut state = State { start: LineStart::default(), is_absolute: true, has_jumps };
    lines
        .iter()
        .map(|line| {
            let mut start = state.start;
            state.read(line);
            start.is_compensated |= state.start.is_compensated;
            start
        })
        .collect()
}

/// Modes between lines.
struct State {
    start: LineStart,
    is_absolute: bool,
    /// True if each line with a number can follow another line than that before it.
    has_jumps: bool,
}

impl State {
    fn read(&mut self, line: &str) {
        if WordLine::is_comment(line) || line.trim().starts_with('%') {
            return;
        }
        let is_optional = line.trim().starts_with('/');
        // The slash can have the number of a switch.
        let text = line.trim().trim_start_matches(|c: char| is_optional && (c == '/' || c.is_ascii_digit()));
        let Some(words) = WordLine::literal_words(text) else {
            self.start.known = [false; AXIS_COUNT];
            return;
        };
        let has = |letter: char| words.iter().any(|(found, _)| *found == letter);
        let codes = |wanted: char| {
            words
                .iter()
                .filter(move |(letter, _)| *letter == wanted)
                .map(|(_, value)| (value * 10.0).round() as u32)
        };
        for code in codes('G') {
            match code {
                900 => self.is_absolute = true,
                910 => self.is_absolute = false,
                410..=423 => self.start.is_compensated = true,
                400 => self.start.is_compensated = false,
                _ => {}
            }
        }
        let is_work_offset = |code: u32| (540..=593).contains(&code);
        let are_modes = codes('G').all(|code| MODES.contains(&code) || is_work_offset(code));
        let given = AXIS_LETTERS.map(has);
        let leaves = codes('M').any(|code| !AUXILIARY.contains(&(code / 10)));
        let loses_all = leaves
            || (codes('G').any(|code| REFERENCES.contains(&code)) && given == [false; AXIS_COUNT])
            || codes('G').any(|code| is_work_offset(code) || SHIFTS.contains(&code))
            || ['U', 'V', 'W'].into_iter().any(has)
            || (self.has_jumps && has('N'));
        if loses_all {
            self.start.known = [false; AXIS_COUNT];
        }
        if codes('G').any(|code| LENGTHS.contains(&code)) {
            self.start.known[2] = false;
        }
        for (known, _) in self.start.known.iter_mut().zip(given).filter(|(_, is_given)| *is_given) {
            *known = are_modes && !is_optional && !leaves && (self.is_absolute || *known);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the letters of the known axes after the lines of a program, and `*` under compensation.
    fn known(program: &str) -> Vec<String> {
        let lines: Vec<String> = program.lines().map(str::to_owned).chain([String::new()]).collect();
        let letters = |start: &LineStart| -> String {
            let mark = start.is_compensated.then_some('*');
            AXIS_LETTERS
                .into_iter()
                .zip(start.known)
                .filter_map(|(letter, is)| is.then_some(letter))
                .chain(mark)
                .collect()
        };
        line_starts(&lines).iter().skip(1).map(letters).collect()
    }

    #[test]
    fn axes_are_known_from_their_words_until_the_machine_decides() {
        for (program, expected) in [
            ("G21 G90\nG0 X1 Y2\nG43 H1 Z50\nG1 Z-1 F100", &["", "XY", "XYZ", "XYZ"][..]),
            ("G0 X1 Y2 Z3\nG43 H2\nG1 X2\nG1 Z2", &["XYZ", "XY", "XY", "XYZ"]),
            ("G0 X1 Y2 Z3\nG55 X1\nY2", &["XYZ", "X", "XY"]),
            ("G0 X1 Y2 Z3\nG38.2 Z-5\nG53 G0 Z0\nG28 X0\nG28", &["XYZ", "XY", "XY", "Y", ""]),
            ("G0 X1 Y2 Z3\n/ X5\n/2 M8", &["XYZ", "YZ", "YZ"]),
            ("G0 X1 Y2 Z3\nG91 X1\nG28 Z0\nG90 Z1", &["XYZ", "XYZ", "XY", "XYZ"]),
            ("G0 X1 Y2 Z3\nM8\n(G55)\nM6\nX1\nM98 P5", &["XYZ", "XYZ", "XYZ", "", "X", ""]),
            ("G0 X1 Y2\nG1 G41 D1 X2\nY3\nG40 X0\nX1", &["XY*", "Y*", "Y*", "XY", "XY"]),
            ("N1 X1\nIF[#1EQ1]GOTO1\nX1\nN9 Y1", &["X", "", "X", "Y"]),
            ("G0 X1 Y2\nX#1\nG81 X1 Z-1 R1 F1\nX2\nG80\nG52 X1", &["XY", "", "", "X", "X", ""]),
        ] {
            assert_eq!(known(program), expected, "{program}");
        }
    }
}
