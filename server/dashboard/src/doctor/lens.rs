//! Checks a lens by what it reports about itself.

use super::finding::Finding;
use parfocal_devices::lens::{LensError, LensInfo};

const LENS: &str = "lens";

/// Checks a lens; `asked` is what it reported about itself, or why it did not answer.
#[must_use]
pub fn lens(asked: Result<LensInfo, LensError>) -> Finding {
    let info = match asked {
        Ok(info) => info,
        Err(error) => {
            let found = format!("No lens can be used: {error}.");
            return Finding::wrong(LENS, found, "Check its cable and power, and that no server uses it now.");
        }
    };

    let LensInfo { driver, firmware, serial, min_dioptre, max_dioptre, .. } = &info;
    let found =
        format!("{driver}, firmware {firmware}, serial number {serial}: {min_dioptre:.1} to {max_dioptre:.1} dpt.");

    if info.status.is_empty() {
        return Finding::well(LENS, found);
    }
    Finding::wrong(LENS, format!("{found} It reports: {}.", info.status.join("; ")), "Follow docs/bench.md, \"Lens\".")
}
