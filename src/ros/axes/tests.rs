//! Tests of the axes' thread without clock and network.

use std::time::Duration;

use allocation_counter::{AllocationInfo, measure};

use tokio::sync::oneshot;

use super::*;
use crate::validation::StreamSetpoints;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trajectory::{
    MotionId, Start, StreamEnd, Trajectory, TrajectoryPoint, TrajectoryRequest, ValidationContext,
};
use virtual_axes_core::units::seconds;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;

/// Number of cycles in which queues and buffers grow to their final size.
const WARM_UP: i64 = 256;
/// Number of measured cycles.
const MEASURED: i64 = 256;
/// Number of cycles between two receptions of the queued frames.
const RECEIVE_EVERY: i64 = 7;

/// State of the axes' thread and the other ends of its channels.
struct TestThread {
    axes: stepper::Axes,
    names: Vec<String>,
    commands: (mpsc::Sender<Command>, mpsc::Receiver<Command>),
    frames: (mpsc::Sender<Arc<SampleFrame>>, mpsc::Receiver<Arc<SampleFrame>>),
    reports: mpsc::UnboundedReceiver<SimulationReport>,
    health: watch::Receiver<Health>,
}

impl TestThread {
    fn new() -> Self {
        let parameters = Parameters::embedded_default().expect("the embedded machine is valid");
        let config = parameters.machine_config().expect("valid");
        let limits = joint_limits(&config, "");
        let names = limits.iter().map(|joint| joint.name.clone()).collect();
        let simulation = Simulation::new(&config, limits, 0).expect("can be simulated");
        let (reports_out, reports) = mpsc::unbounded_channel();
        let (health_out, health) = watch::channel(Health::default());
        let axes = stepper::Axes::new(simulation, reports_out, health_out);
        TestThread {
            axes,
            names,
            commands: mpsc::channel(COMMAND_QUEUE),
            frames: mpsc::channel(64),
            reports,
            health,
        }
    }

    fn command(&self, command: Command) {
        self.commands.0.try_send(command).expect("free space in the queue");
    }

