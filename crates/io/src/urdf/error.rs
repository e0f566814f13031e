//! Error of the conversion of a machine into a URDF.

/// Error of the conversion of a machine into a URDF.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// A joint has no role in the kinematic chain.
    #[error(
        "joint {joint} ({kind}) has no role in the chain workpiece-C-A-X/Y/Z-tool; its joints are x, y, z (linear), a \
         and c (rotary), each at most once"
    )]
    NotInChain {
        /// Name of the joint.
        joint: String,
        /// Kind of the joint, `linear` or `rotary`.
        kind: &'static str,
    },
    /// A text contains a character that XML 1.0 does not allow.
    #[error("{what} {text:?} contains the character {character:?}, which XML does not allow")]
    NotXml {
        /// Meaning of the text.
        what: &'static str,
        /// Text.
        text: String,
        /// First invalid character.
        character: char,
    },
    /// Writing the XML failed.
    #[error("the URDF cannot be written: {0}")]
    Write(#[from] std::io::Error),
}
