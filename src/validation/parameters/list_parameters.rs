//! Selection of parameters by prefix and depth for `rcl_interfaces/ListParameters`.

use virtual_axes_io::messages::rcl_interfaces::msg::ListParametersResult;

const SEPARATOR: char = '.';

/// Returns the names below any of `prefixes` (all names if it is empty) with at most `depth` parts below the
/// prefix (0 is unlimited), and the prefixes of their groups.
///
/// A name equal to a prefix is listed for any depth, as in rclcpp.
pub fn list_parameters(names: &[String], prefixes: &[String], depth: u64) -> ListParametersResult {
    let is_within_depth = |rest: &str| depth == 0 || (rest.matches(SEPARATOR).count() as u64) < depth;
    let is_selected = |name: &str| {
        if prefixes.is_empty() {
            return is_within_depth(name);
        }
        prefixes.iter().any(|prefix| {
            name.strip_prefix(prefix.as_str()).is_some_and(|rest| {
                rest.is_empty() || rest.strip_prefix(SEPARATOR).is_some_and(is_within_depth)
            })
        })
    };
    let mut result = ListParametersResult::default();
    for name in names.iter().filter(|name| is_selected(name)) {
        result.names.push(name.clone());
        if let Some((group, _)) = name.rsplit_once(SEPARATOR)
            && !result.prefixes.iter().any(|known| known == group)
        {
            result.prefixes.push(group.to_owned());
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_and_depth_select_as_in_rclcpp() {
        let names = ["time", "x.gain", "x.gpc.n1", "x.gpc.n2", "xy.gain"].map(str::to_owned);
        for (prefixes, depth, expected, groups) in [
            (vec![], 0, vec!["time", "x.gain", "x.gpc.n1", "x.gpc.n2", "xy.gain"], vec!["x", "x.gpc", "xy"]),
            (vec![], 1, vec!["time"], vec![]),
            (vec![], 2, vec!["time", "x.gain", "xy.gain"], vec!["x", "xy"]),
            (vec!["x"], 0, vec!["x.gain", "x.gpc.n1", "x.gpc.n2"], vec!["x", "x.gpc"]),
            (vec!["x"], 1, vec!["x.gain"], vec!["x"]),
            (vec!["x.gpc"], 1, vec!["x.gpc.n1", "x.gpc.n2"], vec!["x.gpc"]),
            (vec!["x.gain", "time"], 1, vec!["time", "x.gain"], vec!["x"]),
            (vec!["z"], 0, vec![], vec![]),
            (vec![""], 0, vec![], vec![]),
        ] {
            let prefixes: Vec<String> = prefixes.into_iter().map(str::to_owned).collect();
            let result = list_parameters(&names, &prefixes, depth);
            assert_eq!(result.names, expected, "{prefixes:?} {depth}");
            assert_eq!(result.prefixes, groups, "{prefixes:?} {depth}");
        }
    }
}
