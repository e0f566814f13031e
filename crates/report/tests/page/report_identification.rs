//! The page of an identification: results of every step, and notices on missing results.

use std::sync::LazyLock;

use crate::report_common::{assert_self_contained, assert_well_formed};
use virtual_axes_core::config::{AxisConfig, AxisKind, MachineConfig, Parameters};
use virtual_axes_identify::identify::campaign::CampaignOptions as Course;
use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::identify::{
    Agreement, AxisIdentification, AxisValidation, ConditionedRecording, FeedforwardMode, Identification,
    IdentificationInput, IdentificationOptions, IdentifiedValue, RefinementScope, identify, validate,
};
use virtual_axes_identify::recording::{Conditioning, Finding, RawRecording, Signals, condition};
use virtual_axes_report::{Chart, ChartSeries, Document, IdentificationPage, Section, Table};
use virtual_axes_verification::fixtures::machines::{M_MIN, TSP, parameters};
use virtual_axes_verification::fixtures::recordings::{Disturbance, axis_index, record_campaign};

/// Headings of the sections, in their order.
const SECTIONS: [&str; 10] = [
    "Result",
    "Identified parameters",
    "Recordings",
    "Gravity",
    "Friction law",
    "Equivalent inertia",
    "Feedforward",
    "Delays",
    "Refinement in closed loop",
    "Measured and simulated",
];

/// An axis with recordings of its campaign.
struct TestCase {
    parameters: Parameters,
    machine: MachineConfig,
    axis: String,
    recordings: Vec<(FeedforwardMode, Signals)>,
    findings: Vec<Vec<Finding>>,
}

impl TestCase {
    fn new(
        parameters: Parameters,
        axis: &str,
        parts: &[FeedforwardMode],
        course: &Course,
        change: impl Fn(&mut RawRecording),
    ) -> Self {
        let machine = parameters.machine_config().expect("valid");
        let config = &machine.axes()[axis_index(&machine, axis)];
        let disturbance = Disturbance::usual(config.kind(), 11);
        let (mut recordings, mut findings) = (Vec::new(), Vec::new());
        for (mode, mut raw) in record_campaign(&parameters, axis, parts, course, &disturbance) {
            change(&mut raw);
            let (signals, found) =
                condition(&raw, config, &machine.periods(), &Conditioning::default()).expect("fit for use");
            recordings.push((mode, signals));
            findings.push(found);
        }
        TestCase { machine, axis: axis.to_owned(), recordings, findings, parameters }
    }

    fn config(&self) -> &AxisConfig {
        &self.machine.axes()[axis_index(&self.machine, &self.axis)]
    }

    fn inputs(&self) -> Vec<IdentificationInput<'_>> {
        self.recordings
            .iter()
            .map(|(mode, signals)| IdentificationInput { signals, feedforward: Some(*mode) })
            .collect()
    }

    fn identify(&self, refine: bool) -> (Identification, Vec<IdentifiedValue>) {
        let refine = if refine { RefinementScope::ALL } else { RefinementScope::NONE };
        let options = IdentificationOptions { refine, ..IdentificationOptions::default() };
        let found = identify(&self.inputs(), self.config(), &self.machine.periods(), &options);
        let values = found.values(&self.parameters, &self.axis);
        (found, values)
    }

    fn document(&self, found: &Identification, values: &[IdentifiedValue]) -> Document {
        self.checked(found, values, Vec::new())
    }

    fn checked(
        &self,
        identification: &Identification,
        values: &[IdentifiedValue],
        validations: Vec<AxisValidation>,
    ) -> Document {
        let inputs = self.inputs();
        let validated: Vec<_> = validations.iter().map(|v| (v.recorded.input(), &v.agreement)).collect();
        let summary = IdentificationSummary::new(
            self.machine.name(),
            (&inputs, &[]),
            identification,
            values.to_vec(),
            &validated,
            identification.findings.clone(),
        );
        let recordings = self.recordings.iter().zip(&self.findings).map(|((mode, signals), findings)| {
            let (signals, findings) = (signals.clone(), findings.clone());
            ConditionedRecording { signals, feedforward: Some(*mode), findings }
        });
        let found = AxisIdentification {
            recordings: recordings.collect(),
            identification: identification.clone(),
            transmissions: Vec::new(),
            validations,
            summary,
            identified: self.parameters.clone(),
        };
        IdentificationPage { found: &found, periods: self.machine.periods() }.document()
    }
}

/// X over a short range, all parts, refined; validated with the recording with velocity feedforward, and with
/// the same recording without PSEC.
struct Whole {
    case: TestCase,
    found: Identification,
    values: Vec<IdentifiedValue>,
    blind: Signals,
    validations: Vec<Agreement>,
}

