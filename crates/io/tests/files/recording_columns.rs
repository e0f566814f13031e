//! Detection of columns from their headers, the list of the columns of a file, and sampling rates.

use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use virtual_axes_core::config::{AxisConfig, MachineConfig, Parameters};
use virtual_axes_identify::recording::{Finding, RawRecording};
use virtual_axes_io::files::{
    Channel, Columns, FileError, FoundColumn, RecordingColumns, RecordingFormat, RecordingOptions,
    inspect_recording, read_recording,
};
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Returns an axis of the default machine: x, y, z are linear, a and c are rotary.
pub(crate) fn axis(name: &str) -> &'static AxisConfig {
    static MILL: LazyLock<MachineConfig> =
        LazyLock::new(|| Parameters::embedded_default().expect("shipped").machine_config().expect("valid"));
    MILL.axes().iter().find(|axis| axis.name() == name).expect("it has one")
}

pub(crate) type Outcome = Result<(RawRecording, Vec<Finding>), FileError>;

/// Recording in a folder of its own.
pub(crate) struct Recorded {
    folder: TestFolder,
    options: RecordingOptions,
    content: Vec<u8>,
}

impl Recorded {
    pub(crate) fn new(name: &str, content: impl AsRef<[u8]>) -> Self {
        // Tests run at the same time.
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let options = RecordingOptions::default();
        Recorded {
            folder: TestFolder::new(&format!("recording_{name}_{number}")),
            options,
            content: content.as_ref().to_vec(),
        }
    }

    pub(crate) fn columns(mut self, texts: &[&str]) -> Self {
        self.options.columns = Columns::read(None, texts, "--column").expect("a mapping");
        self
    }

    pub(crate) fn joint(mut self, joint: &str) -> Self {
        self.options.joint = Some(joint.to_owned());
        self
    }

    pub(crate) fn rate(mut self, rate_hz: f64) -> Self {
        self.options.rate_hz = Some(rate_hz);
        self
    }

    pub(crate) fn format(mut self, format: RecordingFormat) -> Self {
        self.options.format = Some(format);
        self
    }

    pub(crate) fn read(&self, name: &str) -> Outcome {
        let path = self.folder.file("r", &self.content);
        read_recording(&path, axis(name), &self.options)
    }

    #[track_caller]
    pub(crate) fn good(&self, name: &str) -> RawRecording {
        self.read(name).expect("good").0
    }

    /// Returns the error message without the folder.
    #[track_caller]
    pub(crate) fn error(&self, name: &str) -> String {
        let error = self.read(name).expect_err("must be rejected").to_string();
        error.replace(&*self.folder.0.join("r").to_string_lossy(), "r")
    }

    #[track_caller]
    pub(crate) fn inspect(&self) -> RecordingColumns {
        inspect_recording(&self.folder.file("r", &self.content), &self.options).expect("columns")
    }
}

/// Returns channel, unit and axis of a column as one text: `position [mm] x`.
pub(crate) fn summary(column: &FoundColumn) -> String {
    let channel = column.channel.map_or("-", Channel::name);
    let unit = column.unit.as_ref().map_or_else(String::new, |unit| format!(" [{unit}]"));
    let axis = column.axis.as_ref().map_or_else(String::new, |axis| format!(" {axis}"));
    format!("{channel}{unit}{axis}")
}

#[track_caller]
fn detected(header: &str) -> String {
    let text = format!("{header};other\n0;0\n");
    let found = Recorded::new("detected", text).inspect();
    summary(found.columns.first().expect("a column"))
}

