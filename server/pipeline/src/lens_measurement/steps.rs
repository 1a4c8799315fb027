//! Steps up and down, watched by a camera.

use std::time::Duration;

use super::curve::Flank;
use super::fit::{Fit, Sample};
use super::{CameraView, MeasurementError};
use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;
use parfocal_devices::lens::Lens;

/// Scatter (share of the step) above which the steps are useless.
const SCATTER: f64 = 0.2;
/// Share of the watched time within which the lens must settle. The rest shows where it came to rest.
const SETTLED_BY: f64 = 0.66;
/// Frames whose mean is the sharpness at rest.
const FRAMES_AT_REST: usize = 3;

/// The plan of a measurement.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Stops over the range, on the way up and again on the way down, that map sharpness to focal power.
    pub stops: u32,
    /// Number of steps up, and of steps down.
    pub repeats: u32,
    /// How long the lens rests before its sharpness at rest is measured, and how long a step is watched.
    pub watch: Duration,
}

impl Default for Plan {
    fn default() -> Self {
        Self { stops: 21, repeats: 12, watch: Duration::from_millis(300) }
    }
}

/// The results of a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Fit to the steps both ways.
    pub both: Fit,
    /// Fit to the steps up.
    pub up: Fit,
    /// Fit to the steps down.
    pub down: Fit,
    /// Distance between the focal powers at which the way up and the way down look the same.
    pub hysteresis: f64,
    /// Focal powers between which the steps went.
    pub between: (f64, f64),
    /// Samples of the steps up, and of those down.
    pub samples: [Vec<Sample>; 2],
}

/// Measures `lens` with `view`. `pause` waits for the given time. Each repeat sends its command at a different time
/// between two frames. So the frames of all steps together show the response more finely than the camera's rate allows.
///
/// # Errors
/// If lens or camera fail, or the picture does not show enough. The error says what to do.
pub fn measure(
    lens: &mut dyn Lens,
    view: &mut CameraView,
    plan: Plan,
    pause: &dyn Fn(Duration),
) -> Result<Measurement, MeasurementError> {
    let mut stand = TestBench { lens, view, plan };
    let flank = stand.flank()?;
    let (low, high) = flank.ends();

    let mut samples = [Vec::new(), Vec::new()];
    for repeat in 0..plan.repeats {
        for (direction, samples) in samples.iter_mut().enumerate() {
            let (from, to) = if direction == 0 { (low, high) } else { (high, low) };
            let phase = f64::from(repeat) / f64::from(plan.repeats);
            stand.step((from, to), phase, &flank, pause, samples)?;
        }
    }

    let longest = plan.watch.as_secs_f64();
    let [up, down] = samples.each_ref().map(|samples| Fit::of(samples, longest));
    let both = Fit::of(&samples.concat(), longest);

    if both.delay + both.settling > SETTLED_BY * longest {
        return Err(MeasurementError::TooSlow(1000.0 * longest));
    }
    if both.rms > SCATTER {
        return Err(MeasurementError::Unsteady(both.rms));
    }

    Ok(Measurement { both, up, down, hysteresis: flank.hysteresis.max(0.0), between: (low, high), samples })
}

/// The lens and the camera that are measured.
struct TestBench<'a> {
    lens: &'a mut dyn Lens,
    view: &'a mut CameraView,
    plan: Plan,
}

impl TestBench<'_> {
    /// Measures sharpness over focal power, up and down, and finds its steepest side.
    fn flank(&mut self) -> Result<Flank, MeasurementError> {
        let powers: Vec<f64> = (0..self.plan.stops.max(3)).map(f64::from).collect();
        let last = powers.last().copied().unwrap_or(1.0);
        let powers: Vec<f64> = powers.into_iter().map(|stop| stop / last).collect();

        // Starts from below, so that hysteresis acts the same way during the whole way up.
        self.at_rest(0.0)?;
        let up = powers.iter().map(|&power| self.at_rest(power)).collect::<Result<Vec<_>, _>>()?;
        let down = powers.iter().rev().map(|&power| self.at_rest(power)).collect::<Result<Vec<_>, _>>()?;

        Flank::find(&powers, &up, &down.into_iter().rev().collect::<Vec<_>>())
    }

    /// Sends the lens to `power`, lets it rest, and measures the sharpness.
    fn at_rest(&mut self, power: f64) -> Result<f64, MeasurementError> {
        self.lens.set(FocalPower::nearest(power))?;
        let rested = self.view.now() + self.plan.watch;
        self.view.mean(rested, FRAMES_AT_REST)
    }

    /// Makes one step, commanded `phase` of a frame's time after a frame came, and adds its frames to
    /// `samples`.
    fn step(
        &mut self,
        (from, to): (f64, f64),
        phase: f64,
        flank: &Flank,
        pause: &dyn Fn(Duration),
        samples: &mut Vec<Sample>,
    ) -> Result<(), MeasurementError> {
        let start = flank.focal_power(self.at_rest(from)?);

        // Sends the command `phase` of a frame's time after a frame.
        let (earlier, _) = self.view.next()?;
        let (later, _) = self.view.next()?;
        pause(later.since(earlier).mul_f64(phase));

        let commanded = self.view.now();
        self.lens.set(FocalPower::nearest(to))?;
        let seen = self.watch(commanded, flank)?;

        let settled_from = SETTLED_BY * self.plan.watch.as_secs_f64();
        let at_rest: Vec<f64> = seen.iter().filter(|(at, _)| *at >= settled_from).map(|(_, power)| *power).collect();
        let end = at_rest.iter().sum::<f64>() / at_rest.len().max(1) as f64;

        samples.extend(seen.into_iter().map(|(at, power)| Sample { at, share: (power - start) / (end - start) }));
        Ok(())
    }

    /// Frames exposed within the time to watch after `commanded`: seconds after it, and the focal power
    /// seen.
    fn watch(&mut self, commanded: Moment, flank: &Flank) -> Result<Vec<(f64, f64)>, MeasurementError> {
        let mut seen = Vec::new();
        loop {
            let (at, sharpness) = self.view.next()?;
            if at >= commanded {
                seen.push((at.since(commanded).as_secs_f64(), flank.focal_power(sharpness)));
            }
            if at >= commanded + self.plan.watch {
                return Ok(seen);
            }
        }
    }
}
