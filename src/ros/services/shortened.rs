//! Descriptions of parameters within the largest response of a service.

use ros2_interfaces_jazzy_serde::rcl_interfaces::srv::DescribeParametersResponse;

use virtual_axes_dds::response_fits;

/// Numbers of characters to which the descriptions are shortened, in order, until the response can be sent.
const LENGTHS: [usize; 4] = [80, 50, 20, 0];

/// Shortens the descriptions of a response that is too long to be sent; types, ranges and constraints remain.
pub(super) fn shortened(mut response: DescribeParametersResponse) -> DescribeParametersResponse {
    for length in LENGTHS {
        if response_fits(&response) {
            break;
        }
        for descriptor in &mut response.descriptors {
            if let Some((end, _)) = descriptor.description.char_indices().nth(length) {
                descriptor.description.truncate(end);
                descriptor.description.push('…');
            }
        }
    }
    response
}

#[cfg(test)]
mod tests {
    use ros2_interfaces_jazzy_serde::rcl_interfaces::msg::ParameterDescriptor;

    use super::*;

    /// Returns the descriptions of a response to a request for `count` parameters, each described by 100 characters.
    fn descriptions(count: usize) -> Vec<String> {
        let descriptor = ParameterDescriptor {
            name: "x.velocity_loop.gain".to_owned(),
            description: "µ".repeat(100),
            ..ParameterDescriptor::default()
        };
        let response = shortened(DescribeParametersResponse { descriptors: vec![descriptor; count] });
        assert!(response_fits(&response), "{count}");
        response.descriptors.into_iter().map(|descriptor| descriptor.description).collect()
    }

    #[test]
    fn only_too_long_responses_are_shortened() {
        for (count, wanted) in [(200, 100), (300, 80), (400, 50), (600, 20)] {
            for description in descriptions(count) {
                let kept = description.chars().filter(|character| *character == 'µ').count();
                assert_eq!(kept, wanted, "{count}");
                assert_eq!(description.ends_with('…'), wanted < 100);
            }
        }
    }
}
