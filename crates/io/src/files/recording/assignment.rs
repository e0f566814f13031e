//! Assignment of columns to channels: by column mappings, default headers, or detected meanings.

use super::axis_match::{axes_of, matching_axes, number_of};
use super::columns::Column;
use super::context::Context;
use super::format::Found;
use super::found_column::{ColumnFactor, FoundColumn};
use super::unit::Channel;
use crate::files::error::{ErrorKind, FileError, MAX_LISTED};
use virtual_axes_core::text::{is_slip, nearest_hint, nearest_name, shortened};
use virtual_axes_identify::recording::Finding;

/// Maximum number of names in an error message.
const MAX_NAMES: usize = 40;

/// Formats names for an error message.
fn format_names(names: &[String]) -> String {
    let shown: Vec<String> = names.iter().take(MAX_NAMES).map(|name| shortened(name)).collect();
    let more =
        if names.len() > MAX_NAMES { format!(", … ({} columns)", names.len()) } else { String::new() };
    shown.join(", ") + &more
}

/// Columns of the channels of one axis.
#[derive(Debug, Default)]
pub(super) struct ColumnAssignment {
    /// Per column: index of its channel in [`Channel::ALL`], and factor to SI.
    pub slots: Vec<Option<(usize, f64)>>,
    /// Indices of the channels found by their default headers.
    pub default_channels: Vec<usize>,
    /// Indices of the channels found by their detected meaning.
    pub detected_channels: Vec<usize>,
    /// Findings about columns that are not read.
    pub findings: Vec<Finding>,
}

impl ColumnAssignment {
    /// Returns the column of the channel with an index, if any.
    pub fn column_of(&self, index: usize) -> Option<usize> {
        self.slots.iter().position(|slot| slot.is_some_and(|(channel, _)| channel == index))
    }

    /// Warns of columns that are not read, whose name is nearly that of a channel without a column.
    fn report_slips(&self, context: &Context, found: &[FoundColumn], findings: &mut Vec<Finding>) {
        let absent =
            Channel::ALL.into_iter().enumerate().filter(|(index, _)| self.column_of(*index).is_none());
        let absent: Vec<&str> = absent.map(|(_, channel)| channel.name()).collect();
        for (column, slot) in found.iter().zip(&self.slots) {
            let is_other = column.axis.as_ref().is_some_and(|axis| !axis.eq_ignore_ascii_case(context.joint));
            if slot.is_some() || column.channel.is_some() || is_other {
                continue;
            }
            // Without axis and unit: `curent` of `x.curent [A]`.
            let name = column.header.rsplit('.').next().unwrap_or_default().split(['[', '(']).next();
            let name = name.unwrap_or_default().trim().to_lowercase();
            if let Some(near) = nearest_name(&name, absent.iter().filter(|channel| is_slip(&name, channel))) {
                let header = shortened(&column.header);
                let what =
                    format!("{}: column {header} is not read; the nearest channel is {near}", context.name);
                let remedy = format!("rename it, or select it by --column '{near}={header}'");
                findings.push(Finding::warning("unread-column", what, remedy));
            }
        }
    }

    /// Reports the columns of channels without a mapping: those with default headers beside a mapping, and those with
    /// detected meanings.
    pub fn report(&self, context: &Context, found: &[FoundColumn], findings: &mut Vec<Finding>) {
        findings.extend(self.findings.iter().cloned());
        self.report_slips(context, found, findings);
        let column = |index: &usize| {
            let channel = Channel::ALL.get(*index)?;
            Some((*channel, found.get(self.column_of(*index)?)?))
        };
        if !context.columns.mappings.is_empty() && !self.default_channels.is_empty() {
            let columns = self.default_channels.iter().filter_map(column).map(|(channel, column)| {
                let unit = channel.units(context.axis).first().map_or("", |(symbol, _)| *symbol);
                format!("{channel} from column {} in {unit}", shortened(&column.header))
            });
            let columns = columns.collect::<Vec<_>>().join(", ");
            let what = format!("{}: channels without a mapping use default columns: {columns}", context.name);
            findings.push(Finding::note("usual-columns", what));
        }
        if !self.detected_channels.is_empty() {
            let columns = self.detected_channels.iter().filter_map(column).map(|(channel, column)| {
                let mapped = context.columns.mapping(channel).and_then(|mapping| mapping.unit);
                let unit = match (mapped, &column.unit) {
                    (Some(unit), _) => format!(" in {unit}"),
                    (None, Some(unit)) => format!(" in {unit}"),
                    (None, None) => String::new(),
                };
                format!("{channel} from column {}{unit}", shortened(&column.header))
            });
            let columns = columns.collect::<Vec<_>>().join(", ");
            findings.push(Finding::note("detected-columns", format!("{}: detected {columns}", context.name)));
        }
    }
}

