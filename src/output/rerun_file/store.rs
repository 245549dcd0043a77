//! One store of a rerun file: a recording or a blueprint.
//!
//! The SDK's own recording stream stamps every row with the time of day and batches in a thread of
//! its own. Here the rows are put together directly, with numbers that follow from the content: the
//! same recording gives the same bytes up to the file's footer (whose two parts the encoder writes in
//! any order), and every error reaches the caller.

use std::collections::BTreeMap;

use rerun::external::re_log_encoding::Encoder;
use rerun::external::re_log_types::external::re_tuid::Tuid;
use rerun::external::re_log_types::{
    BlueprintActivationCommand, SetStoreInfo, StoreId, StoreInfo, StoreSource,
};
use rerun::log::{Chunk, ChunkId, LogMsg, RowId};
use rerun::{AsComponents, EntityPath, TimePoint, Timeline};

/// The entities of one recording or blueprint.
pub(super) struct Store {
    id: StoreId,
    first_chunk: u128,
    rows: u128,
    entities: BTreeMap<(EntityPath, bool), Vec<Row>>,
}

struct Row {
    id: RowId,
    time: TimePoint,
    components: Vec<rerun::SerializedComponentBatch>,
}

impl Store {
    /// An empty store; the numbers of its chunks start at `first_chunk`, which should be unlike
    /// that of other stores.
    pub(super) fn new(id: StoreId, first_chunk: u128) -> Self {
        Self {
            id,
            first_chunk,
            rows: 0,
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
        when: &[(&'static str, u32)],
        what: &dyn AsComponents,
    ) {
        self.rows += 1;
        let time = when
            .iter()
            .fold(TimePoint::default(), |time, &(timeline, place)| {
                time.with(Timeline::new_sequence(timeline), i64::from(place))
            });
        self.entities
            .entry((path.into(), when.is_empty()))
            .or_default()
            .push(Row {
                id: RowId::from_u128(self.rows),
                time,
                components: what.as_serialized_batches(),
            });
    }

    /// The messages of this store: one chunk for each entity.
    fn messages(self) -> rerun::log::ChunkResult<Vec<LogMsg>> {
        let info = StoreInfo::new(self.id.clone(), StoreSource::Other("elastocal".to_owned()));
        let mut messages = vec![LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: Tuid::from_u128(self.first_chunk),
            info,
        })];
        for (index, ((path, _), rows)) in (1..).zip(self.entities) {
            let id = ChunkId::from_u128(self.first_chunk.wrapping_add(index));
            let chunk = rows
                .into_iter()
                .fold(Chunk::builder_with_id(id, path), |chunk, row| {
                    chunk.with_serialized_batches(row.id, row.time, row.components)
                })
                .build()?;
            messages.push(LogMsg::ArrowMsg(self.id.clone(), chunk.to_arrow_msg()?));
        }
        Ok(messages)
    }
}

/// The bytes of a file with a recording and the blueprint by which it is shown.
pub(super) fn encode(recording: Store, blueprint: Store) -> Result<Vec<u8>, String> {
    let activation = BlueprintActivationCommand {
        blueprint_id: blueprint.id.clone(),
        make_active: true,
        make_default: true,
    };
    let write = || -> Result<Vec<u8>, Box<dyn std::error::Error>> {
        let mut messages = blueprint.messages()?;
        messages.push(LogMsg::BlueprintActivationCommand(activation));
        messages.extend(recording.messages()?);
        Ok(Encoder::encode(messages.into_iter().map(Ok))?)
    };
    write().map_err(|error| error.to_string())
}
