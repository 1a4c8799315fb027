//! The exchange before the first command: identification, temperature limits, focal power mode.

use std::path::Path;

use super::codec::{DeviceError, Limits, Reply, Request, WireError};
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

    let Reply::FirmwareType(letter) = link.ask(Request::FirmwareType)? else { return Err(confused()) };
    let version = match link.ask(Request::FirmwareVersion)? {
        Reply::FirmwareVersion(major, minor, build, revision) => format!("{major}.{minor}.{build}.{revision}"),
        _ => return Err(confused()),
    };
    let Reply::Serial(serial) = link.ask(Request::Serial)? else { return Err(confused()) };

    let Reply::Status(status) = link.ask(Request::Status)? else { return Err(confused()) };
    check_lens(Status(status))?;

    let limits = control_focal_power(link, settings)?;
    let scale = Scale::of_firmware(letter);
    let range = Range::new(scale, limits, settings.min_dioptre, settings.max_dioptre)?;

    let Reply::Mode(mode) = link.ask(Request::Mode)? else { return Err(confused()) };
    if mode != FOCAL_POWER_MODE {
        let mode = mode_name(mode);
        return Err(LensError::Refused(format!("it stays in {mode} mode instead of focal power mode")));
    }

    let Reply::Status(status) = link.ask(Request::Status)? else { return Err(confused()) };
    let Reply::Temperature(sixteenths) = link.ask(Request::Temperature)? else { return Err(confused()) };
    let Reply::FocalPower(read_back) = link.ask(Request::FocalPower)? else { return Err(confused()) };

    Ok(Device {
        firmware: format!("type {}, version {version}", char::from(letter)),
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
    let request = Request::TemperatureLimits { high: sixteenths(high), low: sixteenths(low) };
    let Reply::TemperatureLimits(_) = link.ask(request).map_err(explain_incompatible)? else { return Err(confused()) };

    match link.ask(Request::FocalPowerMode).map_err(explain_incompatible)? {
        Reply::FocalPowerMode(limits) => Ok(limits),
        _ => Err(confused()),
    }
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

fn confused() -> LensError {
    LensError::Refused("its reply does not match the request".into())
}

fn sixteenths(celsius: f64) -> i16 {
    (celsius * 16.0).round().clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16
}