    /// Submits a reciprocating motion of Y that lasts beyond the measured cycles.
    fn submit_motion(&self) {
        let parameters = Parameters::embedded_default().expect("the embedded machine is valid");
        let limits = joint_limits(&parameters.machine_config().expect("valid"), "");
        let period = self.axes.simulation().period();
        let mut request = TrajectoryRequest::new(Start::Now, vec!["y".to_owned()]);
        for k in 0..2 * (WARM_UP + MEASURED) {
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
        self.command(Command::Submit { id: MotionId(1), trajectory, tolerances: None });
    }

    /// Runs one cycle as in real time and returns its allocations.
    fn run_cycle(&mut self) -> AllocationInfo {
        measure(|| {
            let late = Duration::from_micros(50);
            let continues =
                real::run_cycle(&mut self.axes, &mut self.commands.1, &self.frames.0, late, false)
                    .is_continue();
            assert!(continues);
        })
    }
}

#[test]
fn a_position_cycle_allocates_and_frees_nothing() {
    let mut thread = TestThread::new();
    let (mut streamed, mut loads) = (ArcPool::default(), ArcPool::default());
    thread.submit_motion();
    for k in 0..WARM_UP + MEASURED {
        let position = vec![0.005 * (2.0 * seconds(k * thread.axes.simulation().period())).sin()];
        let message = JointState { name: vec!["x".to_owned()], position, ..JointState::default() };
        let setpoints = StreamSetpoints::from_message(&message, &thread.names);
        thread.command(Command::Stream(streamed.acquire(|last| *last = setpoints)));
        thread.command(Command::Load {
            loads: loads.acquire(|last| *last = vec![(2, 50.0)]),
            hold: 60_000_000,
        });
        let found = thread.run_cycle();
        assert!(
            k < WARM_UP || found == AllocationInfo::default(),
            "cycle {k}: {} allocations, {:+} left",
            found.count_total,
            found.count_current
        );
        if k % RECEIVE_EVERY == 0 {
            while thread.frames.1.try_recv().is_ok() {}
        }
    }
    // The commands took effect.
    let health = thread.health.borrow();
    assert_eq!((health.periods, health.dropped), ((WARM_UP + MEASURED).unsigned_abs(), 0));
    assert!(health.is_moving && health.stream.is_active, "{health:?}");
    assert!(matches!(thread.reports.try_recv(), Ok(SimulationReport::Decision(MotionId(1), _, Ok(_)))));
}

/// The channel of reports is unbounded. A reader that never acknowledges a result stops its reception.
#[test]
fn any_number_of_stops_leaves_no_reports() {
    let parameters = Parameters::embedded_default().expect("the embedded machine is valid");
    let limits = joint_limits(&parameters.machine_config().expect("valid"), "");
    let mut thread = TestThread::new();
    let period = thread.axes.simulation().period();
    let context =
        ValidationContext { joints: &limits, period, max_points: 1, allow_nonzero_end_velocity: false };
    let stop = Trajectory::new(TrajectoryRequest::new(Start::Now, Vec::new()), &context)
        .map(Arc::new)
        .expect("a stop");
    for id in 0..200 {
        thread.command(Command::Stop(MotionId(id), Arc::clone(&stop)));
        thread.run_cycle();
    }
    assert!(thread.reports.try_recv().is_err());
    // After all stops have ended, the test holds the only reference.
    thread.run_cycle();
    assert_eq!(Arc::strong_count(&stop), 1);
}

#[test]
fn reports_on_stream_ends_are_bounded_and_include_the_last() {
    let mut thread = TestThread::new();
    for _ in 0..200 {
        let setpoints = StreamSetpoints { positions: vec![(0, 0.0)], ..StreamSetpoints::default() };
        thread.command(Command::Stream(Arc::new(setpoints)));
        thread.run_cycle();
        thread.command(Command::Reset(oneshot::channel().0));
        thread.run_cycle();
    }
    let mut waiting = Vec::new();
    while let Ok(report) = thread.reports.try_recv() {
        assert!(matches!(report, SimulationReport::StreamEnded(_, StreamEnd::Reset, _, _)), "{report:?}");
        waiting.push(report);
    }
    assert!((2..=64).contains(&waiting.len()), "{} reports", waiting.len());
    drop(waiting);
    thread.run_cycle();
    assert!(matches!(thread.reports.try_recv(), Ok(SimulationReport::StreamEnded(..))), "the merged report");
}

#[test]
fn a_frame_is_not_changed_while_it_is_referenced() {
    let mut thread = TestThread::new();
    thread.run_cycle();
    let kept = thread.frames.1.try_recv().expect("a frame");
    for _ in 0..10 {
        thread.run_cycle();
        let _ = thread.frames.1.try_recv();
    }
    assert_eq!((kept.instant, kept.time, kept.samples.len()), (0, 0, 5));
}

#[test]
fn an_inactive_node_publishes_no_frame() {
    let mut thread = TestThread::new();
    // As at the start of a managed node: the grid is moved to the wall clock, then the node is deactivated.
    thread.axes.jump_to(1_000_000_000);
    thread.command(Command::Deactivate { id: MotionId(1), stop: None, done: oneshot::channel().0 });
    for _ in 0..3 {
        thread.run_cycle();
        assert!(!thread.frames.1.try_recv().expect("a frame").is_published);
    }
}

#[test]
fn unread_frames_are_dropped_and_counted() {
    let mut thread = TestThread::new();
    for _ in 0..70 {
        thread.run_cycle();
    }
    assert_eq!(thread.health.borrow().dropped, 6);
    assert_eq!(thread.frames.1.try_recv().expect("a frame").instant, 0);
}

#[test]
fn each_frame_is_published_in_its_own_cycle() {
    const FRAMES: i64 = 5;
    let TestThread { mut axes, commands: (commands_out, mut commands), frames: (frames, mut taken), .. } =
        TestThread::new();
    let (found_out, found) = std::sync::mpsc::channel();
    let outputs = async move {
        while let Some(frame) = taken.recv().await {
            let _ = found_out.send((frame.instant, taken.len()));
            if frame.instant == FRAMES - 1 {
                let _ = commands_out.try_send(Command::Shutdown);
            }
        }
    };
    let mut tasks = CooperativeTasks { inputs: Box::pin(std::future::pending()), outputs: Box::pin(outputs) };
    let thread = std::thread::spawn(move || real::run(&mut axes, &mut commands, &frames, &mut tasks));
    for instant in 0..FRAMES {
        let found = found.recv_timeout(Duration::from_secs(20)).expect("a frame");
        assert_eq!(found, (instant, 0), "no frame waits");
    }
    thread.join().expect("the thread ends");
}

#[test]
fn missed_instants_are_computed_counted_and_not_published() {
    const BEFORE: i64 = 20;
    const MISSED: i64 = 300;
    let late = Duration::from_millis(6);
    let (mut paused, mut in_time) = (TestThread::new(), TestThread::new());
    for thread in [&mut paused, &mut in_time] {
        thread.submit_motion();
        for _ in 0..BEFORE {
            thread.run_cycle();
        }
        while thread.frames.1.try_recv().is_ok() {}
    }
    // Commands received during the stall take effect at the current instant.
    paused.command(Command::Load { loads: Arc::new(vec![(0, 200.0)]), hold: 60_000_000 });
    let newest = BEFORE + MISSED;
    real::catch_up(&mut paused.axes, late * 300, newest, |k| {
        late * u32::try_from(newest - k).expect("missed instants only")
    });
    assert_eq!(paused.axes.simulation().next_instant(), newest);
    assert!(paused.frames.1.try_recv().is_err(), "missed instants are not published");
    let health = paused.health.borrow().clone();
    assert_eq!((health.periods, health.missed, health.unpublished, health.dropped), (320, 300, 300, 0));
    // Lateness of the first missed instant: 300 periods of 6 ms.
    assert!((health.max_lateness - 1.8).abs() < 1e-9, "{}", health.max_lateness);

    for _ in 0..MISSED {
        in_time.run_cycle();
        let _ = in_time.frames.1.try_recv();
    }
    in_time.command(Command::Load { loads: Arc::new(vec![(0, 200.0)]), hold: 60_000_000 });
    let next = [&mut paused, &mut in_time].map(|thread| {
        thread.run_cycle();
        thread.frames.1.try_recv().expect("a frame")
    });
    assert_eq!(next[0].instant, newest);
    assert_eq!(
        format!("{:?}", next[0]),
        format!("{:?}", next[1]),
        "bit-identical to the thread without a stall"
    );
}

#[test]
fn an_instant_that_is_due_is_not_missed() {
    let mut thread = TestThread::new();
    real::catch_up(&mut thread.axes, Duration::from_secs(2), 0, |_| Duration::ZERO);
    assert_eq!((thread.axes.simulation().next_instant(), thread.health.borrow().missed), (0, 0));
}

#[test]
fn a_step_of_the_wall_clock_is_found_and_restarts_the_time() {
    const SECOND: i64 = 1_000_000_000;
    let mut thread = TestThread::new();
    let config = Parameters::embedded_default().expect("valid").machine_config().expect("valid");
    let simulation =
        Simulation::new(&config, joint_limits(&config, ""), 1000 * SECOND).expect("can be simulated");
    let wall = Duration::from_secs(1000);
    let clock = wall::PaceClock::new(&simulation, || wall);
    for shown in [wall, wall + Duration::from_millis(50), wall - Duration::from_millis(50)] {
        assert_eq!(clock.stepped_to(|| shown), None);
    }
    for shown in [wall + Duration::from_secs(100), wall - Duration::from_secs(100)] {
        assert_eq!(clock.stepped_to(|| shown), i64::try_from(shown.as_nanos()).ok());
    }
    for step in [100 * SECOND + 1, -100 * SECOND] {
        thread.submit_motion();
        thread.run_cycle();
        let (before, jumps) = (thread.axes.next_time(), thread.health.borrow().clock.jumps);
        real::follow_step(&mut thread.axes, before + step);
        let after = thread.axes.next_time();
        assert!(after >= before + step && after < before + step + thread.axes.simulation().period());
        assert_eq!(after % thread.axes.simulation().period(), 0);
        assert_eq!(thread.health.borrow().clock.jumps, jumps + 1);
        // The motion would last for a thousand cycles; the axes stop within some of them.
        for _ in 0..100 {
            thread.run_cycle();
        }
        assert!(!thread.axes.simulation().has_trajectory(), "the motion is aborted");
    }
}

#[test]
fn setting_the_wall_clock_neither_stops_nor_accelerates_the_axes() {
    const HOUR: Duration = Duration::from_secs(3600);
    let thread = TestThread::new();
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
    // The clock is set between the choice of the origin and the start.
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
