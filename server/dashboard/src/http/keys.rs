//! The keys of the three roles: unguessable, stored in the data folder, compared in constant time.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use subtle::ConstantTimeEq;
use uuid::Uuid;

use parfocal_base::files::{make_private, replace_private};
use parfocal_base::ids::SessionId;
use parfocal_trial::role::Role;

/// Name of the key file in the data folder.
const FILE: &str = "keys.toml";

/// Bytes of a key: 128 bits cannot be guessed.
const KEY_BYTES: usize = 16;

const HEADER: &str = "# Keys of the three roles' links. Whoever has a key has the role. \
                      Delete this file and restart to\n\
                      # make new keys; every browser then has to be let in anew.\n\n";

/// Roles that have a key.
pub const ROLES: [Role; 3] = [Role::Surgeon, Role::Operator, Role::Researcher];

/// Why the keys could not be loaded or made.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// The file could not be read or written.
    #[error("cannot keep the roles' keys in {}: {source}; check the folder's permissions and free space",
            path.display())]
    Io {
        /// The key file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The content of the file is not valid.
    #[error("{} is damaged ({reason}); delete it to make new keys", path.display())]
    Damaged {
        /// The key file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The system gave no random numbers.
    #[error("the system gave no random numbers: {0}")]
    Random(getrandom::Error),
}

/// One key for each role, in hexadecimal.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keys {
    surgeon: String,
    operator: String,
    researcher: String,
}

impl Keys {
    /// The keys stored in `data_dir`. They are made on first use, and only their owner can read the file.
    ///
    /// # Errors
    /// If the file cannot be read or written, or is damaged.
    pub fn load_or_create(data_dir: &Path) -> Result<Self, KeyError> {
        let path = data_dir.join(FILE);
        let io = |source| KeyError::Io { path: path.clone(), source };

        match fs::read_to_string(&path) {
            Ok(text) => {
                make_private(&path).map_err(io)?;
                Self::parse(&text).map_err(|reason| KeyError::Damaged { path, reason })
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let keys = Self::random()?;
                keys.write(&path).map_err(io)?;
                Ok(keys)
            }
            Err(error) if error.kind() == std::io::ErrorKind::InvalidData => {
                Err(KeyError::Damaged { path, reason: "it is not UTF-8".to_owned() })
            }
            Err(error) => Err(io(error)),
        }
    }

    /// New keys, which are not stored.
    ///
    /// # Errors
    /// If the system gives no random numbers.
    pub fn random() -> Result<Self, KeyError> {
        let key = || {
            let mut bytes = [0; KEY_BYTES];
            getrandom::fill(&mut bytes).map_err(KeyError::Random)?;
            Ok(hex::encode(bytes))
        };

        Ok(Self { surgeon: key()?, operator: key()?, researcher: key()? })
    }

    fn parse(text: &str) -> Result<Self, String> {
        let keys: Self = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        for role in ROLES {
            if hex::decode(keys.of(role)).ok().is_none_or(|bytes| bytes.len() < KEY_BYTES) {
                return Err("each key must be at least 32 hexadecimal digits".into());
            }
        }
        Ok(keys)
    }

    fn write(&self, path: &Path) -> std::io::Result<()> {
        let keys = toml::to_string(self).map_err(std::io::Error::other)?;
        replace_private(path, format!("{HEADER}{keys}").as_bytes())
    }

    /// The key of `role`. It is empty for [`Role::System`], and grants nothing.
    pub fn of(&self, role: Role) -> &str {
        match role {
            Role::Surgeon => &self.surgeon,
            Role::Operator => &self.operator,
            Role::Researcher => &self.researcher,
            Role::System => "",
        }
    }

    /// The role that `key` grants. Takes the same time for every key of the same length.
    pub fn role_of(&self, key: &str) -> Option<Role> {
        let mut found = None;

        // No early exit: the time must not depend on the given key.
        for role in ROLES {
            if bool::from(self.of(role).as_bytes().ct_eq(key.as_bytes())) {
                found = Some(role);
            }
        }

        found
    }

    /// The value of the cookie of `role`. It is a hash of the key, so a stolen cookie does not reveal the link. It
    /// stays the same after a restart, so a tablet stays let in.
    pub fn token(&self, role: Role) -> String {
        let digest = Sha256::new().chain_update(b"parfocal cookie 1:").chain_update(self.of(role)).finalize();
        hex::encode(digest)
    }

