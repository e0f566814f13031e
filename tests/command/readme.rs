//! The README's table of parameters is the schema's.

#[test]
fn the_readme_lists_every_parameter_as_the_schema_has_it() {
    let readme = include_str!("../../README.md");
    let table = virtual_axes_core::config::listing::markdown();
    assert!(readme.contains(&table), "README.md: put the output of `virtual_axes parameters --markdown` in");
}
