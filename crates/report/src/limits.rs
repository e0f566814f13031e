//! Limits of speed, current and voltage that axes reached: sentences, and time ranges of the plots.

use virtual_axes_core::assess::AxisTrace;

use super::axes::axis_name;
use super::page::Page;

/// Returns the time ranges in which an axis is at a limit, s: begin and end.
pub(super) fn ranges(time: &[f64], axis: &AxisTrace) -> Vec<[f64; 2]> {
    let mut found: Vec<[f64; 2]> = Vec::new();
    let ends = time.iter().skip(1).chain(time.last());
    let mut was_limited = false;
    for ((&begin, &end), &share) in time.iter().zip(ends).zip(&axis.saturation) {
        let is_limited = share > 0.0;
        match found.last_mut() {
            Some(range) if is_limited && was_limited => range[1] = end,
            _ if is_limited => found.push([begin, end]),
            _ => {}
        }
        was_limited = is_limited;
    }
    found
}

/// Writes a sentence for each axis and run that reached a limit; nothing if none did.
pub(super) fn section(page: &mut Page) {
    let mut sentences = Vec::new();
    for (index, run) in page.runs.iter().enumerate() {
        for axis in &run.recording.axes {
            let found = ranges(&run.recording.time, axis);
            let Some([first, _]) = found.first() else { continue };
            let times = if found.len() == 1 { "once".to_owned() } else { format!("{} times", found.len()) };
            let name = page.caption_for_run(&axis_name(&axis.name), index);
            sentences.push(format!(
                "{name}: at a limit of speed, current or voltage {times}, first at {first:.3} s. \
                 The plots of its current are shaded there."
            ));
        }
    }
    if !sentences.is_empty() {
        page.html.open_section("limits", "Limits reached");
        sentences.iter().for_each(|sentence| page.html.paragraph(sentence));
        page.html.close_section();
    }
}
