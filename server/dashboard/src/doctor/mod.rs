//! Checks whether a machine is ready for a trial: what is well, what could be better, and what must be fixed first,
//! with advice on how.

mod calibration;
mod certificate;
mod database;
mod devices;
mod finding;
mod folder;
mod network;
mod system;
mod tablet;

use std::path::Path;

pub use calibration::{calibration, unreadable_calibration};
pub use certificate::certificate;
pub use database::database;
pub use devices::{camera_in_use, lens, lens_in_use};
pub use finding::{Finding, Verdict};
pub use folder::LEAST_ROOM;
pub use network::outward;
pub use tablet::{Tablet, TabletPart, TriedTablet, tablets, tried};

use parfocal_base::clock::Clock;

/// Checks everything except the database and the devices: the folder `data` and its disk, clock, network and rights.
/// `local`: a server that no other machine can connect to asks.
pub fn machine(data: &Path, clock: &dyn Clock, local: bool) -> Vec<Finding> {
    let mut findings = vec![folder::disk(data), folder::access(data)];
    findings.push(system::clock(clock));
    findings.push(if local { network::this_machine_alone() } else { network::addresses() });
    findings.extend(network::camera_links());
    findings.push(system::real_time());
    findings.push(system::memory());
    findings.push(system::videos());
    findings
}
