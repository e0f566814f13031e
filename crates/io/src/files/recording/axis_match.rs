//! Axes of a file by their names and numbers.

use super::found_column::FoundColumn;

/// Axis of a file: its name, and its number if it differs.
pub(super) type FileAxis<'a> = (&'a str, Option<&'a str>);

/// Returns the axes of columns with a channel, in the order of the columns.
pub(super) fn axes_of<'a>(columns: impl Iterator<Item = &'a FoundColumn>) -> Vec<FileAxis<'a>> {
    let mut axes: Vec<FileAxis> = Vec::new();
    for column in columns.filter(|column| column.channel.is_some()) {
        let Some(axis) = column.axis.as_deref() else { continue };
        if !axes.iter().any(|(known, _)| *known == axis) {
            axes.push((axis, column.axis_number.as_deref()));
        }
    }
    axes
}

/// Returns the names of the axes that fit the name of a joint: the same name or number whatever its case, else the name of a
/// machine axis (`X1`, `MX1`, `AX1` for `x`), else those of a joint with a prefix (`x` for `mill_x`).
pub(super) fn matching_axes<'a>(axes: &[FileAxis<'a>], joint: &str) -> Vec<&'a str> {
    let by = |is_similar: fn(&str, &str) -> bool| -> Vec<&'a str> {
        let fits = |(name, number): &&FileAxis| {
            is_similar(name, joint) || number.or(number_of(name)).is_some_and(|number| is_same(number, joint))
        };
        axes.iter().filter(fits).map(|(name, _)| *name).collect()
    };
    let found = [is_same, is_numbered, is_prefixed].map(by);
    found.into_iter().find(|names| !names.is_empty()).unwrap_or_default()
}

/// Returns true for equal names, whatever their case.
fn is_same(axis: &str, joint: &str) -> bool {
    axis.eq_ignore_ascii_case(joint)
}

/// Returns true for the name of a machine axis: `X1`, `MX1`, `AX1` for `x`.
fn is_numbered(axis: &str, joint: &str) -> bool {
    let name = axis.trim_end_matches(|c: char| c.is_ascii_digit());
    let letter = machine_axis_letter(axis).is_some_and(|letter| is_same(letter, joint));
    letter || !name.is_empty() && is_same(name, joint)
}

/// Returns the letter of a machine axis `MX1` or `AX1`, the usual names of machine axes of Sinumerik.
pub(super) fn machine_axis_letter(axis: &str) -> Option<&str> {
    /// Letters of geometry and rotary axes.
    const LETTERS: &str = "xyzabcuwXYZABCUW";
    let name = axis.trim_end_matches(|c: char| c.is_ascii_digit());
    let letter = name.strip_prefix(['m', 'M', 'a', 'A'])?;
    (name.len() < axis.len() && letter.len() == 1 && LETTERS.contains(letter)).then_some(letter)
}

/// Returns the number of an axis that is named by its number only: `2`, `AX2`.
pub(super) fn number_of(axis: &str) -> Option<&str> {
    let start = axis.get(..2).filter(|start| is_same(start, "ax")).map_or(0, str::len);
    axis.get(start..).filter(|rest| !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Returns true for a joint with a prefix: `mill_x` for `x` or `X1`.
fn is_prefixed(axis: &str, joint: &str) -> bool {
    let last = joint.rsplit(['_', '/', '.']).next().unwrap_or_default();
    is_same(axis, last) || is_numbered(axis, last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_numbers_and_prefixes_match() {
        let axes = [("X1", Some("1")), ("Y1", Some("2")), ("sp", None), ("SP1", None)];
        assert_eq!(matching_axes(&axes, "x"), ["X1"]);
        assert_eq!(matching_axes(&axes, "2"), ["Y1"]);
        assert_eq!(matching_axes(&axes, "y1"), ["Y1"]);
        assert_eq!(matching_axes(&axes, "mill_y"), ["Y1"]);
        // An equal name takes precedence.
        assert_eq!(matching_axes(&axes, "SP"), ["sp"]);
        assert_eq!(matching_axes(&axes, "z"), [""; 0]);
        assert_eq!(matching_axes(&[("X1", None), ("X2", None)], "x"), ["X1", "X2"]);
    }

    #[test]
    fn machine_axes_match_their_letters() {
        let axes = [("MX1", Some("1")), ("AY1", None), ("MC1", None), ("sp1", None)];
        for (joint, axis) in [("x", "MX1"), ("y", "AY1"), ("c", "MC1"), ("mill_c", "MC1"), ("MX1", "MX1")] {
            assert_eq!(matching_axes(&axes, joint), [axis], "{joint}");
        }
        for joint in ["m", "a", "z", "p", "max"] {
            assert_eq!(matching_axes(&axes, joint), [""; 0], "{joint}");
        }
        assert_eq!(matching_axes(&[("AX1", None)], "x"), ["AX1"]);
        // Several of them are numbers of axes.
        let numbered = [("ax1", None), ("ax2", None)];
        assert_eq!(matching_axes(&numbered, "x"), ["ax1", "ax2"]);
        assert_eq!(matching_axes(&numbered, "2"), ["ax2"]);
    }
}