static WHOLE: LazyLock<Whole> = LazyLock::new(|| {
    // The initial machine deviates from the recorded one.
    let truth = parameters::<&str>(&[]);
    let course = Course { range: Some([0.0, 0.3]), max_feed: Some(12.0 * M_MIN) };
    let mut case = TestCase::new(truth, "x", &FeedforwardMode::ALL, &course, |_| {});
    let off = parameters(&[("x.motor.inertia_kg_m2", 0.024), ("x.friction.a", 1.4)]);
    case.machine = off.machine_config().expect("valid");
    case.parameters = off;
    let (found, values) = case.identify(true);
    let mut blind = case.recordings[1].1.clone();
    blind.name = "blind".to_owned();
    blind.spans.iter_mut().for_each(|span| span.psec = None);
    let check = |signals| {
        let input = IdentificationInput { signals, feedforward: Some(FeedforwardMode::Velocity) };
        validate(&input, found.axis(), &case.machine.periods()).expect("it can be simulated")
    };
    let validations = vec![check(&case.recordings[1].1), check(&blind)];
    Whole { case, found, values, blind, validations }
});

impl Whole {
    fn document(&self) -> Document {
        let signals = [&self.case.recordings[1].1, &self.blind];
        let checks = signals.iter().zip(&self.validations).map(|(signals, agreement)| AxisValidation {
            recorded: ConditionedRecording {
                signals: (*signals).clone(),
                feedforward: Some(FeedforwardMode::Velocity),
                findings: Vec::new(),
            },
            agreement: agreement.clone(),
        });
        self.case.checked(&self.found, &self.values, checks.collect())
    }
}

fn page(document: &Document) -> String {
    let mut bytes = Vec::new();
    document.write(&mut bytes).expect("memory can be written");
    String::from_utf8(bytes).expect("UTF-8")
}

/// Keeps a page for inspection.
fn keep(name: &str, page: &str) {
    let path = format!("{}/identification_{name}.html", env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(path, page).expect("the folder is writable");
}

fn headings(document: &Document) -> Vec<&str> {
    document.sections.iter().map(|section| section.heading.as_str()).collect()
}

fn section<'a>(document: &'a Document, heading: &str) -> &'a Section {
    let found = document.sections.iter().find(|section| section.heading == heading);
    found.unwrap_or_else(|| panic!("no section {heading}"))
}

fn text(section: &Section) -> String {
    let notices = section.notices.iter().map(|notice| notice.text.clone());
    section.paragraphs.iter().cloned().chain(notices).collect::<Vec<_>>().join(" ")
}

fn table<'a>(section: &'a Section, caption: &str) -> &'a Table {
    let found = section.tables.iter().find(|table| table.caption == caption);
    found.unwrap_or_else(|| panic!("no table {caption}"))
}

fn chart<'a>(section: &'a Section, title: &str) -> &'a Chart {
    let found = section.charts.iter().find(|chart| chart.title == title);
    found.unwrap_or_else(|| panic!("no chart {title}"))
}

fn series<'a>(chart: &'a Chart, quantity: &str, label: &str) -> &'a ChartSeries {
    let panel = chart.panels.iter().find(|panel| panel.y.quantity == quantity);
    let panel = panel.unwrap_or_else(|| panic!("no panel {quantity}"));
    panel.series.iter().find(|s| s.label == label).unwrap_or_else(|| panic!("no series {label}"))
}

fn value(cell: &str) -> f64 {
    let plain: String = cell.chars().filter(|c| !c.is_whitespace()).collect();
    plain.replace('−', "-").parse().unwrap_or_else(|_| panic!("{cell} is no number"))
}

fn assert_sound(page: &str) {
    assert_well_formed(page);
    assert_self_contained(page);
}

#[test]
fn every_step_has_a_section_with_its_plots() {
    let document = WHOLE.document();
    let text_of_page = page(&document);
    keep("x", &text_of_page);
    assert_sound(&text_of_page);
    let (steps, validations) = (&headings(&document)[..10], &headings(&document)[10..]);
    assert_eq!(steps, SECTIONS);
    assert_eq!(validations, ["Validation on velocity", "Validation on blind"]);
    for (section, pictures) in document.sections.iter().zip([0, 0, 3, 1, 1, 1, 2, 3, 0, 3, 1, 1]) {
        assert!(section.charts.len() >= pictures, "{}", section.heading);
        assert!(!section.paragraphs.is_empty(), "{}", section.heading);
        assert!(
            !section.tables.is_empty() || ["Equivalent inertia", "Feedforward"].contains(&&*section.heading)
        );
    }
    for name in ["off", "velocity", "both"] {
        assert!(document.facts.contains(&("identified from".to_owned(), name.to_owned())), "{name}");
    }
}

