//! The local certificate authority. It is made once, kept in the data folder, and trusted once by each tablet and
//! laptop. It signs the server's certificates.
//!
//! Its certificate limits the names and addresses that it can sign for: private networks, this machine's names, and the
//! addresses that the machine had when the authority was made. So a thief of its key cannot impersonate any other site
//! to the devices that trust it.

use std::fs;
use std::io::ErrorKind;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use jiff::Timestamp;
use rcgen::{
    BasicConstraints, CertificateParams, CidrSubnet, DistinguishedName, DnType, ExtendedKeyUsagePurpose,
    GeneralSubtree, IsCa, Issuer, KeyPair, KeyUsagePurpose, NameConstraints, SanType,
};
use sha2::{Digest, Sha256};
use time::OffsetDateTime;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};

use super::facts::{Facts, Permitted};
use super::names::Names;
use super::{TlsError, unreadable};
use parfocal_base::files::{make_private, replace, replace_private};

/// Name of the authority's folder in the data folder.
pub const FOLDER: &str = "tls";

/// The authority's certificate and private key.
const FILE: &str = "authority.pem";

/// The authority's certificate alone, for programs on this machine (`curl --cacert`).
const PUBLIC_FILE: &str = "authority.crt";

const DAY: Duration = Duration::from_hours(24);

/// How long the authority is valid. Every device has to trust a new one, so it outlasts a study.
const AUTHORITY_LIVES: Duration = DAY.saturating_mul(10 * 365);

/// How long a server certificate is valid. Apple's devices refuse a local authority's certificate that is valid for
/// more than 825 days (support.apple.com/en-us/103769). A shorter time is enough, because a new one is signed at each
/// start.
const CERTIFICATE_LIVES: Duration = DAY.saturating_mul(90);

/// How far a tablet's clock may be behind this machine's clock.
const SLOW_CLOCKS: Duration = DAY.saturating_mul(2);

/// Networks that anybody may use privately (RFC 1918, RFC 6598, RFC 3927, RFC 4193), and each machine's loopback
/// network.
const PRIVATE_NETWORKS: [(&str, u8); 8] = [
    ("10.0.0.0", 8),
    ("172.16.0.0", 12),
    ("192.168.0.0", 16),
    ("100.64.0.0", 10),
    ("169.254.0.0", 16),
    ("127.0.0.0", 8),
    ("fc00::", 7),
    ("::1", 128),
];

/// The public part of the authority.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PublicAuthority {
    /// Certificate of the authority, in PEM form.
    pub pem: String,
    /// Common name of the certificate, which devices show.
    pub name: String,
    /// SHA-256 of the certificate as pairs of hexadecimal digits, as devices show it.
    pub fingerprint: String,
    /// SHA-256 of the certificate.
    pub digest: [u8; 32],
}

/// A certificate with its private key.
pub(super) struct Signed {
    pub(super) certificate: CertificateDer<'static>,
    pub(super) key: PrivateKeyDer<'static>,
    pub(super) facts: Facts,
}

/// The local authority.
pub(super) struct Authority {
    issuer: Issuer<'static, KeyPair>,
    permitted: Permitted,
    facts: Facts,
    path: PathBuf,
    pub(super) public: PublicAuthority,
}

impl Authority {
    /// Loads the authority from `data_dir`. The first use makes it, with a private key that only the owner can read.
    pub(super) fn load_or_create(data_dir: &Path, now: Timestamp) -> Result<Self, TlsError> {
        let folder = data_dir.join(FOLDER);
        let path = folder.join(FILE);
        let unwritable = |error| {
            let path = path.display();
            TlsError::File(format!(
                "cannot keep the local authority in {path}: {error}; check the folder's permissions and free space"
            ))
        };

        let pem = match fs::read_to_string(&path) {
            Ok(pem) => {
                make_private(&path).map_err(unwritable)?;
                pem
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let pem = make(&Names::of_whole_machine(), now)?;
                fs::create_dir_all(&folder).map_err(unwritable)?;
                make_private(&folder).map_err(unwritable)?;
                replace_private(&path, pem.as_bytes()).map_err(unwritable)?;
                tracing::info!("made a local authority in {}", path.display());
                pem
            }
            Err(error) => return Err(unreadable(&path, &error)),
        };

        let authority = Self::parse(&pem, &path)?;
        replace(&folder.join(PUBLIC_FILE), authority.public.pem.as_bytes()).map_err(unwritable)?;
        authority.check(now)?;
        Ok(authority)
    }

