//! Tool table: numbers, names, lengths and radii; files of LinuxCNC and CSV files.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use virtual_axes_core::encoding::decode_text;
use virtual_axes_core::units::MILLIMETER;

/// Largest number of tools in a table.
const MAX_TOOLS: usize = 100_000;
/// Longest file, bytes.
const MAX_TABLE: u64 = 1 << 24;
/// Largest length and radius, m.
const MAX_SIZE: f64 = 100.0;

/// Tool with its geometry.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tool {
    /// Length along the tool axis, m.
    pub length: f64,
    /// Radius, m.
    pub radius: f64,
    /// Name, as in `T="MILL_10"`.
    pub name: Option<String>,
}

/// Tools by number.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ToolTable {
    tools: BTreeMap<u32, Tool>,
}

impl ToolTable {
    /// Returns the tool with a number.
    pub fn get(&self, number: u32) -> Option<&Tool> {
        self.tools.get(&number)
    }

    /// Returns number and tool by name, without regard to case.
    pub fn named(&self, name: &str) -> Option<(u32, &Tool)> {
        let is_named = |tool: &Tool| tool.name.as_ref().is_some_and(|known| known.eq_ignore_ascii_case(name));
        self.tools.iter().find(|(_, tool)| is_named(tool)).map(|(number, tool)| (*number, tool))
    }

    /// Adds or replaces a tool.
    pub fn insert(&mut self, number: u32, tool: Tool) {
        self.tools.insert(number, tool);
    }

    /// Returns the tool with a number for a change, which is added if it is missing.
    pub(super) fn entry(&mut self, number: u32) -> &mut Tool {
        self.tools.entry(number).or_default()
    }

    /// Adds the tools of another table, which replace those of the same number.
    pub(super) fn replace_with(&mut self, other: Self) {
        self.tools.extend(other.tools);
    }

    /// Reads a file with a tool table of LinuxCNC or a CSV table, see [`parse`](Self::parse).
    ///
    /// # Errors
    ///
    /// Returns an error with the file, if it cannot be read, is longer than 16 MiB, or contains an invalid entry.
    pub fn from_file(path: &Path) -> Result<Self, String> {
        let mut bytes = Vec::new();
        let name = path.display();
        let read = File::open(path).and_then(|file| file.take(MAX_TABLE + 1).read_to_end(&mut bytes));
        match read.map_err(|error| format!("{name}: {error}"))? as u64 > MAX_TABLE {
            true => Err(format!("{name}: the table is longer than {MAX_TABLE} bytes")),
            false => decode_text(&bytes)
                .and_then(|text| Self::parse(&text))
                .map_err(|error| format!("{name}: {error}")),
        }
    }

    /// Returns the number of tools.
    pub fn len(&self) -> usize {
        self.tools.len()
    }

    /// Returns true without tools.
    pub fn is_empty(&self) -> bool {
        self.tools.is_empty()
    }

    /// Parses a tool table of LinuxCNC (`T1 P1 Z50 D10 ;name`, in mm, D is the diameter), or a CSV table whose header names
    /// its columns: `number`, `length_mm`, `radius_mm` or `diameter_mm`, `name`.
    ///
    /// # Errors
    ///
    /// Returns an error with the line of an invalid entry.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut table = Self::default();
        let mut columns: Option<Vec<Column>> = None;
        for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            let content = line.trim();
            if content.is_empty() || content.starts_with([';', '#']) {
                continue;
            }
            let at = |reason: String| format!("line {}: {reason}", index + 1);
            let (number, tool) = match &columns {
                Some(columns) => csv_tool(content, columns).map_err(at)?,
                None if is_linuxcnc(content) => linuxcnc_tool(content).map_err(at)?,
                None if table.is_empty() => {
                    columns = Some(header(content).map_err(at)?);
                    continue;
                }
                None => return Err(at(format!("{content}: must begin with T, the number of the tool"))),
            };
            if table.len() >= MAX_TOOLS {
                return Err(at(format!("more than {MAX_TOOLS} tools")));
            }
            if table.tools.insert(number, tool).is_some() {
                return Err(at(format!("tool {number} is given twice")));
            }
        }
        match table.is_empty() {
            true => Err(
                "no tool: a line is T1 Z50 D10, or a CSV table has the columns number,length_mm,radius_mm"
                    .to_owned(),
            ),
            false => Ok(table),
        }
    }
}

/// Column of a CSV table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Number,
    Length,
    Radius,
    Diameter,
    Name,
    Other,
}

fn is_linuxcnc(line: &str) -> bool {
    let mut letters = line.chars();
    matches!(letters.next(), Some('T' | 't')) && letters.next().is_some_and(|letter| letter.is_ascii_digit())
}

