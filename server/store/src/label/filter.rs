//! Answers that fit a filter, newest first, a page of them at a time: to look at again.

use domain::query::Question;
use sqlx::sqlite::SqliteRow;
use sqlx::{Encode, QueryBuilder, Row as _, Sqlite, Type};

use super::{Label, TABLES, TOLD_METHOD, read, select};
use crate::error::StoreError;
use crate::pressed::Pressed;
use crate::run::RunId;
use crate::store::Store;
use crate::study::StudyId;

/// Which answers. What is said must all fit; what is `None` is not asked about.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LabelFilter {
    /// Of this run.
    pub run: Option<RunId>,
    /// Of all labelers of this study.
    pub study: Option<StudyId>,
    /// Name of whoever answered, whatever its capitals.
    pub labeler: Option<String>,
    /// Name of the run's task.
    pub task: Option<String>,
    /// Method that chose the query; no answer of a study fits before that is closed.
    pub method: Option<String>,
    /// What was asked.
    pub question: Option<Question>,
    /// What was pressed, by its word: a skip is the same whatever was asked.
    pub pressed: Option<Pressed>,
    /// What sets the answer apart.
    pub flag: Option<LabelFlag>,
    /// Round of asking, from 0.
    pub session: Option<u32>,
    /// Stored then or later, milliseconds since 1970.
    pub from_ms: Option<i64>,
    /// Stored before then, milliseconds since 1970.
    pub before_ms: Option<i64>,
}

/// What sets an answer apart from others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LabelFlag {
    /// It replaces another, or another replaces it.
    Changed,
    /// A skip.
    Skipped,
    /// A skip that nobody pressed: the labeler's page, a program or the server passed the pair over.
    PassedOver,
    /// Of a study: to learn what is asked.
    Practice,
    /// Of a study: its right answer is known.
    Check,
    /// Of a study: asked once more with the sides swapped.
    Repeat,
}

/// Where a page of answers begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LabelsFrom {
    /// At the newest.
    Newest,
    /// Below a place in the order of storing.
    Below(i64),
}

/// A page of answers.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundLabels {
    /// Newest first.
    pub labels: Vec<FoundLabel>,
    /// How many fit, on all pages.
    pub n_in_all: u64,
    /// Where the page of newer ones begins; `None` at the newest.
    pub newer: Option<LabelsFrom>,
    /// Where the page of older ones begins; `None` at the oldest.
    pub older: Option<LabelsFrom>,
}

/// An answer that was looked for.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundLabel {
    /// As every export has it.
    pub label: Label,
    /// Whether it is of a study that is not closed, so that its method is not told.
    pub is_blinded: bool,
}

/// What there is to filter by.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelChoices {
    /// Names of those who answered.
    pub labelers: Vec<String>,
    /// Tasks of which there are answers.
    pub tasks: Vec<String>,
    /// Methods that are told, of runs and studies with answers.
    pub methods: Vec<String>,
}

impl LabelFlag {
    fn condition(self) -> &'static str {
        match self {
            Self::Changed => {
                "(answer.supersedes is not null
                or exists (select 1 from answer as later where later.supersedes = answer.id))"
            }
            Self::Skipped => "answer.pressed = 'skip'",
            Self::PassedOver => "answer.pressed = 'skip' and answer.input is null",
            Self::Practice => "study_turn.role = 'practice'",
            Self::Check => "study_turn.role = 'check'",
            Self::Repeat => "study_turn.role = 'repeat'",
        }
    }
}

impl Store {
    /// Answers that fit, newest first. Pages lie side by side, whatever is stored meanwhile: none
    /// leaves an answer out or shows one that the page beside it shows. Only the newest page is
    /// always full, and may show some of the one below it again.
    ///
    /// * `limit` – answers on a page
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn filtered_labels(
        &self,
        filter: &LabelFilter,
        from: LabelsFrom,
        limit: u32,
    ) -> Result<FoundLabels, StoreError> {
        let mut rows = self
            .rows_below(filter, from, limit.saturating_add(1))
            .await?;
        let has_older = rows.len() > limit as usize;
        rows.truncate(limit as usize);
        let last = rows.last().filter(|_| has_older);
        let last: Option<i64> = last.map(|row| row.try_get("place")).transpose()?;
        Ok(FoundLabels {
            labels: rows.iter().map(found).collect::<Result<_, _>>()?,
            n_in_all: self.count(filter).await?,
            newer: match from {
                LabelsFrom::Newest => None,
                LabelsFrom::Below(place) => self.page_above(filter, place, limit).await?,
            },
            older: last.map(LabelsFrom::Below),
        })
    }

