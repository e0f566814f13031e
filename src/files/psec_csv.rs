//! PSEC from CSV: `time,x,y,z,a,c` in s, m and rad.

use std::io::Read;

use crate::trajectory::{Rejection, Request, Row, Start};
use crate::units::{Nanoseconds, SECOND_NS};

/// The column of times.
const TIME: &str = "time";
/// The largest time, s: three years, more than anybody waits for.
const LONGEST: f64 = 1e8;

/// Why a file of set-points cannot be used; each names file and line.
#[derive(Debug, thiserror::Error)]
pub enum PsecError {
    /// The file cannot be read, or is not CSV.
    #[error("{file}: {reason}")]
    Unreadable {
        /// Name of the file.
        file: String,
        /// What the reader says, with the line where there is one.
        reason: String,
    },
    /// The first line is not a header that begins with `time` and names joints.
    #[error("{file}:1: the header is \"{found}\"; it begins with \"{TIME}\", then a joint for each column")]
    Header {
        /// Name of the file.
        file: String,
        /// What stands there.
        found: String,
    },
    /// A field is not a number.
    #[error("{file}:{line}: {column} is \"{found}\", must be a finite number")]
    Number {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Header of the column.
        column: String,
        /// What stands there.
        found: String,
    },
    /// A time is out of range.
    #[error("{file}:{line}: {TIME} is {found} s, must lie in ±{LONGEST} s")]
    Time {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// What stands there.
        found: f64,
    },
    /// A point is refused.
    #[error("{file}:{line}: {rejection}")]
    Point {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: u64,
        /// Why.
        rejection: Rejection,
    },
    /// There is no point.
    #[error("{file}: there is no set-point below the header")]
    Empty {
        /// Name of the file.
        file: String,
    },
}

/// Reads set-points, s, m and rad, one line each under a header; `file` is for messages.
///
/// # Errors
/// [`PsecError`], the first fault from the top.
pub fn read_psec(input: impl Read, file: &str) -> Result<Request, PsecError> {
    let unreadable =
        |error: csv::Error| PsecError::Unreadable { file: file.to_owned(), reason: error.to_string() };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(input);
    let header = reader.headers().map_err(unreadable)?.clone();
    let joints: Vec<String> = header.iter().skip(1).map(str::to_owned).collect();
    if header.get(0) != Some(TIME) || joints.is_empty() || joints.iter().any(String::is_empty) {
        let found = header.iter().collect::<Vec<_>>().join(",");
        return Err(PsecError::Header { file: file.to_owned(), found });
    }
    let mut request = Request::new(Start::Now, joints);
    let mut positions = Vec::with_capacity(header.len());
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(unreadable)? {
        let line = record.position().map_or(0, csv::Position::line);
        let number = |column: usize| -> Result<f64, PsecError> {
            let text = record.get(column).unwrap_or_default();
            text.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| PsecError::Number {
                file: file.to_owned(),
                line,
                column: header.get(column).unwrap_or_default().to_owned(),
                found: text.to_owned(),
            })
        };
        let time = number(0)?;
        if time.abs() > LONGEST {
            return Err(PsecError::Time { file: file.to_owned(), line, found: time });
        }
        positions.clear();
        for column in 1..header.len() {
            positions.push(number(column)?);
        }
        let row = Row { positions: &positions, ..Row::default() };
        request.push(nearest_nanosecond(time), row).map_err(|rejection| PsecError::Point {
            file: file.to_owned(),
            line,
            rejection,
        })?;
    }
    if request.points() == 0 {
        return Err(PsecError::Empty { file: file.to_owned() });
    }
    Ok(request)
}

/// A time in s as ns.
fn nearest_nanosecond(time: f64) -> Nanoseconds {
    let whole = time.floor();
    let rest = ((time - whole) * SECOND_NS as f64).round() as Nanoseconds;
    whole as Nanoseconds * SECOND_NS + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        read_psec(text.as_bytes(), "p.csv").expect_err("must be refused").to_string()
    }

    #[test]
    fn times_on_the_position_grid_are_whole_nanoseconds() {
        assert_eq!(nearest_nanosecond(0.006 * 1111.0), 6_666_000_000);
    }

    #[test]
    fn faults_name_file_line_and_column() {
        assert_eq!(
            error("t,x\n0,0\n"),
            "p.csv:1: the header is \"t,x\"; it begins with \"time\", then a joint for each column"
        );
        assert_eq!(error("time,x\n0,0\n0.006,NaN\n"), "p.csv:3: x is \"NaN\", must be a finite number");
        assert!(error("time,x\n0,0\n2e8,1\n").starts_with("p.csv:3: time is 200000000 s, must lie in"));
        assert_eq!(error("time,x\n"), "p.csv: there is no set-point below the header");
        assert!(error("time,x,y\n0,0\n").contains("line: 2"), "{}", error("time,x,y\n0,0\n"));
    }
}