/// Selection of the columns of one axis among the columns of a file.
struct Selector<'a> {
    context: &'a Context<'a>,
    found: &'a [FoundColumn],
    /// Indices of the columns that mappings and default headers select.
    taken: Vec<usize>,
    at: &'a dyn Fn() -> String,
    /// Name of the selected axis; `None` if the file names none.
    axis: Found<Option<&'a str>>,
}

impl Context<'_> {
    /// Assigns columns that a format describes by themselves.
    ///
    /// # Errors
    /// The first column that cannot be assigned.
    pub fn assign_found(&self, found: &[FoundColumn], at: &dyn Fn() -> String) -> Found<ColumnAssignment> {
        let headers: Vec<String> = found.iter().map(|column| column.header.clone()).collect();
        self.assign(&headers, found, at, &self.factors()?)
    }

    /// Assigns the columns with the headers `columns` and the meanings `found` to channels.
    pub fn assign(
        &self,
        columns: &[String],
        found: &[FoundColumn],
        at: &dyn Fn() -> String,
        factors: &[f64],
    ) -> Found<ColumnAssignment> {
        let mut assignment =
            ColumnAssignment { slots: vec![None; columns.len()], ..ColumnAssignment::default() };
        let is_trace =
            Channel::ALL.iter().any(|c| *c != Channel::Time && columns.contains(&self.trace_header(*c)));
        let mut direct = [None; Channel::ALL.len()];
        for (place, channel) in direct.iter_mut().zip(Channel::ALL).filter(|(_, c)| self.is_read(*c)) {
            *place = self.find(channel, &self.candidate_headers(channel, is_trace), columns, at)?;
        }
        // A mapping may use the column of the motor's position for another channel.
        let is_mapped =
            |index: usize| Channel::ALL.get(index).is_some_and(|c| self.columns.mapping(*c).is_some());
        for (index, channel) in Channel::ALL.into_iter().enumerate() {
            let is_of_motor = matches!(channel, Channel::MotorPosition | Channel::WindUp);
            let is_taken = |&(other, place): &(usize, &Option<usize>)| {
                is_mapped(other) && place.is_some() && *place == direct[index]
            };
            if is_of_motor && !is_mapped(index) && direct.iter().enumerate().any(|pair| is_taken(&pair)) {
                direct[index] = None;
            }
        }
        let found = if is_trace { &[] } else { found };
        let selector = Selector::new(self, found, direct.into_iter().flatten().collect(), at);
        let places = Channel::ALL.into_iter().enumerate().zip(direct);
        for ((index, channel), direct) in places.filter(|((_, channel), _)| self.is_read(*channel)) {
            let factor = factors.get(index).copied().unwrap_or(1.0);
            let choice = match direct {
                Some(column) => Some((column, selector.stated_factor(channel, column)?.unwrap_or(factor))),
                None if self.has_selected_column(channel) => None,
                None => selector.choose(channel, &mut assignment)?,
            };
            let Some((column, factor)) = choice else {
                let wanted = self.candidate_headers(channel, is_trace);
                self.check_missing(channel, &wanted, columns, found, at)?;
                continue;
            };
            let Some(slot) = assignment.slots.get_mut(column) else { continue };
            if let Some((before, _)) = *slot {
                let first = Channel::ALL.get(before).copied().unwrap_or(channel);
                let number = column + 1;
                let reason = format!("{first} and {channel} both use column #{number}");
                return Err(FileError::new(at(), reason));
            }
            *slot = Some((index, factor));
            let is_default = !assignment.detected_channels.contains(&index);
            if is_default && self.columns.mapping(channel).is_none() {
                assignment.default_channels.push(index);
            }
        }
        Ok(assignment)
    }

    /// Returns true if a mapping selects the column of the channel.
    fn has_selected_column(&self, channel: Channel) -> bool {
        self.columns.mapping(channel).is_some_and(|mapping| mapping.column != Column::Default)
    }

    fn check_missing(
        &self,
        channel: Channel,
        wanted: &[String],
        columns: &[String],
        found: &[FoundColumn],
        at: &dyn Fn() -> String,
    ) -> Found<()> {
        if self.columns.mapping(channel).is_none() && !self.is_required(channel) {
            return Ok(());
        }
        let counter = found.iter().find(|column| column.unit.as_ref().is_some_and(|unit| unit.is_samples()));
        let hint = match (channel, counter) {
            (Channel::Time, Some(column)) => format!(
                ", or give the sampling rate by --rate-hz, since column {} counts samples",
                shortened(&column.header)
            ),
            (Channel::Time, None) => ", or give the sampling rate by --rate-hz".to_owned(),
            _ => String::new(),
        };
        Err(self.no_column(channel, wanted, columns, at()).with_hint(&hint))
    }

    fn find(
        &self,
        channel: Channel,
        wanted: &[String],
        columns: &[String],
        at: &dyn Fn() -> String,
    ) -> Found<Option<usize>> {
        if let Some(Column::Index(index)) = self.columns.mapping(channel).map(|mapping| &mapping.column) {
            return Ok((*index < columns.len()).then_some(*index));
        }
        for name in wanted {
            let count = columns.iter().filter(|column| *column == name).count();
            if count > 1 {
                let reason = format!(
                    "{count} columns have the header \"{}\"; select the column of {channel} by number, for example #3",
                    shortened(name)
                );
                return Err(FileError::new(at(), reason));
            }
            if count == 1 {
                return Ok(columns.iter().position(|column| column == name));
            }
        }
        Ok(None)
    }

    fn no_column(&self, channel: Channel, wanted: &[String], columns: &[String], at: String) -> FileError {
        let names = || columns.iter().map(String::as_str);
        let nearest = wanted.iter().find_map(|name| nearest_name(name, names()));
        // A column named after the axis is probably its position.
        let axis = || names().find(|name| *name == self.joint).map(str::to_owned);
        let mut wanted: Vec<String> = wanted.iter().map(|name| format!("\"{}\"", shortened(name))).collect();
        wanted.dedup();
        let reason = format!(
            "there is no column {} for {channel}; there are {}{}; time and position are required: select a column by --column \
             CHANNEL=COLUMN[UNIT]",
            wanted.join(" or "),
            format_names(columns),
            nearest_hint(&nearest.or_else(axis))
        );
        FileError::new(at, reason).with_kind(ErrorKind::NoColumn)
    }
}

