//! Identifiers: one type each, so that the compiler keeps them apart.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

macro_rules! identifier {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema)]
        #[serde(transparent)]
        pub struct $name(pub Uuid);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }

        impl FromStr for $name {
            type Err = uuid::Error;

            fn from_str(text: &str) -> Result<Self, uuid::Error> {
                text.parse().map($name)
            }
        }
    };
}

identifier!(
    /// A trial session. Random.
    SessionId
);
identifier!(
    /// One segment of a session. Random, so that two segments of one policy share nothing.
    SegmentId
);
identifier!(
    /// A browser that surgeons use, all its tabs together. Random, made by its page and kept there.
    DeviceId
);
identifier!(
    /// Made by a browser for one comment or answer, which is kept once, however often it is sent.
    IdempotencyKey
);
