//! The options of `parfocal serve` for OpenIGTLink.

use std::io::ErrorKind;
use std::net::{Ipv4Addr, SocketAddr};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use tokio::net::TcpListener;

use parfocal_imaging::Size;
use parfocal_pipeline::openigtlink::LinkSettings;

/// OpenIGTLink.
#[derive(Debug, Args)]
pub struct Navigation {
    /// Give the live picture to 3D Slicer and other programs by OpenIGTLink, at this address or, with a port alone, to
    /// this machine. Whoever reaches the address sees the picture: there is no key and no encryption.
    #[arg(long, value_name = "ADDR", value_parser = address)]
    openigtlink: Option<SocketAddr>,
    /// Size of these pictures: one pixel per mosaic cell, or two by two.
    #[arg(long, value_name = "SIZE", default_value = "cell", requires = "openigtlink", value_parser = sizes())]
    openigtlink_size: Size,
    /// Most of these pictures a second.
    #[arg(
        long, value_name = "N", default_value_t = 10, requires = "openigtlink",
        value_parser = clap::value_parser!(u32).range(1..=100)
    )]
    openigtlink_rate: u32,
}

/// The sizes that a stream has the bandwidth for.
fn sizes() -> impl TypedValueParser<Value = Size> {
    PossibleValuesParser::new(["cell", "half"]).map(|name| if name == "half" { Size::Half } else { Size::Cell })
}

/// `HOST:PORT`, or a port of this machine alone.
fn address(text: &str) -> Result<SocketAddr, String> {
    match text.parse::<u16>() {
        Ok(port) => Ok(SocketAddr::from((Ipv4Addr::LOCALHOST, port))),
        Err(_) => {
            text.parse().map_err(|_| "give a port such as 18944, or an address such as 127.0.0.1:18944".to_owned())
        }
    }
}

impl Navigation {
    /// What clients get.
    pub fn settings(&self) -> LinkSettings {
        LinkSettings { size: self.openigtlink_size, rate: self.openigtlink_rate }
    }

    /// Takes the port; `None` without OpenIGTLink.
    ///
    /// # Errors
    /// If the port cannot be had.
    pub async fn listen(&self) -> Result<Option<TcpListener>, String> {
        let Some(address) = self.openigtlink else { return Ok(None) };
        let listener = TcpListener::bind(address).await.map_err(|error| match error.kind() {
            ErrorKind::AddrInUse => {
                format!("{address} is in use by another program; choose another port with --openigtlink")
            }
            _ => format!("cannot listen on {address} for OpenIGTLink: {error}; choose another with --openigtlink"),
        })?;
        Ok(Some(listener))
    }
}
