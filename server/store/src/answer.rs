//! Answers: stored once however often they are sent, never changed, superseded by newer rows.

use domain::answer::{Answer, Preference, Which};
use domain::query::QueryKey;
use domain::teacher::Answered;
use serde_json::json;
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use crate::audit::{self, Deed};
use crate::error::StoreError;
use crate::event;
use crate::labeler::{LabelerId, SERVER};
use crate::lease::question;
use crate::notice::Notice;
use crate::pressed::Pressed;
use crate::query::{QueryId, which, word};
use crate::run::RunId;
use crate::secret::random_name;
use crate::store::Store;
use crate::study::{check_open, turn_role};
use crate::time::now_ms;
use crate::writer::Transaction;

/// How a labeler came to an answer.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Timing {
    /// From the first frame of both clips to the key while the page was visible and no dialog lay
    /// over them, milliseconds.
    pub visible_ms: Option<u32>,
    /// While it was hidden, milliseconds.
    pub hidden_ms: Option<u32>,
    /// Loops watched.
    pub loops: Option<f64>,
    /// Jumps in time.
    pub seeks: Option<u32>,
    /// Playback speed at the end.
    pub speed: Option<f64>,
    /// Frames that were not shown in time.
    pub dropped_frames: Option<u32>,
    /// `key` or `pointer`.
    pub input: Option<String>,
}

/// An answer as it arrives.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NewAnswer {
    /// The word.
    pub pressed: String,
    /// Why, for a skip.
    pub reason: Option<String>,
    /// The answer that this one replaces.
    pub supersedes: Option<String>,
    /// SHA-256 of the guidance that was shown.
    pub guidance_sha256: Option<String>,
    /// How.
    pub timing: Timing,
}

/// An answer as it is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredAnswer {
    /// Name.
    pub id: String,
    /// Gap-free number in its run and kind of question, from 1.
    pub sequence: u64,
    /// The word.
    pub pressed: String,
    /// Milliseconds since 1970.
    pub stored_at_ms: i64,
    /// Whether this request stored it; false where it was there already.
    pub is_new: bool,
}

/// A lease as an answer needs it.
struct Leased {
    id: String,
    question_id: i64,
    kind: String,
    run: RunId,
    query: QueryId,
    left_is: Which,
    state: String,
    /// Of a stage question whose pair was skipped.
    is_withdrawn: bool,
}

impl Store {
    /// Stores an answer, its audit row and its event in one transaction; returns after the commit.
    ///
    /// Sent again it is found again. A lease that ran out still takes its answer unless somebody
    /// else has the question now.
    ///
    /// # Errors
    /// [`StoreError::Missing`], [`StoreError::NotYours`], [`StoreError::WrongQuestion`],
    /// [`StoreError::NoReason`], [`StoreError::Different`], [`StoreError::NotSupersedable`];
    /// [`StoreError::Taken`], [`StoreError::Withdrawn`] and, for a study that is closed,
    /// [`StoreError::StudyState`], where the answer is kept aside.
    pub async fn answer(
        &self,
        lease: &str,
        labeler: LabelerId,
        answer: NewAnswer,
    ) -> Result<StoredAnswer, StoreError> {
        let lease = lease.to_owned();
        self.write(move |t| {
            Box::pin(async move {
                let leased = find_lease(t, &lease, labeler).await?;
                let pressed = Pressed::parse(question(&leased.kind), &answer.pressed)?;
                let has_reason = answer
                    .reason
                    .as_ref()
                    .is_some_and(|reason| !reason.trim().is_empty());
                if pressed.word() == "skip" && !has_reason {
                    return Err(StoreError::NoReason);
                }
                if let Some(stored) = find_sent_before(t, &leased, pressed, &answer).await? {
                    return Ok(Ok(stored));
                }
                if let Err(closed) = check_open(t, leased.run, labeler).await {
                    keep_aside(t, &leased, labeler, &answer).await?;
                    return Ok(Err(closed));
                }
                if leased.state == "taken" && is_elsewhere(t, &leased).await? {
                    keep_aside(t, &leased, labeler, &answer).await?;
                    return Ok(Err(StoreError::Taken));
                }
                if leased.is_withdrawn {
                    keep_aside(t, &leased, labeler, &answer).await?;
                    return Ok(Err(StoreError::Withdrawn));
                }
                insert(t, &leased, labeler, pressed, &answer).await.map(Ok)
            })
        })
        .await?
    }

