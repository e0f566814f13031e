//! Operations of a part program, which begin with a comment or a tool change: their times and energy.

use std::collections::{BTreeMap, VecDeque};
use std::io::{self, BufRead};

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::machine::Machine;
use virtual_axes_core::text::cut;
use virtual_axes_core::units::seconds;

use crate::interpret::{code_of, has_word};
use crate::plan::ProgramActivity;

/// Largest number of comments that begin an operation; the last operation has the rest of the program.
const MAX_COMMENTS: usize = 10_000;
/// Longest text of an operation, characters.
const TEXT: usize = 60;
/// Number of lines with the largest electrical input.
const LINES: usize = 10;

/// Times of a part program or of a part of it, s.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ProgramTimes {
    /// Motions at feed.
    pub feed: f64,
    /// Rapid traverse.
    pub rapid: f64,
    /// Dwells.
    pub dwell: f64,
    /// Standstills for tool changes and changes of the spindle speed.
    pub auxiliary: f64,
}

impl ProgramTimes {
    /// Returns the sum, s.
    pub fn total(&self) -> f64 {
        self.feed + self.rapid + self.dwell + self.auxiliary
    }
}

/// Electrical energy of all axes over a part of a program.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ProgramEnergy {
    /// Electrical input minus what was fed back, J.
    pub input: f64,
    /// Copper loss, J.
    pub copper_loss: f64,
}

impl ProgramEnergy {
    fn add(&mut self, other: &ProgramEnergy) {
        self.input += other.input;
        self.copper_loss += other.copper_loss;
    }
}

/// Number of position cycles of each [`TimeKind`](crate::plan::TimeKind), and energy.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    cycles: [u64; 4],
    energy: ProgramEnergy,
}

impl Sums {
    fn add(&mut self, other: &Sums) {
        self.cycles.iter_mut().zip(other.cycles).for_each(|(sum, cycles)| *sum += cycles);
        self.energy.add(&other.energy);
    }

    /// Returns the times for position cycles of `period` s.
    fn times(&self, period: f64) -> ProgramTimes {
        let [feed, rapid, dwell, auxiliary] = self.cycles.map(|cycles| cycles as f64 * period);
        ProgramTimes { feed, rapid, dwell, auxiliary }
    }
}

/// Operation of a part program.
#[derive(Debug, Clone, PartialEq)]
pub struct OperationFigures {
    /// Line of the comment that begins the operation; 0 for the start of the program.
    pub line: usize,
    /// Text of the comment; empty for the start of the program.
    pub text: String,
    /// Tool; `None` before the first tool change.
    pub tool: Option<u32>,
    /// Times.
    pub times: ProgramTimes,
    /// Energy; `None` if it was not evaluated.
    pub energy: Option<ProgramEnergy>,
}

/// Times and energy of a tool.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolFigures {
    /// Tool; `None` before the first tool change.
    pub tool: Option<u32>,
    /// Times.
    pub times: ProgramTimes,
    /// Energy; `None` if it was not evaluated.
    pub energy: Option<ProgramEnergy>,
}

/// Electrical energy of a source line.
#[derive(Debug, Clone, PartialEq)]
pub struct LineEnergy {
    /// Source line, from 1; 0 before the first motion.
    pub line: usize,
    /// Text of the line.
    pub text: String,
    /// Energy.
    pub energy: ProgramEnergy,
}

/// Times and energy of a part program by operation, tool and line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OperationSummary {
    /// Times of the program.
    pub times: ProgramTimes,
    /// Operations in order of their first setpoint.
    pub operations: Vec<OperationFigures>,
    /// Tools in order of their first setpoint.
    pub tools: Vec<ToolFigures>,
    /// Lines with the largest electrical input, the largest first; empty if energy was not evaluated.
    pub energy_lines: Vec<LineEnergy>,
}

/// Accumulator of times and energy by operation, tool and line.
#[derive(Debug)]
pub struct OperationMeter {
    /// Position period, s.
    period: f64,
    /// Sums by number of comments before the line and tool, in order of the first setpoint.
    operations: Vec<((usize, Option<u32>), Sums)>,
    /// Index in `operations` of the last one.
    last: usize,
    lines: BTreeMap<usize, ProgramEnergy>,
    has_energy: bool,
    /// Activities of the setpoints that the controllers have not seen yet, with their operations.
    delayed: VecDeque<(usize, usize)>,
    /// Position cycles by which the position controllers see their setpoints later.
    delay: usize,
    /// Energy of the ticks of a position cycle, which is not used.
    ticks: Vec<f64>,
}

