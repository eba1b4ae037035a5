//! Studies with people: what a study's file says.
//!
//! A study asks labelers about fixed pairs of segments: which is better, or whether both show the
//! same stage of the task. Its file says where the segments come from, how many pairs each
//! labeler answers, and what labelers read before they begin.

mod file;
mod known_pair;
mod plan;
mod query_set;
mod ready;
mod section;
mod source;

pub use file::StudyFile;
pub use known_pair::{Expected, KnownPair, Player, Shot};
pub use plan::{PairRole, PlanError, PlannedPair, plan};
pub use query_set::{
    DEFAULT_QUERIES, PackedQueries, PackedQuery, PackedSegment, QuerySetError, spread,
};
pub use ready::READY;
pub use section::{Mistake, Mistakes};
pub use source::{QuerySet, Source};
