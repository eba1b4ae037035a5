//! What one labeler is asked, task by task.

use sqlx::Row as _;

use super::{ROW, StudyRow, read};
use crate::error::StoreError;
use crate::labeler::LabelerId;
use crate::lease::Practice;
use crate::query::QueryId;
use crate::run::RunId;
use crate::store::Store;
use crate::writer::Transaction;

/// The questions about one task to one labeler.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Their run.
    pub run: RunId,
    /// The task's name.
    pub task: String,
    /// Answers, practice not counted.
    pub answered: u32,
    /// Questions, practice not counted.
    pub budget: u32,
    /// Whether nothing is left to answer, practice included.
    pub is_done: bool,
}

impl Store {
    /// The study in which a labeler sits, the seat's number, and the parts in their order; `None` for a labeler of
    /// ordinary runs.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn seat_of(
        &self,
        labeler: LabelerId,
    ) -> Result<Option<(StudyRow, u32, Vec<Part>)>, StoreError> {
        let seat = sqlx::query("select study_id, number, id from study_seat where labeler_id = ?")
            .bind(labeler.0)
            .fetch_optional(self.readers())
            .await?;
        let Some(seat) = seat else { return Ok(None) };
        let study = sqlx::query(sqlx::AssertSqlSafe(format!("{ROW} where study.id = ?")))
            .bind(seat.try_get::<i64, _>(0)?)
            .fetch_one(self.readers())
            .await?;
        let rows = sqlx::query(
            "select run.id, run.task, run.n_labels, run.budget,
                not exists (select 1 from question where question.run_id = run.id and question.state = 'open')
             from study_part join run on run.id = study_part.run_id where study_part.seat_id = ? order by study_part.task",
        )
        .bind(seat.try_get::<i64, _>(2)?)
        .fetch_all(self.readers())
        .await?;
        let parts = rows.iter().map(|row| {
            Ok(Part {
                run: RunId(row.try_get(0)?),
                task: row.try_get(1)?,
                answered: row.try_get(2)?,
                budget: row.try_get(3)?,
                is_done: row.try_get(4)?,
            })
        });
        let parts: Result<Vec<Part>, StoreError> = parts.collect();
        Ok(Some((read(&study)?, seat.try_get(1)?, parts?)))
    }
}

/// Refuses questions of a study to all but the labeler whose they are, and to everybody while
/// the study is not open; refuses questions of other runs to those who were invited to a study.
pub(crate) async fn check_open(
    t: &mut Transaction<'_>,
    run: RunId,
    labeler: LabelerId,
) -> Result<(), StoreError> {
    let row = sqlx::query(
        "select study.state, study_seat.labeler_id from run join study on study.id = run.study_id
         left join study_part on study_part.run_id = run.id
         left join study_seat on study_seat.id = study_part.seat_id where run.id = ?",
    )
    .bind(run.0)
    .fetch_optional(&mut *t.connection)
    .await?;
    let Some(row) = row else {
        let seated = sqlx::query("select 1 from study_seat where labeler_id = ?").bind(labeler.0);
        let seated = seated.fetch_optional(&mut *t.connection).await?;
        return seated.map_or(Ok(()), |_| Err(StoreError::NotYours));
    };
    if row.try_get::<Option<i64>, _>(1)? != Some(labeler.0) {
        return Err(StoreError::NotYours);
    }
    let state: String = row.try_get(0)?;
    if state == "open" {
        return Ok(());
    }
    let told = "it takes no answers";
    Err(StoreError::StudyState { state, told })
}

/// Why a labeler of a study is asked this; `None` outside of studies.
pub(crate) async fn turn_role(
    t: &mut Transaction<'_>,
    query: QueryId,
) -> Result<Option<String>, StoreError> {
    let row = sqlx::query("select role from study_turn where query_id = ?")
        .bind(query.0)
        .fetch_optional(&mut *t.connection)
        .await?;
    Ok(row.map(|row| row.try_get(0)).transpose()?)
}

/// The right answer of a practice pair with its reason, in the columns `expects`, `because`.
pub(crate) fn practice(row: &sqlx::sqlite::SqliteRow) -> Result<Option<Practice>, StoreError> {
    let expects: Option<String> = row.try_get("expects")?;
    let Some(expects) = expects else {
        return Ok(None);
    };
    Ok(Some(Practice {
        expects,
        because: row
            .try_get::<Option<String>, _>("because")?
            .unwrap_or_default(),
    }))
}
