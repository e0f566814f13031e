//! The period of the thread, without clock and network.

use std::time::Duration;

use allocation_counter::{AllocationInfo, measure};

use super::super::arc_pool::ArcPool;
use super::*;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trajectory::{Start, TrajectoryPoint, TrajectoryRequest, ValidationContext};
use virtual_axes_core::units::seconds;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;

/// Periods in which queues and buffers grow to their size.
const WARM_UP: i64 = 256;
/// Periods that are looked at.
const LOOKED_AT: i64 = 256;
/// Periods that whoever takes the frames falls behind by, again and again.
const BEHIND: i64 = 7;

/// The thread's part of the node, and what stands at the other ends of its channels.
struct Thread {
    axes: axes::Axes,
    names: Vec<String>,
    commands: (mpsc::Sender<Command>, mpsc::Receiver<Command>),
    frames: (mpsc::Sender<Arc<Frame>>, mpsc::Receiver<Arc<Frame>>),
    reports: mpsc::UnboundedReceiver<Report>,
    health: watch::Receiver<Health>,
}

impl Thread {
    fn new() -> Self {
        let parameters = Parameters::embedded_default().expect("the embedded machine is valid");
        let config = parameters.machine_config().expect("valid");
        let limits = joint_limits(&config, "");
        let names = limits.iter().map(|joint| joint.name.clone()).collect();
        let simulation = Simulation::new(&config, limits, 0).expect("can be simulated");
        let (reports_out, reports) = mpsc::unbounded_channel();
        let (health_out, health) = watch::channel(Health::default());
        let axes = axes::Axes::new(simulation, reports_out, health_out);
        Thread {
            axes,
            names,
            commands: mpsc::channel(COMMAND_QUEUE),
            frames: mpsc::channel(64),
            reports,
            health,
        }
    }

    fn command(&self, command: Command) {
        self.commands.0.try_send(command).expect("there is room");
    }

    /// Y to and fro until after what is looked at.
    fn offer(&self) {
        let parameters = Parameters::embedded_default().expect("the embedded machine is valid");
        let limits = joint_limits(&parameters.machine_config().expect("valid"), "");
        let period = self.axes.simulation().period();
        let mut request = TrajectoryRequest::new(Start::Now, vec!["y".to_owned()]);
        for k in 0..2 * (WARM_UP + LOOKED_AT) {
            let position = [0.01 * (1.0 - (2.0 * seconds(k * period)).cos())];
            request
                .push(k * period, TrajectoryPoint { positions: &position, ..TrajectoryPoint::default() })
                .expect("well formed");
        }
        let context = ValidationContext {
            joints: &limits,
            period,
            max_points: 10_000,
            allow_nonzero_end_velocity: true,
        };
        let trajectory = Arc::new(Trajectory::new(request, &context).expect("within limits"));
        self.command(Command::Offer { id: MotionId(1), trajectory, tolerances: None });
    }

    /// One period as in real time, counted.
    fn period(&mut self) -> AllocationInfo {
        measure(|| {
            let late = Duration::from_micros(50);
            let goes_on =
                real::period(&mut self.axes, &mut self.commands.1, &self.frames.0, late, false).is_continue();
            assert!(goes_on);
        })
    }
}

