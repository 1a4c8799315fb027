//! Passphrases: which ones are allowed, and their argon2id hashes.
//!
//! Following NIST SP 800-63B-4, there are no rules about the characters of a passphrase: blanks and all of Unicode are
//! allowed. A passphrase is converted to the normalization form NFC before it is hashed, so that é is the same on every
//! keyboard.

use argon2::{Algorithm, Argon2, Params, Version};
use subtle::ConstantTimeEq;
use unicode_normalization::UnicodeNormalization;

use super::AccountError;
use crate::store::PassphraseHash;
use parfocal_trial::account::{LONGEST_PASSPHRASE, SHORTEST_PASSPHRASE};
use parfocal_trial::refusal::Refusal;

const SALT_BYTES: usize = 16;
const HASH_BYTES: usize = 32;

/// The cost of computing a hash, and so of each guess.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cost {
    /// Memory in KiB.
    pub memory_kib: u32,
    /// Number of passes over the memory.
    pub passes: u32,
}

impl Default for Cost {
    /// The first choice for argon2id in OWASP's Password Storage Cheat Sheet: 19 MiB, 2 passes, 1 lane.
    fn default() -> Self {
        Self { memory_kib: 19 * 1024, passes: 2 }
    }
}

/// A passphrase of allowed length, in the normalization form NFC.
pub struct Passphrase(String);

impl Passphrase {
    /// Checks `text` and makes it a passphrase.
    ///
    /// # Errors
    /// If it is too short or too long.
    pub fn new(text: &str) -> Result<Self, Refusal> {
        let normalized: String = text.nfc().collect();
        if (SHORTEST_PASSPHRASE..=LONGEST_PASSPHRASE).contains(&normalized.chars().count()) {
            return Ok(Self(normalized));
        }
        Err(Refusal::Invalid(format!(
            "a passphrase has {SHORTEST_PASSPHRASE} to {LONGEST_PASSPHRASE} characters; 15 or more are recommended, such \
             as four words; blanks and letters of any alphabet are allowed"
        )))
    }

    /// Whether `text` is this passphrase.
    pub(super) fn is(&self, text: &str) -> bool {
        text.nfc().eq(self.0.chars())
    }

    pub(super) fn hash(&self, cost: Cost) -> Result<PassphraseHash, AccountError> {
        let mut salt = vec![0; SALT_BYTES];
        getrandom::fill(&mut salt).map_err(|error| AccountError::Storage(format!("no random numbers: {error}")))?;
        let hash = argon2id(&self.0, &salt, cost)?;
        Ok(PassphraseHash { memory_kib: cost.memory_kib, passes: cost.passes, salt, hash })
    }
}

/// Whether `given` is the passphrase of `hash`. If there is no hash, it takes as long as for a hash of `cost`.
pub(super) fn fits(given: &str, hash: Option<&PassphraseHash>, cost: Cost) -> Result<bool, AccountError> {
    // A longer text belongs to no account, and would only take time.
    let given: String = given.nfc().take(LONGEST_PASSPHRASE + 1).collect();
    let Some(hash) = hash else {
        argon2id(&given, &[0; SALT_BYTES], cost)?;
        return Ok(false);
    };

    let its_cost = Cost { memory_kib: hash.memory_kib, passes: hash.passes };
    let made = argon2id(&given, &hash.salt, its_cost)?;
    Ok(bool::from(made.ct_eq(&hash.hash)))
}

fn argon2id(text: &str, salt: &[u8], cost: Cost) -> Result<Vec<u8>, AccountError> {
    let failed = |error: argon2::Error| AccountError::Storage(format!("the passphrase could not be hashed: {error}"));
    let parameters = Params::new(cost.memory_kib, cost.passes, 1, Some(HASH_BYTES)).map_err(failed)?;

    let mut hash = vec![0; HASH_BYTES];
    let argon2 = Argon2::new(Algorithm::Argon2id, Version::V0x13, parameters);
    argon2.hash_password_into(text.as_bytes(), salt, &mut hash).map_err(failed)?;
    Ok(hash)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_argon2id_as_the_reference_program_computes_it() {
        // From src/test.c of github.com/P-H-C/phc-winner-argon2: argon2id, version 0x13.
        let hash = argon2id("password", b"somesalt", Cost { memory_kib: 256, passes: 2 }).unwrap();
        let expected = "9dfeb910e80bad0311fee20f9c0e2b12c17987b4cac90c2ef54d5b3021c68bfe";
        assert_eq!(hex::encode(hash), expected);
    }

    #[test]
    fn a_passphrase_is_compared_in_one_normalization_form() {
        let cost = Cost { memory_kib: 64, passes: 1 };
        let hash = Passphrase::new("caf\u{e9} au lait 🫖").unwrap().hash(cost).unwrap();
        assert!(fits("cafe\u{301} au lait 🫖", Some(&hash), cost).unwrap());
        for wrong in ["cafe au lait 🫖", "", "Caf\u{e9} au lait 🫖", "caf\u{e9} au lait 🫖 "] {
            assert!(!fits(wrong, Some(&hash), cost).unwrap(), "{wrong}");
        }
        assert!(!fits("", None, cost).unwrap());
    }

    #[test]
    fn only_the_length_is_asked_for() {
        for good in ["          ", "ünïcödé äß", &"x".repeat(256)] {
            assert!(Passphrase::new(good).is_ok(), "{good}");
        }
        for bad in ["", "123456789", &"x".repeat(257)] {
            assert!(Passphrase::new(bad).is_err(), "{bad}");
        }
    }
}
