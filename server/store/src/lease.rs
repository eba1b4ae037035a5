//! Leases: questions in one labeler's hands for a while.

use domain::answer::Which;
use domain::query::Question;
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use crate::error::StoreError;
use crate::labeler::LabelerId;
use crate::query::{QueryId, which, word};
use crate::run::RunId;
use crate::secret::{coin, random_name};
use crate::store::Store;
use crate::study::{check_open, practice};
use crate::writer::Transaction;

/// How long a question stays with a labeler who is not heard of.
const LEASE_MS: i64 = 10 * 60 * 1000;

/// A clip as a lease shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeaseClip {
    /// Name of the clip.
    pub sha256: String,
    /// Pictures.
    pub n_frames: u32,
    /// Pictures a second.
    pub fps: u32,
}

/// A question in a labeler's hands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lease {
    /// Tells nothing, cannot be guessed.
    pub id: String,
    /// Its run.
    pub run: RunId,
    /// What it is about.
    pub query: QueryId,
    /// What is asked.
    pub question: Question,
    /// Which segment is on the left.
    pub left_is: Which,
    /// The left clip; `None` where clips are unwanted.
    pub left: Option<LeaseClip>,
    /// The right clip.
    pub right: Option<LeaseClip>,
    /// The right answer, where this is practice.
    pub practice: Option<Practice>,
    /// Milliseconds since 1970.
    pub expires_at_ms: i64,
}

/// What a labeler who practises is told after the answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Practice {
    /// `left`, `right`, `equal`, `same` or `different`: with the sides of the lease.
    pub expects: String,
    /// Why.
    pub because: String,
}

/// What stands between a labeler and the next question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Queue {
    /// Open questions whose clips are not drawn yet.
    pub n_drawing: u32,
    /// Open questions in other labelers' hands.
    pub n_held: u32,
    /// When the first of those may come back, milliseconds since 1970.
    pub held_until_ms: Option<i64>,
}

impl Store {
    /// The labeler's open leases of a run, renewed and topped up to `count`.
    ///
    /// `needs_clips`: offer only what can be shown. Questions whose lease ran out in somebody
    /// else's hands are taken over when nothing else is left.
    ///
    /// # Errors
    /// [`StoreError::Missing`] for an unknown run; [`StoreError::NotYours`] and
    /// [`StoreError::StudyState`] for a run of a study.
    pub async fn lease(
        &self,
        run: RunId,
        labeler: LabelerId,
        count: u32,
        needs_clips: bool,
        now_ms: i64,
    ) -> Result<Vec<Lease>, StoreError> {
        self.write(move |t| {
            Box::pin(async move {
                let row = sqlx::query("select method from run where id = ?").bind(run.0);
                let row = row.fetch_optional(&mut *t.connection).await?;
                let method: String = row
                    .ok_or_else(|| StoreError::missing("run", &run))?
                    .try_get(0)?;
                check_open(t, run, labeler).await?;
                renew(t, run, labeler, now_ms).await?;
                let mut n_open = count_open(t, run, labeler).await?;
                let holder = Holder {
                    run,
                    labeler,
                    method: &method,
                    now_ms,
                };
                while n_open < count {
                    let Some((question, left_is)) = next_question(t, &holder, needs_clips).await?
                    else {
                        break;
                    };
                    grant(t, &holder, question, left_is).await?;
                    n_open += 1;
                }
                open_leases(t, run, labeler).await
            })
        })
        .await
    }

    /// Keeps a lease for another while; returns until when.
    ///
    /// # Errors
    /// [`StoreError::Missing`], [`StoreError::NotYours`], [`StoreError::Taken`].
    pub async fn heartbeat(
        &self,
        lease: &str,
        labeler: LabelerId,
        now_ms: i64,
    ) -> Result<i64, StoreError> {
        let lease = lease.to_owned();
        self.write(move |t| {
            Box::pin(async move {
                let row =
                    sqlx::query("select labeler_id, state from lease where id = ?").bind(&lease);
                let row = row.fetch_optional(&mut *t.connection).await?;
                let row = row.ok_or_else(|| StoreError::missing("lease", &lease))?;
                if row.try_get::<i64, _>(0)? != labeler.0 {
                    return Err(StoreError::NotYours);
                }
                if row.try_get::<String, _>(1)? == "taken" {
                    return Err(StoreError::Taken);
                }
                let until = now_ms + LEASE_MS;
                sqlx::query("update lease set expires_at_ms = ? where id = ? and state = 'open'")
                    .bind(until)
                    .bind(&lease)
                    .execute(&mut *t.connection)
                    .await?;
                Ok(until)
            })
        })
        .await
    }

