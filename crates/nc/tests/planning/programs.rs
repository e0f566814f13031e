//! Motions of test programs.

use virtual_axes_nc::motion::{
    Blend, Coordinates, Feed, MotionKind, Nurbs, PathControl, PlanarArc, Plane, ProgramEvent, ProgramMotion,
    ProgramStep,
};

pub type Step = Result<ProgramStep, std::io::Error>;

/// Builder of a program.
pub struct Program {
    pub steps: Vec<ProgramStep>,
    pub at: Coordinates,
    pub feed: f64,
    pub control: PathControl,
    pub tcp_length: Option<f64>,
}

pub fn blend(tolerance: f64) -> PathControl {
    PathControl::Blend(Blend {
        tolerance: Some(tolerance),
        rotary_tolerance: Some((tolerance * 1e3).to_radians()),
        merge_tolerance: None,
    })
}

impl Program {
    pub fn new(feed: f64, control: PathControl) -> Self {
        Self { steps: Vec::new(), at: [0.0; 9], feed, control, tcp_length: None }
    }

    fn push(&mut self, kind: MotionKind, end: Coordinates, feed: Feed) {
        let motion = ProgramMotion {
            line: self.steps.len() + 1,
            kind,
            start: self.at,
            end,
            feed,
            path_control: self.control,
            tcp_length: self.tcp_length,
        };
        self.steps.push(ProgramStep::Motion(motion));
        self.at = end;
    }

    /// Appends a line to `x`, `y`, `z`, m.
    pub fn line(&mut self, x: f64, y: f64, z: f64) -> &mut Self {
        let mut end = self.at;
        end[..3].copy_from_slice(&[x, y, z]);
        self.push(MotionKind::Line, end, Feed::Linear(self.feed));
        self
    }

    /// Appends a line of all coordinates.
    pub fn line_to(&mut self, end: Coordinates) -> &mut Self {
        self.push(MotionKind::Line, end, Feed::Linear(self.feed));
        self
    }

    pub fn rapid(&mut self, end: Coordinates) -> &mut Self {
        self.push(MotionKind::Rapid, end, Feed::Rapid);
        self
    }

    /// Appends an arc in the XY plane around `center` with `sweep`, rad, and a change of Z.
    pub fn arc(&mut self, center: [f64; 2], sweep: f64, dz: f64) -> &mut Self {
        let (x, y) = (self.at[0] - center[0], self.at[1] - center[1]);
        let (s, c) = sweep.sin_cos();
        let mut end = self.at;
        end[0] = center[0] + c * x - s * y;
        end[1] = center[1] + s * x + c * y;
        end[2] += dz;
        let arc = PlanarArc { plane: Plane::Xy, center, sweep };
        self.push(MotionKind::Arc(arc), end, Feed::Linear(self.feed));
        self
    }

    /// Appends a NURBS curve in the XY plane with control points (m) and weights after the present point.
    pub fn nurbs(&mut self, order: usize, control: &[([f64; 2], f64)]) -> &mut Self {
        let start = ([self.at[0], self.at[1]], 1.0);
        let control: Vec<_> = std::iter::once(start).chain(control.iter().copied()).collect();
        let mut end = self.at;
        end[..2].copy_from_slice(&control[control.len() - 1].0);
        self.push(
            MotionKind::Nurbs(Nurbs { plane: Plane::Xy, order, control }),
            end,
            Feed::Linear(self.feed),
        );
        self
    }

    pub fn dwell(&mut self, time: f64) -> &mut Self {
        let line = self.steps.len() + 1;
        self.steps.push(ProgramStep::Event { line, event: ProgramEvent::Dwell(time) });
        self
    }

    pub fn iter(&self) -> impl Iterator<Item = Step> + '_ {
        self.steps.iter().cloned().map(Ok)
    }

    pub fn motions(&self) -> impl Iterator<Item = &ProgramMotion> {
        self.steps.iter().filter_map(|step| match step {
            ProgramStep::Motion(motion) => Some(motion),
            ProgramStep::Event { .. } => None,
        })
    }
}

/// Raster of micro-segments on a wavy surface: `rows` rows of `length`, m, with segments of `segment`, coordinates
/// rounded to `rounding`.
pub fn raster(rows: usize, length: f64, segment: f64, rounding: f64, feed: f64, tolerance: f64) -> Program {
    let mut program = Program::new(feed, blend(tolerance));
    let round = |x: f64| if rounding > 0.0 { (x / rounding).round() * rounding } else { x };
    let height = |x: f64, y: f64| 2e-3 * ((x / 8e-3).sin() * (y / 5e-3).cos());
    let count = (length / segment).round() as usize;
    program.at[2] = round(height(0.0, 0.0));
    for row in 0..rows {
        let y = 0.2e-3 * row as f64;
        for i in 0..=count {
            let i = if row % 2 == 0 { i } else { count - i };
            let x = length * i as f64 / count as f64;
            if row == 0 && i == 0 {
                continue;
            }
            program.line(round(x), round(y), round(height(x, y)));
        }
    }
    program
}

/// Returns a wave of 40 lines on which A and C swivel, with TCP control of a tool of this length, m.
pub fn five_axis(tool_length: f64) -> Program {
    let mut program = Program::new(0.1, blend(20e-6));
    program.tcp_length = Some(tool_length);
    for i in 1..=40 {
        let t = f64::from(i) / 40.0;
        let mut end = [0.0; 9];
        end[0] = 0.06 * t;
        end[1] = 0.01 * (6.0 * t).sin();
        end[3] = 0.3 * t;
        end[5] = 0.4 * t * t;
        program.line_to(end);
    }
    program
}