#[test]
fn the_same_identification_gives_the_same_bytes() {
    assert_eq!(page(&WHOLE.document()), page(&WHOLE.document()));
}

#[test]
fn all_identified_values_are_in_the_first_table() {
    let document = WHOLE.document();
    let found = table(section(&document, "Identified parameters"), "Identified values");
    assert!(WHOLE.values.len() >= 9, "{:?}", WHOLE.values);
    for (row, wanted) in found.rows.iter().zip(&WHOLE.values) {
        assert_eq!(row[0], wanted.key);
        assert_eq!(row[1].parse(), Ok(wanted.value));
        assert_eq!(row[4].parse(), Ok(wanted.before));
        assert_eq!((row[2].as_str(), &row[5]), (wanted.unit, &wanted.source));
        assert_eq!(row[3].contains('…'), wanted.interval.is_some(), "{row:?}");
    }
    let inertia = found.rows.iter().find(|row| row[0] == "x.motor.inertia_kg_m2").expect("it was identified");
    assert_eq!(inertia[4], "0.024");
}

#[test]
fn the_friction_table_compares_each_speed_with_the_law() {
    let document = WHOLE.document();
    let friction = section(&document, "Friction law");
    let rows = &table(friction, "Constant velocities").rows;
    let levels = &WHOLE.found.steady.levels;
    assert_eq!(2 * rows.len(), levels.len());
    assert!(rows.len() >= 10, "{}", rows.len());
    for row in rows {
        let cells: Vec<f64> = row.iter().map(|cell| value(cell)).collect();
        let (speed, plus, minus, law) = (cells[0], cells[1], cells[3], cells[5]);
        // Friction law of X (Prévost appendix 2), V in m/min.
        let truth = 1.576 * (0.019_65 * speed).exp() - 0.5332 * (-0.2801 * speed).exp();
        assert!((law - truth).abs() < 0.03 * truth, "{row:?}: {truth}");
        assert!((plus / law - 1.0).abs() < 0.1 && (minus / law + 1.0).abs() < 0.1, "{row:?}");
    }
    // The plot has the points of the table, in m/s and A.
    let picture = chart(friction, "Friction law");
    let minus = series(picture, "Friction current", "measured, negative direction");
    assert!(minus.points.iter().all(|[v, i]| *v < 0.0 && *i < 0.0));
    assert_eq!(minus.points.len(), rows.len());
    assert_eq!(minus.errors.len(), minus.points.len());
    let fastest = series(picture, "Friction current", "fitted law").points.last().copied().expect("a line");
    assert!((fastest[0] / M_MIN / value(&rows.last().expect("rows")[0]) - 1.0).abs() < 1e-3);
}

#[test]
fn plots_show_deviations_and_a_fast_move_of_a_long_recording() {
    let document = WHOLE.document();
    let compared = section(&document, "Measured and simulated");
    let whole = chart(compared, "off, feedforward off");
    let (experiment, simulated) =
        (&WHOLE.found.agreements[0].experiments[0], &WHOLE.found.agreements[0].simulated[0]);
    let deviation = series(whole, "Deviation", "");
    assert_eq!(deviation.points.len(), experiment.position.len());
    for (i, [time, value]) in deviation.points.iter().enumerate() {
        assert!((time - experiment.start - i as f64 * TSP).abs() < 1e-9);
        assert_eq!(*value, simulated.position[i] - experiment.position[i]);
    }
    for quantity in ["Following error", "Velocity", "Current"] {
        for label in ["measured", "simulated"] {
            assert_eq!(series(whole, quantity, label).points.len(), deviation.points.len());
        }
    }
    let rows = &table(compared, "Simulated minus measured").rows;
    assert_eq!(rows.len(), 3);
    // Without feedforward X lags by V/Kp, 25 s⁻¹, and by α, whose 9 ms are two position cycles.
    let window = chart(compared, "off, feedforward off: a fast move");
    let errors = series(window, "Following error", "measured");
    let lag = errors.points.iter().map(|point| point[1].abs()).fold(0.0, f64::max);
    assert!((lag / (12.0 * M_MIN * (1.0 / 25.0 + 2.0 * TSP)) - 1.0).abs() < 0.01, "{lag}");
    assert!(errors.points.len() < deviation.points.len() / 20);
    let classes: Vec<_> = window.bands.iter().map(|band| band.label.as_str()).collect();
    assert!(classes.contains(&"constant velocity") && classes.contains(&"accelerating"), "{classes:?}");
}

#[test]
fn a_recording_without_setpoints_is_compared_by_inverse_dynamics() {
    let document = WHOLE.document();
    let blind = section(&document, "Validation on blind");
    assert!(text(blind).contains("has no PSEC"), "{}", text(blind));
    let picture = chart(blind, "blind: current by inverse dynamics");
    let measured = series(picture, "Current", "measured");
    assert_eq!(measured.points.len(), series(picture, "Current", "modeled").points.len());
    assert_eq!(blind.tables.len(), 2);
}

