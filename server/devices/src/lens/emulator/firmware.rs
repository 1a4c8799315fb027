//! The emulated driver's firmware: bytes in, bytes out.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use super::unit::{Fault, Glitch, LENS_DIOPTRES, Model};
use super::wire::{REQUESTS, checksum_of, framed};
use crate::lens::Response;
use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;

/// Span of the temperature limits, in °C, up to which the lens holds its whole range. A wider span narrows the range at
/// both ends.
const FULL_RANGE_SPAN: f64 = 20.0;
/// Dioptres lost at each end for each further degree.
const NARROWING: f64 = 0.02;
const IMAX_HUNDREDTHS: u16 = 29_284;
/// An incomplete request is dropped if the next byte does not come within this time.
const PATIENCE: Duration = Duration::from_millis(50);
/// Focal power commands remembered for inspection.
const REMEMBERED: usize = 8192;
/// Additional delay of a [`Glitch::Late`] reply: longer than the driver waits.
const LATE: Duration = Duration::from_millis(200);
/// Bytes that [`Glitch::Noise`] puts before a reply.
const NOISE: [u8; 3] = [0xFF, 0x00, 0x7E];

/// A reply on its way.
#[derive(Debug)]
pub struct Reply {
    /// The bytes to send.
    pub bytes: Vec<u8>,
    /// Delay before they are sent.
    pub takes: Duration,
}

/// An order that the driver received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LensCommand {
    /// Control by current.
    CurrentMode,
    /// Go to a current, in counts.
    Current(i16),
    /// Control by focal power.
    FocalPowerMode,
    /// Go to a focal power, in the driver's units.
    FocalPower(i16),
}

/// The firmware of a driver, with its lens.
pub struct Firmware {
    /// Properties of the unit.
    pub model: Model,
    /// The current fault.
    pub fault: Fault,
    /// Temperature of the lens, °C.
    pub temperature: f64,
    /// Whether a lens is plugged into the driver.
    pub lens_present: bool,
    /// Focal power commands carried out, in the driver's units, each with the time it was read.
    pub commands: VecDeque<(Moment, i16)>,
    /// Every order that the driver received, carried out or not.
    pub orders: VecDeque<LensCommand>,
    /// Number of whole requests that have arrived.
    pub requests: u64,
    /// Glitches of the next replies, in order; `None` for a good reply.
    pub glitches: VecDeque<Option<Glitch>>,
    /// Number of replies made under [`Fault::NoisyLine`].
    noisy_replies: usize,
    glass: Arc<Response>,
    mode: u8,
    /// Temperature limits in 1/16 °C: upper, lower.
    limits: Option<(i16, i16)>,
    focal_power: i16,
    unreachable: bool,
    current: i16,
    buffer: Vec<u8>,
    last_byte: Moment,
}

impl Firmware {
    /// A unit that has just been switched on.
    pub fn new(model: Model) -> Self {
        Self {
            glass: Arc::new(Response::new(model.glass, model.play, FocalPower::MIN)),
            model,
            fault: Fault::None,
            temperature: 25.5,
            lens_present: true,
            commands: VecDeque::new(),
            orders: VecDeque::new(),
            requests: 0,
            glitches: VecDeque::new(),
            noisy_replies: 0,
            mode: 1,
            limits: None,
            focal_power: 0,
            unreachable: false,
            current: 0,
            buffer: Vec::new(),
            last_byte: Moment::default(),
        }
    }

    /// Loses everything that is not in permanent memory: mode, limits, focal power.
    pub fn power_cycle(&mut self, now: Moment) {
        self.mode = 1;
        self.limits = None;
        self.focal_power = 0;
        self.current = 0;
        self.unreachable = false;
        self.buffer.clear();
        self.glass.command(now, FocalPower::MIN);
    }

    /// The true focal power; 0..=1 is the whole range of the lens.
    pub fn glass(&self) -> Arc<Response> {
        self.glass.clone()
    }

    /// Mode of control, and the current, in counts.
    pub const fn mode_and_current(&self) -> (u8, i16) {
        (self.mode, self.current)
    }