    /// Preferences and skips with a number above `after`, in order: what a run takes in.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn answers_after(&self, run: RunId, after: u64) -> Result<Vec<Answered>, StoreError> {
        let rows = sqlx::query(
            "select answer.sequence, answer.meaning, query.session, query.position
             from answer join question on question.id = answer.question_id join query on query.id = question.query_id
             where answer.run_id = ? and answer.kind = 'preference' and answer.sequence > ? order by answer.sequence",
        )
        .bind(run.0)
        .bind(after.cast_signed())
        .fetch_all(self.readers())
        .await?;
        rows.iter()
            .map(|row| {
                let meaning: String = row.try_get(1)?;
                let preference = match meaning.as_str() {
                    "first" => Some(Preference::Prefer(Which::First)),
                    "second" => Some(Preference::Prefer(Which::Second)),
                    "equal" => Some(Preference::Equal),
                    _ => None,
                };
                Ok(Answered {
                    key: QueryKey {
                        session: row.try_get(2)?,
                        index: row.try_get(3)?,
                    },
                    preference,
                    sequence: row.try_get::<i64, _>(0)?.unsigned_abs(),
                })
            })
            .collect()
    }
}

/// Closes a query that cannot be drawn, in the server's own name.
pub(crate) async fn skip_by_server(
    t: &mut Transaction<'_>,
    query: QueryId,
    reason: &str,
) -> Result<(), StoreError> {
    let row = sqlx::query(
        "select id, run_id from question where query_id = ? and kind = 'preference' and state = 'open'",
    )
    .bind(query.0)
    .fetch_optional(&mut *t.connection)
    .await?;
    let Some(row) = row else { return Ok(()) };
    let leased = Leased {
        id: String::new(),
        question_id: row.try_get(0)?,
        kind: "preference".into(),
        run: RunId(row.try_get(1)?),
        query,
        left_is: Which::First,
        state: "open".into(),
        is_withdrawn: false,
    };
    let answer = NewAnswer {
        pressed: "skip".into(),
        reason: Some(reason.to_owned()),
        ..NewAnswer::default()
    };
    insert(
        t,
        &leased,
        SERVER,
        Pressed::Preference(Answer::Skip),
        &answer,
    )
    .await?;
    Ok(())
}

async fn find_lease(
    t: &mut Transaction<'_>,
    lease: &str,
    labeler: LabelerId,
) -> Result<Leased, StoreError> {
    let row = sqlx::query(
        "select lease.labeler_id, lease.question_id, question.kind, question.run_id, question.query_id,
            lease.left_is, lease.state, question.state = 'withdrawn'
         from lease join question on question.id = lease.question_id where lease.id = ?",
    )
    .bind(lease)
    .fetch_optional(&mut *t.connection)
    .await?;
    let row = row.ok_or_else(|| StoreError::missing("lease", &lease))?;
    if row.try_get::<i64, _>(0)? != labeler.0 {
        return Err(StoreError::NotYours);
    }
    Ok(Leased {
        id: lease.to_owned(),
        question_id: row.try_get(1)?,
        kind: row.try_get(2)?,
        run: RunId(row.try_get(3)?),
        query: QueryId(row.try_get(4)?),
        left_is: which(row.try_get(5)?),
        state: row.try_get(6)?,
        is_withdrawn: row.try_get(7)?,
    })
}

