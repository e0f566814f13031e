//! HTML elements of every page: head, sections, paragraphs, and figures with captions and legends.

use std::fmt;

use super::markers::Marker;
use super::svg::Svg;
use super::text::Text;

/// Style sheet: layout, and colors for light, dark and print themes.
const STYLE: &str = include_str!("style.css");
/// Content security policy: nothing is loaded and no script runs, regardless of the text of a page.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";
/// Number of line styles in the style sheet.
const LINE_STYLES: usize = 6;
/// Width and height of a sample in a legend, pixels.
const SWATCH: [f64; 2] = [34.0, 12.0];

/// A page while it is written.
#[derive(Debug)]
pub(super) struct Html {
    text: String,
    figures: usize,
}

/// Caption above a plot.
#[derive(Debug, Default)]
pub(super) struct Caption {
    /// Title of the plot.
    pub title: String,
    /// Remark behind the title; can be empty.
    pub note: String,
    /// CSS class and label of each legend entry.
    pub legend: Vec<(String, String)>,
}

/// Returns the CSS class of the lines of a run, or of one of several lines, by index.
pub(super) fn run_class(run: usize) -> String {
    format!("run-{}", run % LINE_STYLES + 1)
}

impl Html {
    /// Begins a page with its head and heading. An empty description is omitted.
    pub(super) fn begin(title: &str, description: &str) -> Html {
        let mut html = Html { text: String::new(), figures: 0 };
        let title = Text(title);
        html.append(format_args!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n<h1>{title}</h1>\n"
        ));
        if !description.is_empty() {
            html.append(format_args!("<p class=\"description\">{}</p>\n", Text(description)));
        }
        html.append(format_args!("</header>\n"));
        html
    }

    /// Ends the page and returns it.
    pub(super) fn end(mut self) -> String {
        self.append(format_args!(
            "</main>\n<footer>{} {}</footer>\n</body>\n</html>\n",
            env!("CARGO_PKG_NAME"),
            env!("CARGO_PKG_VERSION")
        ));
        self.text
    }

    /// Appends formatted HTML; writing to a string cannot fail.
    pub(super) fn append(&mut self, piece: fmt::Arguments) {
        let _ = fmt::write(&mut self.text, piece);
    }

    /// Begins a section with a heading.
    pub(super) fn open_section(&mut self, class: &str, heading: &str) {
        self.append(format_args!("<section class=\"{class}\">\n<h2>{}</h2>\n", Text(heading)));
    }

    /// Ends a section.
    pub(super) fn close_section(&mut self) {
        self.append(format_args!("</section>\n"));
    }

    /// Appends the result in one line per compared run.
    pub(super) fn verdict(&mut self, lines: &[String]) {
        lines.iter().for_each(|line| self.append(format_args!("<p class=\"verdict\">{}</p>\n", Text(line))));
    }

    /// Appends a paragraph.
    pub(super) fn paragraph(&mut self, text: &str) {
        self.append(format_args!("<p>{}</p>\n", Text(text)));
    }

    /// Begins a row of `count` plots side by side.
    pub(super) fn open_row(&mut self, count: usize) {
        // Four plots are more legible as two by two.
        let columns = match count {
            0 | 1 => 1,
            2 | 4 => 2,
            _ => 3,
        };
        self.append(format_args!("<div class=\"row of-{columns}\">\n"));
    }

    /// Ends a row.
    pub(super) fn close_row(&mut self) {
        self.append(format_args!("</div>\n"));
    }

    /// Appends a figure whose SVG `draw` returns from an id and a title.
    pub(super) fn figure(
        &mut self,
        class: &str,
        caption: &Caption,
        title: &str,
        draw: impl FnOnce(&str, &str) -> String,
    ) {
        self.figures += 1;
        self.append(format_args!(
            "<figure class=\"{class}\">\n<figcaption><span class=\"title\">{}</span>",
            Text(&caption.title)
        ));
        if !caption.note.is_empty() {
            self.append(format_args!(" <span class=\"note\">{}</span>", Text(&caption.note)));
        }
        if !caption.legend.is_empty() {
            self.append(format_args!(" <span class=\"legend\">"));
            for (class, label) in &caption.legend {
                self.append(format_args!("<span class=\"key\">{}{}</span> ", swatch(class), Text(label)));
            }
            self.append(format_args!("</span>"));
        }
        let picture = draw(&format!("p{}", self.figures), title);
        self.append(format_args!("</figcaption>\n<div class=\"picture\">{picture}</div>\n</figure>\n"));
    }
}

/// Returns a legend sample of a line, a marker or a band as SVG.
pub(super) fn swatch(class: &str) -> String {
    let [width, height] = SWATCH;
    let mut svg = Svg::new(width, height);
    let middle = [width / 2.0, height / 2.0];
    let length = width - 2.0;
    match class.split_once(' ').unwrap_or((class, "")) {
        ("start" | "dot" | "mark", _) => svg.circle(class, middle, 4.0),
        ("points", _) => svg.path(class, &Marker::from_class(class).strokes(middle, 1.0)),
        ("band", kind) => {
            svg.rectangle(class, [1.0, 0.0], [1.0 + length, height]);
            svg.horizontal_line(&format!("edge {kind}"), [1.0, 2.0], length);
        }
        _ => svg.horizontal_line(class, [1.0, height / 2.0], length),
    }
    svg.into_swatch()
}
