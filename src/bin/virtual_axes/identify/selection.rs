//! Axes of the options `--axis` and `--joint`.

use std::error::Error;
use std::path::PathBuf;

use virtual_axes_core::text::shortened;
use virtual_axes_identify::recording::Finding;
use virtual_axes_io::files::{Channel, RecordingColumns, RecordingFormat, inspect_recording};

use crate::identify::recordings::RecordingArguments;

/// Value of `--axis` for all recorded axes.
pub const ALL: &str = "all";
/// Names that the axes of a new machine can have.
const LETTERS: [&str; 9] = ["x", "y", "z", "a", "b", "c", "u", "v", "w"];

/// Axis of the machine, with its name in the recordings if that is given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SelectedAxis {
    /// Name in the machine file.
    pub name: String,
    /// Name or number in the recordings.
    pub joint: Option<String>,
}

/// Returns the axes that `--axis` names, with their names of `--joint` in the recordings.
///
/// # Errors
/// Returns an error if a name is given twice, or if the numbers of names differ.
pub fn selected(axes: &str, joints: Option<&str>) -> Result<Vec<SelectedAxis>, String> {
    let names: Vec<&str> = axes.split(',').map(str::trim).collect();
    if let Some(name) = names.iter().enumerate().find(|(k, name)| names[..*k].contains(name)) {
        return Err(format!("--axis: {} is given twice", shortened(name.1)));
    }
    // The name of a single axis in the recordings may contain a comma.
    let joints: Vec<&str> = match joints {
        None => Vec::new(),
        Some(joint) if names.len() == 1 => vec![joint],
        Some(joints) => joints.split(',').map(str::trim).collect(),
    };
    if !joints.is_empty() && joints.len() != names.len() {
        return Err(format!(
            "--joint: {} names for the {} axes of --axis; give one for each, in their order",
            joints.len(),
            names.len()
        ));
    }
    let joint = |k: usize| joints.get(k).map(|joint| (*joint).to_owned());
    Ok(names
        .iter()
        .enumerate()
        .map(|(k, name)| SelectedAxis { name: (*name).to_owned(), joint: joint(k) })
        .collect())
}

/// Returns the axes of a new machine: those of the recordings whose names have the letter of an axis (`X1`, `MX1` for x),
/// otherwise the axes 1, 2 and 3 as x, y and z.
///
/// # Errors
/// Returns an error if a recording cannot be read, or has no such axis.
pub fn recorded_axes(
    recordings: &[PathBuf],
    reading: &RecordingArguments,
) -> Result<Vec<SelectedAxis>, Box<dyn Error>> {
    let options = reading.options()?;
    let mut common: Option<Vec<SelectedAxis>> = None;
    for path in recordings {
        let found = inspect_recording(path, &options)?;
        let file = path.display();
        if found.format == RecordingFormat::Mcap {
            return Err(format!("{file}: --axis all requires columns; give the names of the axes").into());
        }
        let readable = found.readable_axes();
        let is_readable = |letter: &&&str| {
            found.axis_of(letter).is_some_and(|axis| readable.iter().any(|known| known == axis))
        };
        let select = |name: &str, joint| SelectedAxis { name: name.to_owned(), joint };
        let mut axes: Vec<SelectedAxis> =
            LETTERS.iter().filter(is_readable).map(|letter| select(letter, None)).collect();
        if axes.is_empty() {
            let numbered = LETTERS.iter().zip(["1", "2", "3"]);
            axes.extend(numbered.filter_map(|(letter, number)| {
                let name = readable.iter().find(|known| known.trim_start_matches('0') == number)?;
                Some(select(letter, Some(name.clone())))
            }));
        }
        if axes.is_empty() && readable.is_empty() {
            return Err(without_axis(&file.to_string(), &found).into());
        }
        if axes.is_empty() {
            return Err(format!(
                "{file}: --axis all: no axis of the file ({}) has the letter of an axis; name the axes of the new machine and \
                 those of the file, for example --axis x,c --joint 1,6",
                readable.join(", ")
            )
            .into());
        }
        common = Some(match common {
            Some(known) => known.into_iter().filter(|axis| axes.contains(axis)).collect(),
            None => axes,
        });
    }
    Ok(common.unwrap_or_default())
}

/// Returns the error of `--axis all` about a file whose columns name no axis with a position.
pub fn without_axis(file: &str, found: &RecordingColumns) -> String {
    let has_position = found.columns.iter().any(|column| column.channel == Some(Channel::Position));
    let reason = match has_position {
        true => "the columns name no axis; give its name, for example --axis x",
        false => {
            "no column is recognized as a position; list the columns without --axis, and select them by --column with the name of \
             the axis, for example --axis x --column 'position=#2[mm]'"
        }
    };
    format!("{file}: --axis all: {reason}")
}

/// Returns the finding about axes of the recordings whose names `--axis all` does not know as those of `axes`.
///
/// # Errors
/// Returns an error if a recording cannot be read.
pub fn unnamed_axes(
    recordings: &[PathBuf],
    reading: &RecordingArguments,
    axes: &[SelectedAxis],
) -> Result<Option<Finding>, Box<dyn Error>> {
    let options = reading.options()?;
    let mut unnamed: Vec<String> = Vec::new();
    for path in recordings {
        let found = inspect_recording(path, &options)?;
        let of = |axis: &SelectedAxis| match &axis.joint {
            Some(joint) => Some(joint.clone()),
            None => found.axis_of(&axis.name).map(str::to_owned),
        };
        let named: Vec<String> = axes.iter().filter_map(of).collect();
        let is_new = |name: &String| !name.is_empty() && !named.contains(name) && !unnamed.contains(name);
        let new: Vec<String> = found.readable_axes().into_iter().filter(is_new).collect();
        unnamed.extend(new);
    }
    let names: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
    let joints: Vec<&str> = axes.iter().map(|axis| axis.joint.as_deref().unwrap_or(&axis.name)).collect();
    let what = || {
        format!(
            "not identified: {} of the recordings, whose names are no axes of the machine; name both, for example --axis {},NAME \
             --joint {},{}",
            unnamed.join(", "),
            names.join(","),
            joints.join(","),
            unnamed[0]
        )
    };
    Ok((!unnamed.is_empty()).then(|| Finding::note("unnamed-axes", what())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_axis_has_its_name_in_the_recordings() {
        let all = |axes, joints| {
            let found = selected(axes, joints)?;
            Ok::<_, String>(
                found.into_iter().map(|axis| (axis.name, axis.joint.unwrap_or_default())).collect::<Vec<_>>(),
            )
        };
        let pair = |name: &str, joint: &str| (name.to_owned(), joint.to_owned());
        assert_eq!(all("x", None), Ok(vec![pair("x", "")]));
        assert_eq!(all("x, c", Some("1,6")), Ok(vec![pair("x", "1"), pair("c", "6")]));
        assert_eq!(all("x", Some("a,b")), Ok(vec![pair("x", "a,b")]));
        assert!(all("x,c", Some("1")).is_err_and(|error| error.contains("--joint: 1 names for the 2 axes")));
        assert!(all("x,y,x", None).is_err_and(|error| error.contains("x is given twice")));
    }
}
