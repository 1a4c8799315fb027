//! Checks camera and lens. Those of a running server are checked by what it already knows: a device that the control
//! loop holds is never asked.

use super::finding::Finding;
use parfocal_devices::camera::CameraHealth;
use parfocal_devices::lens::{LensError, LensHealth, LensInfo};

const CAMERA: &str = "camera";
const LENS: &str = "lens";

/// Checks the camera. For a GigE camera, its message includes the size of the packets.
pub fn camera_in_use(health: &CameraHealth) -> Finding {
    let found = named(&health.name, &health.message);
    if !health.working {
        return Finding::wrong(CAMERA, found, "Check its cable and power. The server looks for it by itself.");
    }
    if health.simulated {
        return Finding::advice(CAMERA, found, "For a real picture, start the server with --camera gige:ID.");
    }
    if health.lost > 0 {
        let found = format!("{found} Frames lost since the start: {}.", health.lost);
        return Finding::advice(CAMERA, found, "If the number rises, follow docs/bench.md, \"The camera\".");
    }
    Finding::well(CAMERA, found)
}

/// Checks the lens.
pub fn lens_in_use(health: &LensHealth) -> Finding {
    let found = named(&health.name, &health.message);
    if !health.working {
        return Finding::wrong(LENS, found, "Check its cable and power. The server looks for it by itself.");
    }
    if health.caution {
        return Finding::advice(LENS, found, "Follow docs/bench.md, \"The lens\".");
    }
    if health.simulated {
        return Finding::advice(LENS, found, "For real glass, start the server with --lens optotune:auto.");
    }
    match &health.info {
        Some(info) => described(info),
        None => Finding::well(LENS, found),
    }
}

/// Checks a lens that no server uses; `asked` is what it reported about itself, or why it did not answer.
pub fn lens(asked: Result<LensInfo, LensError>) -> Finding {
    match asked {
        Ok(info) => described(&info),
        Err(error) => {
            let found = format!("No lens can be used: {error}.");
            Finding::wrong(LENS, found, "Check its cable and power, and that no server uses it now.")
        }
    }
}

/// Checks a lens by what it reported about itself.
fn described(info: &LensInfo) -> Finding {
    let LensInfo { driver, firmware, serial, min_dioptre, max_dioptre, status, .. } = info;
    let found =
        format!("{driver}, firmware {firmware}, serial number {serial}: {min_dioptre:.1} to {max_dioptre:.1} dpt.");

    if status.is_empty() {
        return Finding::well(LENS, found);
    }
    Finding::wrong(LENS, format!("{found} It reports: {}.", status.join("; ")), "Follow docs/bench.md, \"The lens\".")
}

/// A device's name and message as one sentence.
fn named(name: &str, message: &str) -> String {
    let end = if message.ends_with('.') { "" } else { "." };
    format!("{name}: {message}{end}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    fn lens_health(working: bool, caution: bool, simulated: bool) -> LensHealth {
        let message = "as it should".into();
        LensHealth { name: "a lens".into(), simulated, working, caution, message, line_errors: 0, info: None }
    }

    fn camera_health(working: bool, lost: u64) -> CameraHealth {
        let message = "2048x1088 Mono10, packets of 8996 bytes".into();
        CameraHealth { name: "a camera".into(), simulated: false, working, message, fps: 50.0, lost }
    }

    #[test]
    fn an_absent_device_is_wrong_and_a_simulated_one_is_reported() {
        assert_eq!(lens_in_use(&lens_health(false, false, false)).verdict, Verdict::Wrong);
        assert_eq!(lens_in_use(&lens_health(true, true, false)).verdict, Verdict::Advice);
        assert_eq!(lens_in_use(&lens_health(true, false, true)).verdict, Verdict::Advice);
        assert_eq!(lens_in_use(&lens_health(true, false, false)).verdict, Verdict::Well);

        assert_eq!(camera_in_use(&camera_health(false, 0)).verdict, Verdict::Wrong);
        assert_eq!(camera_in_use(&camera_health(true, 3)).verdict, Verdict::Advice);
        let well = camera_in_use(&camera_health(true, 0));
        assert_eq!((well.verdict, well.found.contains("packets of 8996 bytes.")), (Verdict::Well, true));
    }
}
