//! SVG writer. Shapes have CSS classes only; the style sheet sets colors for light, dark and print themes.

use std::fmt::{self, Display, Write as _};

use super::decimate::{PixelPoint, simplified};
use super::text::Text;

/// Horizontal alignment of a text relative to its point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A plot while it is drawn. Coordinates are pixels, y points downwards.
#[derive(Debug)]
pub(super) struct Svg {
    width: f64,
    height: f64,
    body: String,
}

impl Svg {
    /// Creates an empty plot.
    pub(super) fn new(width: f64, height: f64) -> Self {
        Svg { width, height, body: String::new() }
    }

    /// Appends formatted SVG; writing to a string cannot fail.
    fn append(&mut self, shape: fmt::Arguments) {
        let _ = self.body.write_fmt(shape);
    }

    /// Draws a straight line.
    pub(super) fn line(&mut self, class: &str, [x1, y1]: PixelPoint, [x2, y2]: PixelPoint) {
        let [x1, y1, x2, y2] = [x1, y1, x2, y2].map(Pixel::of);
        self.append(format_args!(
            "<line class=\"{class}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>"
        ));
    }

    /// Draws a circle.
    pub(super) fn circle(&mut self, class: &str, [x, y]: PixelPoint, radius: f64) {
        let [x, y, r] = [x, y, radius].map(Pixel::of);
        self.append(format_args!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{r}\"/>"));
    }

    /// Draws a rectangle from its upper left to its lower right corner.
    pub(super) fn rectangle(&mut self, class: &str, [x1, y1]: PixelPoint, [x2, y2]: PixelPoint) {
        let [x, y, width, height] = [x1, y1, x2 - x1, y2 - y1].map(Pixel::of);
        self.append(format_args!(
            "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>"
        ));
    }

    /// Draws a horizontal line from a point to the right, as a path.
    pub(super) fn horizontal_line(&mut self, class: &str, [x, y]: PixelPoint, length: f64) {
        let [x, y, length] = [x, y, length].map(Pixel::of);
        self.append(format_args!("<path class=\"{class}\" d=\"M{x}{}{y}h{length}\"/>", y.separator()));
    }

    /// Draws a line through points, in one or several parts. A part of one point is a dot.
    pub(super) fn path(&mut self, class: &str, parts: &[Vec<PixelPoint>]) {
        if parts.iter().all(Vec::is_empty) {
            return;
        }
        self.append(format_args!("<path class=\"{class}\" d=\""));
        for part in parts {
            let mut points = simplified(part).into_iter().map(|point| point.map(Pixel::of));
            let Some([mut x, mut y]) = points.next() else { continue };
            self.append(format_args!("M{x}{}{y}", y.separator()));
            let mut command = "l";
            for [next_x, next_y] in points {
                let (dx, dy) = (next_x.minus(x), next_y.minus(y));
                if dx.is_zero() && dy.is_zero() {
                    continue;
                }
                let before = if command.is_empty() { dx.separator() } else { "" };
                self.append(format_args!("{command}{before}{dx}{}{dy}", dy.separator()));
                (x, y, command) = (next_x, next_y, "");
            }
            if !command.is_empty() {
                self.body.push_str("h0");
            }
        }
        self.body.push_str("\"/>");
    }

    /// Draws a line of text.
    pub(super) fn text(&mut self, class: &str, [x, y]: PixelPoint, anchor: Anchor, text: &str) {
        let [x, y] = [x, y].map(Pixel::of);
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        self.append(format_args!(
            "<text class=\"{class}\" x=\"{x}\" y=\"{y}\"{anchor}>{}</text>",
            Text(text)
        ));
    }

    /// Draws a line of text from bottom to top, centered at a point.
    pub(super) fn upward_text(&mut self, class: &str, [x, y]: PixelPoint, text: &str) {
        let [x, y] = [x, y].map(Pixel::of);
        self.append(format_args!(
            "<text class=\"{class}\" transform=\"translate({x} {y}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            Text(text)
        ));
    }

    /// Ends the drawing and returns it as a legend sample without text alternative.
    pub(super) fn into_swatch(self) -> String {
        let Svg { width, height, body } = self;
        let [width, height] = [width, height].map(Pixel::of);
        format!("<svg class=\"swatch\" viewBox=\"0 0 {width} {height}\" aria-hidden=\"true\">{body}</svg>")
    }

    /// Ends the drawing and returns it with a title and a text alternative. `id` is unique in the page.
    pub(super) fn finish(self, id: &str, title: &str, description: &str) -> String {
        let Svg { width, height, body } = self;
        let [width, height] = [width, height].map(Pixel::of);
        let (title, description) = (Text(title), Text(description));
        format!(
            "<svg role=\"img\" viewBox=\"0 0 {width} {height}\" aria-labelledby=\"{id}-t {id}-d\">\
             <title id=\"{id}-t\">{title}</title><desc id=\"{id}-d\">{description}</desc>{body}</svg>\n"
        )
    }
}

/// Coordinate in tenths of a pixel with the shortest notation.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pixel(i64);

impl Pixel {
    fn of(value: f64) -> Self {
        // Plots are smaller than a million pixels; NaN becomes 0.
        Pixel((value.clamp(-1e6, 1e6) * 10.0).round() as i64)
    }

    fn minus(self, other: Pixel) -> Pixel {
        Pixel(self.0 - other.0)
    }

    fn is_zero(self) -> bool {
        self.0 == 0
    }

    /// Returns the separator after a preceding number.
    fn separator(self) -> &'static str {
        if self.0 < 0 { "" } else { " " }
    }
}

impl Display for Pixel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let magnitude = self.0.unsigned_abs();
        let (whole, tenth) = (magnitude / 10, magnitude % 10);
        if self.0 < 0 {
            f.write_char('-')?;
        }
        if whole > 0 || tenth == 0 {
            write!(f, "{whole}")?;
        }
        if tenth > 0 {
            write!(f, ".{tenth}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short() {
        let shown = [0.0, 0.04, -0.3, 12.0, -1.25, f64::NAN, f64::INFINITY].map(|v| Pixel::of(v).to_string());
        assert_eq!(shown, ["0", "0", "-.3", "12", "-1.3", "0", "1000000"]);
    }

    #[test]
    fn a_path_is_relative_and_breaks_where_its_parts_do() {
        let mut svg = Svg::new(10.0, 10.0);
        svg.path("line", &[vec![[1.0, 2.0], [2.0, 1.5], [3.5, 4.0]], vec![[5.0, 5.0]]]);
        assert_eq!(svg.body, "<path class=\"line\" d=\"M1 2l1-.5 1.5 2.5M5 5h0\"/>");
    }

    #[test]
    fn texts_of_a_plot_are_escaped() {
        let mut svg = Svg::new(10.0, 10.0);
        svg.text("t", [0.0, 0.0], Anchor::End, "<a>");
        let text = svg.finish("p1", "<b>", "</desc><script>");
        for tag in ["<a>", "<b>", "<script>"] {
            assert!(!text.contains(tag), "{text}");
        }
    }
}
