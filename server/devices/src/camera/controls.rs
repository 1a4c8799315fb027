//! The settings that an operator may change on a running camera: exposure, gain, frame rate.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::LEAST_FPS;

/// Longest exposure with which a camera still makes [`LEAST_FPS`], microseconds.
const LONGEST_EXPOSURE: f64 = 1e6 / LEAST_FPS as f64;

/// A setting of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Setting {
    /// Exposure time, microseconds.
    Exposure,
    /// Gain, in the camera's own units, usually decibel.
    Gain,
    /// Frames a second.
    FrameRate,
}

impl Setting {
    /// Every setting.
    pub const ALL: [Self; 3] = [Self::Exposure, Self::Gain, Self::FrameRate];

    /// Its name, as in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exposure => "exposure",
            Self::Gain => "gain",
            Self::FrameRate => "frame-rate",
        }
    }

    /// Name at the start of a sentence.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Exposure => "Exposure",
            Self::Gain => "Gain",
            Self::FrameRate => "Frame rate",
        }
    }
}

/// A setting's value and the bounds that the camera gives for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Adjustable {
    /// The setting.
    pub setting: Setting,
    /// Its present value.
    pub value: f64,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
}

/// What can be changed, and whether the last change failed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct CameraOffer {
    /// Every setting that the camera offers now.
    pub settings: Vec<Adjustable>,
    /// Why the camera did not make the last change, if it did not.
    pub trouble: Option<String>,
}

impl CameraOffer {
    /// The settings' values by their names, as JSON has them.
    pub fn by_name(&self) -> BTreeMap<String, f64> {
        self.settings.iter().map(|one| (one.setting.name().to_owned(), one.value)).collect()
    }

    /// Time between two frames, if the camera tells its rate: no less than an exposure takes, and no more than at
    /// [`LEAST_FPS`].
    pub fn frame_period(&self) -> Option<Duration> {
        let value = |setting| self.settings.iter().find(|one| one.setting == setting).map(|one| one.value);
        let by_rate = 1e6 / value(Setting::FrameRate).filter(|rate| *rate > 0.0)?;
        let exposure = value(Setting::Exposure).unwrap_or(0.0);
        let micros = [by_rate, exposure].into_iter().fold(0.0, f64::max).min(LONGEST_EXPOSURE);
        Some(Duration::from_secs_f64(micros / 1e6))
    }
}

/// A camera's settings, shared between the operator and the camera's thread. Clone freely; never blocks.
#[derive(Debug, Clone, Default)]
pub struct Controls(Arc<Mutex<Inner>>);

#[derive(Debug, Default)]
struct Inner {
    offer: CameraOffer,
    wanted: Vec<(Setting, f64)>,
}

/// Why a setting cannot be changed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ControlError {
    /// The camera is away, or does not have this setting.
    #[error("the camera does not offer this setting now")]
    NotOffered,
    /// The value lies outside the camera's bounds.
    #[error("must be from {min} to {max}")]
    OutOfBounds {
        /// Least value.
        min: f64,
        /// Greatest value.
        max: f64,
    },
}

impl Controls {
    /// The settings that the camera offers now.
    pub fn offered(&self) -> CameraOffer {
        self.inner().offer.clone()
    }

    /// Asks for `setting` to be set to `value`. The camera's thread does this before the next frame.
    ///
    /// # Errors
    /// If the camera does not offer the setting, or `value` is outside its bounds.
    pub fn ask(&self, setting: Setting, value: f64) -> Result<(), ControlError> {
        let mut inner = self.inner();
        let offered = inner.offer.settings.iter().find(|one| one.setting == setting);
        let &Adjustable { min, max, .. } = offered.ok_or(ControlError::NotOffered)?;
        if !(min..=max).contains(&value) {
            return Err(ControlError::OutOfBounds { min, max });
        }

        inner.offer.trouble = None;
        inner.wanted.retain(|(other, _)| *other != setting);
        inner.wanted.push((setting, value));
        Ok(())
    }

    /// For the camera: sets what it offers now. Frame rates below [`LEAST_FPS`] are left out, and so are exposures that
    /// leave no time for as many frames: the control loop would take such a camera for one that fails.
    pub fn offer(&self, mut available: Vec<Adjustable>) {
        for one in &mut available {
            match one.setting {
                Setting::FrameRate => one.min = one.min.max(LEAST_FPS.into()).min(one.max),
                Setting::Exposure => one.max = one.max.min(LONGEST_EXPOSURE).max(one.min),
                Setting::Gain => {}
            }
        }
        self.inner().offer.settings = available;
    }