    fn parse(pem: &str, path: &Path) -> Result<Self, TlsError> {
        let damaged = |reason: &str| {
            TlsError::File(format!(
                "the local authority in {} is damaged ({reason}); restore the file, or delete it to make a new authority, \
                 which every tablet and laptop must then trust anew",
                path.display()
            ))
        };
        let certificate =
            CertificateDer::from_pem_slice(pem.as_bytes()).map_err(|_| damaged("it holds no certificate"))?;
        let key = PrivateKeyDer::from_pem_slice(pem.as_bytes()).map_err(|_| damaged("it holds no private key"))?;
        let key = KeyPair::try_from(&key).map_err(|_| damaged("its private key cannot be read"))?;

        let (_, read) =
            x509_parser::parse_x509_certificate(&certificate).map_err(|_| damaged("its certificate cannot be read"))?;
        if read.public_key().subject_public_key.data != key.public_key_raw() {
            return Err(damaged("its private key belongs to another certificate"));
        }
        // The authority signed its own certificate. A changed certificate must be refused here, because rcgen writes
        // the authority's name into everything that it signs, and panics on an impossible name.
        read.verify_signature(None).map_err(|_| damaged("the signature of its certificate does not match"))?;

        let name = read.subject().iter_common_name().next().and_then(|name| name.as_str().ok());
        let name = name.unwrap_or_default().to_owned();

        let facts = Facts::read(&certificate).ok_or_else(|| damaged("its certificate has no dates"))?;
        let permitted = Permitted::read(&certificate).ok_or_else(|| damaged("its certificate names no limits"))?;
        let digest: [u8; 32] = Sha256::digest(&certificate).into();

        Ok(Self {
            permitted,
            facts,
            path: path.to_owned(),
            public: PublicAuthority {
                pem: certificate_alone(pem).ok_or_else(|| damaged("it holds no certificate"))?,
                name,
                fingerprint: digest.map(|byte| format!("{byte:02X}")).join(":"),
                digest,
            },
            issuer: Issuer::from_ca_cert_der(&certificate, key)?,
        })
    }

    fn check(&self, now: Timestamp) -> Result<(), TlsError> {
        let Facts { from, until, .. } = self.facts;
        if now < from || now >= until {
            return Err(TlsError::File(format!(
                "the local authority in {} is valid from {from} to {until}, and this machine's clock says {now}; set the \
                 clock if it is wrong, else delete the file to make a new authority, which every tablet and laptop must \
                 then trust anew",
                self.path.display()
            )));
        }
        Ok(())
    }

    /// Signs a new certificate for `names`. Leaves out the names that the authority may not sign for, because one of
    /// them would make the whole certificate invalid.
    pub(super) fn sign(&self, names: &Names, now: Timestamp) -> Result<Signed, TlsError> {
        self.check(now)?;
        let hosts = names.hosts.iter().filter(|host| self.permitted.host(host));
        let addresses = names.addresses.iter().filter(|address| self.permitted.address(**address));

        let mut params = CertificateParams::default();
        for host in hosts {
            params.subject_alt_names.push(SanType::DnsName(host.as_str().try_into()?));
        }
        params.subject_alt_names.extend(addresses.map(|address| SanType::IpAddress(*address)));

        params.distinguished_name = named("parfocal server");
        params.not_before = date(self.facts.from.max(earlier(now, SLOW_CLOCKS)));
        params.not_after = date(self.facts.until.min(later(now, CERTIFICATE_LIVES)));
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
        params.use_authority_key_identifier_extension = true;

        let key = KeyPair::generate()?;
        let certificate = params.signed_by(&key, &self.issuer)?.der().clone();
        let facts = Facts::read(&certificate).ok_or(rcgen::Error::CouldNotParseCertificate)?;
        let key = PrivateKeyDer::try_from(key.serialize_der()).map_err(|_| rcgen::Error::CouldNotParseKeyPair)?;
        Ok(Signed { certificate, key, facts })
    }

    /// The hosts and addresses in `names` that the authority may not sign for, as texts.
    pub(super) fn not_permitted(&self, names: &Names) -> Vec<String> {
        let hosts = names.hosts.iter().filter(|host| !self.permitted.host(host)).cloned();
        let addresses = names.addresses.iter().filter(|address| !self.permitted.address(**address));
        hosts.chain(addresses.map(ToString::to_string)).collect()
    }

