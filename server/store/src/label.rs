//! Answers as researchers read them: one row each, with everything that belongs to it.

use serde::{Deserialize, Serialize};
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use crate::error::StoreError;
use crate::run::RunId;
use crate::store::Store;
use crate::study::StudyId;
use crate::time::rfc3339;

mod filter;

pub use filter::{FoundLabel, FoundLabels, LabelChoices, LabelFilter, LabelFlag, LabelsFrom};

/// One answer with all that belongs to it; the columns of every export, in this order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Label {
    /// Name of the answer.
    pub answer_id: String,
    /// Run.
    pub run_id: i64,
    /// Task.
    pub task: String,
    /// Method that chose the query; `None` for pairs that no method chose, and in a study that
    /// is not closed.
    pub method: Option<String>,
    /// Seed of the run.
    pub seed: i64,
    /// `preference` or `same_stage`.
    pub question: String,
    /// Gap-free number within run and question.
    pub sequence: i64,
    /// Query.
    pub query_id: i64,
    /// Round of asking, from 0.
    pub session: u32,
    /// Place in the round, from 0.
    pub position: u32,
    /// Who.
    pub labeler: String,
    /// The word that was pressed.
    pub pressed: String,
    /// What it means, whatever the sides: `first`, `second`, or the word.
    pub meaning: String,
    /// Which segment was on the left.
    pub left_is: String,
    /// Why, for a skip.
    pub reason: Option<String>,
    /// The answer that this one replaces.
    pub supersedes: Option<String>,
    /// Whether no later answer replaces this one.
    pub is_current: bool,
    /// Episode of the first segment.
    pub first_episode: i64,
    /// Its first step.
    pub first_start: i64,
    /// Its clip.
    pub first_clip: Option<String>,
    /// Episode of the second segment.
    pub second_episode: i64,
    /// Its first step.
    pub second_start: i64,
    /// Its clip.
    pub second_clip: Option<String>,
    /// Steps in each segment.
    pub segment_len: i64,
    /// Disagreement when it was chosen.
    pub disagreement: Option<f64>,
    /// Stage gap when it was chosen, in the unit of the method's gap.
    pub stage_gap: Option<f64>,
    /// Guidance that was shown.
    pub guidance_sha256: Option<String>,
    /// Visible time, milliseconds.
    pub visible_ms: Option<i64>,
    /// Hidden time, milliseconds.
    pub hidden_ms: Option<i64>,
    /// Loops watched.
    pub loops: Option<f64>,
    /// Jumps in time.
    pub seeks: Option<i64>,
    /// Playback speed.
    pub speed: Option<f64>,
    /// Frames not shown in time.
    pub dropped_frames: Option<i64>,
    /// `key` or `pointer`; `None` where the page itself passed the pair over.
    pub input: Option<String>,
    /// RFC 3339.
    pub stored_at: String,
    /// The study, where it was asked in one.
    pub study_id: Option<i64>,
    /// The study's pair: the same for every labeler.
    pub item_id: Option<i64>,
    /// `counted`, `practice`, `check` or `repeat`, in a study.
    pub role: Option<String>,
    /// The right answer where it is known: `first`, `second`, `equal`, `same`, `different`.
    pub expects: Option<String>,
}

/// Whose answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LabelsOf {
    /// Of one run.
    Run(RunId),
    /// Of all labelers of a study.
    Study(StudyId),
}

impl LabelsOf {
    /// The numbers that a query binds: of the run, or of the study.
    pub(crate) fn ids(self) -> (Option<i64>, Option<i64>) {
        match self {
            Self::Run(run) => (Some(run.0), None),
            Self::Study(study) => (None, Some(study.0)),
        }
    }
}

/// Some answers of many.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelPage {
    /// In the order in which they were stored.
    pub labels: Vec<Label>,
    /// Where the next page begins; `None` on the last.
    pub next: Option<i64>,
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Text.
    Text,
    /// A whole number.
    Integer,
    /// A number.
    Number,
    /// True or false.
    Truth,
}

