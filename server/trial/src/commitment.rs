//! The commitment: a hash that is published when a session is created. After unblinding, anyone can use it to check
//! that the order was not changed since. It includes the seed's 256 random bits, so nobody can guess the order from it.

use sha2::{Digest, Sha256};

use super::allocation::{Algorithm, Seed};
use super::protocol::Protocol;
use parfocal_base::PolicyName;
use parfocal_base::ids::SessionId;

/// A session's order, and everything that it was drawn from.
#[derive(Debug, Clone, PartialEq)]
pub struct Allocation {
    /// Session that the order belongs to.
    pub session: SessionId,
    /// Algorithm that drew the order.
    pub algorithm: Algorithm,
    /// Seed of the draw.
    pub seed: Seed,
    /// Index of the session in the set that shares the seed, from 0.
    pub index: usize,
    /// SHA-256 of the protocol's text.
    pub protocol_sha256: [u8; 32],
    /// Policy of each segment, in order.
    pub schedule: Vec<PolicyName>,
}

impl Allocation {
    /// Draws the order of the new session `session` with `protocol`, for place `index` among the sessions that share
    /// `seed`.
    pub fn draw(session: SessionId, protocol: &Protocol, seed: Seed, index: usize) -> Self {
        Self {
            session,
            algorithm: protocol.order.algorithm(),
            seed,
            index,
            protocol_sha256: protocol.sha256(),
            schedule: protocol.draw(seed, index),
        }
    }

    /// The text that is hashed: seven lines, each ending with a line feed.
    pub fn statement(&self) -> String {
        let schedule: Vec<&str> = self.schedule.iter().map(PolicyName::as_str).collect();
        format!(
            "parfocal-commitment-1\nsession {}\nalgorithm {}\nseed {}\nindex {}\nprotocol {}\nschedule {}\n",
            self.session,
            self.algorithm,
            self.seed.to_hex(),
            self.index,
            hex::encode(self.protocol_sha256),
            schedule.join(","),
        )
    }

    /// SHA-256 of the [statement](Self::statement), in hexadecimal.
    pub fn commitment(&self) -> String {
        hex::encode(Sha256::digest(self.statement()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commitment_is_what_sha256sum_says_of_the_statement() {
        let allocation = Allocation {
            session: "00000000-0000-4000-8000-000000000001".parse().unwrap(),
            algorithm: Algorithm::Shuffle1,
            seed: Seed([0; 32]),
            index: 0,
            protocol_sha256: [0xab; 32],
            schedule: ["fixed", "mgm-hill-climber"].map(PolicyName::new).to_vec(),
        };

        // printf 'parfocal-commitment-1\nsession …\n…' | sha256sum
        assert_eq!(allocation.commitment(), "c9ef7743934603d3dca9fc252a945a2e078f679169d9d81fb4b2ba4294f7be45");
    }
}