    /// The driver's answers to `bytes`, one per request.
    pub fn receive(&mut self, bytes: &[u8], now: Moment) -> Vec<Reply> {
        if now.since(self.last_byte) > PATIENCE {
            self.buffer.clear();
        }

        self.last_byte = now;
        self.buffer.extend(bytes);

        let mut answers = Vec::new();

        match self.fault {
            Fault::Silent => self.buffer.clear(),
            Fault::Stranger => {
                self.buffer.clear();
                answers.push(Reply { bytes: b"ok T:21.4 B:60.0\r\n".to_vec(), takes: self.model.latency });
            }
            _ => {
                while let Some(answer) = self.next(now) {
                    self.requests += 1;
                    if !answer.is_empty() {
                        answers.push(self.sent(answer));
                    }
                }
            }
        }

        answers
    }

    /// The answer to the first request in the buffer, empty if it gets none; `None` while the request is incomplete.
    fn next(&mut self, now: Moment) -> Option<Vec<u8>> {
        if self.buffer.is_empty() {
            return None;
        }
        if self.buffer.starts_with(b"Start") {
            self.buffer.drain(..5);
            return Some(b"Ready\r\n".to_vec());
        }

        let Some(&(name, values)) = REQUESTS.iter().find(|(name, _)| self.buffer.starts_with(name)) else {
            let mut names = REQUESTS.iter().map(|(name, _)| *name).chain([&b"Start"[..]]);
            if names.any(|name| name.starts_with(&self.buffer)) {
                return None;
            }
            self.buffer.clear();
            return Some(self.error(3));
        };

        let length = name.len() + values;
        if self.buffer.len() < length + 2 {
            return None;
        }

        let request: Vec<u8> = self.buffer.drain(..length + 2).collect();
        let (payload, checksum) = request.split_at(length);
        if checksum != checksum_of(payload) {
            return Some(if self.model.old { b"N\r\n".to_vec() } else { self.error(1) });
        }

        if self.fault == Fault::Errors {
            return Some(self.error(3));
        }

        Some(self.answer(name, payload.get(name.len()..).unwrap_or_default(), now))
    }

    fn remember(&mut self, order: LensCommand) {
        if self.orders.len() == REMEMBERED {
            self.orders.pop_front();
        }
        self.orders.push_back(order);
    }

    fn answer(&mut self, name: &[u8], values: &[u8], now: Moment) -> Vec<u8> {
        let value = |index: usize| match values.get(2 * index..2 * index + 2) {
            Some(&[high, low]) => i16::from_be_bytes([high, low]),
            _ => 0,
        };

        let order = match name {
            b"Aw" => Some(LensCommand::Current(value(0))),
            b"MwDA" => Some(LensCommand::CurrentMode),
            b"MwCA" => Some(LensCommand::FocalPowerMode),
            b"PwDA" => Some(LensCommand::FocalPower(value(0))),
            _ => None,
        };
        if let Some(order) = order {
            self.remember(order);
        }

        match name {
            b"H" => framed(&[b'H', self.model.firmware]),
            b"V" => framed(&[b'V', 1, 8, 0, 3, 0, 1]),
            b"X" => framed(&[&b"X"[..], &self.model.serial].concat()),
            b"CrMA" => framed(&[&b"CMA"[..], &IMAX_HUNDREDTHS.to_be_bytes()].concat()),
            b"Aw" => self.set_current(value(0), now),
            b"Ar" => framed(&[&b"A"[..], &self.current.to_be_bytes()].concat()),
            b"MwDA" => {
                self.mode = 1;
                framed(b"MDA")
            }
            b"MwCA" => self.enter_focal_power_mode(),
            b"MMA" => framed(&[b'M', b'M', b'A', self.mode]),
            b"PwTA" => self.set_limits(value(0), value(1)),
            b"PwDA" => self.set_focal_power(value(0), now),
            b"PrDA" => framed(&[&b"PD"[..], &self.focal_power.to_be_bytes()].concat()),
            b"TCA" => framed(&[&b"TCA"[..], &sixteenths(self.temperature).to_be_bytes()].concat()),
            b"Sr" => framed(&[b'S', 0, 0, 0, self.status()]),
            _ => Vec::new(),
        }
    }

