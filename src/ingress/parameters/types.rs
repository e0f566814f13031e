//! Parameters as plain values, and what somebody must offer to have them served.

/// The kinds of value that ROS parameters know, with their numbers on the wire
/// (rcl_interfaces/msg/ParameterType).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum ParameterType {
    /// `true` or `false`
    Bool = 1,
    /// 64 bits, signed
    Integer = 2,
    /// 64 bits, floating point
    Double = 3,
    /// UTF-8
    String = 4,
    /// Octets
    ByteArray = 5,
    /// Several `Bool`
    BoolArray = 6,
    /// Several `Integer`
    IntegerArray = 7,
    /// Several `Double`
    DoubleArray = 8,
    /// Several `String`
    StringArray = 9,
}

/// A parameter's value.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterValue {
    /// `true` or `false`
    Bool(bool),
    /// 64 bits, signed
    Integer(i64),
    /// 64 bits, floating point
    Double(f64),
    /// UTF-8
    String(String),
    /// Octets
    ByteArray(Vec<u8>),
    /// Several `Bool`
    BoolArray(Vec<bool>),
    /// Several `Integer`
    IntegerArray(Vec<i64>),
    /// Several `Double`
    DoubleArray(Vec<f64>),
    /// Several `String`
    StringArray(Vec<String>),
}

impl ParameterValue {
    /// Which kind of value it is.
    #[must_use]
    pub fn kind(&self) -> ParameterType {
        match self {
            Self::Bool(_) => ParameterType::Bool,
            Self::Integer(_) => ParameterType::Integer,
            Self::Double(_) => ParameterType::Double,
            Self::String(_) => ParameterType::String,
            Self::ByteArray(_) => ParameterType::ByteArray,
            Self::BoolArray(_) => ParameterType::BoolArray,
            Self::IntegerArray(_) => ParameterType::IntegerArray,
            Self::DoubleArray(_) => ParameterType::DoubleArray,
            Self::StringArray(_) => ParameterType::StringArray,
        }
    }
}

/// The values that a number may have, both ends included. A step of 0 allows every one between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// For `Integer` and `IntegerArray`.
    Integer {
        /// The smallest.
        from: i64,
        /// The largest.
        to: i64,
        /// The distance between allowed values.
        step: u64,
    },
    /// For `Double` and `DoubleArray`.
    Double {
        /// The smallest.
        from: f64,
        /// The largest.
        to: f64,
        /// The distance between allowed values.
        step: f64,
    },
}

/// What there is to know about a parameter besides its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Descriptor {
    /// Its kind of value.
    pub kind: ParameterType,
    /// What it does, with its unit.
    pub description: String,
    /// Rules that a range cannot express, in words; may be empty.
    pub additional_constraints: String,
    /// It cannot be set while the node runs.
    pub read_only: bool,
    /// It may change its kind.
    pub dynamic_typing: bool,
    /// The values that it may have.
    pub range: Option<Range>,
}

/// Somebody who has parameters. The services ask from one task, one call at a time; none of the
/// calls may wait for the network.
pub trait ParameterHost: Send + 'static {
    /// All parameters, in the order in which they are to be listed.
    fn names(&self) -> Vec<String>;

    /// A parameter's present value, or `None` when there is no such parameter.
    fn get(&self, name: &str) -> Option<ParameterValue>;

    /// A parameter's description, or `None` when there is no such parameter.
    fn describe(&self, name: &str) -> Option<Descriptor>;

    /// Waits until changes can be taken, whoever else keeps the host busy.
    fn ready(&mut self) -> impl Future<Output = ()> + Send;

    /// Makes all of the changes, or none of them; call [`Self::ready`] first.
    ///
    /// # Errors
    /// Why they cannot be made, in a sentence for whoever asked: name, value, what is allowed.
    fn set(&mut self, changes: Vec<(String, ParameterValue)>) -> Result<(), String>;
}