    /// For the camera: notes that it did not change `setting`, and `why`.
    pub fn refuse(&self, setting: Setting, why: &str) {
        self.inner().offer.trouble = Some(format!("{} was not changed: the camera says: {why}", setting.label()));
    }

    /// For the camera: takes the changes that were asked for, one per setting.
    pub fn take(&self) -> Vec<(Setting, f64)> {
        std::mem::take(&mut self.inner().wanted)
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_offered_can_be_asked_and_the_last_word_counts() {
        let controls = Controls::default();
        assert_eq!(controls.ask(Setting::Gain, 1.0), Err(ControlError::NotOffered));
        controls.offer(vec![Adjustable { setting: Setting::Gain, value: 0.0, min: 0.0, max: 24.0 }]);
        assert_eq!(controls.ask(Setting::Gain, 25.0), Err(ControlError::OutOfBounds { min: 0.0, max: 24.0 }));
        assert!(controls.ask(Setting::Gain, f64::NAN).is_err());
        controls.ask(Setting::Gain, 3.0).unwrap();
        controls.ask(Setting::Gain, 6.0).unwrap();
        assert_eq!(controls.take(), [(Setting::Gain, 6.0)]);
        assert!(controls.take().is_empty());
        controls.refuse(Setting::Gain, "busy");
        assert_eq!(controls.offered().trouble.unwrap(), "Gain was not changed: the camera says: busy");
        controls.ask(Setting::Gain, 2.0).unwrap();
        assert_eq!(controls.offered().trouble, None, "trouble is reported for the last change alone");
    }

    #[test]
    fn a_frame_rate_too_low_for_the_control_loop_cannot_be_asked() {
        let controls = Controls::default();
        for (min, max, offered) in [(1.0, 120.0, (5.0, 120.0)), (10.0, 60.0, (10.0, 60.0)), (0.5, 3.0, (3.0, 3.0))] {
            controls.offer(vec![Adjustable { setting: Setting::FrameRate, value: max, min, max }]);
            let [rate] = controls.offered().settings[..] else { panic!("the frame rate is offered") };
            assert_eq!((rate.min, rate.max), offered);
        }

        controls.offer(vec![Adjustable { setting: Setting::FrameRate, value: 50.0, min: 1.0, max: 120.0 }]);
        assert!(controls.ask(Setting::FrameRate, 4.0).is_err());
        assert_eq!(controls.ask(Setting::FrameRate, 5.0), Ok(()));
    }

    #[test]
    fn an_exposure_too_long_for_the_control_loop_cannot_be_asked() {
        let controls = Controls::default();
        for (min, max, offered) in [(10.0, 1e6, 200_000.0), (10.0, 30_000.0, 30_000.0), (3e5, 1e6, 3e5)] {
            controls.offer(vec![Adjustable { setting: Setting::Exposure, value: min, min, max }]);
            let [exposure] = controls.offered().settings[..] else { panic!("the exposure is offered") };
            assert_eq!((exposure.min, exposure.max), (min, offered));
        }

        controls.offer(vec![Adjustable { setting: Setting::Exposure, value: 8000.0, min: 10.0, max: 1e6 }]);
        assert!(controls.ask(Setting::Exposure, 200_001.0).is_err());
        assert_eq!(controls.ask(Setting::Exposure, 200_000.0), Ok(()));
    }

    #[test]
    fn frames_come_as_fast_as_rate_and_exposure_allow() {
        let period = |rate: f64, micros: f64| {
            let of = |setting, value| Adjustable { setting, value, min: 0.0, max: 1e9 };
            let settings = vec![of(Setting::FrameRate, rate), of(Setting::Exposure, micros)];
            CameraOffer { settings, trouble: None }.frame_period().map(|period| period.as_millis())
        };
        assert_eq!(
            [period(50.0, 8000.0), period(50.0, 40_000.0), period(50.0, f64::NAN)],
            [Some(20), Some(40), Some(20)]
        );
        assert_eq!([period(2.0, 8000.0), period(50.0, 1e6)], [Some(200); 2]);
        for unknown in [0.0, -1.0, f64::NAN] {
            assert_eq!(period(unknown, 8000.0), None, "{unknown}");
        }
        assert_eq!(CameraOffer::default().frame_period(), None);
    }
}