#[test]
fn headers_name_channel_unit_and_axis() {
    let table = [
        ("position [mm]", "position [mm]"),
        ("pos_x_mm", "position [mm] x"),
        ("Actual position (mm)", "position [mm]"),
        ("Actual position X (mm)", "position [mm] x"),
        ("Position X / mm", "position [mm] x"),
        ("velocity_mm_s", "velocity [mm/s]"),
        ("velocity_x_mm_per_s", "velocity [mm/s] x"),
        ("vel_y_m_min", "velocity [m/min] y"),
        ("v_x [m/min]", "velocity [m/min] x"),
        ("time_ms", "time [ms]"),
        ("Time (s)", "time [s]"),
        ("Zeit [ms]", "time [ms]"),
        ("t", "time [s (assumed)]"),
        ("timestamp", "time [s (assumed)]"),
        ("%time", "time [s (assumed)]"),
        ("sample", "time [samples]"),
        ("Sample number", "time [samples]"),
        ("CYCLE", "time [samples]"),
        ("/joint_states/shoulder_pan_joint/position", "position [m or rad (assumed)]"),
        ("torque", "torque [N.m (assumed)]"),
        ("Sollposition [mm]", "psec [mm]"),
        ("Istposition X [mm]", "position [mm] x"),
        ("Lagesollwert C [°]", "psec [deg] c"),
        ("Lageistwert [mm]", "position [mm]"),
        ("Istgeschwindigkeit [mm/min]", "velocity [mm/min]"),
        ("Strom [A]", "current [A]"),
        ("Momentenbildender Strom [A]", "current [A]"),
        ("torque-producing current", "current [A (assumed)]"),
        ("iq", "current [A (assumed)]"),
        ("current_mA", "current [mA]"),
        ("current_x_a", "current [A] x"),
        ("Torque [Nm]", "current [N.m]"),
        ("motor_torque_N_m", "current [N.m]"),
        ("commanded position", "psec [m or rad (assumed)]"),
        ("Axis 1.Setpoint position [mm]", "psec [mm] 1"),
        ("MAIN.axis2.ActPos", "position [m or rad (assumed)] 2"),
        ("x_pos_cmd", "psec [m or rad (assumed)] x"),
        ("xPosFb", "position [m or rad (assumed)] x"),
        ("target [mm]", "psec [mm]"),
        ("joint_3 encoder [deg]", "position [deg] 3"),
        ("X1 position [mm]", "position [mm] x1"),
        ("velocity feedforward [rpm]", "velocity_feedforward [rpm]"),
        ("torque_ffw_Nm", "torque_feedforward [N.m]"),
        ("Drehzahlvorsteuerung", "velocity_feedforward [rad/s of the motor (assumed)]"),
        ("Position [inch]", "position [in]"),
        ("Y Actual (in)", "position [in] y"),
        ("Velocity_actual_ipm", "velocity [in/min]"),
        ("Position [ft]", "position [unknown: ft]"),
        ("x_cmd", "psec [m or rad (assumed)] x"),
        ("X Ist [mm]", "position [mm] x"),
        ("v [mm/s]", "velocity [mm/s]"),
        ("v_act_m_min", "velocity [m/min]"),
        ("Encoder 2 position [mm]", "position [mm]"),
        ("x.wind_up", "wind_up [m or rad (assumed)] x"),
        ("Wind-up [um]", "wind_up [um]"),
        ("motor position setpoint [mm]", "psec [mm]"),
        // No channels.
        ("following error [mm]", "-"),
        ("Schleppfehler X [mm]", "- x"),
        ("velocity setpoint [mm/s]", "-"),
        ("current_setpoint", "-"),
        ("motor speed [rpm]", "-"),
        ("drive torque", "-"),
        ("x", "- x"),
        ("v", "- v"),
        ("x_ref_limit", "- x"),
        ("tool", "-"),
        ("distance", "-"),
        ("", "-"),
    ];
    let wrong: Vec<String> = table
        .iter()
        .filter(|(header, wanted)| detected(header) != *wanted)
        .map(|(header, wanted)| format!("{header}: {} for {wanted}", detected(header)))
        .collect();
    assert_eq!(wrong, [""; 0]);
}

#[test]
fn the_position_of_a_motor_is_that_of_its_axis_without_another_one() {
    let channels = |header: &str| -> Vec<String> {
        let recorded = Recorded::new("a.csv", format!("{header}\n0,0,0,0\n"));
        recorded
            .inspect()
            .columns
            .iter()
            .map(|column| column.channel.map_or("-", Channel::name).to_owned())
            .collect()
    };
    let header = "time,motor position x [mm],position x [mm],motor position y [mm]";
    assert_eq!(channels(header), ["time", "motor_position", "position", "position"]);
    assert_eq!(channels("time,Motor Lage [mm],wind_up,current"), ["time", "position", "wind_up", "current"]);
    let header = "time,Load position X [mm],Motor position X [mm],Load X [%]";
    assert_eq!(channels(header), ["time", "position", "motor_position", "-"]);
    let header = "time,Load position [mm],Load velocity [mm/s],Motor load [N.m]";
    assert_eq!(channels(header), ["time", "position", "velocity", "-"]);
}

