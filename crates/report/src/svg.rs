//! Pictures as SVG text: shapes carry classes only, so that the page's style gives them colors for
//! light, dark and paper.

use std::fmt::{self, Display, Write as _};

use super::decimate::{PixelPoint, simplified};
use super::text::Text;

/// Where a text stands relative to its point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A picture that is being drawn; coordinates are pixels at the picture's natural size, y downwards.
#[derive(Debug)]
pub(super) struct Svg {
    width: f64,
    height: f64,
    body: String,
}

impl Svg {
    /// An empty picture.
    pub(super) fn new(width: f64, height: f64) -> Self {
        Svg { width, height, body: String::new() }
    }

    /// Appends; writing to a text cannot fail.
    fn put(&mut self, shape: fmt::Arguments) {
        let _ = self.body.write_fmt(shape);
    }

    /// A straight line.
    pub(super) fn line(&mut self, class: &str, [x1, y1]: PixelPoint, [x2, y2]: PixelPoint) {
        let [x1, y1, x2, y2] = [x1, y1, x2, y2].map(Pixel::of);
        self.put(format_args!("<line class=\"{class}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>"));
    }

    /// A circle.
    pub(super) fn circle(&mut self, class: &str, [x, y]: PixelPoint, radius: f64) {
        let [x, y, r] = [x, y, radius].map(Pixel::of);
        self.put(format_args!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{r}\"/>"));
    }

    /// A rectangle between two corners, the first above and left of the second.
    pub(super) fn rectangle(&mut self, class: &str, [x1, y1]: PixelPoint, [x2, y2]: PixelPoint) {
        let [x, y, width, height] = [x1, y1, x2 - x1, y2 - y1].map(Pixel::of);
        self.put(format_args!(
            "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>"
        ));
    }

    /// A level line from a point to the right, as a path.
    pub(super) fn level(&mut self, class: &str, [x, y]: PixelPoint, length: f64) {
        let [x, y, length] = [x, y, length].map(Pixel::of);
        self.put(format_args!("<path class=\"{class}\" d=\"M{x}{}{y}h{length}\"/>", y.separator()));
    }

    /// A line through points, in one or several parts; a part of one point is a dot.
    pub(super) fn path(&mut self, class: &str, parts: &[Vec<PixelPoint>]) {
        if parts.iter().all(Vec::is_empty) {
            return;
        }
        self.put(format_args!("<path class=\"{class}\" d=\""));
        for part in parts {
            let mut points = simplified(part).into_iter().map(|point| point.map(Pixel::of));
            let Some([mut x, mut y]) = points.next() else { continue };
            self.put(format_args!("M{x}{}{y}", y.separator()));
            let mut command = "l";
            for [next_x, next_y] in points {
                let (dx, dy) = (next_x.minus(x), next_y.minus(y));
                if dx.is_zero() && dy.is_zero() {
                    continue;
                }
                let before = if command.is_empty() { dx.separator() } else { "" };
                self.put(format_args!("{command}{before}{dx}{}{dy}", dy.separator()));
                (x, y, command) = (next_x, next_y, "");
            }
            if !command.is_empty() {
                self.body.push_str("h0");
            }
        }
        self.body.push_str("\"/>");
    }

    /// A line of text.
    pub(super) fn text(&mut self, class: &str, [x, y]: PixelPoint, anchor: Anchor, text: &str) {
        let [x, y] = [x, y].map(Pixel::of);
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        self.put(format_args!("<text class=\"{class}\" x=\"{x}\" y=\"{y}\"{anchor}>{}</text>", Text(text)));
    }

    /// A line of text that is read from below, about its middle.
    pub(super) fn upward_text(&mut self, class: &str, [x, y]: PixelPoint, text: &str) {
        let [x, y] = [x, y].map(Pixel::of);
        self.put(format_args!(
            "<text class=\"{class}\" transform=\"translate({x} {y}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            Text(text)
        ));
    }

    /// The picture as a part of a legend, which says what it means.
    pub(super) fn into_swatch(self) -> String {
        let Svg { width, height, body } = self;
        let [width, height] = [width, height].map(Pixel::of);
        format!("<svg class=\"swatch\" viewBox=\"0 0 {width} {height}\" aria-hidden=\"true\">{body}</svg>")
    }

    /// The picture with what it says to those who do not see it; `id` is unique in the page.
    pub(super) fn finish(self, id: &str, title: &str, description: &str) -> String {
        let Svg { width, height, body } = self;
        let [width, height] = [width, height].map(Pixel::of);
        let (title, description) = (Text(title), Text(description));
        format!(
            "<svg role=\"img\" viewBox=\"0 0 {width} {height}\" aria-labeledby=\"{id}-t {id}-d\">\
             <title id=\"{id}-t\">{title}</title><desc id=\"{id}-d\">{description}</desc>{body}</svg>\n"
        )
    }
}

/// A coordinate in tenths of a pixel, written as short as it can be.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pixel(i64);

impl Pixel {
    fn of(value: f64) -> Self {
        // No picture is a million pixels wide; what is not a number becomes 0.
        Pixel((value.clamp(-1e6, 1e6) * 10.0).round() as i64)
    }

    fn minus(self, other: Pixel) -> Pixel {
        Pixel(self.0 - other.0)
    }

    fn is_zero(self) -> bool {
        self.0 == 0
    }

    /// What parts it from a number before it.
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
    fn what_a_picture_says_is_escaped() {
        let mut svg = Svg::new(10.0, 10.0);
        svg.text("t", [0.0, 0.0], Anchor::End, "<a>");
        let text = svg.finish("p1", "<b>", "</desc><script>");
        for tag in ["<a>", "<b>", "<script>"] {
            assert!(!text.contains(tag), "{text}");
        }
    }
}
