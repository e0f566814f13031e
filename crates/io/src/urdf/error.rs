//! Why a machine has no URDF.

/// A machine that cannot be said as a URDF.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// A joint without a place in the chain.
    #[error(
        "joint {joint} ({kind}) has no place in the chain workpiece-C-A-X/Y/Z-tool; its joints are x, y, z (linear), a \
         and c (rotary), each at most once"
    )]
    NotInChain {
        /// Its name.
        joint: String,
        /// `linear` or `rotary`.
        kind: &'static str,
    },
    /// A text with a character that XML does not have.
    #[error("{what} {text:?} has the character {character:?}, which cannot stand in XML")]
    NotXml {
        /// What the text is.
        what: &'static str,
        /// The text.
        text: String,
        /// The first character that cannot be written.
        character: char,
    },
    /// The XML cannot be put together.
    #[error("the URDF cannot be written: {0}")]
    Write(#[from] std::io::Error),
}