    /// What stands between a labeler and the next question, when there is no lease to give.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn queue(&self, run: RunId, labeler: LabelerId) -> Result<Queue, StoreError> {
        let row = sqlx::query(
            "select
                (select count(*) from question join query on query.id = question.query_id
                 where question.run_id = ?1 and question.state = 'open' and query.clip_state = 'waiting'),
                count(*), min(lease.expires_at_ms)
             from question join lease on lease.question_id = question.id and lease.state = 'open'
             where question.run_id = ?1 and question.state = 'open' and lease.labeler_id != ?2",
        )
        .bind(run.0)
        .bind(labeler.0)
        .fetch_one(self.readers())
        .await?;
        Ok(Queue {
            n_drawing: row.try_get(0)?,
            n_held: row.try_get(1)?,
            held_until_ms: row.try_get(2)?,
        })
    }

    /// Which segment a labeler sees on the left in an open or answered lease on this query, or
    /// whoever is asked where a study has planned it.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn left_for(
        &self,
        query: QueryId,
        labeler: LabelerId,
    ) -> Result<Option<Which>, StoreError> {
        let row = sqlx::query(
            "select left_is from study_turn where query_id = ?1
             union all
             select left_is from lease join question on question.id = lease.question_id
             where question.query_id = ?1 and lease.labeler_id = ?2 and lease.state != 'taken' limit 1",
        )
        .bind(query.0)
        .bind(labeler.0)
        .fetch_optional(self.readers())
        .await?;
        row.map(|row| Ok(which(row.try_get(0)?))).transpose()
    }
}

/// Who asks, and where.
struct Holder<'a> {
    run: RunId,
    labeler: LabelerId,
    method: &'a str,
    now_ms: i64,
}

async fn renew(
    t: &mut Transaction<'_>,
    run: RunId,
    labeler: LabelerId,
    now_ms: i64,
) -> Result<(), StoreError> {
    sqlx::query(
        "update lease set expires_at_ms = ? where labeler_id = ? and state = 'open'
         and question_id in (select id from question where run_id = ? and state = 'open')",
    )
    .bind(now_ms + LEASE_MS)
    .bind(labeler.0)
    .bind(run.0)
    .execute(&mut *t.connection)
    .await?;
    Ok(())
}

async fn count_open(
    t: &mut Transaction<'_>,
    run: RunId,
    labeler: LabelerId,
) -> Result<u32, StoreError> {
    let row = sqlx::query(
        "select count(*) from lease join question on question.id = lease.question_id
         where lease.labeler_id = ? and lease.state = 'open' and question.run_id = ? and question.state = 'open'",
    )
    .bind(labeler.0)
    .bind(run.0)
    .fetch_one(&mut *t.connection)
    .await?;
    Ok(row.try_get(0)?)
}

/// The next open question that nobody holds, or that somebody held too long; in the order of
/// asking. A stage question follows its preference, where that is asked, to the same labeler
/// with the same sides. Sides of studies are planned.
async fn next_question(
    t: &mut Transaction<'_>,
    holder: &Holder<'_>,
    needs_clips: bool,
) -> Result<Option<(i64, Option<Which>)>, StoreError> {
    let row = sqlx::query(
        "select question.id, question.kind,
            (select lease.left_is from lease join question as asked on asked.id = lease.question_id
             where asked.query_id = question.query_id and asked.kind = 'preference'
                and lease.labeler_id = ?2 and lease.state != 'taken' limit 1) as mine, study_turn.left_is as planned,
            held.id as held, held.labeler_id, held.left_is
         from question join query on query.id = question.query_id
         left join study_turn on study_turn.query_id = query.id
         left join lease as held on held.question_id = question.id and held.state = 'open'
         where question.run_id = ?1 and question.state = 'open'
            and (query.clip_state = 'ready' or (?3 = 0 and query.clip_state in ('waiting', 'unwanted')))
            and (held.id is null or (held.labeler_id != ?2 and held.expires_at_ms <= ?4))
            and (question.kind = 'preference' or mine is not null
                 or not exists (select 1 from question as asked where asked.query_id = question.query_id
                                and asked.kind = 'preference' and asked.state != 'answered'))
         order by held.id is not null, query.session, query.position, question.kind limit 1",
    )
    .bind(holder.run.0)
    .bind(holder.labeler.0)
    .bind(needs_clips)
    .bind(holder.now_ms)
    .fetch_optional(&mut *t.connection)
    .await?;
    let Some(row) = row else { return Ok(None) };
    if let Some(overdue) = row.try_get::<Option<String>, _>("held")? {
        take(t, holder, &overdue, &row).await?;
    }
    let mine: Option<String> = row.try_get("mine")?;
    let planned: Option<String> = row.try_get("planned")?;
    let left_is = mine.or(planned);
    Ok(Some((row.try_get("id")?, left_is.as_deref().map(which))))
}

/// Ends somebody's overdue lease; what they saw does not count in their balance any more.
async fn take(
    t: &mut Transaction<'_>,
    holder: &Holder<'_>,
    lease: &str,
    row: &SqliteRow,
) -> Result<(), StoreError> {
    sqlx::query("update lease set state = 'taken' where id = ?")
        .bind(lease)
        .execute(&mut *t.connection)
        .await?;
    if row.try_get::<String, _>("kind")? == "preference" {
        let left_is: String = row.try_get("left_is")?;
        let is_first = left_is == "first";
        balance(
            t,
            LabelerId(row.try_get("labeler_id")?),
            holder.method,
            -i64::from(is_first),
            -i64::from(!is_first),
        )
        .await?;
    }
    Ok(())
}

