//! Page that compares runs: overview, errors, figures, axes, facts and provenance.

use std::io;

use super::axes::{self, ReportRun};
use super::document::{Document, Section};
use super::table::Table;
use super::tool_path::{RunPath, ToolPath};

/// Contents of a page with tables and plots of one or several runs.
#[derive(Debug, Clone, Default)]
pub struct Report<'a> {
    /// Heading, and title of the browser window.
    pub title: &'a str,
    /// Description of the trial in one or two sentences; can be empty.
    pub description: &'a str,
    /// Result in one line per compared run; can be empty.
    pub verdict: Vec<String>,
    /// Texts and tables beside the path of the tool, such as those of part programs.
    pub overview: Section,
    /// Tables of figures, with a column per run where runs are compared.
    pub tables: Vec<Table>,
    /// Remarks below the tables, such as the sampling of the figures.
    pub notes: Vec<String>,
    /// Sections above the figures, such as that of a search.
    pub sections: Vec<Section>,
    /// Runs to compare. Line styles repeat after six runs.
    pub runs: Vec<ReportRun<'a>>,
    /// Names and values that allow the runs to be repeated: date, version, command line, digest of the machine file.
    pub provenance: Vec<(String, String)>,
}

impl Report<'_> {
    /// Writes the page in UTF-8. Equal reports give equal bytes.
    ///
    /// # Errors
    ///
    /// Returns the error of `out` if it cannot be written.
    pub fn write(&self, out: &mut impl io::Write) -> io::Result<()> {
        self.document().write(out)
    }

    fn document(&self) -> Document {
        let mut sections = vec![self.overview()];
        sections.extend(axes::errors(&self.runs));
        sections.extend(self.sections.iter().cloned());
        sections.push(Section { tables: self.tables.clone(), ..Section::new("Figures") });
        sections.push(Section { paragraphs: self.notes.clone(), ..Section::default() });
        sections.extend(axes::sections(&self.runs));
        let facts: Vec<&[(String, String)]> = self.runs.iter().map(|run| run.facts.as_slice()).collect();
        let titles: Vec<&str> = self.runs.iter().map(|run| run.title).collect();
        for (heading, table) in [
            ("Runs", Table::of_facts(&titles, &facts)),
            ("Provenance", Table::of_facts(&[], &[&self.provenance])),
        ] {
            sections.push(Section { tables: vec![table], ..Section::new(heading) });
        }
        sections.retain(|section| !section.is_empty());
        Document {
            title: self.title.to_owned(),
            description: self.description.to_owned(),
            verdict: self.verdict.clone(),
            runs: titles.into_iter().map(str::to_owned).collect(),
            facts: Vec::new(),
            sections,
        }
    }

    /// Returns the section with the path of the tool and the limits that axes reached.
    fn overview(&self) -> Section {
        let mut section = self.overview.clone();
        section.paragraphs.extend(axes::limits(&self.runs));
        let path = |run: &ReportRun| match run.program {
            Some(path) => Some(path.clone()),
            None => run.recording.tool.as_ref().map(|tool| ToolPath::from_trace(&run.recording.time, tool)),
        };
        let paths = self.runs.iter().enumerate();
        let paths = paths.filter_map(|(index, run)| {
            Some(RunPath { title: run.title.to_owned(), run: index, path: path(run)? })
        });
        section.paths = paths.collect();
        section
    }
}
