//! Names of values: as they stand in the database and in exports.

/// Gives the values of an enum their names. A name never changes.
macro_rules! names {
    ($kind:ty { $($value:ident: $name:literal),+ $(,)? }) => {
        impl $kind {
            /// The name, as in the database and in exports.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name),+
                }
            }

            /// The value with this name, if there is one.
            pub fn named(name: &str) -> Option<Self> {
                [$(Self::$value),+].into_iter().find(|value| value.name() == name)
            }
        }
    };
}
