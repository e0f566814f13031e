//! Archive of an FMU: model description, machine file, documentation and libraries.

use std::error::Error;
use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::description::{MODEL_IDENTIFIER, model_description};
use crate::documentation::documentation;
use crate::resources::MACHINE_FILE;

/// Name that the library of an FMU exports.
const EXPORTED: &[u8] = b"fmi2DoStep";

/// Returns the FMU of the machine file `text` with `libraries`, at most one for each platform, as a zip archive.
///
/// # Errors
/// A machine that is invalid, or a library that cannot be read, that is none of this crate, or whose platform has one.
pub fn fmu_archive(
    text: &str,
    libraries: &[impl AsRef<Path>],
) -> Result<Vec<u8>, Box<dyn Error + Send + Sync>> {
    let description = model_description(text)?;
    let page = documentation(text)?;
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    archive.start_file("modelDescription.xml", options)?;
    archive.write_all(description.as_bytes())?;
    archive.start_file(format!("resources/{MACHINE_FILE}"), options)?;
    archive.write_all(text.as_bytes())?;
    archive.start_file("documentation/index.html", options)?;
    archive.write_all(page.as_bytes())?;
    let mut platforms: Vec<&str> = Vec::new();
    for path in libraries.iter().map(AsRef::as_ref) {
        let content = fs::read(path).map_err(|error| format!("library {}: {error}", path.display()))?;
        let (platform, extension) =
            platform(&content).map_err(|reason| format!("library {}: {reason}", path.display()))?;
        if platforms.contains(&platform) {
            return Err(format!("library {}: there is one for {platform} already", path.display()).into());
        }
        platforms.push(platform);
        archive.start_file(
            format!("binaries/{platform}/{MODEL_IDENTIFIER}.{extension}"),
            options.unix_permissions(0o755),
        )?;
        archive.write_all(&content)?;
    }
    Ok(archive.finish()?.into_inner())
}

/// Returns true if the program headers of an ELF file for 64 bits, little endian, name an interpreter: only a program has
/// one.
fn has_elf_interpreter(elf: &[u8]) -> bool {
    const INTERPRETER: u32 = 3;
    let bytes = |at: usize| elf.get(at..).unwrap_or_default();
    let half = |at: usize| bytes(at).first_chunk().map_or(0, |bytes| u16::from_le_bytes(*bytes)) as usize;
    let start = bytes(32).first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
    let start = usize::try_from(start).unwrap_or(usize::MAX);
    let (size, count) = (half(54), half(56));
    let kind = |index: usize| bytes(start.saturating_add(index * size)).first_chunk().copied();
    (0..count).any(|index| kind(index).map(u32::from_le_bytes) == Some(INTERPRETER))
}

/// Returns the folder of FMI 2.0 for a library, and the extension of its name.
fn platform(library: &[u8]) -> Result<(&'static str, &'static str), String> {
    let half = |offset: usize| {
        let bytes = library.get(offset..)?.first_chunk()?;
        Some(u16::from_le_bytes(*bytes))
    };
    let word = |offset: usize| {
        let bytes = library.get(offset..)?.first_chunk()?;
        Some(u32::from_le_bytes(*bytes))
    };
    let not_shared = "it is a program, not a shared library".to_owned();
    let found = if library.starts_with(b"\x7fELF\x02\x01") {
        if has_elf_interpreter(library) {
            return Err(not_shared);
        }
        match half(18) {
            Some(62) => Some(("linux64", "so")),
            Some(183) => Some(("aarch64-linux", "so")),
            _ => None,
        }
    } else if library.starts_with(b"MZ") {
        let header = word(60).map_or(0, |offset| offset as usize);
        // The flag IMAGE_FILE_DLL of the characteristics.
        if half(header.saturating_add(22)).is_some_and(|flags| flags & 0x2000 == 0) {
            return Err(not_shared);
        }
        (half(header.saturating_add(4)) == Some(0x8664)).then_some(("win64", "dll"))
    } else {
        let is_mach = word(0) == Some(0xfeed_facf);
        // The file type MH_DYLIB.
        if is_mach && word(12) != Some(6) {
            return Err(not_shared);
        }
        is_mach.then_some(("darwin64", "dylib"))
    };
    let found =
        found.ok_or("it is no shared library of Linux, Windows or macOS for 64-bit x86 or ARM processors")?;
    if !library.windows(EXPORTED.len()).any(|window| window == EXPORTED) {
        return Err("it exports no fmi2DoStep; it must be that of virtual_axes_fmu".to_owned());
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::platform;

    fn library(head: &[u8], at: usize, machine: u16) -> Vec<u8> {
        let mut bytes = vec![0; 200];
        bytes[..head.len()].copy_from_slice(head);
        bytes[at..at + 2].copy_from_slice(&machine.to_le_bytes());
        bytes.extend(b"fmi2DoStep");
        bytes
    }

    #[test]
    fn the_head_of_a_library_decides_its_folder() {
        let mut windows = library(b"MZ", 104, 0x8664);
        windows[60] = 100;
        assert_eq!(platform(&windows), Err("it is a program, not a shared library".to_owned()));
        windows[123] = 0x20;
        assert_eq!(platform(&windows), Ok(("win64", "dll")));
        assert_eq!(platform(&library(b"\x7fELF\x02\x01", 18, 62)), Ok(("linux64", "so")));
        assert_eq!(platform(&library(b"\x7fELF\x02\x01", 18, 183)), Ok(("aarch64-linux", "so")));
        assert_eq!(platform(&library(&0xfeed_facf_u32.to_le_bytes(), 12, 6)), Ok(("darwin64", "dylib")));
        assert!(platform(&library(&0xfeed_facf_u32.to_le_bytes(), 12, 2)).is_err());
    }

    #[test]
    fn a_program_is_no_library() {
        let program = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        let error = platform(&program).unwrap_err();
        assert_eq!(error, "it is a program, not a shared library");
    }

    #[test]
    fn other_files_are_rejected() {
        for bytes in [&b""[..], b"MZ", b"\x7fELF\x02\x01", b"text fmi2DoStep"] {
            assert!(platform(bytes).is_err_and(|error| error.contains("shared library")), "{bytes:?}");
        }
        let mut foreign = library(b"\x7fELF\x02\x01", 18, 62);
        foreign.truncate(200);
        assert!(platform(&foreign).is_err_and(|error| error.contains("fmi2DoStep")));
    }
}
