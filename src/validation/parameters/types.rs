//! Parameter values and descriptors, and the interface between a parameter host and its services.

/// Types of ROS parameters with their numbers in `rcl_interfaces/msg/ParameterType`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum ParameterType {
    /// `true` or `false`.
    Bool = 1,
    /// Signed 64-bit integer.
    Integer = 2,
    /// 64-bit floating-point number.
    Double = 3,
    /// UTF-8 text.
    String = 4,
    /// Array of octets.
    ByteArray = 5,
    /// Array of `Bool`.
    BoolArray = 6,
    /// Array of `Integer`.
    IntegerArray = 7,
    /// Array of `Double`.
    DoubleArray = 8,
    /// Array of `String`.
    StringArray = 9,
}

/// Value of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterValue {
    /// `true` or `false`.
    Bool(bool),
    /// Signed 64-bit integer.
    Integer(i64),
    /// 64-bit floating-point number.
    Double(f64),
    /// UTF-8 text.
    String(String),
    /// Array of octets.
    ByteArray(Vec<u8>),
    /// Array of `Bool`.
    BoolArray(Vec<bool>),
    /// Array of `Integer`.
    IntegerArray(Vec<i64>),
    /// Array of `Double`.
    DoubleArray(Vec<f64>),
    /// Array of `String`.
    StringArray(Vec<String>),
}

impl ParameterValue {
    /// Returns the type of the value.
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

/// Allowed range of a number, including both ends; a step of 0 allows all values between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ParameterRange {
    /// Range of `Integer` and `IntegerArray`.
    Integer {
        /// Smallest value.
        from: i64,
        /// Largest value.
        to: i64,
        /// Distance between allowed values.
        step: u64,
    },
    /// Range of `Double` and `DoubleArray`.
    Double {
        /// Smallest value.
        from: f64,
        /// Largest value.
        to: f64,
        /// Distance between allowed values.
        step: f64,
    },
}

/// Descriptor of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterDescriptor {
    /// Type of its value.
    pub kind: ParameterType,
    /// Description with unit.
    pub description: String,
    /// Constraints that a range cannot express, as text; can be empty.
    pub additional_constraints: String,
    /// True if it cannot be set while the node runs.
    pub read_only: bool,
    /// True if its type can change.
    pub dynamic_typing: bool,
    /// Allowed range.
    pub range: Option<ParameterRange>,
}

/// Owner of parameters. The parameter services call it from one task, one call at a time; no call waits for
/// the network.
pub trait ParameterHost: Send + 'static {
    /// Returns the names of all parameters, in the order of listing.
    fn names(&self) -> Vec<String>;

    /// Returns the present value of a parameter; `None` if it is unknown.
    fn get(&self, name: &str) -> Option<ParameterValue>;

    /// Returns the descriptor of a parameter; `None` if it is unknown.
    fn describe(&self, name: &str) -> Option<ParameterDescriptor>;

    /// Waits until the host can apply changes.
    fn ready(&mut self) -> impl Future<Output = ()> + Send;

    /// Applies all changes or none of them; call [`Self::ready`] first.
    ///
    /// # Errors
    /// Text with name, value and allowed values of the first invalid change.
    fn set(&mut self, changes: Vec<(String, ParameterValue)>) -> Result<(), String>;
}
