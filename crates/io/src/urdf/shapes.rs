//! Shapes of the links for visualization and collisions: boxes and cylinders.

use std::iter;

use nalgebra::Vector3;
use virtual_axes_core::config::{KinematicsConfig, LimitsConfig};
use virtual_axes_core::kinematics::AxisRole;

/// Drawn half travel of an axis without travel limits, m.
const DEFAULT_HALF_TRAVEL: f64 = 0.3;
/// Largest drawn half travel, m.
const MAX_HALF_TRAVEL: f64 = 5.0;
/// Thickness of plates and of the table, m.
const PLATE: f64 = 0.04;
/// Clearance between moving parts, m.
const GAP: f64 = 0.02;
/// Cross-section of the slides, m.
const SLIDE: f64 = 0.16;
/// Radius of the table, m.
const TABLE_RADIUS: f64 = 0.2;
/// Radius of the spindle, m.
const SPINDLE_RADIUS: f64 = 0.05;
/// Length of the spindle, m.
const SPINDLE_LENGTH: f64 = 0.2;
/// Radius of the tool, m.
const TOOL_RADIUS: f64 = 0.006;
/// Reciprocal of the rounding of dimensions, 1/m: 0.1 mm.
const ROUNDING: f64 = 1e4;
/// Radius of the bearings of A, m.
const BEARING_RADIUS: f64 = 0.07;

