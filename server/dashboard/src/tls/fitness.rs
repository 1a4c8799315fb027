//! Whether a given certificate can be a server's: its key, its purpose, and the order of its chain.

use tokio_rustls::rustls::pki_types::CertificateDer;
use x509_parser::prelude::{FromDer, X509Certificate};
use x509_parser::public_key::PublicKey;

/// Lengths of RSA keys, in bits, with which the server can sign.
const RSA_BITS: std::ops::RangeInclusive<usize> = 2048..=8192;

/// Curves by their object identifiers (RFC 5480, 2.1.1.1): the name, and whether the server can sign on it.
const CURVES: [(&str, &str, bool); 3] =
    [("1.2.840.10045.3.1.7", "P-256", true), ("1.3.132.0.34", "P-384", true), ("1.3.132.0.35", "P-521", false)];

/// Why the server cannot use the key of the certificate `der`; none if it can, or if nothing is known against it.
pub(super) fn unusable_key(der: &[u8]) -> Option<String> {
    let (_, certificate) = X509Certificate::from_der(der).ok()?;
    let key = certificate.public_key();

    match key.parsed().ok()? {
        PublicKey::RSA(rsa) if !RSA_BITS.contains(&rsa.key_size()) => {
            Some(format!("its RSA key has {} bits", rsa.key_size()))
        }
        PublicKey::EC(_) => {
            let curve = key.algorithm.parameters.as_ref()?.as_oid().ok()?.to_id_string();
            match CURVES.iter().find(|(id, ..)| *id == curve) {
                Some((_, _, true)) => None,
                Some((_, name, false)) => Some(format!("its key is on the curve {name}")),
                None => Some(format!("its key is on the curve with the number {curve}")),
            }
        }
        _ => None,
    }
}

/// Whether the certificate `der` may stand for a server: it does not limit its purposes, or a server's is among them.
pub(super) fn is_for_servers(der: &[u8]) -> bool {
    let Ok((_, certificate)) = X509Certificate::from_der(der) else { return false };
    let purposes = certificate.extended_key_usage().ok().flatten();
    purposes.is_none_or(|purposes| purposes.value.any || purposes.value.server_auth)
}

/// The place, from 1, of the first certificate in `chain` that did not sign the one before it.
pub(super) fn out_of_order(chain: &[CertificateDer]) -> Option<usize> {
    let signed_by = |pair: &[CertificateDer]| {
        let (_, signed) = X509Certificate::from_der(&pair[0]).ok()?;
        let (_, issuer) = X509Certificate::from_der(&pair[1]).ok()?;
        Some(signed.issuer().as_raw() == issuer.subject().as_raw())
    };
    chain.windows(2).position(|pair| signed_by(pair) != Some(true)).map(|place| place + 2)
}
