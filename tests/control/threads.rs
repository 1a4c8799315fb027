//! The whole loop on its threads, with the system's clock. Tests wait for events; the long limits only end a test that
//! would otherwise hang.

use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::step::{Hold, StepRecord};
use parfocal_devices::camera::{Adjustable, Controls, Setting};
use parfocal_imaging::Reconstructor;
use parfocal_pipeline::control::{
    Command, ControlHandle, ControlLoop, ControlStatus, ControlledFrame, Drive, LoopSettings, Rig,
};
use rustix::thread::Pid;
use tokio::sync::mpsc;

use super::fakes::{Deed, FakeCamera, FakeLens, Script, Shot, drive, power};

const LIMIT: Duration = Duration::from_secs(20);
const SIDE: usize = 32;

struct Stage {
    control: ControlLoop,
    handle: ControlHandle,
    telemetry: mpsc::Receiver<StepRecord>,
    camera: Sender<Shot>,
    lens: FakeLens,
    script: Script,
}

impl Stage {
    fn new(telemetry_capacity: usize) -> Self {
        Self::with_controls(telemetry_capacity, None)
    }

    /// A stage whose camera can be changed by `controls`.
    fn with_controls(telemetry_capacity: usize, controls: Option<Controls>) -> Self {
        let clock = Arc::new(SystemClock);
        let (mut fake_camera, camera) = FakeCamera::new(clock.clone());
        fake_camera.controls = controls;
        let lens = FakeLens::at(power(0.5));
        let script = Script::new(Deed::GoTo(0.6));
        let rig = Rig {
            camera: Box::new(fake_camera),
            lens: Box::new(lens.clone()),
            reconstructor: Reconstructor::default(),
            registry: script.registry(),
            clock,
        };

        let settings = LoopSettings { frame_period: Duration::from_millis(20), telemetry_capacity, dynamics: None };
        let (control, handle, telemetry) = ControlLoop::spawn(settings, rig).unwrap();
        Self { control, handle, telemetry, camera, lens, script }
    }

    /// Lets the camera deliver a frame, and waits until the loop has processed it.
    fn shoot(&self) -> ControlledFrame {
        self.camera.send(Shot::Frame(SIDE)).unwrap();
        self.handle.frames.take(LIMIT).expect("the frame comes through")
    }

    /// Takes frames until the record of one satisfies `wanted`.
    fn shoot_until(&self, wanted: impl Fn(&StepRecord) -> bool) -> StepRecord {
        std::iter::repeat_with(|| self.shoot().record).find(wanted).expect("endless")
    }

    /// Waits until the status satisfies `wanted`.
    fn status_until(&mut self, wanted: impl FnMut(&Arc<ControlStatus>) -> bool) -> Arc<ControlStatus> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        runtime.block_on(async {
            let status = self.handle.status.wait_for(wanted);
            tokio::time::timeout(LIMIT, status).await.expect("the status comes").unwrap().clone()
        })
    }
}

#[test]
fn frames_commands_and_telemetry_go_through() {
    let mut stage = Stage::new(16);
    let first = stage.shoot().record;
    assert_eq!((first.frame, first.asked, &first.policy), (1, power(0.5), &None));
    stage.handle.send(drive("scripted", None));
    let followed = stage.shoot_until(|record| record.policy.is_some() && record.held.is_none());
    assert_eq!((followed.asked, stage.lens.position()), (power(0.6), power(0.6)));
    assert_eq!(stage.telemetry.blocking_recv(), Some(first));
    stage.control.stop();
    assert!(stage.handle.frames.is_closed(), "whoever waits for frames learns that none will come");
}

#[test]
fn telemetry_that_nobody_takes_is_counted_and_stops_nothing() {
    let mut stage = Stage::new(4);
    for _ in 0..50 {
        stage.shoot();
    }
    let status = stage.status_until(|status| status.steps == 50);
    assert_eq!(status.telemetry_dropped, 46);
    let kept: Vec<u64> = std::iter::from_fn(|| stage.telemetry.try_recv().ok()).map(|record| record.frame).collect();
    assert_eq!(kept, [1, 2, 3, 4], "the records that are kept are whole and in order");
}

#[test]
fn a_hanging_policy_does_not_stop_the_view() {
    let stage = Stage::new(16);
    stage.script.set(Deed::Hang);
    stage.handle.send(drive("scripted", None));
    stage.shoot_until(|record| record.held == Some(Hold::PolicySlow));
    for _ in 0..50 {
        assert_eq!(stage.shoot().record.held, Some(Hold::PolicySlow));
    }
    stage.script.set(Deed::GoTo(0.7));
    stage.shoot_until(|record| record.held.is_none());
    stage.control.stop();
}

#[test]
fn a_policy_has_as_long_as_the_cameras_present_rate_leaves() {
    let rate = |value| Adjustable { setting: Setting::FrameRate, value, min: 5.0, max: 100.0 };
    let controls = Controls::default();
    controls.offer(vec![rate(50.0)]);
    let mut stage = Stage::with_controls(16, Some(controls.clone()));
    controls.offer(vec![rate(8.0)]);
    stage.status_until(|status| status.camera_offer.settings == [rate(8.0)]);

    stage.script.set(Deed::Hang);
    stage.handle.send(drive("scripted", None));
    let late = stage.shoot_until(|record| record.held == Some(Hold::PolicySlow));
    assert!(late.latency_micros >= 125_000, "one frame at 8 a second, not at 50: {late:?}");
    stage.script.set(Deed::GoTo(0.7));
    stage.control.stop();
}

