//! Output files beside the temporary files of other processes.

use std::fs::File;
use std::io::Write;

use virtual_axes_io::files::OutputFile;
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Number beyond the largest of a process on Linux.
const NO_PROCESS: u32 = 4_194_305;

#[test]
fn the_next_output_removes_the_temporary_file_of_a_killed_process() {
    let folder = TestFolder::new("killed");
    let abandoned = folder.file(&format!(".t.csv.{NO_PROCESS}.0.partial"), b"half");
    let own = folder.file(&format!(".t.csv.{}.7.partial", std::process::id()), b"half");
    let kept = [
        // The first process always runs.
        folder.file(".t.csv.1.0.partial", b"half"),
        folder.file(&format!(".u.csv.{NO_PROCESS}.0.partial"), b"half"),
        folder.file(&format!(".t.csv.{NO_PROCESS}.0.partial.csv"), b"half"),
        folder.file(&format!(".t.csv.{NO_PROCESS}.1.partial"), b"half"),
    ];
    let in_use = File::open(&kept[3]).expect("there");
    in_use.lock().expect("locked");
    let mut first = OutputFile::create(&folder.0.join("t.csv")).expect("can be made");
    assert!(!abandoned.exists() && !own.exists());
    // The file of a running output of this process is kept.
    let mut second = OutputFile::create(&folder.0.join("t.csv")).expect("can be made");
    for file in &kept {
        assert!(file.exists(), "{}", file.display());
    }
    for (output, text) in [(&mut first, "first"), (&mut second, "second")] {
        output.write_all(text.as_bytes()).expect("written");
    }
    first.finish().expect("renamed");
    second.finish().expect("renamed");
    assert_eq!(std::fs::read_to_string(folder.0.join("t.csv")).expect("there"), "second");
}