impl<'a> Selector<'a> {
    fn new(
        context: &'a Context<'a>,
        found: &'a [FoundColumn],
        taken: Vec<usize>,
        at: &'a dyn Fn() -> String,
    ) -> Self {
        let mut selector = Selector { context, found, taken, at, axis: Ok(None) };
        selector.axis = selector.select_axis();
        selector
    }

    /// Returns the columns with a channel that are not selected otherwise.
    fn detected(&self) -> impl Iterator<Item = &'a FoundColumn> {
        let is_open = |column: &&FoundColumn| {
            let is_free = !self.taken.contains(&column.number.saturating_sub(1));
            is_free && column.channel.is_some_and(|channel| !self.context.has_selected_column(channel))
        };
        self.found.iter().filter(is_open)
    }

    /// Returns the name of the axis to read: the one that the joint names, or the only one of the file.
    fn select_axis(&self) -> Found<Option<&'a str>> {
        let axes = axes_of(self.detected());
        if axes.is_empty() {
            return Ok(None);
        }
        match matching_axes(&axes, self.context.joint).as_slice() {
            [] => {}
            [axis] => return Ok(Some(axis)),
            several => return Err(self.axis_error("several axes of the file fit", several)),
        }
        // A number does not contradict the name of the axis.
        if let ([(axis, _)], false) = (axes.as_slice(), self.context.is_joint_given)
            && number_of(axis).is_some()
        {
            return Ok(Some(axis));
        }
        let names: Vec<&str> = axes.iter().map(|(name, _)| *name).collect();
        Err(self.axis_error("the file has no columns of", &names))
    }

    fn axis_error(&self, reason: &'static str, axes: &[&str]) -> FileError {
        let axes: Vec<String> = axes.iter().take(MAX_LISTED).map(|axis| shortened(axis)).collect();
        let axis = shortened(self.context.joint);
        let axes = axes.join(", ");
        FileError::new(
            (self.at)(),
            format_args!("{reason} axis {axis}; there are the axes {axes}: select one by --joint"),
        )
    }

    /// Returns the detected column of the channel with its factor to SI.
    fn choose(&self, channel: Channel, assignment: &mut ColumnAssignment) -> Found<Option<(usize, f64)>> {
        let mut fitting: Vec<&FoundColumn> =
            self.detected().filter(|column| column.channel == Some(channel)).collect();
        if channel != Channel::Time {
            match &self.axis {
                Ok(None) => {}
                Ok(Some(axis)) => self.keep_axis(&mut fitting, axis, assignment),
                Err(error) if channel == Channel::Position && fitting.iter().any(|c| c.axis.is_some()) => {
                    return Err(error.clone());
                }
                Err(_) => fitting.retain(|column| column.axis.is_none()),
            }
        }
        if fitting.iter().any(|column| !column.is_secondary) {
            fitting.retain(|column| !column.is_secondary);
        }
        match fitting.as_slice() {
            [] => Ok(None),
            [column] => self.accept(channel, column, assignment),
            several @ [first, ..] => {
                let columns = several.iter().take(MAX_LISTED);
                let columns: Vec<String> = columns
                    .map(|column| format!("#{} \"{}\"", column.number, shortened(&column.header)))
                    .collect();
                let reason = format!(
                    "columns {} all fit {channel}: select one, for example by --column '{channel}=#{}'",
                    columns.join(", "),
                    first.number
                );
                Err(FileError::new((self.at)(), reason))
            }
        }
    }

    /// Keeps the columns of the axis; columns without an axis are those of the only axis.
    fn keep_axis(&self, fitting: &mut Vec<&FoundColumn>, axis: &str, assignment: &mut ColumnAssignment) {
        let is_only = self.detected().filter_map(|column| column.axis.as_deref()).all(|other| other == axis);
        let bare: Vec<String> = fitting
            .iter()
            .filter(|column| !is_only && column.axis.is_none())
            .take(MAX_LISTED)
            .map(|column| shortened(&column.header))
            .collect();
        if !bare.is_empty() {
            let what = format!(
                "{}: the file has several axes; columns without an axis are not read: {}",
                self.context.name,
                bare.join(", ")
            );
            assignment.findings.push(Finding::note("unassigned-column", what));
        }
        fitting.retain(|column| column.axis.as_deref().map_or(is_only, |other| other == axis));
    }

    /// Returns the factor to SI that the header of a column states which a mapping names without a unit.
    fn stated_factor(&self, channel: Channel, place: usize) -> Found<Option<f64>> {
        let mapping = self.context.columns.mapping(channel).filter(|mapping| mapping.unit.is_none());
        let column = self.found.get(place).filter(|_| mapping.is_some());
        let Some((column, unit)) = column.and_then(|column| Some((column, column.unit.as_ref()?))) else {
            return Ok(None);
        };
        match unit.factor(channel, self.context.axis) {
            ColumnFactor::Value(factor) => Ok(Some(factor)),
            ColumnFactor::Samples => Ok(None),
            problem => Err(self.unit_error(channel, column, problem)),
        }
    }

    /// Returns the error of a column whose unit is unknown or not that of the channel.
    fn unit_error(&self, channel: Channel, column: &FoundColumn, problem: ColumnFactor) -> FileError {
        let unit = column.unit.as_ref().map_or_else(String::new, ToString::to_string);
        let found = match problem {
            ColumnFactor::Unfit => format!("is in {unit}"),
            _ => format!("has the {}", unit.replacen("unknown:", "unknown unit", 1)),
        };
        let allowed: Vec<&str> = channel.units(self.context.axis).iter().map(|(symbol, _)| *symbol).collect();
        let example = match allowed.contains(&"mm") {
            true => "25.4 mm".to_owned(),
            false => format!("0.5 {}", allowed.first().unwrap_or(&"")),
        };
        let reason = format!(
            "{channel} from column {} {found}, must be in one of {}; give the unit by --column \
             '{channel}=COLUMN[UNIT]', for example with a factor: [{example}]",
            shortened(&column.header),
            allowed.join(", ")
        );
        FileError::new((self.at)(), reason)
    }

    fn accept(
        &self,
        channel: Channel,
        column: &FoundColumn,
        assignment: &mut ColumnAssignment,
    ) -> Found<Option<(usize, f64)>> {
        let context = self.context;
        let index = Channel::ALL.iter().position(|other| *other == channel).unwrap_or_default();
        let place = column.number.saturating_sub(1);
        let Some(unit) = &column.unit else { return Ok(None) };
        if let Some(mapping) = context.columns.mapping(channel)
            && mapping.unit.is_some()
        {
            let factor = context.factors()?.get(index).copied().unwrap_or(1.0);
            assignment.detected_channels.push(index);
            return Ok(Some((place, factor)));
        }
        let factor = match (unit.factor(channel, context.axis), context.rate) {
            (ColumnFactor::Value(factor), _) => factor,
            (ColumnFactor::Samples, Some(_)) => 1.0,
            (ColumnFactor::Samples, None) => return Ok(None),
            (problem @ (ColumnFactor::Unfit | ColumnFactor::Unknown), _) => {
                let error = self.unit_error(channel, column, problem);
                // Without the current there is neither inertia nor friction.
                let is_unknown_current =
                    channel == Channel::Current && matches!(problem, ColumnFactor::Unknown);
                if channel.is_required() || is_unknown_current {
                    return Err(error);
                }
                let what = format!("{error}; it is not read");
                assignment.findings.push(Finding::note("unfit-unit", what));
                return Ok(None);
            }
        };
        assignment.detected_channels.push(index);
        Ok(Some((place, factor)))
    }
}