/// A thread's scheduling policy, by the kernel's number, and its niceness.
fn scheduling(thread: Pid) -> (i32, i32) {
    let stat = std::fs::read_to_string(format!("/proc/self/task/{}/stat", thread.as_raw_pid())).unwrap();
    let after_name = stat.rsplit_once(')').unwrap().1;
    let fields: Vec<_> = after_name.split_whitespace().collect();
    // Fields 41 and 19 of proc(5); the name is the second.
    (fields[38].parse().unwrap(), fields[16].parse().unwrap())
}

#[test]
fn a_policy_that_spins_has_real_time_priority_for_a_frame_and_then_goes_behind_all_others() {
    const OTHER: i32 = 0;
    const FIFO: i32 = 1;
    let allowed = std::process::Command::new("chrt").args(["--fifo", "30", "true"]).status().unwrap().success();
    let in_charge = if allowed { FIFO } else { OTHER };
    let stage = Stage::new(16);
    stage.handle.send(drive("scripted", None));
    stage.shoot_until(|record| record.policy.is_some() && record.held.is_none());
    let first = stage.script.threads()[0];
    stage.shoot_until(|_| scheduling(first).0 == in_charge);

    stage.script.set(Deed::Spin);
    stage.shoot_until(|record| record.held == Some(Hold::PolicySlow));
    assert_eq!(scheduling(first).0, OTHER, "it is late");
    stage.shoot_until(|_| scheduling(first) == (OTHER, 19));

    stage.script.set(Deed::GoTo(0.7));
    stage.shoot_until(|record| record.held.is_none());
    let latest = stage.script.threads().last().copied().unwrap();
    stage.shoot_until(|_| scheduling(latest).0 == in_charge);
    stage.control.stop();
}

#[test]
fn a_slow_start_after_a_long_pause_is_not_a_long_hold() {
    let mut stage = Stage::new(16);
    let clock = SystemClock;
    stage.handle.send(drive("scripted", None));
    stage.shoot_until(|record| record.asked == power(0.6));
    stage.handle.send(Command::Drive { drive: Drive::Hold { at: None }, segment: None });
    while stage.handle.status.borrow().held_for < Duration::from_millis(300) {
        stage.shoot();
    }
    assert_eq!(stage.handle.status.borrow().held, Some(Hold::Paused));
    let resumed = clock.now();
    stage.script.set(Deed::Hang);
    stage.handle.send(drive("scripted", None));
    stage.shoot_until(|record| record.held == Some(Hold::PolicySlow));
    let status = stage.status_until(|status| status.held == Some(Hold::PolicySlow));
    assert!(status.held_for <= clock.now().since(resumed), "{:?}", status.held_for);
    stage.script.set(Deed::GoTo(0.7));
    stage.shoot_until(|record| record.held.is_none());
    stage.control.stop();
}

#[test]
fn when_a_status_comes_does_not_depend_on_what_the_policy_does() {
    let mut stage = Stage::new(16);
    stage.handle.send(drive("scripted", None));
    stage.shoot_until(|record| record.policy.is_some() && record.held.is_none());
    stage.status_until(|status| status.policy.is_some());

    let mut times = Vec::new();
    while times.len() < 5 {
        for (deed, slow) in [(Deed::Hang, true), (Deed::GoTo(0.7), false)] {
            stage.script.set(deed);
            while (stage.shoot().record.held == Some(Hold::PolicySlow)) != slow {
                times.push(stage.handle.status.borrow().at);
            }
            times.push(stage.handle.status.borrow().at);
        }
        times.dedup();
    }

    let apart = times.windows(2).map(|pair| pair[1].since(pair[0]));
    assert!(apart.clone().all(|apart| apart >= Duration::from_millis(200)), "{:?}", apart.collect::<Vec<_>>());
}

#[test]
fn a_hanging_policy_does_not_keep_the_loop_from_ending() {
    let stage = Stage::new(16);
    stage.script.set(Deed::Hang);
    stage.handle.send(drive("scripted", None));
    stage.shoot_until(|record| record.held == Some(Hold::PolicySlow));
    stage.control.stop();
    assert!(stage.handle.frames.is_closed());
    stage.script.set(Deed::GoTo(0.5));
}

#[test]
fn a_camera_that_fails_is_reported_and_comes_back() {
    for failure in [Shot::Failure, Shot::Panic] {
        let mut stage = Stage::new(16);
        stage.handle.send(drive("scripted", None));
        stage.shoot_until(|record| record.asked == power(0.6));
        stage.camera.send(failure).unwrap();
        let status = stage.status_until(|status| status.held == Some(Hold::CameraFailed));
        assert!(!status.camera.working && status.lens.working);
        assert!(status.message.as_ref().unwrap().contains("no frame"), "{:?}", status.message);
        assert!(status.camera.message.contains("no frame"), "{}", status.camera.message);
        assert_eq!(stage.lens.position(), power(0.6));
        let again = stage.status_until(|_| true);
        assert_eq!(again.policy, status.policy, "the policy stays in charge");
        stage.shoot();
        let status = stage.status_until(|status| status.held.is_none());
        assert!(status.camera.working && status.message.is_none());
    }
}

#[test]
fn the_hand_works_while_the_camera_is_dead() {
    let mut stage = Stage::new(16);
    stage.status_until(|status| status.held == Some(Hold::CameraFailed));
    stage.handle.send(Command::Drive { drive: Drive::Manual(power(0.25)), segment: None });
    stage.status_until(|status| status.focal_power == power(0.25));
    assert_eq!(stage.lens.position(), power(0.25));
}

#[test]
fn the_status_tells_pace_and_latency() {
    let mut stage = Stage::new(16);
    for _ in 0..10 {
        stage.shoot();
    }
    let status = stage.status_until(|status| status.steps_per_second > 0.0);
    assert!(status.latency_p50_micros > 0 && status.latency_p50_micros <= status.latency_p99_micros);
}
