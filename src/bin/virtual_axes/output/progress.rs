//! Progress bars on standard error for work that takes more than a second.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use virtual_axes_core::text::escaped;
use virtual_axes_identify::tune::Progress;

use crate::output::interrupt;

/// Duration of work below which no progress is shown.
const SHOW_AFTER: Duration = Duration::from_secs(1);
/// Number of reports between two reads of the clock.
const CALLS_PER_CHECK: u32 = 256;
/// Steps of the bar per simulated second.
const STEPS_PER_SECOND: f64 = 1000.0;

/// Returns a bar that is not drawn.
fn hidden_bar(length: Option<u64>, template: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::hidden());
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Bar that is drawn after a second; it remains hidden if standard error is no terminal.
#[derive(Debug)]
struct DelayedBar {
    bar: ProgressBar,
    began: Instant,
    is_shown: AtomicBool,
    is_quiet: bool,
}

impl DelayedBar {
    /// Creates the bar; `is_quiet` hides it.
    fn new(length: Option<u64>, template: &str, is_quiet: bool) -> Self {
        let bar = hidden_bar(length, template);
        DelayedBar { bar, began: Instant::now(), is_shown: AtomicBool::new(false), is_quiet }
    }

    /// Draws the bar from now on if it is due, and returns true then.
    fn show(&self) -> bool {
        let is_due = !self.is_quiet && self.began.elapsed() >= SHOW_AFTER;
        if is_due && !self.is_shown.swap(true, Ordering::Relaxed) {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        is_due
    }
}

impl Drop for DelayedBar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Progress of a trial or a part program: a bar, or a counter if the duration is unknown.
#[derive(Debug)]
pub struct TrialProgress {
    delayed: DelayedBar,
    calls: u32,
}

impl TrialProgress {
    /// Creates the progress of `name` with its simulated duration, s, if it is known; `is_quiet` hides it.
    pub fn new(name: &str, duration: Option<f64>, is_quiet: bool) -> Self {
        let template = match duration {
            Some(_) => "{prefix} {wide_bar} {percent} %, {eta} left",
            None => "{prefix} {spinner} {msg}",
        };
        let steps = duration.map(|duration| (duration * STEPS_PER_SECOND) as u64);
        Self::with_template(name, steps, template, is_quiet)
    }

    /// Creates the progress of the part program `name` by its source lines; `is_quiet` hides it.
    pub fn with_lines(name: &str, lines: u64, is_quiet: bool) -> Self {
        Self::with_template(
            name,
            Some(lines),
            "{prefix} {wide_bar} line {pos} of {len}, {eta} left",
            is_quiet,
        )
    }

    fn with_template(name: &str, length: Option<u64>, template: &str, is_quiet: bool) -> Self {
        let delayed = DelayedBar::new(length, template, is_quiet);
        delayed.bar.set_prefix(name.to_owned());
        TrialProgress { delayed, calls: 0 }
    }

    /// Returns the bar if it is to be drawn.
    fn due(&mut self) -> Option<&ProgressBar> {
        self.calls = (self.calls + 1) % CALLS_PER_CHECK;
        (self.calls == 0 && self.delayed.show()).then_some(&self.delayed.bar)
    }

    /// Reports that `time` s have been simulated.
    pub fn set_time(&mut self, time: f64) {
        if let Some(bar) = self.due() {
            bar.set_position((time * STEPS_PER_SECOND) as u64);
            bar.set_message(format!("{time:.0} s simulated"));
        }
    }

    /// Reports that the lines of a part program have been read up to `line`, from 1.
    pub fn set_line(&mut self, line: usize) {
        if let Some(bar) = self.due() {
            bar.set_position(line as u64);
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.delayed.bar.finish_and_clear();
    }
}

/// Progress of a search: a bar that counts runs from any thread.
#[derive(Debug)]
pub struct SearchProgress(DelayedBar);

impl SearchProgress {
    /// Creates a bar without runs; `is_quiet` hides it.
    pub fn new(is_quiet: bool) -> Self {
        SearchProgress(DelayedBar::new(None, "{prefix} {wide_bar} {pos} of {len} runs, {eta} left", is_quiet))
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.0.bar.finish_and_clear();
    }
}

impl Progress for SearchProgress {
    fn begin(&self, part: &'static str, runs: usize) {
        let bar = &self.0.bar;
        bar.set_position(0);
        bar.set_length(runs as u64);
        bar.set_prefix(part);
        bar.reset_eta();
    }

    fn finish_run(&self) {
        self.0.bar.inc(1);
        self.0.show();
    }

    fn check_interrupt(&self) -> io::Result<()> {
        interrupt::check()
    }
}

/// Time between two frames of the spinner.
const FRAME_TIME: Duration = Duration::from_millis(100);

/// Spinner with its own thread, for work of unknown progress.
#[derive(Debug)]
pub struct Spinner {
    bar: ProgressBar,
    /// Channel whose end stops the thread.
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Spinner {
    /// Starts the spinner, which is hidden for the first second.
    pub fn new() -> Self {
        let bar = hidden_bar(None, "{spinner} {msg}, {elapsed}");
        let (stop, stopped) = mpsc::channel();
        let visible = bar.clone();
        let thread = thread::spawn(move || {
            let mut wait = SHOW_AFTER;
            while stopped.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
                if wait == SHOW_AFTER {
                    // The bar remains hidden if standard error is no terminal.
                    visible.set_draw_target(ProgressDrawTarget::stderr());
                    wait = FRAME_TIME;
                }
                visible.tick();
            }
        });
        Spinner { bar, stop: Some(stop), thread: Some(thread) }
    }

    /// Shows the current activity. Returns an error if the command was interrupted.
    pub fn set_activity(&self, activity: impl Into<String>) -> io::Result<()> {
        self.bar.set_message(escaped(&activity.into()));
        interrupt::check()
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            // The thread only draws; its result is irrelevant.
            let _ = thread.join();
        }
        self.bar.finish_and_clear();
    }
}
