//! Pieces that every page is made of: head, sections, and the frame around the pictures.

use std::fmt;

use super::markers::Mark;
use super::svg::Svg;
use super::text::Text;

/// Colors for light, dark and paper, and the layout.
const STYLE: &str = include_str!("style.css");
/// Nothing is loaded and no script runs, whatever text a page brings along.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";
/// Styles of lines that the page has.
const LINE_STYLES: usize = 6;
/// Pixels of a piece of a line in a legend.
const SWATCH: [f64; 2] = [34.0, 12.0];

/// A page that is being written.
#[derive(Debug)]
pub(super) struct Html {
    text: String,
    pictures: usize,
}

/// What stands above a picture.
#[derive(Debug, Default)]
pub(super) struct Caption {
    /// What is shown.
    pub title: String,
    /// What must be said about it.
    pub note: String,
    /// Style and meaning of its lines.
    pub legend: Vec<(String, String)>,
}

/// Style of the lines of a run, or of one of several lines.
pub(super) fn run_class(run: usize) -> String {
    format!("run-{}", run % LINE_STYLES + 1)
}

impl Html {
    /// The head of a page with its heading; the description can be empty.
    pub(super) fn begin(title: &str, description: &str) -> Html {
        let mut html = Html { text: String::new(), pictures: 0 };
        let title = Text(title);
        html.put(format_args!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n<h1>{title}</h1>\n"
        ));
        if !description.is_empty() {
            html.put(format_args!("<p class=\"description\">{}</p>\n", Text(description)));
        }
        html.put(format_args!("</header>\n"));
        html
    }

    /// The whole page.
    pub(super) fn end(mut self) -> String {
        self.put(format_args!(
            "</main>\n<footer>{} {}</footer>\n</body>\n</html>\n",
            env!("CARGO_PKG_NAME"),
            env!("CARGO_PKG_VERSION")
        ));
        self.text
    }

    /// Appends; writing to a text cannot fail.
    pub(super) fn put(&mut self, piece: fmt::Arguments) {
        let _ = fmt::write(&mut self.text, piece);
    }

    /// Begins a section.
    pub(super) fn open_section(&mut self, class: &str, heading: &str) {
        self.put(format_args!("<section class=\"{class}\">\n<h2>{}</h2>\n", Text(heading)));
    }

    /// Ends it.
    pub(super) fn close_section(&mut self) {
        self.put(format_args!("</section>\n"));
    }

    /// A paragraph.
    pub(super) fn paragraph(&mut self, text: &str) {
        self.put(format_args!("<p>{}</p>\n", Text(text)));
    }

    /// Begins a row of `count` pictures side by side.
    pub(super) fn open_row(&mut self, count: usize) {
        // Four are better legible as two by two.
        let columns = match count {
            0 | 1 => 1,
            2 | 4 => 2,
            _ => 3,
        };
        self.put(format_args!("<div class=\"row of-{columns}\">\n"));
    }

    /// Ends it.
    pub(super) fn close_row(&mut self) {
        self.put(format_args!("</div>\n"));
    }

    /// A picture that `draw` makes from an id and a title.
    pub(super) fn figure(
        &mut self,
        class: &str,
        caption: &Caption,
        title: &str,
        draw: impl FnOnce(&str, &str) -> String,
    ) {
        self.pictures += 1;
        self.put(format_args!(
            "<figure class=\"{class}\">\n<figcaption><span class=\"title\">{}</span>",
            Text(&caption.title)
        ));
        if !caption.note.is_empty() {
            self.put(format_args!(" <span class=\"note\">{}</span>", Text(&caption.note)));
        }
        if !caption.legend.is_empty() {
            self.put(format_args!(" <span class=\"legend\">"));
            for (class, label) in &caption.legend {
                self.put(format_args!("<span class=\"key\">{}{}</span> ", swatch(class), Text(label)));
            }
            self.put(format_args!("</span>"));
        }
        let picture = draw(&format!("p{}", self.pictures), title);
        self.put(format_args!("</figcaption>\n<div class=\"picture\">{picture}</div>\n</figure>\n"));
    }
}

/// A piece of a line, a point or a shade, as in the picture.
pub(super) fn swatch(class: &str) -> String {
    let [width, height] = SWATCH;
    let mut svg = Svg::new(width, height);
    let middle = [width / 2.0, height / 2.0];
    let length = width - 2.0;
    match class.split_once(' ').unwrap_or((class, "")) {
        ("start" | "dot" | "mark", _) => svg.circle(class, middle, 4.0),
        ("points", _) => svg.path(class, &Mark::of_class(class).strokes(middle, 1.0)),
        ("band", kind) => {
            svg.rectangle(class, [1.0, 0.0], [1.0 + length, height]);
            svg.level(&format!("edge {kind}"), [1.0, 2.0], length);
        }
        _ => svg.level(class, [1.0, height / 2.0], length),
    }
    svg.into_swatch()
}