#[test]
fn missing_results_are_reported() {
    let course = Course { range: Some([0.0, 0.1]), max_feed: Some(5.0 * M_MIN) };
    let case = TestCase::new(parameters::<&str>(&[]), "y", &[FeedforwardMode::Velocity], &course, |raw| {
        (raw.psec, raw.current, raw.velocity_feedforward, raw.torque_feedforward) = (None, None, None, None);
    });
    let (found, values) = case.identify(true);
    assert!(values.is_empty());
    let document = case.document(&found, &values);
    let text_of_page = page(&document);
    keep("y", &text_of_page);
    assert_sound(&text_of_page);
    assert_eq!(headings(&document), SECTIONS);
    for (heading, wanted) in [
        ("Gravity", "record the motor current"),
        ("Delays", "record the position setpoints"),
        ("Identified parameters", "No parameter was identified"),
        ("Identified parameters", "record the motor current"),
        ("Identified parameters", "record the position setpoints"),
        ("Gravity", "not identified"),
        ("Friction law", "No friction law"),
        ("Equivalent inertia", "not identified"),
        ("Feedforward", "VFFW was not identified"),
        ("Delays", "No delay"),
        ("Refinement in closed loop", "was not run"),
        ("Measured and simulated", "no comparison is possible"),
    ] {
        let text = text(section(&document, heading));
        assert!(text.contains(wanted), "{heading}: {text}");
    }
    // The segmentation of the recording is still plotted.
    assert_eq!(section(&document, "Recordings").charts.len(), 1);
    assert!(section(&document, "Measured and simulated").charts.is_empty());
}

#[test]
fn a_recording_has_its_file_name_unless_another_has_the_same() {
    let course = Course { range: Some([0.0, 0.1]), max_feed: Some(5.0 * M_MIN) };
    let parts = [FeedforwardMode::Off, FeedforwardMode::Velocity];
    let mut case = TestCase::new(parameters::<&str>(&[]), "x", &parts, &course, |_| {});
    for (second, shown) in
        [("/traces/b/slow.csv", ["fast.csv", "slow.csv"]), ("/traces/b/fast.csv", ["/traces/a/fast.csv"; 2])]
    {
        case.recordings[0].1.name = "/traces/a/fast.csv".to_owned();
        case.recordings[1].1.name = second.to_owned();
        case.findings[0] = vec![Finding::note("gap", "/traces/a/fast.csv: a gap of 6 ms")];
        let (found, values) = case.identify(false);
        let document = case.document(&found, &values);
        let recordings = section(&document, "Recordings");
        assert_eq!(recordings.tables[0].rows[0][0], shown[0]);
        assert_eq!(recordings.notices[0].text, format!("{}: a gap of 6 ms", shown[0]));
        assert_eq!(recordings.tables[0].rows[1][0], if shown[0] == shown[1] { second } else { shown[1] });
    }
}

#[test]
fn a_rotary_axis_is_reported_in_degrees() {
    let parts = [FeedforwardMode::Both];
    let course = Course { range: None, max_feed: None };
    let case = TestCase::new(parameters::<&str>(&[]), "a", &parts, &course, |_| {});
    assert_eq!(case.config().kind(), AxisKind::Rotary);
    let (found, values) = case.identify(false);
    let document = case.document(&found, &values);
    let text_of_page = page(&document);
    keep("a", &text_of_page);
    assert_sound(&text_of_page);
    for wanted in ["Velocity (rpm)", "Deviation (mdeg)", "kg·m²", "min/rev", "factor of sin q"] {
        assert!(text_of_page.contains(wanted), "{wanted}");
    }
    // Texts and data, without the scripts of every page.
    let own = text_of_page.split("<script>").next().unwrap_or_default();
    for unwanted in ["m/min", "µm", "(mm)"] {
        assert!(!own.contains(unwanted), "{unwanted}");
    }
}

#[test]
fn the_inertia_of_a_linear_motor_is_a_mass() {
    let course = Course { range: None, max_feed: None };
    let machine =
        Parameters::load("linear_motor_center", virtual_axes_builtin::MACHINES).expect("it is shipped");
    let case = TestCase::new(machine, "x", &[FeedforwardMode::Off], &course, |_| {});
    let (found, values) = case.identify(false);
    let document = case.document(&found, &values);
    let text_of_page = page(&document);
    keep("linear_motor", &text_of_page);
    assert_sound(&text_of_page);
    assert!(text_of_page.contains("linear motor") && text_of_page.contains("x.motor.mass_kg"));
    assert!(!text_of_page.contains("kg·m²") && !text_of_page.contains("rad/s"));
}