/// The row that this request made when it was sent before; refuses one that contradicts it.
async fn find_sent_before(
    t: &mut Transaction<'_>,
    leased: &Leased,
    pressed: Pressed,
    answer: &NewAnswer,
) -> Result<Option<StoredAnswer>, StoreError> {
    let rows = sqlx::query(
        "select id, sequence, pressed, stored_at_ms, supersedes from answer where lease_id = ? order by sequence",
    )
    .bind(&leased.id)
    .fetch_all(&mut *t.connection)
    .await?;
    let replaces = |row: &&SqliteRow| row.get::<Option<String>, _>(4) == answer.supersedes;
    if let Some(row) = rows.iter().find(replaces) {
        let newest = rows.last().unwrap_or(row);
        let is_same = row.try_get::<String, _>(2)? == pressed.word();
        return if is_same {
            read(row).map(Some)
        } else {
            Err(StoreError::Different(Box::new(read(newest)?)))
        };
    }
    if let Some(superseded) = &answer.supersedes {
        let is_newest = rows
            .last()
            .is_some_and(|row| row.get::<String, _>(0) == *superseded);
        if !is_newest {
            return Err(StoreError::NotSupersedable(superseded.clone()));
        }
    }
    Ok(None)
}

/// Whether somebody else holds or has answered the question of a lease that was taken.
async fn is_elsewhere(t: &mut Transaction<'_>, leased: &Leased) -> Result<bool, StoreError> {
    let row = sqlx::query(
        "select exists (select 1 from answer where question_id = ?1 and supersedes is null)
             or exists (select 1 from lease where question_id = ?1 and state = 'open')",
    )
    .bind(leased.question_id)
    .fetch_one(&mut *t.connection)
    .await?;
    Ok(row.try_get(0)?)
}

async fn keep_aside(
    t: &mut Transaction<'_>,
    leased: &Leased,
    labeler: LabelerId,
    answer: &NewAnswer,
) -> Result<(), StoreError> {
    let body = json!({
        "answer": answer.pressed, "reason": answer.reason, "supersedes": answer.supersedes,
        "visible_ms": answer.timing.visible_ms, "hidden_ms": answer.timing.hidden_ms,
    });
    let added = sqlx::query(
        "insert into late_answer (lease_id, labeler_id, pressed, body, received_at_ms) values (?, ?, ?, ?, ?)
         on conflict (lease_id, body) do nothing",
    )
    .bind(&leased.id)
    .bind(labeler.0)
    .bind(&answer.pressed)
    .bind(body.to_string())
    .bind(now_ms())
    .execute(&mut *t.connection)
    .await?;
    if added.rows_affected() == 0 {
        return Ok(());
    }
    let deed = Deed {
        labeler: Some(labeler),
        run: Some(leased.run),
        action: "answered too late",
        subject: &leased.id,
        detail: body,
    };
    audit::record(t, deed).await
}