#[test]
fn the_list_of_columns_has_reasons_axes_and_the_line_of_the_header() {
    let found = Recorded::new(
        "list",
        "Export of today\n\nTime [ms];Soll X [mm];Ist X [mm];Ist Y [mm];Strom X [A];note\n0;0;0;0;0;0\n",
    )
    .inspect();
    assert_eq!((found.format, found.header_line), (RecordingFormat::Csv, Some(3)));
    assert_eq!(found.axes(), ["x", "y"]);
    assert!(found.has_time());
    let summaries: Vec<String> = found.columns.iter().map(summary).collect();
    assert_eq!(
        summaries,
        ["time [ms]", "psec [mm] x", "position [mm] x", "position [mm] y", "current [A] x", "-"]
    );
    let second = &found.columns[1];
    assert_eq!((second.number, second.header.as_str()), (2, "Soll X [mm]"));
    assert_eq!(second.reason, "\"soll\" in the header");
    assert!(!second.unit.as_ref().expect("a unit").is_assumed());
    assert_eq!(found.columns[5].reason, "no known word");

    assert_eq!(
        (found.readable_axes(), found.axis_of("X")),
        (vec!["x".to_owned(), "y".to_owned()], Some("x"))
    );
    assert_eq!((found.axis_of("mill_y"), found.axis_of("z")), (Some("y"), None));
    let bare = Recorded::new("bare", "0.1;0.2\n0.2;0.3\n").inspect();
    assert_eq!(bare.columns[1].header, "#2");
    assert!(bare.columns[1].reason.contains("no header"), "{}", bare.columns[1].reason);
    assert!(!bare.has_time() && bare.axes().is_empty());
}

#[test]
fn the_columns_of_the_axis_are_read() {
    let text = "time_ms,pos_x_mm,pos_y_mm,cmd_x_mm,cmd_y_mm,iq_x_A,iq_y_A\n0,1,2,3,4,5,6\n2,1,2,3,4,5,6\n";
    let (x, findings) = Recorded::new("axis", text).read("x").expect("good");
    assert_eq!((x.time, x.position), (vec![0.0, 0.002], Some(vec![0.001; 2])));
    assert_eq!((x.psec, x.current), (Some(vec![0.003; 2]), Some(vec![5.0; 2])));
    let [finding] = findings.as_slice() else { panic!("one: {findings:?}") };
    assert_eq!(finding.code, "detected-columns");
    assert!(
        finding.what.ends_with(
            "detected time from column time_ms in ms, psec from column cmd_x_mm in mm, position from column \
             pos_x_mm in mm, current from column iq_x_A in A"
        ),
        "{finding}"
    );
    let y = Recorded::new("axis", text).good("y");
    assert_eq!((y.position, y.current), (Some(vec![0.002; 2]), Some(vec![6.0; 2])));
    let by_joint = Recorded::new("axis", text).joint("Y").good("x");
    assert_eq!(by_joint.position, Some(vec![0.002; 2]));
    assert_eq!(
        Recorded::new("axis", text).error("z"),
        "r:1: the file has no columns of axis z; there are the axes x, y: select one by --joint"
    );
    // X1 is the axis x; a current without an axis is not that of one of several.
    let numbered = "time,X1 position [mm],Y1 position [mm],Strom\n0,1,2,3\n";
    let (x, findings) = Recorded::new("axis", numbered).read("x").expect("good");
    assert_eq!((x.position, x.current), (Some(vec![0.001]), None));
    assert!(findings.iter().any(|finding| finding.code == "unassigned-column"), "{findings:?}");
    let numbers = "time,position 1 [mm],position 2 [mm]\n0,1,2\n";
    assert!(Recorded::new("axis", numbers).error("x").contains("there are the axes 1, 2"));
    assert_eq!(Recorded::new("axis", numbers).joint("2").good("x").position, Some(vec![0.002]));
    // The only axis of a file needs no name; its currents may have none.
    let single = "time,axis 3 position [mm],current\n0,1,2\n";
    let only = Recorded::new("axis", single).good("x");
    assert_eq!((only.position, only.current), (Some(vec![0.001]), Some(vec![2.0])));
    // current_A beside pos_a is that of the axis a.
    let rotary = "time,pos_x,pos_a_deg,current_X,current_A\n0,1,180,2,3\n";
    let a = Recorded::new("axis", rotary).good("a");
    assert_eq!((a.position, a.current), (Some(vec![std::f64::consts::PI]), Some(vec![3.0])));
}