#[test]
fn a_period_of_the_thread_allocates_and_frees_nothing() {
    let mut thread = Thread::new();
    let (mut streamed, mut loads) = (ArcPool::default(), ArcPool::default());
    thread.offer();
    for k in 0..WARM_UP + LOOKED_AT {
        let position = vec![0.005 * (2.0 * seconds(k * thread.axes.simulation().period())).sin()];
        let message = JointState { name: vec!["x".to_owned()], position, ..JointState::default() };
        let setpoints = StreamSetpoints::from_message(&message, &thread.names);
        thread.command(Command::Stream(streamed.acquire(|last| *last = setpoints)));
        thread.command(Command::Load {
            loads: loads.acquire(|last| *last = vec![(2, 50.0)]),
            hold: 60_000_000,
        });
        let found = thread.period();
        assert!(
            k < WARM_UP || found == AllocationInfo::default(),
            "period {k}: {} allocations, {:+} left",
            found.count_total,
            found.count_current
        );
        if k % BEHIND == 0 {
            while thread.frames.1.try_recv().is_ok() {}
        }
    }
    // It did what it was asked to do.
    let health = thread.health.borrow();
    assert_eq!((health.periods, health.dropped), ((WARM_UP + LOOKED_AT).unsigned_abs(), 0));
    assert!(health.moving && health.stream.drives, "{health:?}");
    assert!(matches!(thread.reports.try_recv(), Ok(Report::Decided(MotionId(1), _, Ok(_)))));
}

/// Reports that nobody takes wait in a channel without a bound: a reader that never acknowledges a result has that effect.
#[test]
fn stops_without_end_leave_no_reports() {
    let parameters = Parameters::embedded_default().expect("the embedded machine is valid");
    let limits = joint_limits(&parameters.machine_config().expect("valid"), "");
    let mut thread = Thread::new();
    let period = thread.axes.simulation().period();
    let context =
        ValidationContext { joints: &limits, period, max_points: 1, allow_nonzero_end_velocity: false };
    let stop = Trajectory::new(TrajectoryRequest::new(Start::Now, Vec::new()), &context)
        .map(Arc::new)
        .expect("a stop");
    for id in 0..200 {
        thread.command(Command::Stop(MotionId(id), Arc::clone(&stop)));
        thread.period();
    }
    assert!(thread.reports.try_recv().is_err());
    // Nobody but this test has it when all of them are over.
    thread.period();
    assert_eq!(Arc::strong_count(&stop), 1);
}

#[test]
fn streams_that_end_without_end_leave_some_reports_and_the_last() {
    let mut thread = Thread::new();
    for _ in 0..200 {
        let setpoints = StreamSetpoints { positions: vec![(0, 0.0)], ..StreamSetpoints::default() };
        thread.command(Command::Stream(Arc::new(setpoints)));
        thread.period();
        thread.command(Command::Reset(oneshot::channel().0));
        thread.period();
    }
    let mut waiting = Vec::new();
    while let Ok(report) = thread.reports.try_recv() {
        assert!(matches!(report, Report::StreamEnded(_, StreamEnd::Reset, _, _)), "{report:?}");
        waiting.push(report);
    }
    assert!((2..=64).contains(&waiting.len()), "{} reports", waiting.len());
    drop(waiting);
    thread.period();
    assert!(matches!(thread.reports.try_recv(), Ok(Report::StreamEnded(..))), "what was held back");
}

#[test]
fn a_frame_stays_as_it_was_while_somebody_has_it() {
    let mut thread = Thread::new();
    thread.period();
    let kept = thread.frames.1.try_recv().expect("a frame");
    for _ in 0..10 {
        thread.period();
        let _ = thread.frames.1.try_recv();
    }
    assert_eq!((kept.instant, kept.time, kept.samples.len()), (0, 0, 5));
}

#[test]
fn frames_that_nobody_takes_are_dropped_and_counted() {
    let mut thread = Thread::new();
    for _ in 0..70 {
        thread.period();
    }
    assert_eq!(thread.health.borrow().dropped, 6);
    assert_eq!(thread.frames.1.try_recv().expect("a frame").instant, 0);
}