async fn insert(
    t: &mut Transaction<'_>,
    leased: &Leased,
    labeler: LabelerId,
    pressed: Pressed,
    answer: &NewAnswer,
) -> Result<StoredAnswer, StoreError> {
    let (id, now) = (random_name()?, now_ms());
    let sequence = next_sequence(t, leased).await?;
    let meaning = pressed.meaning(leased.left_is);
    let timing = &answer.timing;
    sqlx::query(
        "insert into answer (id, run_id, question_id, kind, sequence, lease_id, labeler_id, left_is, pressed, meaning,
            reason, supersedes, guidance_sha256, visible_ms, hidden_ms, loops, seeks, speed, dropped_frames, input,
            stored_at_ms)
         values (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(&id)
    .bind(leased.run.0)
    .bind(leased.question_id)
    .bind(&leased.kind)
    .bind(sequence.cast_signed())
    .bind((!leased.id.is_empty()).then_some(&leased.id))
    .bind(labeler.0)
    .bind(word(leased.left_is))
    .bind(pressed.word())
    .bind(meaning)
    .bind(&answer.reason)
    .bind(&answer.supersedes)
    .bind(&answer.guidance_sha256)
    .bind(timing.visible_ms)
    .bind(timing.hidden_ms)
    .bind(timing.loops)
    .bind(timing.seeks)
    .bind(timing.speed)
    .bind(timing.dropped_frames)
    .bind(&timing.input)
    .bind(now)
    .execute(&mut *t.connection)
    .await?;
    close_question(t, leased, pressed, answer).await?;
    let data = json!({
        "kind": "answer", "question": leased.kind, "sequence": sequence, "query": leased.query,
        "answer": pressed.word(), "superseded": answer.supersedes.is_some(),
    });
    event::add(t, leased.run, &data).await?;
    let action = if answer.supersedes.is_some() {
        "superseded"
    } else {
        "answered"
    };
    let deed = Deed {
        labeler: Some(labeler),
        run: Some(leased.run),
        action,
        subject: &id,
        detail: data,
    };
    audit::record(t, deed).await?;
    if leased.kind == "preference" {
        t.tell(Notice::Answer(leased.run, sequence));
    }
    Ok(StoredAnswer {
        id,
        sequence,
        pressed: pressed.word().into(),
        stored_at_ms: now,
        is_new: true,
    })
}

async fn next_sequence(t: &mut Transaction<'_>, leased: &Leased) -> Result<u64, StoreError> {
    let row = sqlx::query(
        "select coalesce(max(sequence), 0) + 1 from answer where run_id = ? and kind = ?",
    )
    .bind(leased.run.0)
    .bind(&leased.kind)
    .fetch_one(&mut *t.connection)
    .await?;
    Ok(row.try_get::<i64, _>(0)?.unsigned_abs())
}

/// Counters and states that follow from an answer.
async fn close_question(
    t: &mut Transaction<'_>,
    leased: &Leased,
    pressed: Pressed,
    answer: &NewAnswer,
) -> Result<(), StoreError> {
    sqlx::query("update question set state = 'answered' where id = ?")
        .bind(leased.question_id)
        .execute(&mut *t.connection)
        .await?;
    sqlx::query("update lease set state = 'answered' where id = ?")
        .bind(&leased.id)
        .execute(&mut *t.connection)
        .await?;
    if let Some(role) = turn_role(t, leased.query).await? {
        // A study's pairs are fixed: a skip is an answer about a pair, and nothing replaces it.
        let is_one_more = role != "practice" && answer.supersedes.is_none();
        return count(t, leased.run, i64::from(is_one_more)).await;
    }
    if leased.kind != "preference" {
        return Ok(());
    }
    let is_skip = pressed.word() == "skip";
    let was_counted = match &answer.supersedes {
        None => false,
        Some(superseded) => {
            let row = sqlx::query("select pressed from answer where id = ?").bind(superseded);
            row.fetch_one(&mut *t.connection)
                .await?
                .try_get::<String, _>(0)?
                != "skip"
        }
    };
    let more = i64::from(!is_skip) - i64::from(was_counted);
    count(t, leased.run, more).await?;
    let (from, to) = if is_skip {
        ("open", "withdrawn")
    } else {
        ("withdrawn", "open")
    };
    sqlx::query(
        "update question set state = ? where query_id = ? and kind = 'same_stage' and state = ?",
    )
    .bind(to)
    .bind(leased.query.0)
    .bind(from)
    .execute(&mut *t.connection)
    .await?;
    Ok(())
}

async fn count(t: &mut Transaction<'_>, run: RunId, more: i64) -> Result<(), StoreError> {
    sqlx::query("update run set n_labels = n_labels + ? where id = ?")
        .bind(more)
        .bind(run.0)
        .execute(&mut *t.connection)
        .await?;
    Ok(())
}

fn read(row: &SqliteRow) -> Result<StoredAnswer, StoreError> {
    Ok(StoredAnswer {
        id: row.try_get(0)?,
        sequence: row.try_get::<i64, _>(1)?.unsigned_abs(),
        pressed: row.try_get(2)?,
        stored_at_ms: row.try_get(3)?,
        is_new: false,
    })
}

#[cfg(test)]
mod tests;
