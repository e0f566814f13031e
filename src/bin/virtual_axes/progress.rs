//! Progress bars on standard error for work that takes more than a second.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use virtual_axes_identify::tune::Progress;

use crate::interrupt;

/// Duration of work below which no progress is shown.
const SHOW_AFTER: Duration = Duration::from_secs(1);
/// Number of reports between two reads of the clock.
const CALLS_PER_CHECK: u32 = 256;
/// Steps of the bar per simulated second.
const STEPS_PER_SECOND: f64 = 1000.0;

/// Progress of a trial or a part program: a bar, or a counter if the duration is unknown. Hidden if standard error is
/// no terminal.
#[derive(Debug)]
pub struct TrialProgress {
    bar: ProgressBar,
    began: Instant,
    calls: u32,
    is_shown: bool,
    is_quiet: bool,
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
        let template = "{prefix} {wide_bar} line {pos} of {len}, {eta} left";
        Self::with_template(name, Some(lines), template, is_quiet)
    }

    fn with_template(name: &str, length: Option<u64>, template: &str, is_quiet: bool) -> Self {
        let bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_prefix(name.to_owned());
        TrialProgress { bar, began: Instant::now(), calls: 0, is_shown: false, is_quiet }
    }

    /// Returns true if the bar is to be drawn.
    fn is_due(&mut self) -> bool {
        self.calls = (self.calls + 1) % CALLS_PER_CHECK;
        if self.calls != 0 || self.is_quiet || self.began.elapsed() < SHOW_AFTER {
            return false;
        }
        if !self.is_shown {
            // The bar remains hidden if standard error is no terminal.
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
            self.is_shown = true;
        }
        true
    }

    /// Reports that `time` s have been simulated.
    pub fn set_time(&mut self, time: f64) {
        if self.is_due() {
            self.bar.set_position((time * STEPS_PER_SECOND) as u64);
            self.bar.set_message(format!("{time:.0} s simulated"));
        }
    }

    /// Reports that the lines of a part program have been read up to `line`, from 1.
    pub fn set_line(&mut self, line: usize) {
        if self.is_due() {
            self.bar.set_position(line as u64);
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for TrialProgress {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Progress of a search: a bar that counts runs from any thread.
#[derive(Debug)]
pub struct SearchProgress {
    bar: ProgressBar,
    began: Instant,
    is_shown: AtomicBool,
    is_quiet: bool,
}

impl SearchProgress {
    /// Creates a hidden bar without runs; `is_quiet` keeps it hidden.
    pub fn new(is_quiet: bool) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {pos} of {len} runs, {eta} left")
        {
            bar.set_style(style);
        }
        SearchProgress { bar, began: Instant::now(), is_shown: AtomicBool::new(false), is_quiet }
    }

    fn show(&self) {
        if !self.is_quiet
            && self.began.elapsed() >= SHOW_AFTER
            && !self.is_shown.swap(true, Ordering::Relaxed)
        {
            // The bar remains hidden if standard error is no terminal.
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Progress for SearchProgress {
    fn begin(&self, part: &'static str, runs: usize) {
        self.bar.set_position(0);
        self.bar.set_length(runs as u64);
        self.bar.set_prefix(part);
        self.bar.reset_eta();
    }

    fn finish_run(&self) {
        self.bar.inc(1);
        self.show();
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
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed}") {
            bar.set_style(style);
        }
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
        self.bar.set_message(activity.into());
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
