//! The exchange before the first command: identification, temperature limits, focal power mode.

use std::path::Path;

use super::codec::{self, DeviceError, Limits, WireError};
use super::link::{Link, LinkError};
use super::range::{Range, Scale};
use super::shared::Device;
use super::status::{FOCAL_POWER_MODE, Status, mode_name};
use crate::lens::LensError;

/// How to use the lens.
#[derive(Debug, Clone, PartialEq)]
pub struct DriverSettings {
    /// Least dioptres to use; `None` for the device's own limit.
    pub min_dioptre: Option<f64>,
    /// Most dioptres to use; `None` for the device's own limit.
    pub max_dioptre: Option<f64>,
    /// Lens temperatures, in °C, between which focal power must be held. A wider span narrows the
    /// dioptre range.
    pub temperatures: (f64, f64),
    /// Whether the lens keeps its state when opened, and its focal power when dropped. Otherwise it is left without
    /// current before and after use.
    pub keep: bool,
}

impl Default for DriverSettings {
    /// The whole range of dioptres; temperatures from a room's to that of a lens warmed by its own coil.
    fn default() -> Self {
        Self { min_dioptre: None, max_dioptre: None, temperatures: (20.0, 40.0), keep: false }
    }
}

impl DriverSettings {
    /// Checks that each range has its lower end below its upper end.
    pub(super) fn check(&self) -> Result<(), LensError> {
        let (low, high) = self.temperatures;
        if low >= high {
            return Err(LensError::BadSpec(format!(
                "the lowest temperature must be below the highest, but low is {low} °C and high is {high} °C"
            )));
        }

        match (self.min_dioptre, self.max_dioptre) {
            (Some(min), Some(max)) if min >= max => Err(LensError::BadSpec(format!(
                "the least dioptres must be below the most, but min is {min} dpt and max is {max} dpt"
            ))),
            _ => Ok(()),
        }
    }
}

/// Prepares the device behind `link` for commands.
pub fn perform(link: &mut Link, settings: &DriverSettings, path: &Path) -> Result<Device, LensError> {
    greet(link, path)?;
    if !settings.keep && !link.is_known() {
        let_go_first(link)?;
    }

    let letter = link.ask(codec::FIRMWARE_TYPE)?;
    let (major, minor, build, revision) = link.ask(codec::FIRMWARE_VERSION)?;
    let serial = link.ask(codec::SERIAL)?;

    let status = link.ask(codec::STATUS)?;
    check_lens(Status(status))?;

    let limits = control_focal_power(link, settings)?;
    let scale = Scale::of_firmware(letter);
    let range = Range::new(scale, limits, settings.min_dioptre, settings.max_dioptre)?;

    let mode = link.ask(codec::MODE)?;
    if mode != FOCAL_POWER_MODE {
        let mode = mode_name(mode);
        return Err(LensError::Refused(format!("it stays in {mode} mode instead of focal power mode")));
    }

    let status = link.ask(codec::STATUS)?;
    let sixteenths = link.ask(codec::TEMPERATURE)?;
    let read_back = link.ask(codec::FOCAL_POWER)?;

    Ok(Device {
        firmware: format!("type {}, version {major}.{minor}.{build}.{revision}", char::from(letter)),
        serial: String::from_utf8_lossy(&serial).trim_matches(['\0', ' ']).to_owned(),
        range,
        mode,
        status: Status(status),
        temperature: f64::from(sixteenths) / 16.0,
        read_back,
    })
}

fn greet(link: &mut Link, path: &Path) -> Result<(), LensError> {
    match link.greet() {
        Ok(true) => Ok(()),
        Ok(false) if link.is_known() => Err(LensError::Gone("its replies are unreadable: check its USB cable".into())),
        Ok(false) => Err(LensError::Refused(format!(
            "{} answers, but not as an Optotune Lens Driver 4: is this the right port?",
            path.display()
        ))),
        Err(LinkError::Silent) => Err(LensError::Gone(format!(
            "nothing answers at {}: is it an Optotune Lens Driver 4, and is it powered?",
            path.display()
        ))),
        Err(error) => Err(error.into()),
    }
}

/// Removes the lens's current first, because a process that was killed may have left it under current. The driver's
/// answer does not matter: if the driver cannot be used, the next steps find out why.
fn let_go_first(link: &mut Link) -> Result<(), LensError> {
    match link.relax() {
        Err(error @ (LinkError::Stopped | LinkError::Port(_))) => Err(error.into()),
        Err(error) => {
            tracing::debug!(%error, "could not confirm that the lens was without current before set-up");
            Ok(())
        }
        Ok(()) => Ok(()),
    }
}

/// Sets the temperature limits, without which the driver refuses focal power mode, and then that mode. Returns the
/// range of focal power from the last reply.
fn control_focal_power(link: &mut Link, settings: &DriverSettings) -> Result<Limits, LensError> {
    let (low, high) = settings.temperatures;
    let limits = codec::temperature_limits(sixteenths(high), sixteenths(low));
    link.ask(limits).map_err(explain_incompatible)?;
    link.ask(codec::FOCAL_POWER_MODE).map_err(explain_incompatible)
}

fn explain_incompatible(error: LinkError) -> LensError {
    match error {
        LinkError::Wire(WireError::Device(DeviceError::LensIncompatible)) => {
            LensError::Refused("the lens has no focal power calibration: plug in one with a memory".into())
        }
        other => other.into(),
    }
}

fn check_lens(status: Status) -> Result<(), LensError> {
    if status.without_lens() {
        let words = status.words().join("; ");
        return Err(LensError::Gone(format!("the driver is there, but {words}: check the lens's cable")));
    }
    Ok(())
}

fn sixteenths(celsius: f64) -> i16 {
    (celsius * 16.0).round().clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16
}