#[test]
fn what_publishes_gets_each_frame_in_the_period_that_made_it() {
    const FRAMES: i64 = 5;
    let Thread { axes, commands: (commands_out, commands), frames: (frames, mut taken), .. } = Thread::new();
    let (found_out, found) = std::sync::mpsc::channel();
    let published = async move {
        while let Some(frame) = taken.recv().await {
            let _ = found_out.send((frame.instant, taken.len()));
            if frame.instant == FRAMES - 1 {
                let _ = commands_out.try_send(Command::Shutdown);
            }
        }
    };
    let tasks = CooperativeTasks { input: Box::pin(std::future::pending()), output: Box::pin(published) };
    let thread = std::thread::spawn(move || real::run(axes, commands, &frames, tasks));
    for instant in 0..FRAMES {
        let found = found.recv_timeout(Duration::from_secs(20)).expect("a frame");
        assert_eq!(found, (instant, 0), "none may wait");
    }
    thread.join().expect("it ends when it is told to");
}

#[test]
fn what_was_missed_is_computed_counted_and_kept_to_itself() {
    const BEFORE: i64 = 20;
    const MISSED: i64 = 300;
    let late = Duration::from_millis(6);
    let (mut paused, mut in_time) = (Thread::new(), Thread::new());
    for thread in [&mut paused, &mut in_time] {
        thread.offer();
        for _ in 0..BEFORE {
            thread.period();
        }
        while thread.frames.1.try_recv().is_ok() {}
    }
    // The commands of the time that was missed wait for the instant of now.
    paused.command(Command::Load { loads: Arc::new(vec![(0, 200.0)]), hold: 60_000_000 });
    let newest = BEFORE + MISSED;
    real::stood_still(&mut paused.axes, late * 300, newest, |k| {
        late * u32::try_from(newest - k).expect("only what is missed")
    });
    assert_eq!(paused.axes.simulation().next_instant(), newest);
    assert!(paused.frames.1.try_recv().is_err(), "what is old is not published");
    let health = paused.health.borrow().clone();
    assert_eq!((health.periods, health.missed, health.unpublished, health.dropped), (320, 300, 300, 0));
    // Of the first that was missed: 300 periods of 6 ms.
    assert!((health.max_lateness - 1.8).abs() < 1e-9, "{}", health.max_lateness);

    for _ in 0..MISSED {
        in_time.period();
        let _ = in_time.frames.1.try_recv();
    }
    in_time.command(Command::Load { loads: Arc::new(vec![(0, 200.0)]), hold: 60_000_000 });
    let next = [&mut paused, &mut in_time].map(|thread| {
        thread.period();
        thread.frames.1.try_recv().expect("a frame")
    });
    assert_eq!(next[0].instant, newest);
    assert_eq!(format!("{:?}", next[0]), format!("{:?}", next[1]), "the same bits as without the pause");
}

#[test]
fn an_instant_that_is_due_already_is_not_taken_for_missed() {
    let mut thread = Thread::new();
    real::stood_still(&mut thread.axes, Duration::from_secs(2), 0, |_| Duration::ZERO);
    assert_eq!((thread.axes.simulation().next_instant(), thread.health.borrow().missed), (0, 0));
}

#[test]
fn a_wall_clock_that_is_set_neither_stops_nor_hurries_the_axes() {
    const HOUR: Duration = Duration::from_secs(3600);
    let thread = Thread::new();
    let period = Duration::from_nanos(thread.axes.simulation().period().unsigned_abs());
    let origin = wall::since_epoch();
    let parameters = Parameters::embedded_default().expect("the embedded machine is valid");
    let config = parameters.machine_config().expect("valid");
    let simulation = Simulation::new(
        &config,
        joint_limits(&config, ""),
        i64::try_from(origin.as_nanos()).expect("this century"),
    )
    .expect("can be simulated");
    // Set between the choice of the origin and the start; later nobody looks at it (it is an FnOnce).
    for wall in [origin - HOUR, origin, origin + HOUR] {
        let began = std::time::Instant::now();
        let clock = wall::PaceClock::new(&simulation, || wall);
        clock.wait_for(1);
        let waited = began.elapsed();
        assert!(waited >= period && waited < HOUR / 60, "{waited:?}");
        // An hour of instants would be 600 000.
        assert!(clock.newest_due() < 10_000, "{}", clock.newest_due());
    }
}
