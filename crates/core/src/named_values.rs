//! Enumerations whose values have names.

/// Defines an enumeration with a name for each value: all values and names, the name of a value, the value of a name.
///
/// ```
/// virtual_axes_core::named_values! {
///     /// Answer to a question.
///     pub enum Answer {
///         /// Agreement.
///         Yes = "yes",
///         /// Objection.
///         No = "no",
///     }
/// }
///
/// assert_eq!(Answer::from_name("no"), Some(Answer::No));
/// assert_eq!(format!("{}: {}", Answer::Yes, Answer::NAMES.join(" or ")), "yes: yes or no");
/// let error = "yess".parse::<Answer>();
/// assert_eq!(error, Err("unknown \"yess\"; known are yes, no; the nearest is yes".to_owned()));
/// ```
#[macro_export]
macro_rules! named_values {
    (
        $(#[$meta:meta])*
        $vis:vis enum $enum:ident { $($(#[$value_meta:meta])* $value:ident = $name:literal),+ $(,)? }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        $vis enum $enum { $($(#[$value_meta])* $value,)+ }

        #[allow(dead_code, reason = "no enumeration needs every function")]
        impl $enum {
            /// Names of all values.
            pub const NAMES: &'static [&'static str] = &[$($name),+];
            /// All values.
            pub const ALL: [Self; Self::NAMES.len()] = [$(Self::$value),+];

            /// Returns the name.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$value => $name),+ }
            }

            /// Returns the value with this name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.name() == name)
            }
        }

        impl std::fmt::Display for $enum {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $enum {
            type Err = String;

            fn from_str(name: &str) -> Result<Self, String> {
                Self::from_name(name).ok_or_else(|| $crate::text::unknown_name(name, Self::NAMES))
            }
        }
    };
}
