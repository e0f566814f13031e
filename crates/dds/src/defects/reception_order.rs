//! Order of received messages of several publishers.
//!
//! **Symptom:** waiting messages are taken publisher by publisher; of two trajectories the older one could preempt the
//! newer one.
//!
//! **Upstream:** RustDDS 0.15.1, `src/dds/with_key/simpledatareader.rs`, `try_take_one_with`: the cache is read by writer.
//!
//! **Test:** `test_py/test_faults_publishers.py`.
//!
//! **Superfluous when** RustDDS returns samples by reception time.

use futures::{Stream, StreamExt, stream};
use ros2_client::{MessageInfo, ReadResult};

/// Largest number of waiting messages that are sorted at a time.
const BATCH: usize = 64;

/// Sorts waiting messages by reception time.
pub(crate) fn in_reception_order<M>(
    messages: impl Stream<Item = ReadResult<(M, MessageInfo)>>,
) -> impl Stream<Item = ReadResult<(M, MessageInfo)>> {
    messages.ready_chunks(BATCH).flat_map(|mut batch| {
        batch.sort_by_key(|received| received.as_ref().ok().and_then(|(_, info)| info.received_timestamp()));
        stream::iter(batch)
    })
}
