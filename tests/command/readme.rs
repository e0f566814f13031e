//! The README's table of parameters agrees with the schema.

#[test]
fn the_readme_contains_the_parameter_table_of_the_schema() {
    let readme = include_str!("../../README.md");
    let table = virtual_axes_core::config::listing::markdown();
    assert!(readme.contains(&table), "README.md: insert the output of `virtual_axes parameters --markdown`");
}
