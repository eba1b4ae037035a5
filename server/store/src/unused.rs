//! What came of a question and is not learned from: pairs that a page passed over, and answers
//! that came too late.

use sqlx::Row as _;

use crate::error::StoreError;
use crate::label::LabelsOf;
use crate::run::RunId;
use crate::store::Store;

/// A pair that a labeler's page could not show and skipped in their name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PassedOver {
    /// The query; in a study the pair's own, which is the same for every labeler.
    pub query_id: i64,
    /// Round of asking, from 0.
    pub session: u32,
    /// Whose page.
    pub labeler: String,
    /// Why, as the page said.
    pub reason: String,
}

/// How a page's own reason begins.
pub const BY_THE_PAGE: &str = "passed over by the page: ";

impl Store {
    /// What pages passed over by themselves and nobody has answered since, newest first.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn passed_over(
        &self,
        of: LabelsOf,
        limit: u32,
    ) -> Result<Vec<PassedOver>, StoreError> {
        let (run, study) = of.ids();
        let rows = sqlx::query(
            "select coalesce(study_item.query_id, query.id), query.session, labeler.name, answer.reason
             from answer
             join run on run.id = answer.run_id
             join question on question.id = answer.question_id
             join query on query.id = question.query_id
             join labeler on labeler.id = answer.labeler_id
             left join study_turn on study_turn.query_id = query.id
             left join study_item on study_item.id = study_turn.item_id
             where (answer.run_id = ?1 or run.study_id = ?2)
                and answer.pressed = 'skip' and substr(answer.reason, 1, length(?3)) = ?3
                and not exists (select 1 from answer as later where later.supersedes = answer.id)
             order by answer.rowid desc limit ?4",
        )
        .bind(run)
        .bind(study)
        .bind(BY_THE_PAGE)
        .bind(limit)
        .fetch_all(self.readers())
        .await?;
        rows.iter()
            .map(|row| {
                let reason: String = row.try_get(3)?;
                Ok(PassedOver {
                    query_id: row.try_get(0)?,
                    session: row.try_get(1)?,
                    labeler: row.try_get(2)?,
                    reason: reason
                        .strip_prefix(BY_THE_PAGE)
                        .unwrap_or(&reason)
                        .to_owned(),
                })
            })
            .collect()
    }

    /// How many answers to a run's questions came when somebody else had them, the pair was
    /// withdrawn or its study closed: kept aside, and not learned from.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn n_late_answers(&self, run: RunId) -> Result<u32, StoreError> {
        let row = sqlx::query(
            "select count(*) from late_answer join lease on lease.id = late_answer.lease_id
             join question on question.id = lease.question_id where question.run_id = ?",
        )
        .bind(run.0)
        .fetch_one(self.readers())
        .await?;
        Ok(row.try_get(0)?)
    }
}
