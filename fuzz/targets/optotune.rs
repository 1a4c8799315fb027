//! Any bytes from a lens driver's line are a reply, an error or too few; and a reply stays what it
//! is, whatever follows.

#![no_main]

use libfuzzer_sys::fuzz_target;
use parfocal::lens::optotune::codec::{Request, error_reply};

const REQUESTS: [Request; 14] = [
    Request::FirmwareType,
    Request::FirmwareVersion,
    Request::Serial,
    Request::MaxCurrent,
    Request::SetCurrent(0),
    Request::Current,
    Request::CurrentMode,
    Request::FocalPowerMode,
    Request::Mode,
    Request::TemperatureLimits { high: 640, low: 320 },
    Request::SetFocalPower(0),
    Request::FocalPower,
    Request::Temperature,
    Request::Status,
];

fuzz_target!(|bytes: &[u8]| {
    let _ = error_reply(bytes);
    for request in REQUESTS {
        let mut reply = None;
        // As it comes: byte by byte.
        for received in 0..=bytes.len() {
            let now = request.reply(&bytes[..received]).ok().flatten();
            assert!(reply.is_none() || reply == now, "{request:?} was answered {reply:?} and then {now:?}");
            reply = now;
        }
    }
});