#[test]
fn several_fitting_columns_are_an_error() {
    let text = "time,enc1_pos [mm],enc2_pos [mm]\n0,1,2\n";
    assert_eq!(
        Recorded::new("several", text).error("x"),
        "r:1: columns #2 \"enc1_pos [mm]\", #3 \"enc2_pos [mm]\" all fit position: select one, for example by \
         --column 'position=#2'"
    );
    let chosen = Recorded::new("several", text).columns(&["position=#3[mm]"]).good("x");
    assert_eq!(chosen.position, Some(vec![0.002]));
    // A column that a mapping selects is that of no other channel.
    let text = "time,Soll [mm],Ist [mm]\n0,1,2\n";
    let swapped = Recorded::new("several", text).columns(&["position=#2[mm]"]).good("x");
    assert_eq!((swapped.psec, swapped.position), (None, Some(vec![0.001])));
    // A current takes precedence over a torque, an exact header over similar ones.
    let text = "time,position,Position [mm],torque [Nm],current\n0,1,2,3,4\n";
    let found = Recorded::new("several", text).good("x");
    assert_eq!((found.position, found.current), (Some(vec![1.0]), Some(vec![4.0])));
}

#[test]
fn the_list_says_why_a_torque_without_newton_meters_is_not_read() {
    let found = Recorded::new("torque", "time,position,Torque X [%],Torque Y\n0,1,2,3\n").inspect();
    let reasons: Vec<&str> = found.columns[2..].iter().map(|column| column.reason.as_str()).collect();
    assert!(reasons[0].contains("a torque in the unknown unit %"), "{reasons:?}");
    assert!(reasons[1].contains("a torque without unit"), "{reasons:?}");
}

#[test]
fn dates_are_times_from_the_first_one() {
    let text = "Time,position\n2024-05-01 23:59:59.998,1\n2024-05-02 00:00:00.002,2\n";
    assert_eq!(Recorded::new("dates", text).good("x").time, [0.0, 0.004]);
    let message = Recorded::new("dates", "Time,position\n5/1/2024 12:00:00 PM,1\n").error("x");
    assert!(message.contains("write dates and times of day as 2024-02-29T13:45:00.002"), "{message}");
}

#[test]
fn units_of_detected_columns_must_fit_the_axis() {
    assert_eq!(
        Recorded::new("unfit", "time,position [deg]\n0,1\n").error("x"),
        "r:1: position from column position [deg] is in deg, must be in one of m, mm, um, in; give the unit by \
         --column 'position=COLUMN[UNIT]', for example with a factor: [25.4 mm]"
    );
    let message = Recorded::new("unfit", "time,position [ft]\n0,1\n").error("x");
    assert!(message.contains("has the unknown unit ft, must be in one of m, mm, um, in"), "{message}");
    let foot =
        Recorded::new("unfit", "time,position [ft]\n0,1\n").columns(&["position=[304.8 mm]"]).good("x");
    assert_eq!(foot.position, Some(vec![0.3048]));
    let inch = Recorded::new("inch", "time,position (in),velocity [in/min]\n0,10,60\n").good("x");
    assert_eq!((inch.position, inch.velocity), (Some(vec![0.254]), Some(vec![0.0254])));
    let (found, findings) =
        Recorded::new("unfit", "time,position,speed [rpm]\n0,1,2\n").read("x").expect("good");
    assert_eq!(found.velocity, None);
    assert!(findings.iter().any(|finding| finding.code == "unfit-unit"), "{findings:?}");
}

