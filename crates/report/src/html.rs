//! HTML elements of every page: head, sections, paragraphs, figures and scripts.

use std::fmt;

use serde_json::Value;

use super::chart::Chart;
use super::text::{Text, prose};
use super::tool_path::RunPath;

/// Style sheet: layout, and colors for light, dark and print themes.
const STYLE: &str = include_str!("style.css");
/// Script that plots the figures of a page.
const SCRIPT: &str = include_str!("page.js");
/// Content security policy: nothing is loaded, regardless of the text of a page.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data: blob:";
/// Number of line styles in the style sheet.
pub(super) const LINE_STYLES: usize = 6;

/// Returns plotly.js, the first of the scripts that plotly embeds; the other one is for formulas.
fn plotly_script() -> String {
    let scripts = plotly::Plot::offline_js_sources();
    let (_, script) = scripts.split_once('>').unwrap_or_default();
    script.split("</script>").next().unwrap_or_default().to_owned()
}

/// A page while it is written.
#[derive(Debug)]
pub(super) struct Html {
    text: String,
    has_figures: bool,
}

/// Returns the CSS class of the lines of a run, or of one of several lines, by index.
fn run_class(run: usize) -> String {
    format!("run-{}", run % LINE_STYLES + 1)
}

/// Returns a sample of a run's line as SVG.
pub(super) fn swatch(run: usize) -> String {
    let class = run_class(run);
    format!(
        "<svg class=\"swatch\" viewBox=\"0 0 34 12\" aria-hidden=\"true\"><path class=\"line {class}\" d=\"M1 6h32\"/></svg>"
    )
}

impl Html {
    /// Begins a page with its head and heading. An empty description is omitted.
    pub(super) fn begin(title: &str, description: &str) -> Html {
        let mut html = Html { text: String::new(), has_figures: false };
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
            "</main>\n<footer>{} {}</footer>\n",
            env!("CARGO_PKG_NAME"),
            env!("CARGO_PKG_VERSION")
        ));
        if self.has_figures {
            self.append(format_args!("<script>{}</script>\n<script>{SCRIPT}</script>\n", plotly_script()));
        }
        self.text.push_str("</body>\n</html>\n");
        self.text
    }

    /// Appends formatted HTML; writing to a string cannot fail.
    pub(super) fn append(&mut self, piece: fmt::Arguments) {
        let _ = fmt::write(&mut self.text, piece);
    }

    /// Appends the results in one line each.
    pub(super) fn verdict(&mut self, lines: &[String]) {
        lines.iter().for_each(|line| self.append(format_args!("<p class=\"verdict\">{}</p>\n", prose(line))));
    }

    /// Appends switches that hide and show the signals of the runs, unless there is only one; the script activates them.
    pub(super) fn switches(&mut self, runs: &[&str]) {
        if runs.len() < 2 {
            return;
        }
        self.append(format_args!("<fieldset class=\"runs\" hidden><legend>Runs shown</legend>\n"));
        for (run, title) in runs.iter().enumerate() {
            let (line, title) = (swatch(run), Text(title));
            self.append(format_args!(
                "<label><input type=\"checkbox\" checked value=\"{run}\">{line}{title}</label>\n"
            ));
        }
        self.append(format_args!("</fieldset>\n"));
    }

    /// Appends a paragraph.
    pub(super) fn paragraph(&mut self, text: &str) {
        self.append(format_args!("<p>{}</p>\n", prose(text)));
    }

    /// Appends a chart, whose series have at most about `most` points.
    pub(super) fn chart(&mut self, chart: &Chart, most: usize) {
        self.figure(&chart.title, &chart.note, chart.json(most));
    }

    /// Appends the tool paths of runs in space; nothing without a path.
    pub(super) fn path(&mut self, paths: &[RunPath]) {
        if let Some((note, json)) = RunPath::figure(paths) {
            self.figure("Path of the tool", note, json);
        }
    }

    fn figure(&mut self, title: &str, note: &str, json: Value) {
        self.has_figures = true;
        // No text within the JSON ends the script element.
        let json = json.to_string().replace('<', "\\u003c");
        let (title, note) = (Text(title), Text(note));
        self.append(format_args!(
            "<figure>\n<figcaption><span class=\"title\">{title}</span> <span class=\"note\">{note}</span></figcaption>\n\
             <div class=\"plot\" role=\"img\"></div>\n\
             <noscript><p>This plot needs JavaScript.</p></noscript>\n\
             <script type=\"application/json\">{json}</script>\n</figure>\n"
        ));
    }
}