impl OperationMeter {
    /// Creates an accumulator for the position cycles of a machine.
    pub fn new(machine: &MachineConfig) -> Self {
        let periods = machine.periods();
        let delay = machine.axes().iter().map(|axis| axis.delays.alpha).max().unwrap_or(0);
        OperationMeter {
            period: seconds(periods.position),
            operations: Vec::new(),
            last: 0,
            lines: BTreeMap::new(),
            has_energy: false,
            delayed: VecDeque::new(),
            delay: usize::try_from(delay / periods.position).unwrap_or(0),
            ticks: Vec::new(),
        }
    }

    /// Adds the time of a position cycle with the activity at its setpoint; `comments` are those of the program.
    pub fn add_time(&mut self, comments: &[(usize, String)], activity: ProgramActivity) {
        let ProgramActivity { kind, line, tool } = activity;
        let before = comments.partition_point(|(start, _)| *start <= line);
        let is_called = before > 0 && comments[before - 1].1.is_empty();
        let calling = || self.operations.get(self.last).map_or(0, |((comment, _), _)| *comment);
        let key = (if is_called { calling() } else { before }, tool);
        let is_first = self.operations.is_empty();
        if self.operations.get(self.last).is_none_or(|(last, _)| *last != key) {
            let known = self.operations.iter().position(|(other, _)| *other == key);
            self.last = known.unwrap_or_else(|| {
                self.operations.push((key, Sums::default()));
                self.operations.len() - 1
            });
        }
        // The program takes the time from the first setpoint to the last.
        if !is_first {
            self.operations[self.last].1.cycles[kind as usize] += 1;
        }
    }

    /// Adds a position cycle: the activity at its setpoint, `None` behind the last one, and the energy of the axes while
    /// they execute the setpoint that is older by the delay of the position controllers.
    pub(super) fn add(
        &mut self,
        comments: &[(usize, String)],
        activity: Option<ProgramActivity>,
        machine: &Machine,
    ) {
        if let Some(activity) = activity {
            self.add_time(comments, activity);
            self.delayed.push_back((self.last, activity.line));
        }
        // Behind the last setpoint the controllers still execute those before.
        let waiting =
            if activity.is_some() { self.delay + 1 } else { self.delayed.len().saturating_sub(1).max(1) };
        if self.delayed.len() > waiting {
            self.delayed.pop_front();
        }
        let Some(&(operation, line)) = self.delayed.front().filter(|_| machine.records_every_tick()) else {
            return;
        };
        self.has_energy = true;
        self.ticks.resize(machine.ticks_per_period(), 0.0);
        let mut energy = ProgramEnergy::default();
        for axis in 0..machine.axis_count() {
            let cycle = machine.cycle_energy(axis, &mut self.ticks);
            energy.input += cycle.input;
            energy.copper_loss += cycle.copper_loss;
        }
        self.operations[operation].1.energy.add(&energy);
        self.lines.entry(line).or_default().add(&energy);
    }

    /// Returns times and energy; `comments` are those of the program, and the texts of lines stay empty.
    pub fn finish(mut self, comments: &[(usize, String)]) -> OperationSummary {
        // The first setpoint, before any step of the program, has no time.
        if let [(_, first), (_, second), ..] = &mut self.operations[..]
            && first.cycles == [0; 4]
        {
            second.add(first);
            self.operations.remove(0);
        }
        let energy = |sums: &Sums| self.has_energy.then_some(sums.energy);
        let (mut total, mut tools) = (Sums::default(), Vec::<(Option<u32>, Sums)>::new());
        let mut operations = Vec::new();
        for ((comment, tool), sums) in &self.operations {
            total.add(sums);
            match tools.iter_mut().find(|(known, _)| known == tool) {
                Some((_, known)) => known.add(sums),
                None => tools.push((*tool, *sums)),
            }
            let (line, text) = match comment.checked_sub(1).and_then(|index| comments.get(index)) {
                Some((line, text)) => (*line, text.clone()),
                None => (0, String::new()),
            };
            let (times, energy) = (sums.times(self.period), energy(sums));
            operations.push(OperationFigures { line, text, tool: *tool, times, energy });
        }
        let tool = |(tool, sums): &(Option<u32>, Sums)| ToolFigures {
            tool: *tool,
            times: sums.times(self.period),
            energy: energy(sums),
        };
        let line = |(line, energy)| LineEnergy { line, text: String::new(), energy };
        let tools = tools.iter().map(tool).collect();
        // Line 0 is before the first motion.
        let mut energy_lines: Vec<LineEnergy> =
            self.lines.into_iter().filter(|(line, _)| *line > 0).map(line).collect();
        energy_lines.sort_by(|a, b| b.energy.input.total_cmp(&a.energy.input));
        energy_lines.truncate(LINES);
        OperationSummary { times: total.times(self.period), operations, tools, energy_lines }
    }
}

