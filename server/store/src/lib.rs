//! Keeps runs, queries, clips and answers in SQLite, so that what was acknowledged stays.
//!
//! Invariants: every change goes through one [writer](Store) that commits what waits in one
//! transaction and replies after the commit; answers and audit rows are only ever added; the
//! only crate that speaks SQL; knows neither tensors nor pixels nor HTTP.

mod answer;
mod audit;
mod clip;
mod demonstration;
mod error;
mod event;
mod label;
mod labeler;
mod lease;
mod notice;
mod pressed;
mod query;
mod run;
mod secret;
mod store;
mod study;
mod time;
mod token;
mod unused;
mod writer;

pub use answer::{NewAnswer, StoredAnswer, Timing};
pub use clip::{ClipInfo, NewClip};
pub use demonstration::{DemonstrationRow, NewDemonstration};
pub use error::{LinkTrouble, StoreError};
pub use event::EventRow;
pub use label::{
    AnsweredPair, ColumnKind, FoundLabel, FoundLabels, Label, LabelChoices, LabelFilter, LabelFlag,
    LabelPage, LabelsFrom, LabelsOf,
};
pub use labeler::{Labeler, LabelerId};
pub use lease::{Lease, LeaseClip, Practice, Queue};
pub use pressed::Pressed;
pub use query::{BadQuery, ClipJob, QueryId, TaskRewards};
pub use run::{NewRun, Progress, RunId, RunRow, RunState};
pub use secret::Secret;
pub use store::Store;
pub use study::{
    Entered, Entrance, ItemLine, ItemRole, NewItem, NewStudy, Part, SealedClips, Seat, StudyId,
    StudyPlan, StudyRow,
};
pub use time::{now_ms, rfc3339};
pub use token::{Bearer, TokenKind};
pub use unused::{BY_THE_PAGE, PassedOver};