    /// What there is to filter by: nothing that no answer has, and no method that is not told.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn label_choices(&self) -> Result<LabelChoices, StoreError> {
        let labelers =
            "select name from labeler where id in (select labeler_id from answer) order by name";
        let tasks = "select distinct task from run
             where exists (select 1 from answer where answer.run_id = run.id) order by task";
        let methods = format!(
            "select distinct {TOLD_METHOD} as method from run
             left join study on study.id = run.study_id
             left join study_item on study_item.study_id = study.id
             where {TOLD_METHOD} is not null
                and exists (select 1 from answer where answer.run_id = run.id) order by 1"
        );
        Ok(LabelChoices {
            labelers: self.names(labelers.to_owned()).await?,
            tasks: self.names(tasks.to_owned()).await?,
            methods: self.names(methods).await?,
        })
    }

    /// At most `n` rows with all that belongs to them, newest first.
    async fn rows_below(
        &self,
        filter: &LabelFilter,
        from: LabelsFrom,
        n: u32,
    ) -> Result<Vec<SqliteRow>, StoreError> {
        // What belongs to an answer is looked up for those on the page alone.
        let chosen = format!(
            "{} where answer.rowid in (select answer.rowid from {TABLES}",
            select()
        );
        let mut query = narrowed(chosen, filter);
        if let LabelsFrom::Below(place) = from {
            narrow(&mut query, "answer.rowid <", Some(place));
        }
        query
            .push(" order by answer.rowid desc limit ")
            .push_bind(n);
        query.push(") order by answer.rowid desc");
        Ok(query.build().fetch_all(self.readers()).await?)
    }

    async fn count(&self, filter: &LabelFilter) -> Result<u64, StoreError> {
        let mut query = narrowed(format!("select count(*) from {TABLES}"), filter);
        let row = query.build().fetch_one(self.readers()).await?;
        Ok(row.try_get::<i64, _>(0)?.unsigned_abs())
    }

    /// Where the page begins that ends right above a place; `None` where nothing lies above it.
    async fn page_above(
        &self,
        filter: &LabelFilter,
        place: i64,
        limit: u32,
    ) -> Result<Option<LabelsFrom>, StoreError> {
        let mut query = narrowed(format!("select answer.rowid from {TABLES}"), filter);
        narrow(&mut query, "answer.rowid >=", Some(place));
        query.push(" order by answer.rowid limit ");
        query.push_bind(limit.saturating_add(1));
        let above = query.build().fetch_all(self.readers()).await?;
        if above.is_empty() {
            return Ok(None);
        }
        let begin = above.get(limit as usize);
        let begin: Option<i64> = begin.map(|row| row.try_get(0)).transpose()?;
        Ok(Some(begin.map_or(LabelsFrom::Newest, LabelsFrom::Below)))
    }

    /// The first column.
    async fn names(&self, sql: String) -> Result<Vec<String>, StoreError> {
        let rows = sqlx::query(sqlx::AssertSqlSafe(sql))
            .fetch_all(self.readers())
            .await?;
        rows.iter().map(|row| Ok(row.try_get(0)?)).collect()
    }
}

/// Of what is selected, that which fits a filter.
fn narrowed(select: String, filter: &LabelFilter) -> QueryBuilder<Sqlite> {
    let mut query = QueryBuilder::new(select);
    query.push(" where true");
    narrow(&mut query, "answer.run_id =", filter.run.map(|run| run.0));
    let study = filter.study.map(|study| study.0);
    narrow(&mut query, "run.study_id =", study);
    narrow(&mut query, "labeler.name =", filter.labeler.clone());
    narrow(&mut query, "run.task =", filter.task.clone());
    let told = format!("{TOLD_METHOD} =");
    narrow(&mut query, &told, filter.method.clone());
    narrow(&mut query, "answer.kind =", filter.question.map(kind));
    let pressed = filter.pressed.map(Pressed::word);
    narrow(&mut query, "answer.pressed =", pressed);
    narrow(&mut query, "query.session =", filter.session);
    narrow(&mut query, "answer.stored_at_ms >=", filter.from_ms);
    narrow(&mut query, "answer.stored_at_ms <", filter.before_ms);
    if let Some(flag) = filter.flag {
        query.push(" and ").push(flag.condition());
    }
    query
}

/// One more condition, where there is a value: `" and {condition} ?"`.
fn narrow<'v, T>(query: &mut QueryBuilder<Sqlite>, condition: &str, value: Option<T>)
where
    T: Encode<'v, Sqlite> + Type<Sqlite>,
{
    if let Some(value) = value {
        query.push(" and ").push(condition).push(" ");
        query.push_bind(value);
    }
}

/// As the column `kind` of answers has it.
fn kind(question: Question) -> &'static str {
    match question {
        Question::Preference => "preference",
        Question::SameStage => "same_stage",
    }
}

fn found(row: &SqliteRow) -> Result<FoundLabel, StoreError> {
    Ok(FoundLabel {
        label: read(row)?,
        is_blinded: row.try_get("is_blinded")?,
    })
}

#[cfg(test)]
mod tests;
