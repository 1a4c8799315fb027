//! Steps up and down, watched by a camera.

use std::time::Duration;

use super::curve::Flank;
use super::fit::{Fit, Sample};
use super::{BenchError, View};
use crate::clock::Moment;
use crate::lens::{FocalPower, Lens};

/// More scatter than this and the steps tell nothing.
const SCATTER: f64 = 0.2;
/// Part of the time watched by whose end the lens must have settled: the rest shows where it came to rest.
const SETTLED_BY: f64 = 0.66;
/// Frames whose mean is the sharpness at rest.
const FRAMES_AT_REST: usize = 3;

/// How a lens is measured.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Stops over the range, on the way up and again on the way down, that tell focal power from sharpness.
    pub stops: u32,
    /// Steps up, and as many down.
    pub repeats: u32,
    /// How long the lens is left alone before its sharpness at rest is taken, and how long a step is watched.
    pub watch: Duration,
}

impl Default for Plan {
    fn default() -> Self {
        Self { stops: 21, repeats: 12, watch: Duration::from_millis(300) }
    }
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Of steps both ways.
    pub both: Fit,
    /// Of steps up.
    pub up: Fit,
    /// Of steps down.
    pub down: Fit,
    /// Distance between the focal powers at which the way up and the way down look the same.
    pub hysteresis: f64,
    /// Focal powers between which the steps went.
    pub between: (f64, f64),
    /// What was seen of the steps up, and of those down.
    pub samples: [Vec<Sample>; 2],
}

/// Measures `lens` with `view`. `pause` waits: commands fall between frames at ever other times, so that the frames of
/// all steps together show the response more finely than the camera's rate.
///
/// # Errors
/// When lens or camera fail, or what is seen cannot tell; says what to do.
pub fn measure(
    lens: &mut dyn Lens,
    view: &mut View,
    plan: Plan,
    pause: &dyn Fn(Duration),
) -> Result<Measurement, BenchError> {
    let mut stand = Stand { lens, view, plan };
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
        return Err(BenchError::TooSlow(1000.0 * longest));
    }
    if both.rms > SCATTER {
        return Err(BenchError::Unsteady(both.rms));
    }
    Ok(Measurement { both, up, down, hysteresis: flank.hysteresis.max(0.0), between: (low, high), samples })
}

/// Lens and camera on the bench.
struct Stand<'a> {
    lens: &'a mut dyn Lens,
    view: &'a mut View,
    plan: Plan,
}

impl Stand<'_> {
    /// Sharpness over focal power, up and down, and its steepest side.
    fn flank(&mut self) -> Result<Flank, BenchError> {
        let powers: Vec<f64> = (0..self.plan.stops.max(3)).map(f64::from).collect();
        let last = powers.last().copied().unwrap_or(1.0);
        let powers: Vec<f64> = powers.into_iter().map(|stop| stop / last).collect();
        self.at_rest(0.0)?;
        let up = powers.iter().map(|&power| self.at_rest(power)).collect::<Result<Vec<_>, _>>()?;
        let down = powers.iter().rev().map(|&power| self.at_rest(power)).collect::<Result<Vec<_>, _>>()?;
        Flank::find(&powers, &up, &down.into_iter().rev().collect::<Vec<_>>())
    }

    /// Sends the lens to `power`, leaves it alone, and tells the sharpness.
    fn at_rest(&mut self, power: f64) -> Result<f64, BenchError> {
        self.lens.set(FocalPower::nearest(power))?;
        let rested = self.view.now() + self.plan.watch;
        self.view.mean(rested, FRAMES_AT_REST)
    }

    /// One step, commanded `phase` of a frame's time after a frame came; adds what was seen to `samples`.
    fn step(
        &mut self,
        (from, to): (f64, f64),
        phase: f64,
        flank: &Flank,
        pause: &dyn Fn(Duration),
        samples: &mut Vec<Sample>,
    ) -> Result<(), BenchError> {
        let start = flank.focal_power(self.at_rest(from)?);
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

    /// Frames exposed within the time to watch after `commanded`: seconds after it, and the focal power seen.
    fn watch(&mut self, commanded: Moment, flank: &Flank) -> Result<Vec<(f64, f64)>, BenchError> {
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
