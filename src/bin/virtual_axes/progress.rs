//! Progress on standard error, for work that takes more than a second.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use virtual_axes_identify::tune::Progress;

use crate::interrupt;

/// Work shorter than this shows nothing.
const PATIENCE: Duration = Duration::from_secs(1);
/// Position instants between two looks at the clock.
const LOOK: u32 = 256;
/// Steps of the bar in a simulated second.
const RESOLUTION: f64 = 1000.0;

/// A bar, or a counter where the end is not known; neither where nobody looks.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    began: Instant,
    instants: u32,
    shown: bool,
}

impl Progress {
    /// For `name`, which takes `duration` s of simulated time if that is known.
    pub fn new(name: &str, duration: Option<f64>) -> Self {
        let bar = ProgressBar::with_draw_target(
            duration.map(|duration| (duration * RESOLUTION) as u64),
            ProgressDrawTarget::hidden(),
        );
        let template = match duration {
            Some(_) => "{prefix} {wide_bar} {percent} %, {eta} left",
            None => "{prefix} {spinner} {msg}",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_prefix(name.to_owned());
        Progress { bar, began: Instant::now(), instants: 0, shown: false }
    }

    /// Tells that `time` s have been simulated.
    pub fn reached(&mut self, time: f64) {
        self.instants = (self.instants + 1) % LOOK;
        if self.instants != 0 || self.began.elapsed() < PATIENCE {
            return;
        }
        if !self.shown {
            // Hidden still where standard error is no terminal.
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
            self.shown = true;
        }
        self.bar.set_position((time * RESOLUTION) as u64);
        self.bar.set_message(format!("{time:.0} s simulated"));
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Runs of a search, counted from any thread.
#[derive(Debug)]
pub struct Runs {
    bar: ProgressBar,
    began: Instant,
    shown: AtomicBool,
}

impl Runs {
    /// None yet.
    pub fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {pos} of {len} runs, {eta} left")
        {
            bar.set_style(style);
        }
        Runs { bar, began: Instant::now(), shown: AtomicBool::new(false) }
    }

    fn show(&self) {
        if self.began.elapsed() >= PATIENCE && !self.shown.swap(true, Ordering::Relaxed) {
            // Hidden still where standard error is no terminal.
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Progress for Runs {
    fn begin(&self, part: &'static str, runs: usize) {
        self.bar.set_position(0);
        self.bar.set_length(runs as u64);
        self.bar.set_prefix(part);
        self.bar.reset_eta();
    }

    fn done(&self) {
        self.bar.inc(1);
        self.show();
    }

    fn go_on(&self) -> io::Result<()> {
        interrupt::check()
    }
}

/// Time between two pictures of a spinner.
const TURN: Duration = Duration::from_millis(100);

/// A spinner that turns by itself, for work that does not tell how far it is.
#[derive(Debug)]
pub struct Spinner {
    bar: ProgressBar,
    /// Dropped when the work is done.
    working: Option<Sender<()>>,
    turning: Option<JoinHandle<()>>,
}

impl Spinner {
    /// Not seen in the first second.
    pub fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}, {elapsed}") {
            bar.set_style(style);
        }
        let (working, work) = mpsc::channel();
        let seen = bar.clone();
        let turning = thread::spawn(move || {
            let mut wait = PATIENCE;
            while work.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
                if wait == PATIENCE {
                    // Hidden still where standard error is no terminal.
                    seen.set_draw_target(ProgressDrawTarget::stderr());
                    wait = TURN;
                }
                seen.tick();
            }
        });
        Spinner { bar, working: Some(working), turning: Some(turning) }
    }

    /// Says what is being done; an error once the command has been interrupted.
    pub fn now(&self, what: impl Into<String>) -> io::Result<()> {
        self.bar.set_message(what.into());
        interrupt::check()
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        self.working = None;
        if let Some(turning) = self.turning.take() {
            // It only draws: how it ended changes nothing.
            let _ = turning.join();
        }
        self.bar.finish_and_clear();
    }
}
