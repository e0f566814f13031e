//! Output files are written atomically.

use std::fs;
use std::io::{ErrorKind, Write};
use std::path::Path;

use virtual_axes_core::machine::AxisSample;
use virtual_axes_io::files::{OutputFile, TraceCsvWriter, psec_writer, trace_writer};
use virtual_axes_verification::fixtures::folder::TestFolder;

fn joints() -> Vec<String> {
    vec!["x".to_owned()]
}

#[test]
fn a_file_is_replaced_when_it_is_complete() {
    let folder = TestFolder::new("output_whole");
    let path = folder.file("out.txt", "old");
    let mut out = OutputFile::create(&path).expect("can be made");
    out.write_all(b"new").expect("can be written");
    out.flush().expect("can be written");
    assert_eq!(fs::read_to_string(&path).expect("readable"), "old");
    assert_eq!(folder.names().len(), 2);
    out.finish().expect("can be renamed");
    assert_eq!(fs::read_to_string(&path).expect("readable"), "new");
    assert_eq!(folder.names(), ["out.txt"]);
}

#[test]
fn an_abandoned_file_is_removed() {
    let folder = TestFolder::new("output_dropped");
    let path = folder.file("out.txt", "old");
    for name in ["out.txt", "none.txt"] {
        let mut out = OutputFile::create(&folder.0.join(name)).expect("can be made");
        out.write_all(b"new").expect("can be written");
        drop(out);
        assert_eq!(folder.names(), ["out.txt"]);
    }
    for name in ["t.csv", "t.mcap"] {
        let mut trace = trace_writer(&folder.0.join(name), &joints()).expect("can be made");
        trace.row(0, &[AxisSample::default()]).expect("can be written");
        drop(trace);
        let mut psec = psec_writer(&folder.0.join(name), &joints()).expect("can be made");
        psec.row(0, &[0.0]).expect("can be written");
        drop(psec);
        assert_eq!(folder.names(), ["out.txt"], "{name}");
    }
    assert_eq!(fs::read_to_string(&path).expect("readable"), "old");
}

#[cfg(unix)]
#[test]
fn symbolic_links_are_followed_and_permissions_are_kept() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = TestFolder::new("output_links");
    let path = folder.file("real.txt", "old");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("mine");
    let link = folder.0.join("link.txt");
    symlink("real.txt", &link).expect("a link");
    let mut out = OutputFile::create(&link).expect("can be made");
    out.write_all(b"new").expect("can be written");
    out.finish().expect("can be renamed");
    assert_eq!(fs::read_to_string(&path).expect("readable"), "new");
    assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
    assert_eq!(fs::metadata(&path).expect("there").permissions().mode() & 0o777, 0o600);
    assert_eq!(folder.names(), ["link.txt", "real.txt"]);

    let far = folder.0.join("far.txt");
    symlink("not_yet.txt", &far).expect("a link");
    let mut out = OutputFile::create(&far).expect("can be made");
    out.write_all(b"new").expect("can be written");
    out.finish().expect("can be renamed");
    assert!(fs::symlink_metadata(&far).expect("there").is_symlink());
    assert_eq!(fs::read_to_string(folder.0.join("not_yet.txt")).expect("readable"), "new");
}

#[test]
fn two_writers_of_one_file_do_not_interfere() {
    let folder = TestFolder::new("output_two");
    let path = folder.0.join("out.txt");
    let mut first = OutputFile::create(&path).expect("can be made");
    let mut second = OutputFile::create(&path).expect("can be made");
    first.write_all(b"first").expect("can be written");
    second.write_all(b"second").expect("can be written");
    second.finish().expect("can be renamed");
    first.finish().expect("can be renamed");
    assert_eq!(fs::read_to_string(&path).expect("readable"), "first");
    assert_eq!(folder.names(), ["out.txt"]);
}