    fn set_limits(&mut self, high: i16, low: i16) -> Vec<u8> {
        if !self.lens_present {
            return self.error(4);
        }
        self.limits = (high > low).then_some((high, low));
        self.limits_reply(b"PT")
    }

    fn enter_focal_power_mode(&mut self) -> Vec<u8> {
        if !self.lens_present {
            return self.error(4);
        }
        if self.limits.is_some() {
            self.mode = 5;
        }
        self.limits_reply(b"MCA")
    }

    fn limits_reply(&self, name: &[u8]) -> Vec<u8> {
        let (min, max) = self.range();
        framed(&[name, &[self.status()], &max.to_be_bytes(), &min.to_be_bytes()].concat())
    }

    /// Least and greatest focal power within the temperature limits, in the driver's units; zeros without limits.
    fn range(&self) -> (i16, i16) {
        let Some((high, low)) = self.limits else { return (0, 0) };
        let span = (f64::from(high) - f64::from(low)) / 16.0;
        let lost = (span - FULL_RANGE_SPAN).max(0.0) * NARROWING;
        (self.units(LENS_DIOPTRES.0 + lost), self.units(LENS_DIOPTRES.1 - lost))
    }

    fn units(&self, dioptre: f64) -> i16 {
        let offset = if self.model.firmware == b'A' { 5.0 } else { 0.0 };
        ((dioptre + offset) * 200.0).round() as i16
    }

    fn set_focal_power(&mut self, wanted: i16, now: Moment) -> Vec<u8> {
        if self.mode == 5 && self.fault != Fault::DropsCommands {
            let (min, max) = self.range();
            self.focal_power = wanted.clamp(min.min(max), max);
            self.unreachable = self.focal_power != wanted;

            let least = self.units(LENS_DIOPTRES.0);
            let most = self.units(LENS_DIOPTRES.1);
            let share = f64::from(self.focal_power - least) / f64::from(most - least);
            self.glass.command(now, FocalPower::nearest(share));

            if self.commands.len() == REMEMBERED {
                self.commands.pop_front();
            }
            self.commands.push_back((now, wanted));
        }
        Vec::new()
    }

    fn set_current(&mut self, counts: i16, now: Moment) -> Vec<u8> {
        if self.mode == 1 {
            self.current = counts.clamp(-4095, 4095);
            self.glass.command(now, FocalPower::nearest(f64::from(self.current) / 4095.0));
        }
        Vec::new()
    }

    fn status(&self) -> u8 {
        let celsius = self.temperature;
        let outside = |(high, low)| celsius > f64::from(high) / 16.0 || celsius < f64::from(low) / 16.0;
        u8::from(!self.lens_present)
            | u8::from(self.limits.is_none()) << 2
            | u8::from(self.unreachable) << 3
            | u8::from(!(-20.0..=65.0).contains(&celsius)) << 5
            | u8::from(self.limits.is_some_and(outside)) << 7
    }

    fn error(&self, number: u8) -> Vec<u8> {
        framed(&[b'E', if self.model.ascii_errors { b'0' + number } else { number }])
    }

    /// `answer` with the present fault and the next glitch applied.
    fn sent(&mut self, answer: Vec<u8>) -> Reply {
        let mut sent = Reply { bytes: self.damaged(answer), takes: self.model.latency };
        let glitch = self.glitches.pop_front().unwrap_or_else(|| self.noise_of_the_line());

        match glitch {
            Some(Glitch::Noise) => sent.bytes.splice(..0, NOISE).for_each(drop),
            Some(Glitch::Checksum) => spoil_checksum(&mut sent.bytes),
            Some(Glitch::Late) => sent.takes += LATE,
            None => {}
        }

        sent
    }