/// Returns lines that are a comment alone, with their texts, from 1: `( )`, from `;` on, or `MSG("")`. Of comments in a
/// row the last one counts. Lines at which a subprogram begins or ends have no text: what follows them belongs to the
/// operation that calls it.
///
/// # Errors
///
/// Returns an error if the program cannot be read.
pub(super) fn comment_lines(program: impl BufRead) -> io::Result<Vec<(usize, String)>> {
    let mut found: Vec<(usize, String)> = Vec::new();
    for (index, line) in program.split(b'\n').enumerate() {
        let line = line?;
        let line = String::from_utf8_lossy(&line);
        let Some(text) = comment(&line).or_else(|| is_program_boundary(&line).then(String::new)) else {
            continue;
        };
        if found.last().is_some_and(|(last, _)| *last == index) {
            found.pop();
        }
        if found.len() == MAX_COMMENTS {
            break;
        }
        found.push((index + 1, text));
    }
    Ok(found)
}

/// Returns true for a line at which a program or subprogram begins or ends.
fn is_program_boundary(line: &str) -> bool {
    let code = code_of(&line.to_uppercase());
    let code = code.trim_end_matches('(');
    let rest = match code.strip_prefix("O<") {
        Some(rest) => rest.split_once('>').map(|(_, rest)| rest),
        None => {
            code.strip_prefix(['O', ':']).map(|rest| rest.trim_start_matches(|c: char| c.is_ascii_digit()))
        }
    };
    let begins = rest.is_some_and(|rest| matches!(rest, "" | "SUB" | "ENDSUB"));
    let ends = ["M2", "M02", "M30", "M99", "M17", "RET"];
    begins || code.starts_with("%_N_") || ends.iter().any(|end| has_word(code, end))
}

/// Returns the text of a line that is a comment alone.
fn comment(line: &str) -> Option<String> {
    let line = line.trim_start_matches('/').trim();
    let digits =
        line.strip_prefix(['N', 'n']).map(|rest| rest.trim_start_matches(|c: char| c.is_ascii_digit()));
    let line = digits.unwrap_or(line).trim();
    let message = line.strip_prefix("MSG").map(|rest| rest.trim().trim_matches(['(', ')']).trim_matches('"'));
    let bracketed = line.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
    let text = message.or(bracketed.filter(|text| !text.contains(['(', ')']))).or(line.strip_prefix(';'))?;
    let text = cut(&text.trim().replace(char::is_control, ""), TEXT);
    text.chars().any(char::is_alphanumeric).then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_of_each_control_begin_operations() {
        let text = "%\nO1 (PART)\n(T1 D=10)\n( 2D Contour1 )\nT1 M6\n(x)(y)\nG1 X1 (inside)\n; Facing\n/N10 (Drill)\n(---)\n\
                    N20 MSG(\"Bore\")\n()\n";
        let found = comment_lines(text.as_bytes()).unwrap();
        let expected = [(4, "2D Contour1"), (9, "Drill"), (11, "Bore")];
        let found: Vec<_> = found.into_iter().filter(|(_, text)| !text.is_empty()).collect();
        assert_eq!(found, expected.map(|(line, text)| (line, text.to_owned())));
        let text = "O1\n(FIRST)\nM98 P100\nM30\nO100 (PATH)\nG1 X1\nM99\n(LAST)\n\no<hole> sub\no<hole> call\n%_N_A_SPF\n";
        let lines: Vec<(usize, bool)> = comment_lines(text.as_bytes())
            .unwrap()
            .iter()
            .map(|(line, text)| (*line, text.is_empty()))
            .collect();
        assert_eq!(lines, [(2, false), (5, true), (8, false), (10, true), (12, true)]);
        let long = format!("({})", "ä".repeat(61));
        assert_eq!(comment(&long), Some("ä".repeat(60) + "…"));
        assert_eq!(comment(&long.replacen('ä', "", 1)), Some("ä".repeat(60)));
    }
}