fn linuxcnc_tool(line: &str) -> Result<(u32, Tool), String> {
    let (words, comment) = line.split_once(';').unwrap_or((line, ""));
    let (mut number, mut tool) = (None, Tool::default());
    for word in words.split_whitespace() {
        let letter = word.chars().next().unwrap_or_default();
        let value = &word[letter.len_utf8()..];
        match letter.to_ascii_uppercase() {
            'T' => {
                number = Some(value.parse().map_err(|_| format!("{word}: the number must be an integer"))?)
            }
            'Z' => tool.length = length(value, word)?,
            'D' => tool.radius = 0.5 * length(value, word)?,
            'P' | 'X' | 'Y' | 'A' | 'B' | 'C' | 'U' | 'V' | 'W' | 'I' | 'J' | 'Q' => {}
            _ => return Err(format!("{word}: must be one of T P X Y Z A B C U V W D I J Q with a number")),
        }
    }
    let comment = comment.trim();
    tool.name = (!comment.is_empty()).then(|| comment.to_owned());
    Ok((number.ok_or("T, the number of the tool, is missing")?, tool))
}

fn header(line: &str) -> Result<Vec<Column>, String> {
    let column = |name: &str| match name.trim().trim_matches('"').to_ascii_lowercase().as_str() {
        "number" | "tool" | "t" | "no" => Column::Number,
        "length_mm" | "length" | "z" => Column::Length,
        "radius_mm" | "radius" | "r" => Column::Radius,
        "diameter_mm" | "diameter" | "d" => Column::Diameter,
        "name" | "description" | "comment" => Column::Name,
        _ => Column::Other,
    };
    let columns: Vec<_> = line.split(separator(line)).map(column).collect();
    match columns.contains(&Column::Number) && columns.contains(&Column::Length) {
        true => Ok(columns),
        false => Err(format!(
            "{line}: neither a tool of LinuxCNC, T1 Z50 D10, nor a header with number, length_mm, and radius_mm or \
             diameter_mm"
        )),
    }
}

fn csv_tool(line: &str, columns: &[Column]) -> Result<(u32, Tool), String> {
    let (mut number, mut tool) = (None, Tool::default());
    for (column, text) in columns.iter().zip(line.split(separator(line))) {
        let text = text.trim().trim_matches('"').trim();
        match column {
            Column::Number => {
                let digits = text.trim_start_matches(['T', 't']);
                number = Some(digits.parse().map_err(|_| format!("{text}: the number must be an integer"))?);
            }
            Column::Name => tool.name = (!text.is_empty()).then(|| text.to_owned()),
            _ if text.is_empty() => {}
            Column::Length => tool.length = length(text, text)?,
            Column::Radius => tool.radius = length(text, text)?,
            Column::Diameter => tool.radius = 0.5 * length(text, text)?,
            Column::Other => {}
        }
    }
    Ok((number.ok_or("the number of the tool is missing")?, tool))
}

fn separator(line: &str) -> char {
    if line.contains(';') && !line.contains(',') { ';' } else { ',' }
}

/// Reads a length in mm; returns it in m.
fn length(text: &str, word: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().map(|value| value * MILLIMETER);
    let value = value.filter(|value| value.abs() <= MAX_SIZE);
    value.ok_or_else(|| format!("{word}: must be a length in mm, at most {} mm", MAX_SIZE / MILLIMETER))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_linuxcnc_and_csv_tables_give_the_same_tools() {
        let linuxcnc = "; shop\nT1 P1 Z50 D10 ;end mill\nt20 p2 z+61.5 d0.5\n";
        let csv = "\u{feff}number,length_mm,radius_mm,name\n1,50,5,end mill\nT20,61.5,0.25,\n";
        let semicolons = "Tool;Diameter;Length;Name\n1;10;50;end mill\n20;0.5;61.5;\n";
        let table = ToolTable::parse(linuxcnc).unwrap();
        assert_eq!(table, ToolTable::parse(csv).unwrap());
        assert_eq!(table, ToolTable::parse(semicolons).unwrap());
        assert_eq!(table.named("END MILL").map(|(number, tool)| (number, tool.length)), Some((1, 0.05)));
        assert_eq!(table.get(20).map(|tool| tool.radius), Some(0.25e-3));
    }

    #[test]
    fn invalid_tables_name_line_and_remedy() {
        for (text, expected) in [
            ("", "no tool: a line is T1 Z50 D10"),
            ("T1 Z50\nT1 Z60", "line 2: tool 1 is given twice"),
            ("T1 Zx", "line 1: Zx: must be a length in mm"),
            ("T1 Z1e9", "line 1: Z1e9: must be a length in mm, at most 100000 mm"),
            ("T1 H5", "line 1: H5: must be one of T P X"),
            ("number,length\n1,2\n,3", "line 3: : the number must be an integer"),
            ("hello\nworld", "line 1: hello: neither a tool of LinuxCNC"),
        ] {
            let error = ToolTable::parse(text).unwrap_err();
            assert!(error.starts_with(expected), "{text:?}: {error}");
        }
    }
}
