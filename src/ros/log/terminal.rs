//! Lines for the terminal, written by a thread of their own: a reader of stderr that stands still (a pipe that nobody
//! empties, a terminal after Ctrl-S) must not stop the axes.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::thread;
use std::time::{Duration, Instant};

/// Lines that wait for the reader, several times what a start with `--log-level debug` says at once; at some
/// 200 bytes a line 200 kB.
const QUEUE: usize = 1024;
/// How often it looks then whether there is room.
const POLL: Duration = Duration::from_millis(1);

/// The sending end: it never waits.
#[derive(Debug, Clone)]
pub(super) struct Terminal {
    queue: SyncSender<Item>,
    left_out: Arc<AtomicU64>,
}

#[derive(Debug)]
struct Item {
    /// Lines that were left out before it.
    missed: u64,
    line: Option<String>,
    /// Who waits until it, and everything before it, has been written.
    waits: Option<SyncSender<()>>,
}

impl Terminal {
    /// Starts the thread that writes to `out`; `missed` is the line that says how many were left out.
    ///
    /// # Errors
    /// Those of the operating system that gives no thread.
    pub(super) fn start(
        out: impl Write + Send + 'static,
        missed: impl Fn(u64) -> String + Send + 'static,
    ) -> io::Result<Self> {
        let (queue, items) = mpsc::sync_channel(QUEUE);
        let left_out = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&left_out);
        thread::Builder::new().name("log".into()).spawn(move || write(out, &items, &counted, missed))?;
        Ok(Terminal { queue, left_out })
    }

    /// Hands a line, with its end, over; if as many wait as may, it is left out and counted.
    pub(super) fn line(&self, line: String) {
        if self.push(Item { missed: 0, line: Some(line), waits: None }).is_err() {
            self.left_out.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Hands an item over with the count of what was left out before it; it comes back if as many wait as may.
    fn push(&self, item: Item) -> Result<(), Item> {
        let missed = self.left_out.swap(0, Ordering::Relaxed);
        match self.queue.try_send(Item { missed, ..item }) {
            // The thread ends after all senders.
            Ok(()) | Err(TrySendError::Disconnected(_)) => Ok(()),
            Err(TrySendError::Full(item)) => {
                self.left_out.fetch_add(missed, Ordering::Relaxed);
                Err(item)
            }
        }
    }

    /// Waits until what was handed over is written, and `line` behind it, but not for longer than `patience`.
    pub(super) fn finish(&self, line: Option<String>, patience: Duration) {
        let until = Instant::now() + patience;
        let (written, is_written) = mpsc::sync_channel(1);
        let mut last = Item { missed: 0, line, waits: Some(written) };
        while let Err(back) = self.push(last) {
            if Instant::now() >= until {
                return;
            }
            last = back;
            thread::sleep(POLL);
        }
        // Late, or the thread has ended: there is nothing more to be done.
        let _: Result<(), RecvTimeoutError> =
            is_written.recv_timeout(until.saturating_duration_since(Instant::now()));
    }
}

/// Writes until all senders are gone. Nowhere is left to report that stderr is closed.
fn write(mut out: impl Write, items: &Receiver<Item>, left_out: &AtomicU64, missed: impl Fn(u64) -> String) {
    let mut put = |line: &str| drop(out.write_all(line.as_bytes()));
    let gap = |lines: u64| if lines > 0 { missed(lines) } else { String::new() };
    while let Ok(first) = items.recv() {
        let mut next = Some(first);
        while let Some(item) = next {
            put(&gap(item.missed));
            item.line.as_deref().into_iter().for_each(&mut put);
            // Whoever waited may have given up.
            if let Some(waits) = item.waits {
                let _ = waits.try_send(());
            }
            next = items.try_recv().ok();
        }
        // What nothing has come after.
        put(&gap(left_out.swap(0, Ordering::Relaxed)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATIENCE: Duration = Duration::from_secs(20);

    /// A reader that takes a line when it is allowed to.
    struct Slow {
        begun: mpsc::Sender<()>,
        allowed: Receiver<()>,
        taken: mpsc::Sender<String>,
    }

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _ = self.begun.send(());
            self.allowed.recv().map_err(|_| io::ErrorKind::BrokenPipe)?;
            let _ = self.taken.send(String::from_utf8_lossy(bytes).into_owned());
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// The other ends of a slow reader.
    struct Ends {
        begun: Receiver<()>,
        allow: mpsc::Sender<()>,
        lines: Receiver<String>,
    }

    fn slow() -> (Terminal, Ends) {
        let (has_begun, begun) = mpsc::channel();
        let (allow, allowed) = mpsc::channel();
        let (taken, lines) = mpsc::channel();
        let missed = |lines| format!("missed {lines}\n");
        let terminal = Terminal::start(Slow { begun: has_begun, allowed, taken }, missed).expect("a thread");
        (terminal, Ends { begun, allow, lines })
    }

    #[test]
    fn a_reader_that_stands_still_holds_nobody_up_and_is_told_what_it_missed() {
        const MISSED: usize = 10;
        let (terminal, ends) = slow();
        terminal.line("0\n".to_owned());
        // It is being written, and not in the queue any more.
        ends.begun.recv_timeout(PATIENCE).expect("it is begun");
        for _ in 0..QUEUE {
            terminal.line("1\n".to_owned());
        }
        for _ in 0..MISSED {
            terminal.line("3\n".to_owned());
        }
        terminal.finish(None, Duration::ZERO);
        for _ in 0..2 * QUEUE {
            ends.allow.send(()).expect("it writes");
        }
        let mut before = 0;
        loop {
            let line = ends.lines.recv_timeout(PATIENCE).expect("a line");
            if line.starts_with("missed") {
                break assert_eq!(line, format!("missed {MISSED}\n"));
            }
            assert_ne!(line, "3\n");
            before += 1;
        }
        assert_eq!(before, QUEUE + 1);
        terminal.line("4\n".to_owned());
        assert_eq!(ends.lines.recv_timeout(PATIENCE).expect("a line"), "4\n");
    }

    #[test]
    fn the_end_waits_for_a_reader_that_reads() {
        let (terminal, ends) = slow();
        for n in 0..100 {
            terminal.line(format!("{n}\n"));
            ends.allow.send(()).expect("it writes");
        }
        terminal.finish(None, PATIENCE);
        assert_eq!(ends.lines.try_iter().count(), 100);
    }

    #[test]
    fn the_last_line_comes_after_a_gap_that_is_told() {
        let (terminal, ends) = slow();
        terminal.line("0\n".to_owned());
        ends.begun.recv_timeout(PATIENCE).expect("it is begun");
        for _ in 0..QUEUE + 3 {
            terminal.line("1\n".to_owned());
        }
        let ender = terminal.clone();
        let end = thread::spawn(move || ender.finish(Some("last\n".to_owned()), PATIENCE));
        for _ in 0..QUEUE + 3 {
            ends.allow.send(()).expect("it writes");
        }
        end.join().expect("it ends");
        let lines: Vec<String> = ends.lines.try_iter().collect();
        assert_eq!(lines[QUEUE + 1..], ["missed 3\n", "last\n"]);
    }
}