    /// The key of the surgeon's link to `session` only: the session's identifier, and a proof that only this server can
    /// make.
    pub fn of_session(&self, session: SessionId) -> String {
        format!("{}{}", session.0.simple(), self.session_proof("link", session))
    }

    /// The session whose surgeon's link has the key `key`, whether or not it has ended.
    pub fn session_of(&self, key: &str) -> Option<SessionId> {
        self.proven("link", key)
    }

    /// The value of the surgeon's cookie for `session` only.
    pub fn session_token(&self, session: SessionId) -> String {
        format!("{}{}", session.0.simple(), self.session_proof("cookie", session))
    }

    /// The session whose surgeon's cookie is `token`.
    pub fn session_of_token(&self, token: &str) -> Option<SessionId> {
        self.proven("cookie", token)
    }

    /// The first 128 bits of a hash of the surgeon's key, `purpose` and `session`, in hexadecimal.
    fn session_proof(&self, purpose: &str, session: SessionId) -> String {
        let digest = Sha256::new()
            .chain_update(b"parfocal session 1:")
            .chain_update(purpose)
            .chain_update(b":")
            .chain_update(&self.surgeon)
            .chain_update(b":")
            .chain_update(session.0.as_bytes())
            .finalize();
        hex::encode(&digest[..KEY_BYTES])
    }

    fn proven(&self, purpose: &str, text: &str) -> Option<SessionId> {
        let (session, proof) = text.split_at_checked(KEY_BYTES * 2)?;
        let session = SessionId(Uuid::try_parse(session).ok()?);
        bool::from(self.session_proof(purpose, session).as_bytes().ct_eq(proof.as_bytes())).then_some(session)
    }

    /// Whether `token` is the cookie of `role`.
    pub fn opens(&self, role: Role, token: &str) -> bool {
        role != Role::System && bool::from(self.token(role).as_bytes().ct_eq(token.as_bytes()))
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn keys_are_made_once_for_their_owner_alone() {
        let dir = tempfile::tempdir().unwrap();
        let first = Keys::load_or_create(dir.path()).unwrap();
        let again = Keys::load_or_create(dir.path()).unwrap();
        for role in ROLES {
            assert_eq!(first.of(role), again.of(role));
            assert_eq!(first.of(role).len(), 32);
            assert_eq!(first.role_of(again.of(role)), Some(role));
            assert!(first.opens(role, &again.token(role)));
            assert!(!first.opens(role, first.of(role)), "the key itself is no cookie");
        }

        let mode = fs::metadata(dir.path().join(FILE)).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
    }

    #[test]
    fn a_wrong_key_opens_nothing() {
        let keys = Keys::random().unwrap();
        for wrong in ["", "0", &keys.of(Role::Operator)[1..], &keys.of(Role::Operator).to_uppercase()[..31]] {
            assert_eq!(keys.role_of(wrong), None);
        }
        assert!(!keys.opens(Role::Operator, &keys.token(Role::Surgeon)));
        assert!(!keys.opens(Role::System, &keys.token(Role::System)));
    }

    #[test]
    fn a_sessions_link_and_cookie_name_it_and_no_other() {
        let keys = Keys::random().unwrap();
        let session = SessionId(Uuid::from_u128(7));
        let link = keys.of_session(session);
        let cookie = keys.session_token(session);
        assert_eq!((keys.session_of(&link), keys.session_of_token(&cookie)), (Some(session), Some(session)));
        assert_eq!((keys.session_of(&cookie), keys.session_of_token(&link)), (None, None));

        let other = SessionId(Uuid::from_u128(8)).0.simple().to_string();
        for wrong in ["", "é", &link[..63], &format!("{other}{}", &link[32..]), keys.of(Role::Surgeon)] {
            assert_eq!(keys.session_of(wrong), None, "{wrong}");
        }
        assert_eq!(Keys::random().unwrap().session_of(&link), None, "another server's keys");
    }

    #[test]
    fn a_damaged_file_is_reported_as_damaged() {
        let dir = tempfile::tempdir().unwrap();
        let empty_keys = b"surgeon = \"\"\noperator = \"\"\nresearcher = \"\"\n";
        for text in [b"".as_slice(), b"surgeon = 3", empty_keys, b"\xff\xfes\0u\0"] {
            fs::write(dir.path().join(FILE), text).unwrap();
            let error = Keys::load_or_create(dir.path()).err().expect("damaged").to_string();
            assert!(error.contains("keys.toml") && error.contains("delete it"), "{error}");
        }
    }
}