/// Trace and table on one stream: neither is lost or overwritten.
#[cfg(target_os = "linux")]
#[test]
fn a_trace_can_be_written_to_standard_output() {
    let folder = TestFolder::new("output_stdout");
    let psec = folder.file("psec.csv", "time,x\n0,0\n0.06,0.001\n");
    let run = |stdout: std::process::Stdio| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_virtual_axes"));
        command.arg("run").arg(&psec).args(["--trace", "/dev/stdout"]).stdout(stdout);
        command.spawn().and_then(std::process::Child::wait_with_output).expect("runs")
    };
    let piped = String::from_utf8(run(std::process::Stdio::piped()).stdout).expect("text");
    assert!(piped.starts_with("time,x.psec,"), "{piped:.80}");
    assert!(piped.lines().count() > 11 && piped.contains("following error"), "{piped}");
    let out = folder.0.join("out.txt");
    assert!(run(fs::File::create(&out).expect("can be made").into()).status.success());
    assert_eq!(fs::read_to_string(&out).expect("readable"), piped);
    assert_eq!(folder.names(), ["out.txt", "psec.csv"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported_with_the_file_name() {
    let mut out = OutputFile::create("/dev/full".as_ref()).expect("can be opened");
    out.write_all(b"short").expect("is buffered");
    let error = out.finish().expect_err("is full");
    assert_eq!(error.kind(), ErrorKind::StorageFull);
    assert!(error.to_string().starts_with("/dev/full: "), "{error}");

    let folder = TestFolder::new("output_full");
    for name in ["full", "full.csv", "full.mcap"] {
        let path = folder.0.join(name);
        std::os::unix::fs::symlink("/dev/full", &path).expect("a link");
        let mut trace = trace_writer(&path, &joints()).expect("can be opened");
        let rows = (0..100_000)
            .try_for_each(|k| trace.row(k, &[AxisSample { psec: k as f64 / 7.0, ..AxisSample::default() }]));
        let error = rows.and_then(|()| trace.finish()).expect_err("is full");
        assert_eq!(error.kind(), ErrorKind::StorageFull, "{error}");
        let start = format!("{}: ", path.display());
        assert!(error.to_string().starts_with(&start), "{error}");
        assert_eq!(error.to_string().matches(&start).count(), 1, "{error}");
    }
    for extension in ["csv", "yaml", "mcap"] {
        let path = folder.0.join(format!("p.{extension}"));
        std::os::unix::fs::symlink("/dev/full", &path).expect("a link");
        let mut psec = psec_writer(&path, &joints()).expect("can be opened");
        let rows = (0..10_000).try_for_each(|k| psec.row(k, &[k as f64 / 7.0]));
        let error = rows.and_then(|()| psec.finish()).expect_err("is full");
        assert_eq!(error.kind(), ErrorKind::StorageFull, "{error}");
    }
    assert_eq!(folder.names().len(), 6, "the devices are still there, and nothing else");
}

#[test]
fn a_file_that_cannot_be_created_is_reported() {
    let error = OutputFile::create(Path::new("no/such/folder/t.csv")).expect_err("no folder");
    assert!(error.to_string().starts_with("no/such/folder/t.csv: "), "{error}");
    let folder = TestFolder::new("output_folder");
    let error = OutputFile::create(&folder.0).expect_err("a folder");
    assert!(error.to_string().starts_with(&format!("{}: ", folder.0.display())), "{error}");
}

#[test]
fn an_unknown_extension_is_rejected_with_the_supported_ones() {
    let rejected = |path: &str| match trace_writer(path.as_ref(), &joints()) {
        Ok(_) => panic!("{path} must be rejected"),
        Err(error) => error.to_string(),
    };
    assert_eq!(rejected("t.bag"), "t.bag: the file extension must be one of .csv, .mcap");
    assert_eq!(rejected("t"), "t: the file extension must be one of .csv, .mcap");
    let Err(error) = psec_writer("p.json".as_ref(), &joints()) else { panic!("must be rejected") };
    assert_eq!(error.to_string(), "p.json: the file extension must be one of .csv, .mcap, .yaml");
    assert!(!Path::new("t.bag").exists());
}

#[test]
fn a_trace_row_can_be_at_any_tick() {
    let joints = ["x".to_owned(), "c".to_owned()];
    let mut trace = TraceCsvWriter::new(Vec::new(), &joints).expect("in memory");
    let sample = AxisSample { psec: 0.1, position: 1e-7, voltage: -3.0, ..AxisSample::default() };
    trace.row(6_125_000, &[sample, AxisSample::default()]).expect("in memory");
    let text = String::from_utf8(trace.finish().expect("in memory")).expect("text");
    assert_eq!(
        text,
        "time,x.psec,x.position,x.velocity,x.current,x.current_setpoint,x.voltage,x.friction_current,x.wind_up,\
         c.psec,c.position,c.velocity,c.current,c.current_setpoint,c.voltage,c.friction_current,c.wind_up\n\
         0.006125,0.1,0.0000001,0,0,0,-3,0,0,0,0,0,0,0,0,0,0\n"
    );
}
