//! Writes `include/virtual_axes.h` from the source of this crate.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    cbindgen::generate(folder)?.write_to_file(folder.join("include/virtual_axes.h"));
    Ok(())
}