#[test]
fn a_current_in_an_unknown_unit_is_rejected() {
    for (header, unit) in [
        ("X current [%]", "%"),
        ("X current (%)", "%"),
        ("X current in %", "%"),
        ("X current %", "%"),
        ("X current [% of max]", "% of max"),
        ("X current [A rms]", "A rms"),
        ("X current [Arms]", "Arms"),
    ] {
        let message = Recorded::new("percent", format!("time;x position [mm];{header}\n0;1;2\n")).error("x");
        let expected = format!(
            "current from column {header} has the unknown unit {unit}, must be in one of A, mA, N.m, N;"
        );
        assert!(message.contains(&expected), "{message}");
    }
    // Brackets without a unit.
    for header in ["X current (actual value)", "current (X axis)", "X current (no load)", "current [X] in A"]
    {
        let found = Recorded::new("unit", format!("time;x position [mm];{header}\n0;1;2\n")).read("x");
        assert!(found.is_ok(), "{header}: {found:?}");
    }
    let given = Recorded::new("percent", "time;x position [mm];X current [%]\n0;1;2\n")
        .columns(&["current=X current [%][0.5 A]"])
        .good("x");
    assert_eq!(given.current, Some(vec![1.0]));
}

#[test]
fn a_sampling_rate_replaces_a_column_of_time() {
    let text = "position [mm],current\n1,2\n3,4\n5,6\n";
    assert_eq!(Recorded::new("rate", text).rate(500.0).good("x").time, [0.0, 0.002, 0.004]);
    assert_eq!(
        Recorded::new("rate", text).error("x"),
        "r:1: there is no column \"time\" for time; there are position [mm], current; time and position are \
         required: select a column by --column CHANNEL=COLUMN[UNIT], or give the sampling rate by --rate-hz"
    );
    // Lost samples are visible in the sample number.
    let counted = "sample,position [mm]\n7,1\n8,2\n11,3\n";
    let time = Recorded::new("rate", counted).rate(500.0).good("x").time;
    assert_eq!(time, [0.0, 0.002, 0.008]);
    let message = Recorded::new("rate", counted).error("x");
    assert!(message.ends_with("by --rate-hz, since column sample counts samples"), "{message}");
    let (timed, findings) =
        Recorded::new("rate", "t [ms],position\n0,1\n4,1\n").rate(1.0).read("x").expect("good");
    assert_eq!(timed.time, [0.0, 0.004]);
    assert!(findings.iter().any(|finding| finding.code == "unused-rate"), "{findings:?}");
    // Without a header.
    let found = Recorded::new("rate", "1;2\n3;4\n").columns(&["position=#2[mm]"]).rate(10.0).good("x");
    assert_eq!((found.time, found.position), (vec![0.0, 0.1], Some(vec![0.002, 0.004])));
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(
            Recorded::new("rate", text).rate(rate).error("x"),
            format!("--rate-hz: the sampling rate is {rate}, must be a finite number above 0")
        );
    }
}

/// Header and two rows in the layout of the dataset <https://doi.org/10.35097/hvvwn1kfwf7qt48z> (KIT, CC BY 4.0):
/// high-frequency data of Sinumerik Edge as CSV, 500 Hz.
#[test]
fn high_frequency_data_of_sinumerik_edge_as_csv_are_read() {
    let text = "CYCLE,LOAD|6,CURRENT|6,DES_POS|1,ENC_POS|1,CTRL_DIFF|1\n\
                4814008,0.0,0.0,-3.530037,-3.530037,0.0\n4818612,99.98,-36.01,-2.530047,-2.529100,-0.000947\n";
    let recorded = Recorded::new("edge_csv", text).joint("1").rate(500.0);
    let columns: Vec<String> = recorded.inspect().columns.iter().map(summary).collect();
    assert_eq!(
        columns,
        ["time [samples]", "- 6", "current [A] 6", "psec [mm or deg] 1", "position [mm or deg] 1", "- 1"]
    );
    let found = recorded.good("x");
    assert_eq!(found.position, Some(vec![-3.530037 * 1e-3, -2.5291 * 1e-3]));
    // 4604 cycles.
    assert_eq!(found.time, [0.0, 9.208]);
    assert_eq!(found.current, None);
}

#[test]
fn names_of_formats_are_parsed() {
    for format in RecordingFormat::ALL {
        assert_eq!(format.name().parse(), Ok(format));
    }
    let message = "half-sampler".parse::<RecordingFormat>().expect_err("unknown");
    assert!(
        message.starts_with("unknown \"half-sampler\"; known are csv, ")
            && message.ends_with("; the nearest is halsampler"),
        "{message}"
    );
}