impl Label {
    /// Names of the columns and what they hold, in order.
    pub const COLUMNS: &[(&str, ColumnKind)] = &[
        ("answer_id", ColumnKind::Text),
        ("run_id", ColumnKind::Integer),
        ("task", ColumnKind::Text),
        ("method", ColumnKind::Text),
        ("seed", ColumnKind::Integer),
        ("question", ColumnKind::Text),
        ("sequence", ColumnKind::Integer),
        ("query_id", ColumnKind::Integer),
        ("session", ColumnKind::Integer),
        ("position", ColumnKind::Integer),
        ("labeler", ColumnKind::Text),
        ("pressed", ColumnKind::Text),
        ("meaning", ColumnKind::Text),
        ("left_is", ColumnKind::Text),
        ("reason", ColumnKind::Text),
        ("supersedes", ColumnKind::Text),
        ("is_current", ColumnKind::Truth),
        ("first_episode", ColumnKind::Integer),
        ("first_start", ColumnKind::Integer),
        ("first_clip", ColumnKind::Text),
        ("second_episode", ColumnKind::Integer),
        ("second_start", ColumnKind::Integer),
        ("second_clip", ColumnKind::Text),
        ("segment_len", ColumnKind::Integer),
        ("disagreement", ColumnKind::Number),
        ("stage_gap", ColumnKind::Number),
        ("guidance_sha256", ColumnKind::Text),
        ("visible_ms", ColumnKind::Integer),
        ("hidden_ms", ColumnKind::Integer),
        ("loops", ColumnKind::Number),
        ("seeks", ColumnKind::Integer),
        ("speed", ColumnKind::Number),
        ("dropped_frames", ColumnKind::Integer),
        ("input", ColumnKind::Text),
        ("stored_at", ColumnKind::Text),
        ("study_id", ColumnKind::Integer),
        ("item_id", ColumnKind::Integer),
        ("role", ColumnKind::Text),
        ("expects", ColumnKind::Text),
    ];
}

/// The method that chose a query, where it is told: in a study once that is closed.
const TOLD_METHOD: &str =
    "iif(run.study_id is null, run.method, iif(study.state = 'closed', study_item.method, null))";

/// Answers and what belongs to them, one row each.
const TABLES: &str = "answer
    join run on run.id = answer.run_id
    join question on question.id = answer.question_id
    join query on query.id = question.query_id
    join labeler on labeler.id = answer.labeler_id
    left join study on study.id = run.study_id
    left join study_turn on study_turn.query_id = query.id
    left join study_item on study_item.id = study_turn.item_id";

/// The columns of every [`Label`], its place in the order of storing, and whether its method is
/// kept from whoever looks.
fn select() -> String {
    format!(
        "select answer.rowid as place, answer.*, run.task, run.seed, query.id as query_id, query.session, query.position,
            {TOLD_METHOD} as method,
            labeler.name as labeler, query.first_clip, query.second_clip, query.disagreement, query.stage_gap,
            a.episode as first_episode, a.start as first_start, a.len as segment_len,
            b.episode as second_episode, b.start as second_start,
            not exists (select 1 from answer as later where later.supersedes = answer.id) as is_current,
            run.study_id, study_turn.item_id, study_turn.role, study_item.expects,
            coalesce(study.state != 'closed', 0) as is_blinded
        from {TABLES}
        join query_segment as a on a.query_id = query.id and a.which = 'first'
        join query_segment as b on b.query_id = query.id and b.which = 'second'"
    )
}