/// Name and color (red, green, blue, opacity) of a material.
pub(super) type Material = (&'static str, [f64; 4]);

pub(super) const CASTING: Material = ("casting", [0.45, 0.48, 0.50, 1.0]);
pub(super) const SLIDES: Material = ("slides", [0.70, 0.73, 0.76, 1.0]);
pub(super) const CRADLE: Material = ("cradle", [0.20, 0.38, 0.55, 1.0]);
pub(super) const TABLE: Material = ("table", [0.55, 0.60, 0.64, 1.0]);
pub(super) const SPINDLE: Material = ("spindle", [0.25, 0.25, 0.28, 1.0]);
pub(super) const TOOL: Material = ("tool", [0.85, 0.65, 0.20, 1.0]);

/// All materials.
pub(super) const MATERIALS: [Material; 6] = [CASTING, SLIDES, CRADLE, TABLE, SPINDLE, TOOL];

/// Geometry of a shape.
pub(super) enum Geometry {
    /// Box with its edges along X, Y and Z, m.
    Box([f64; 3]),
    /// Cylinder along Z, m.
    Cylinder { radius: f64, length: f64 },
}

/// Shape in the frame of its link.
pub(super) struct Visual {
    pub geometry: Geometry,
    /// Center, m.
    pub origin: [f64; 3],
    /// Roll, pitch and yaw, rad.
    pub rotation: [f64; 3],
    pub material: &'static str,
}

fn rounded(value: f64) -> f64 {
    (value * ROUNDING).round() / ROUNDING
}

/// Creates the box between two corners.
fn block(from: [f64; 3], to: [f64; 3], (material, _): Material) -> Visual {
    let edges = std::array::from_fn(|i| rounded((to[i] - from[i]).abs()));
    let middle = std::array::from_fn(|i| rounded(0.5 * (from[i] + to[i])));
    Visual { geometry: Geometry::Box(edges), origin: middle, rotation: [0.0; 3], material }
}

/// Creates the cylinder about Z between two heights.
fn cylinder(radius: f64, from: f64, to: f64, (material, _): Material) -> Visual {
    let geometry = Geometry::Cylinder { radius, length: rounded((to - from).abs()) };
    Visual { geometry, origin: [0.0, 0.0, rounded(0.5 * (from + to))], rotation: [0.0; 3], material }
}

/// Dimensions of the shapes of one machine.
pub(super) struct Shapes {
    /// Half travel of X, Y and Z, m.
    half: [f64; 3],
    tool_length: f64,
    pivot_a: [f64; 2],
    pivot_c: [f64; 2],
    /// Height of the table surface in the machine frame at home, m: below the lowest tool tip.
    top: f64,
}

impl Shapes {
    pub fn new<'a>(
        geometry: &KinematicsConfig,
        limits: impl Fn(AxisRole) -> Option<&'a LimitsConfig>,
    ) -> Self {
        let half = AxisRole::LINEAR.map(|role| {
            let travel = limits(role).map(|limits| limits.travel_max.max(-limits.travel_min));
            travel.filter(|travel| travel.is_finite()).unwrap_or(DEFAULT_HALF_TRAVEL).min(MAX_HALF_TRAVEL)
        });
        let lowest = (-half[2] - geometry.tool_length).min(geometry.workpiece[2]);
        Shapes {
            half,
            tool_length: geometry.tool_length,
            pivot_a: geometry.pivot_a,
            pivot_c: geometry.pivot_c,
            top: lowest - GAP,
        }
    }

    /// Returns half the clear width between the side plates of the cradle, m.
    fn half_cradle(&self) -> f64 {
        TABLE_RADIUS + self.pivot_c[0].abs() + GAP
    }

    /// Returns the height of the lower face of the cradle at home, m.
    fn cradle_bottom(&self) -> f64 {
        self.top - 2.0 * PLATE - GAP
    }

    /// Returns the height of the rails of X, above all rotating parts, m.
    fn rails(&self) -> f64 {
        self.half[2] + SPINDLE_LENGTH + 2.0 * SLIDE
    }

    /// Returns the Y position of the column behind the tables, m.
    fn column(&self) -> f64 {
        let swing = (self.cradle_bottom() - self.pivot_a[1]).hypot(TABLE_RADIUS + self.pivot_c[1].abs());
        self.pivot_a[0] + swing + GAP
    }

    /// Returns the bed, the posts of A and the column with the rails of X.
    pub fn bed(&self) -> Vec<Visual> {
        let inner = self.half_cradle() + PLATE + GAP;
        let (width, back) = (inner + SLIDE, self.column() + SLIDE);
        // The cradle turns above the bed.
        let floor = self.pivot_a[1] + self.pivot_a[0] - self.column();
        let [y, z] = self.pivot_a;
        let post = |side: f64| {
            let (from, to) = (side * inner, side * width);
            block([from, y - SLIDE, floor], [to, y + SLIDE, z + SLIDE], CASTING)
        };
        let column = width.max(self.half[0] + SLIDE);
        vec![
            block([-column, y - back, floor - SLIDE], [column, back, floor], CASTING),
            post(-1.0),
            post(1.0),
            block([-column, self.column(), floor], [column, back, self.rails() - SLIDE], CASTING),
        ]
    }

    /// Returns the cradle in the frame of A: two side plates with bearings and a bottom plate.
    pub fn cradle(&self) -> Vec<Visual> {
        let (inner, [y, z]) = (self.half_cradle(), self.pivot_a);
        let middle = self.pivot_c[1] - y;
        let bottom = self.cradle_bottom() - z;
        let plate = |side: f64| {
            let from = [side * inner, middle - TABLE_RADIUS / 2.0, bottom];
            block(from, [side * (inner + PLATE), middle + TABLE_RADIUS / 2.0, BEARING_RADIUS], CRADLE)
        };
        let bearing = |side: f64| Visual {
            geometry: Geometry::Cylinder { radius: BEARING_RADIUS, length: PLATE + GAP },
            origin: [rounded(side * (inner + PLATE)), 0.0, 0.0],
            rotation: [0.0, std::f64::consts::FRAC_PI_2, 0.0],
            material: CRADLE.0,
        };
        let half = TABLE_RADIUS / 2.0;
        vec![
            plate(-1.0),
            plate(1.0),
            bearing(-1.0),
            bearing(1.0),
            block([-inner, middle - half, bottom], [inner, middle + half, bottom + PLATE], CRADLE),
        ]
    }

    /// Returns the table in the frame of C, with a groove that shows its angle.
    pub fn table(&self) -> Vec<Visual> {
        let groove = GAP / 4.0;
        vec![
            cylinder(TABLE_RADIUS, self.top - PLATE, self.top, TABLE),
            block([0.0, -groove, self.top], [TABLE_RADIUS, groove, self.top + groove], SPINDLE),
        ]
    }

    /// Returns the shapes of the slide of a linear axis; the spindle is at that of Z if no head carries it.
    pub fn slide(&self, role: AxisRole, has_spindle: bool) -> Vec<Visual> {
        match role {
            AxisRole::X => self.x_slide(),
            AxisRole::Y => self.y_slide(),
            _ => self.z_slide(has_spindle),
        }
    }

    /// Returns a plate below a table or above a head, in the frame of its rotary axis.
    pub fn plate(&self) -> Vec<Visual> {
        let half = SLIDE / 2.0;
        vec![block([-half, -half, -PLATE / 2.0], [half, half, PLATE / 2.0], CRADLE)]
    }

    /// Returns the spindle in the frame of the head that carries it, with its rotary axis at `pivot` in the machine frame at
    /// home, where the spindle nose is the origin, m.
    pub fn head(&self, pivot: Vector3<f64>) -> Vec<Visual> {
        let nose = -pivot.z;
        vec![cylinder(SPINDLE_RADIUS, nose, nose + SPINDLE_LENGTH, SPINDLE)]
    }

    /// Returns the carriage on the rails of X, as long as the travel of Y.
    fn x_slide(&self) -> Vec<Visual> {
        let rails = self.rails();
        let from = [-SLIDE, -self.half[1] - SLIDE, rails - SLIDE];
        vec![block(from, [SLIDE, self.column() + SLIDE, rails], SLIDES)]
    }

    /// Returns the head on the rails of Y.
    fn y_slide(&self) -> Vec<Visual> {
        let bottom = self.rails() - 2.0 * SLIDE;
        vec![block([-SLIDE, -SLIDE, bottom], [SLIDE, SLIDE, bottom + SLIDE], SLIDES)]
    }

    /// Returns quill and spindle, if it is there; the origin of the frame is the spindle nose.
    fn z_slide(&self, has_spindle: bool) -> Vec<Visual> {
        let quill = SLIDE / 2.0;
        let (from, to) = (SPINDLE_LENGTH, SPINDLE_LENGTH + 2.0 * self.half[2] + SLIDE);
        let spindle = has_spindle.then(|| cylinder(SPINDLE_RADIUS, 0.0, SPINDLE_LENGTH, SPINDLE));
        iter::once(block([-quill, -quill, from], [quill, quill, to], SLIDES)).chain(spindle).collect()
    }

    /// Returns the tool from the tip to the spindle nose; empty if the tool length is 0.
    pub fn tool(&self) -> Vec<Visual> {
        if self.tool_length == 0.0 {
            return Vec::new();
        }
        vec![cylinder(TOOL_RADIUS, 0.0, self.tool_length, TOOL)]
    }
}