    /// File with the authority's certificate and private key.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

/// Makes a new authority for a machine with these names. Returns its certificate and private key in PEM form.
fn make(machine: &Names, now: Timestamp) -> Result<String, TlsError> {
    let host = machine.hosts.iter().find(|host| host.as_str() != "localhost");
    let name = host.map_or_else(|| "parfocal".to_owned(), |host| format!("parfocal on {host}"));

    let mut params = CertificateParams::default();
    params.distinguished_name = named(&name);
    params.not_before = date(earlier(now, SLOW_CLOCKS));
    params.not_after = date(later(now, AUTHORITY_LIVES));
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    params.name_constraints = Some(limits(machine));

    let key = KeyPair::generate()?;
    let certificate = params.self_signed(&key)?;
    Ok(format!("{}{}", certificate.pem(), key.serialize_pem()))
}

/// The name constraints of an authority on a machine with these names.
fn limits(machine: &Names) -> NameConstraints {
    // `local` covers the name of any machine in its local network (RFC 6762), so that the machine can be renamed.
    let hosts = machine.hosts.iter().map(String::as_str).chain(["local"]);
    let hosts = hosts.map(|host| GeneralSubtree::DnsName(host.to_owned()));

    let private = PRIVATE_NETWORKS.into_iter().filter_map(|(network, bits)| Some((network.parse().ok()?, bits)));
    let single = |address: &IpAddr| (*address, if address.is_ipv4() { 32 } else { 128 });
    let own = machine.addresses.iter().filter(|address| !address.is_loopback()).map(single);
    let networks = private.chain(own).map(|(network, bits)| CidrSubnet::from_addr_prefix(network, bits));

    NameConstraints {
        permitted_subtrees: hosts.chain(networks.map(GeneralSubtree::IpAddress)).collect(),
        excluded_subtrees: Vec::new(),
    }
}

fn named(name: &str) -> DistinguishedName {
    let mut distinguished = DistinguishedName::new();
    distinguished.push(DnType::CommonName, name);
    distinguished
}

/// The certificate in `pem`, without the private key.
fn certificate_alone(pem: &str) -> Option<String> {
    const BEGIN: &str = "-----BEGIN CERTIFICATE-----";
    const END: &str = "-----END CERTIFICATE-----";

    let begin = pem.find(BEGIN)?;
    let end = begin + pem[begin..].find(END)?;
    let body = pem[begin + BEGIN.len()..end].trim();
    Some(format!("{BEGIN}\n{body}\n{END}\n"))
}

fn earlier(now: Timestamp, by: Duration) -> Timestamp {
    now.saturating_sub(by).unwrap_or(Timestamp::UNIX_EPOCH)
}

fn later(now: Timestamp, by: Duration) -> Timestamp {
    now.saturating_add(by).unwrap_or(now)
}

/// Converts a time. Certificates have whole seconds.
fn date(timestamp: Timestamp) -> OffsetDateTime {
    OffsetDateTime::from_unix_timestamp(timestamp.as_second()).unwrap_or(OffsetDateTime::UNIX_EPOCH)
}

#[cfg(test)]
mod tests {
    use base64::Engine;
    use base64::prelude::BASE64_STANDARD;

    use super::*;

    #[test]
    fn a_certificate_whose_signed_part_was_changed_anywhere_is_refused() {
        let now: Timestamp = "2026-06-01T00:00:00Z".parse().unwrap();
        let pem = make(&Names::default(), now).unwrap();
        let path = Path::new("authority.pem");
        assert!(Authority::parse(&pem, path).is_ok());

        let whole = CertificateDer::from_pem_slice(pem.as_bytes()).unwrap().to_vec();
        let (_, read) = x509_parser::parse_x509_certificate(&whole).unwrap();
        let signed = read.tbs_certificate.as_ref();
        let from = whole.windows(signed.len()).position(|window| window == signed).unwrap();
        let key = &pem[pem.find("-----BEGIN PRIVATE KEY").unwrap()..];

        for (index, bits) in (from..from + signed.len()).flat_map(|index| [(index, 0x01), (index, 0x80)]) {
            let mut changed = whole.clone();
            changed[index] ^= bits;
            let body = BASE64_STANDARD.encode(changed);
            let pem = format!("-----BEGIN CERTIFICATE-----\n{body}\n-----END CERTIFICATE-----\n{key}");
            let refused = Authority::parse(&pem, path).err().map(|error| error.to_string());
            assert!(refused.as_ref().is_some_and(|words| words.contains("is damaged")), "byte {index}: {refused:?}");
        }
    }
}