    /// The glitch of the next reply on a noisy line.
    fn noise_of_the_line(&mut self) -> Option<Glitch> {
        if self.fault != Fault::NoisyLine {
            return None;
        }
        self.noisy_replies += 1;
        let struck = self.noisy_replies.is_multiple_of(3);
        struck.then(|| Glitch::ALL[self.noisy_replies / 3 % Glitch::ALL.len()])
    }

    fn damaged(&self, mut answer: Vec<u8>) -> Vec<u8> {
        match self.fault {
            Fault::Garbage => answer.iter_mut().for_each(|byte| *byte = byte.wrapping_mul(31) ^ 0x5A),
            // The greeting has no checksum.
            Fault::WrongChecksum if answer != b"Ready\r\n" => spoil_checksum(&mut answer),
            Fault::WrongReadBack if answer.starts_with(b"PD") => spoil_checksum(&mut answer),
            _ => {}
        }

        answer
    }
}

fn spoil_checksum(answer: &mut [u8]) {
    if let Some(byte) = answer.len().checked_sub(3).and_then(|at| answer.get_mut(at)) {
        *byte ^= 0x40;
    }
}

fn sixteenths(celsius: f64) -> i16 {
    (celsius * 16.0).round() as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answers(firmware: &mut Firmware, request: &[u8]) -> Vec<u8> {
        let answers = firmware.receive(request, Moment::default());
        answers.into_iter().flat_map(|answer| answer.bytes).collect()
    }

    fn talk(firmware: &mut Firmware, request: &str) -> String {
        hex::encode_upper(answers(firmware, &hex::decode(request).unwrap()))
    }

    #[test]
    fn answers_the_published_requests_with_the_published_replies() {
        let mut firmware = Firmware::new(Model::default());
        assert_eq!(answers(&mut firmware, b"Start"), b"Ready\r\n");
        assert_eq!(talk(&mut firmware, "544341B0D0"), "544341019874660D0A", "25.5 °C");
        assert_eq!(talk(&mut firmware, "43724D4100007180"), "434D41726427FC0D0A", "292.84 mA");
        assert!(!talk(&mut firmware, "507754410280014033D0").is_empty(), "temperature limits");
        assert!(!talk(&mut firmware, "4D7743415676").is_empty(), "focal power mode");
        assert_eq!(talk(&mut firmware, "4D4D416577"), "4D4D410577280D0A", "mode 5");
        assert_eq!(talk(&mut firmware, "544341B0D1"), "4531F3440D0A", "wrong checksum");
        firmware.model.ascii_errors = false;
        assert_eq!(talk(&mut firmware, "544341B0D1"), "4501F3500D0A", "wrong checksum");
        firmware.model.old = true;
        assert_eq!(talk(&mut firmware, "544341B0D1"), "4E0D0A", "wrong checksum");
    }

    #[test]
    fn focal_power_needs_its_mode_and_the_mode_needs_limits() {
        let mut firmware = Firmware::new(Model::default());
        let ten_dioptres = "507744410BB80000B371";
        talk(&mut firmware, "4D7743415676");
        talk(&mut firmware, ten_dioptres);
        assert!(firmware.commands.is_empty());
        talk(&mut firmware, "507754410280014033D0");
        talk(&mut firmware, "4D7743415676");
        talk(&mut firmware, ten_dioptres);
        assert_eq!(firmware.commands, [(Moment::default(), 3000)]);
        assert!(talk(&mut firmware, "50724441000000006470").contains("0BB8"));
    }

    #[test]
    fn no_temperature_limits_are_too_far_apart_to_be_answered() {
        let mut firmware = Firmware::new(Model::default());
        let widest = [&b"PwTA"[..], &i16::MAX.to_be_bytes(), &i16::MIN.to_be_bytes()].concat();
        let request = [&widest[..], &checksum_of(&widest)].concat();
        // Over 4096 °C, 81.5 dpt are lost at each end: nothing is left between them.
        let answer = answers(&mut firmware, &request);
        let [.., max, _, min, _, _, _, _, _] = answer[..] else { panic!("{answer:?}") };
        assert!(max.cast_signed() < min.cast_signed(), "{answer:?}");
    }
}
