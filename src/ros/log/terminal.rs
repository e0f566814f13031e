//! Log output to stderr by a separate thread, so that a blocked reader (a full pipe, a terminal after Ctrl-S) does
//! not stop the axes.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError};
use std::thread;
use std::time::{Duration, Instant};

/// Capacity of the queue, lines: several times the burst of a start with `--log-level debug`; about 200 kB.
const QUEUE: usize = 1024;
/// Period at which a full queue is checked.
const POLL: Duration = Duration::from_millis(1);

/// Sender of log lines that never blocks.
#[derive(Debug, Clone)]
pub(super) struct Terminal {
    queue: SyncSender<Item>,
    dropped: Arc<AtomicU64>,
}

#[derive(Debug)]
struct Item {
    /// Number of lines dropped before this one.
    dropped: u64,
    line: Option<String>,
    /// Signal that this item and all before it have been written.
    written: Option<SyncSender<()>>,
}

impl Terminal {
    /// Starts the thread that writes to `out`. `report` formats the line that reports a number of dropped lines.
    ///
    /// # Errors
    /// Error of the operating system if the thread cannot be started.
    pub(super) fn start(
        out: impl Write + Send + 'static,
        report: impl Fn(u64) -> String + Send + 'static,
    ) -> io::Result<Self> {
        let (queue, items) = mpsc::sync_channel(QUEUE);
        let dropped = Arc::new(AtomicU64::new(0));
        let counter = Arc::clone(&dropped);
        thread::Builder::new().name("log".into()).spawn(move || write(out, &items, &counter, report))?;
        Ok(Terminal { queue, dropped })
    }

    /// Queues a line that ends with a newline. The line is dropped and counted if the queue is full.
    pub(super) fn line(&self, line: String) {
        if self.push(Item { dropped: 0, line: Some(line), written: None }).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Queues an item with the number of lines dropped before it. Returns the item if the queue is full.
    fn push(&self, item: Item) -> Result<(), Item> {
        let dropped = self.dropped.swap(0, Ordering::Relaxed);
        match self.queue.try_send(Item { dropped, ..item }) {
            // The thread ends only after all senders are dropped.
            Ok(()) | Err(TrySendError::Disconnected(_)) => Ok(()),
            Err(TrySendError::Full(item)) => {
                self.dropped.fetch_add(dropped, Ordering::Relaxed);
                Err(item)
            }
        }
    }

    /// Queues `line` and waits until all queued lines are written, for at most `timeout`.
    pub(super) fn finish(&self, line: Option<String>, timeout: Duration) {
        let until = Instant::now() + timeout;
        let (written, is_written) = mpsc::sync_channel(1);
        let mut last = Item { dropped: 0, line, written: Some(written) };
        while let Err(back) = self.push(last) {
            if Instant::now() >= until {
                return;
            }
            last = back;
            thread::sleep(POLL);
        }
        // A timeout, or the end of the thread, is ignored.
        let _: Result<(), RecvTimeoutError> =
            is_written.recv_timeout(until.saturating_duration_since(Instant::now()));
    }
}

/// Writes queued lines until all senders are dropped. Errors of stderr are ignored.
fn write(mut out: impl Write, items: &Receiver<Item>, dropped: &AtomicU64, report: impl Fn(u64) -> String) {
    let mut put = |line: &str| drop(out.write_all(line.as_bytes()));
    let gap = |lines: u64| if lines > 0 { report(lines) } else { String::new() };
    while let Ok(first) = items.recv() {
        let mut next = Some(first);
        while let Some(item) = next {
            put(&gap(item.dropped));
            item.line.as_deref().into_iter().for_each(&mut put);
            // The receiver is dropped after a timeout.
            if let Some(written) = item.written {
                let _ = written.try_send(());
            }
            next = items.try_recv().ok();
        }
        // Lines dropped after the last item.
        put(&gap(dropped.swap(0, Ordering::Relaxed)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: Duration = Duration::from_secs(20);

    /// Test output that writes a line when it is allowed to.
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

    /// Channels that control a slow output.
    struct Ends {
        begun: Receiver<()>,
        allow: mpsc::Sender<()>,
        lines: Receiver<String>,
    }

    fn slow() -> (Terminal, Ends) {
        let (has_begun, begun) = mpsc::channel();
        let (allow, allowed) = mpsc::channel();
        let (taken, lines) = mpsc::channel();
        let report = |lines| format!("dropped {lines}\n");
        let terminal = Terminal::start(Slow { begun: has_begun, allowed, taken }, report).expect("a thread");
        (terminal, Ends { begun, allow, lines })
    }

    #[test]
    fn a_blocked_reader_delays_no_sender_and_gets_the_number_of_dropped_lines() {
        const DROPPED: usize = 10;
        let (terminal, ends) = slow();
        terminal.line("0\n".to_owned());
        // The line is being written and has left the queue.
        ends.begun.recv_timeout(TIMEOUT).expect("it is begun");
        for _ in 0..QUEUE {
            terminal.line("1\n".to_owned());
        }
        for _ in 0..DROPPED {
            terminal.line("3\n".to_owned());
        }
        terminal.finish(None, Duration::ZERO);
        for _ in 0..2 * QUEUE {
            ends.allow.send(()).expect("it writes");
        }
        let mut before = 0;
        loop {
            let line = ends.lines.recv_timeout(TIMEOUT).expect("a line");
            if line.starts_with("dropped") {
                break assert_eq!(line, format!("dropped {DROPPED}\n"));
            }
            assert_ne!(line, "3\n");
            before += 1;
        }
        assert_eq!(before, QUEUE + 1);
        terminal.line("4\n".to_owned());
        assert_eq!(ends.lines.recv_timeout(TIMEOUT).expect("a line"), "4\n");
    }

    #[test]
    fn finish_waits_for_a_slow_reader() {
        let (terminal, ends) = slow();
        for n in 0..100 {
            terminal.line(format!("{n}\n"));
            ends.allow.send(()).expect("it writes");
        }
        terminal.finish(None, TIMEOUT);
        assert_eq!(ends.lines.try_iter().count(), 100);
    }

    #[test]
    fn the_last_line_follows_the_report_of_dropped_lines() {
        let (terminal, ends) = slow();
        terminal.line("0\n".to_owned());
        ends.begun.recv_timeout(TIMEOUT).expect("it is begun");
        for _ in 0..QUEUE + 3 {
            terminal.line("1\n".to_owned());
        }
        let ender = terminal.clone();
        let end = thread::spawn(move || ender.finish(Some("last\n".to_owned()), TIMEOUT));
        for _ in 0..QUEUE + 3 {
            ends.allow.send(()).expect("it writes");
        }
        end.join().expect("it ends");
        let lines: Vec<String> = ends.lines.try_iter().collect();
        assert_eq!(lines[QUEUE + 1..], ["dropped 3\n", "last\n"]);
    }
}
