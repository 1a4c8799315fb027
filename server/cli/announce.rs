//! The announcement that `serve` prints when it is ready: each role's link, a QR code for the tablet, and a loud
//! warning about simulated devices.

use std::fmt::Write;
use std::net::SocketAddr;

use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;

use parfocal_dashboard::http::ServerAddress;
use parfocal_dashboard::http::error::role_name;
use parfocal_dashboard::http::keys::{Keys, ROLES};
use parfocal_imaging::Calibration;
use parfocal_pipeline::control::ControlStatus;
use parfocal_trial::role::Role;

/// The announcement of a server that is reachable at `address`, and by OpenIGTLink at `linked`. On a `terminal` the QR
/// code has colours.
pub fn announcement(
    address: &ServerAddress,
    keys: &Keys,
    status: &ControlStatus,
    calibration: &Calibration,
    linked: Option<SocketAddr>,
    terminal: bool,
) -> String {
    let host = address.host();
    let link = |role| address.link_by(&host, keys.of(role));
    let mut text = String::new();

    // Writing to a string cannot fail.
    let _ =
        writeln!(text, "parfocal {} with {} and {}", env!("CARGO_PKG_VERSION"), status.camera.name, status.lens.name);
    let _ = writeln!(text, "calibration: {}", calibration.title());

    if let Some(warning) = simulated(status) {
        let _ = writeln!(text, "\n*** {warning} ***");
    }

    for (device, working, message) in
        [("camera", status.camera.working, &status.camera.message), ("lens", status.lens.working, &status.lens.message)]
    {
        if !working {
            let _ = writeln!(text, "\n*** THE {} IS NOT THERE YET: {message} ***", device.to_uppercase());
        }
    }

    text.push('\n');
    for role in ROLES {
        let _ = writeln!(text, "{:>10}  {}", role_name(role), link(role));
    }

    if let Ok(code) = QrCode::new(link(Role::Surgeon)) {
        let _ = writeln!(text, "\nScan this with the surgeon's tablet:\n\n{}", drawn(&code, terminal));
    }

    text.push_str(
        "Each page opens only with its link. Anyone with a link has its role, so give each link only to its person.\n",
    );

    if let Some(address) = linked {
        let _ = writeln!(text, "OpenIGTLink: {address}. Whoever reaches that address sees the picture.");
    }

    let _ = writeln!(text, "{}\nCtrl-C stops the server.", advice(address));
    text
}

/// Advice about the connection to the server.
fn advice(address: &ServerAddress) -> String {
    let mut advice = Vec::new();
    if address.loopback_only() {
        advice.push("Only this machine can connect. For a tablet, start with --bind 0.0.0.0:8080 --tls.".to_owned());
    } else if !address.encrypted() {
        advice.push("The connection is not encrypted (--insecure): use a network that you trust.".to_owned());
    }

    if let (Some(page), Some(authority)) = (address.trust_page_by(&address.host()), address.authority()) {
        advice.push(format!("Each tablet and laptop must trust this server once. To do so, open {page} on it."));
        advice.push(format!("Compare the fingerprint (SHA-256) there: {}", authority.fingerprint));
    }
    advice.join("\n")
}

/// The QR code, black on white whatever colours the terminal uses.
fn drawn(code: &QrCode, terminal: bool) -> String {
    let picture = code.render::<Dense1x2>().build();
    if !terminal {
        return picture;
    }
    picture
        .split_inclusive('\n')
        .flat_map(|line| ["\x1b[38;5;16;48;5;231m", line.trim_end_matches('\n'), "\x1b[0m\n"])
        .collect()
}

fn simulated(status: &ControlStatus) -> Option<String> {
    let what = match (status.camera.simulated, status.lens.simulated) {
        (true, true) => "CAMERA AND LENS ARE",
        (true, false) => "THE CAMERA IS",
        (false, true) => "THE LENS IS",
        (false, false) => return None,
    };
    Some(format!("{what} SIMULATED: this is not a real instrument"))
}
