//! One store of a rerun file: a recording or a blueprint.
//!
//! The SDK's own recording stream stamps every row with the time of day and batches in a thread of
//! its own. Here the rows are put together directly, with numbers that follow from the content: the
//! same recording gives the same bytes up to the file's footer (whose two parts the encoder writes in
//! any order), and every error reaches the caller.

use std::collections::BTreeMap;

use re_chunk::{Chunk, ChunkId, ChunkResult, RowId};
use re_log_encoding::Encoder;
use re_log_types::external::re_tuid::Tuid;
use re_log_types::{
    BlueprintActivationCommand, EntityPath, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreSource,
    TimePoint, Timeline,
};
use re_sdk_types::{AsComponents, SerializedComponentBatch};

/// The entities of one recording or blueprint.
pub(super) struct Store {
    id: StoreId,
    next_chunk: u128,
    rows: u128,
    is_open: bool,
    /// The rows that were not taken yet, by entity and timelines.
    entities: BTreeMap<(EntityPath, Vec<&'static str>), Vec<StoreRow>>,
}

/// A place on each of some timelines.
pub(super) type Now<'a> = &'a [(&'static str, i64)];

struct StoreRow {
    id: RowId,
    time: TimePoint,
    components: Vec<SerializedComponentBatch>,
}

impl Store {
    /// An empty store; the numbers of its chunks start at `first_chunk`, which should be unlike
    /// that of other stores.
    pub(super) fn new(id: StoreId, first_chunk: u128) -> Self {
        Self {
            id,
            next_chunk: first_chunk,
            rows: 0,
            is_open: false,
            entities: BTreeMap::new(),
        }
    }

    /// Logs an archetype that holds at all times.
    pub(super) fn log_static(&mut self, path: impl Into<EntityPath>, what: &dyn AsComponents) {
        self.log(path, &[], what);
    }

    /// Logs an archetype from a place on sequence timelines onwards.
    pub(super) fn log(
        &mut self,
        path: impl Into<EntityPath>,
        when: Now<'_>,
        what: &dyn AsComponents,
    ) {
        self.rows += 1;
        let time = (when.iter()).fold(TimePoint::default(), |time, &(timeline, place)| {
            time.with(Timeline::new_sequence(timeline), place)
        });
        self.entities
            .entry((path.into(), when.iter().map(|(name, _)| *name).collect()))
            .or_default()
            .push(StoreRow {
                id: RowId::from_u128(self.rows),
                time,
                components: what.as_serialized_batches(),
            });
    }

    /// The messages of what was logged since the last call: one chunk for each entity.
    pub(super) fn take(&mut self) -> Result<Vec<LogMsg>, String> {
        self.chunks().map_err(|error| error.to_string())
    }

    fn chunks(&mut self) -> ChunkResult<Vec<LogMsg>> {
        let mut messages = Vec::new();
        if !self.is_open {
            let info = StoreInfo::new(self.id.clone(), StoreSource::Other("elastocal".to_owned()));
            messages.push(LogMsg::SetStoreInfo(SetStoreInfo {
                row_id: Tuid::from_u128(self.next_chunk),
                info,
            }));
            self.is_open = true;
        }
        for ((path, _), rows) in std::mem::take(&mut self.entities) {
            self.next_chunk = self.next_chunk.wrapping_add(1);
            let id = ChunkId::from_u128(self.next_chunk);
            let chunk = (rows.into_iter())
                .fold(Chunk::builder_with_id(id, path), |chunk, row| {
                    chunk.with_serialized_batches(row.id, row.time, row.components)
                })
                .build()?;
            messages.push(LogMsg::ArrowMsg(self.id.clone(), chunk.to_arrow_msg()?));
        }
        Ok(messages)
    }
}

/// The messages of a blueprint and those that make the viewer use it, to go before a recording's.
pub(super) fn show_by(mut blueprint: Store) -> Result<Vec<LogMsg>, String> {
    let mut messages = blueprint.take()?;
    messages.push(LogMsg::BlueprintActivationCommand(
        BlueprintActivationCommand {
            blueprint_id: blueprint.id,
            make_active: true,
            make_default: true,
        },
    ));
    Ok(messages)
}

/// The bytes of a file with these messages.
pub(super) fn encode(messages: Vec<LogMsg>) -> Result<Vec<u8>, String> {
    Encoder::encode(messages.into_iter().map(Ok)).map_err(|error| error.to_string())
}