async fn grant(
    t: &mut Transaction<'_>,
    holder: &Holder<'_>,
    question: i64,
    left_is: Option<Which>,
) -> Result<(), StoreError> {
    let left_is = match left_is {
        Some(left_is) => left_is,
        None => draw_side(t, holder).await?,
    };
    sqlx::query(
        "insert into lease (id, question_id, labeler_id, left_is, granted_at_ms, expires_at_ms) values (?, ?, ?, ?, ?, ?)",
    )
    .bind(random_name()?)
    .bind(question)
    .bind(holder.labeler.0)
    .bind(word(left_is))
    .bind(holder.now_ms)
    .bind(holder.now_ms + LEASE_MS)
    .execute(&mut *t.connection)
    .await?;
    Ok(())
}

/// The side that was on the left less often, a coin where both were as often.
async fn draw_side(t: &mut Transaction<'_>, holder: &Holder<'_>) -> Result<Which, StoreError> {
    let row = sqlx::query(
        "select n_first - n_second from side_balance where labeler_id = ? and method = ?",
    )
    .bind(holder.labeler.0)
    .bind(holder.method)
    .fetch_optional(&mut *t.connection)
    .await?;
    let surplus: i64 = row.map_or(Ok(0), |row| row.try_get(0))?;
    let is_first = if surplus == 0 { coin()? } else { surplus < 0 };
    balance(
        t,
        holder.labeler,
        holder.method,
        i64::from(is_first),
        i64::from(!is_first),
    )
    .await?;
    Ok(if is_first {
        Which::First
    } else {
        Which::Second
    })
}

async fn balance(
    t: &mut Transaction<'_>,
    labeler: LabelerId,
    method: &str,
    n_first: i64,
    n_second: i64,
) -> Result<(), StoreError> {
    sqlx::query(
        "insert into side_balance (labeler_id, method, n_first, n_second) values (?1, ?2, ?3, ?4)
         on conflict do update set n_first = n_first + ?3, n_second = n_second + ?4",
    )
    .bind(labeler.0)
    .bind(method)
    .bind(n_first)
    .bind(n_second)
    .execute(&mut *t.connection)
    .await?;
    Ok(())
}

async fn open_leases(
    t: &mut Transaction<'_>,
    run: RunId,
    labeler: LabelerId,
) -> Result<Vec<Lease>, StoreError> {
    let rows = sqlx::query(
        "select lease.id, question.query_id, question.kind, lease.left_is, lease.expires_at_ms,
            a.sha256 as a_sha, a.n_frames as a_frames, a.fps as a_fps,
            b.sha256 as b_sha, b.n_frames as b_frames, b.fps as b_fps,
            iif(study_turn.role = 'practice', study_item.expects, null) as expects, study_item.because
         from lease join question on question.id = lease.question_id
         join query on query.id = question.query_id
         left join clip as a on a.sha256 = query.first_clip
         left join clip as b on b.sha256 = query.second_clip
         left join study_turn on study_turn.query_id = query.id
         left join study_item on study_item.id = study_turn.item_id
         where lease.labeler_id = ? and lease.state = 'open' and question.run_id = ? and question.state = 'open'
         order by query.session, query.position, question.kind",
    )
    .bind(labeler.0)
    .bind(run.0)
    .fetch_all(&mut *t.connection)
    .await?;
    rows.iter().map(|row| read(row, run)).collect()
}

fn read(row: &SqliteRow, run: RunId) -> Result<Lease, StoreError> {
    let clip = |sha: &str, frames: &str, fps: &str| -> Result<Option<LeaseClip>, StoreError> {
        let Some(sha256) = row.try_get::<Option<String>, _>(sha)? else {
            return Ok(None);
        };
        Ok(Some(LeaseClip {
            sha256,
            n_frames: row.try_get(frames)?,
            fps: row.try_get(fps)?,
        }))
    };
    let first = clip("a_sha", "a_frames", "a_fps")?;
    let second = clip("b_sha", "b_frames", "b_fps")?;
    let left_is = which(row.try_get("left_is")?);
    let (left, right) = if left_is == Which::First {
        (first, second)
    } else {
        (second, first)
    };
    Ok(Lease {
        id: row.try_get("id")?,
        run,
        query: QueryId(row.try_get("query_id")?),
        question: question(row.try_get("kind")?),
        left_is,
        left,
        right,
        practice: practice(row)?.map(|practice| practice.seen_with(left_is)),
        expires_at_ms: row.try_get("expires_at_ms")?,
    })
}

impl Practice {
    /// `first` and `second` become what they are on the labeler's page.
    fn seen_with(self, left_is: Which) -> Self {
        let side = |is_left| if is_left { "left" } else { "right" }.to_owned();
        let expects = match self.expects.as_str() {
            "first" => side(left_is == Which::First),
            "second" => side(left_is == Which::Second),
            _ => self.expects,
        };
        Self { expects, ..self }
    }
}

pub(crate) fn question(kind: &str) -> Question {
    if kind == "preference" {
        Question::Preference
    } else {
        Question::SameStage
    }
}