fn read(row: &SqliteRow) -> Result<Label, StoreError> {
    Ok(Label {
        answer_id: row.try_get("id")?,
        run_id: row.try_get("run_id")?,
        task: row.try_get("task")?,
        method: row.try_get("method")?,
        seed: row.try_get("seed")?,
        question: row.try_get("kind")?,
        sequence: row.try_get("sequence")?,
        query_id: row.try_get("query_id")?,
        session: row.try_get("session")?,
        position: row.try_get("position")?,
        labeler: row.try_get("labeler")?,
        pressed: row.try_get("pressed")?,
        meaning: row.try_get("meaning")?,
        left_is: row.try_get("left_is")?,
        reason: row.try_get("reason")?,
        supersedes: row.try_get("supersedes")?,
        is_current: row.try_get("is_current")?,
        first_episode: row.try_get("first_episode")?,
        first_start: row.try_get("first_start")?,
        first_clip: row.try_get("first_clip")?,
        second_episode: row.try_get("second_episode")?,
        second_start: row.try_get("second_start")?,
        second_clip: row.try_get("second_clip")?,
        segment_len: row.try_get("segment_len")?,
        disagreement: row.try_get("disagreement")?,
        stage_gap: row.try_get("stage_gap")?,
        guidance_sha256: row.try_get("guidance_sha256")?,
        visible_ms: row.try_get("visible_ms")?,
        hidden_ms: row.try_get("hidden_ms")?,
        loops: row.try_get("loops")?,
        seeks: row.try_get("seeks")?,
        speed: row.try_get("speed")?,
        dropped_frames: row.try_get("dropped_frames")?,
        input: row.try_get("input")?,
        stored_at: rfc3339(row.try_get("stored_at_ms")?),
        study_id: row.try_get("study_id")?,
        item_id: row.try_get("item_id")?,
        role: row.try_get("role")?,
        expects: row.try_get("expects")?,
    })
}

/// An answered query to look at again.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AnsweredPair {
    /// Query.
    pub query_id: i64,
    /// Round of asking, from 0.
    pub session: u32,
    /// The word that was pressed.
    pub answer: String,
    /// Name of the clip that was on the left.
    pub left: String,
    /// Name of the clip that was on the right.
    pub right: String,
    /// RFC 3339.
    pub stored_at: String,
}

impl Store {
    /// Answers in the order in which they were stored, a page of them at a time.
    ///
    /// * `after` – where the page before ended, 0 for the first
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn labels(
        &self,
        of: LabelsOf,
        after: i64,
        limit: u32,
    ) -> Result<LabelPage, StoreError> {
        let (run, study) = of.ids();
        let page = "where (answer.run_id = ?1 or run.study_id = ?2) and answer.rowid > ?3
            order by answer.rowid limit ?4";
        let rows = sqlx::query(sqlx::AssertSqlSafe(format!("{} {page}", select())))
            .bind(run)
            .bind(study)
            .bind(after)
            .bind(limit)
            .fetch_all(self.readers())
            .await?;
        let is_full = rows.len() == limit as usize;
        let last = rows.last().filter(|_| is_full);
        Ok(LabelPage {
            labels: rows.iter().map(read).collect::<Result<_, _>>()?,
            next: last.map(|row| row.try_get("place")).transpose()?,
        })
    }

    /// The newest answered queries that were shown as clips, newest first.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn newest_pairs(
        &self,
        run: RunId,
        limit: u32,
    ) -> Result<Vec<AnsweredPair>, StoreError> {
        let rows = sqlx::query(
            "select query.id, query.session, answer.pressed,
                iif(answer.left_is = 'first', query.first_clip, query.second_clip),
                iif(answer.left_is = 'first', query.second_clip, query.first_clip), answer.stored_at_ms
             from answer join question on question.id = answer.question_id join query on query.id = question.query_id
             where answer.run_id = ? and answer.kind = 'preference' and query.clip_state = 'ready'
                and not exists (select 1 from answer as later where later.supersedes = answer.id)
             order by answer.sequence desc limit ?",
        )
        .bind(run.0)
        .bind(limit)
        .fetch_all(self.readers())
        .await?;
        rows.iter()
            .map(|row| {
                Ok(AnsweredPair {
                    query_id: row.try_get(0)?,
                    session: row.try_get(1)?,
                    answer: row.try_get(2)?,
                    left: row.try_get(3)?,
                    right: row.try_get(4)?,
                    stored_at: rfc3339(row.try_get(5)?),
                })
            })
            .collect()
    }

    /// How often labelers judged that both segments show one stage: (same, judged).
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn same_stage_rate(&self, run: RunId) -> Result<(u32, u32), StoreError> {
        let row = sqlx::query(
            "select count(*) filter (where meaning = 'same'), count(*) filter (where meaning != 'skip')
             from answer where run_id = ? and kind = 'same_stage'
                and not exists (select 1 from answer as later where later.supersedes = answer.id)",
        )
        .bind(run.0)
        .fetch_one(self.readers())
        .await?;
        Ok((row.try_get(0)?, row.try_get(1)?))
    }
}
