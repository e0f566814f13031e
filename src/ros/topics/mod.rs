//! Topics of the node under their resolved names: creation from the table of topics, output queues, and recording.

mod factory;
mod output;
mod recorder;

pub use factory::{EndpointError, TopicFactory, TopicInput};
pub use output::{Output, OverflowPolicy, queue_length};
pub use recorder::{RecordError, RecordingStatus, Tap, TopicRecorder, TopicRecording};
