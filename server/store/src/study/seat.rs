//! Places for labelers, and the links that lead to them.

use domain::answer::Which;
use domain::random::{Rng, Stream};
use domain::study::{self, Role, Turn};
use serde_json::json;
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use super::item::{COPY_SEGMENTS, collection};
use super::{StudyId, note, state_of};
use crate::error::{LinkTrouble, StoreError};
use crate::labeler::{self, Labeler, LabelerId, name_of_seat};
use crate::query::{QueryId, ask, word};
use crate::run;
use crate::secret::Secret;
use crate::store::Store;
use crate::time::now_ms;
use crate::writer::Transaction;

/// What a study's file says about the order of its questions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyPlan {
    /// Names of the tasks, in the order in which labelers meet them.
    pub tasks: Vec<String>,
    /// Pairs of each task that are asked once more with their sides swapped.
    pub repeats_per_task: u32,
    /// Of every draw.
    pub seed: u64,
}

/// Where a link leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entrance {
    /// The study.
    pub study: StudyId,
    /// The seat's number in it, from 1.
    pub number: u32,
    /// Whether somebody sits there already, who comes back.
    pub is_return: bool,
}

/// A labeler who sits down.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entered {
    /// Who.
    pub labeler: Labeler,
    /// For the browser.
    pub browser: Secret,
    /// For coming back from another machine.
    pub return_code: Secret,
}

/// A place, as researchers see it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seat {
    /// From 1.
    pub number: u32,
    /// Milliseconds since 1970.
    pub invited_at_ms: i64,
    /// Until when its link works, milliseconds since 1970.
    pub expires_at_ms: i64,
    /// Whether its link was used.
    pub is_used: bool,
    /// When somebody first sat down, milliseconds since 1970.
    pub entered_at_ms: Option<i64>,
    /// Answers, practice not counted.
    pub answered: u32,
    /// Questions, practice not counted; 0 before somebody sits down.
    pub budget: u32,
    /// When the newest answer came, milliseconds since 1970.
    pub answered_at_ms: Option<i64>,
}

impl Store {
    /// New places; each secret is shown now and never again.
    ///
    /// * `most` – places that the study has in all
    ///
    /// # Errors
    /// [`StoreError::Missing`]; [`StoreError::StudyState`] while clips are missing, and after
    /// closing; [`StoreError::NoSeatLeft`], and then no place was made.
    pub async fn invite(
        &self,
        study: StudyId,
        n: u32,
        most: u32,
        expires_at_ms: i64,
    ) -> Result<Vec<(u32, Secret)>, StoreError> {
        let secrets: Vec<Secret> = (0..n).map(|_| Secret::random()).collect::<Result<_, _>>()?;
        self.write(move |t| {
            Box::pin(async move {
                check_inviting(t, study).await?;
                let row = sqlx::query("select count(*) from study_seat where study_id = ?").bind(study.0);
                let invited: u32 = row.fetch_one(&mut *t.connection).await?.try_get(0)?;
                if invited.saturating_add(n) > most {
                    return Err(StoreError::NoSeatLeft { most, invited });
                }
                for (number, secret) in (invited + 1..).zip(&secrets) {
                    sqlx::query(
                        "insert into study_seat (study_id, number, invite_hash, invited_at_ms, expires_at_ms) values (?, ?, ?, ?, ?)",
                    )
                    .bind(study.0)
                    .bind(number)
                    .bind(secret.hash())
                    .bind(now_ms())
                    .bind(expires_at_ms)
                    .execute(&mut *t.connection)
                    .await?;
                }
                note(t, study, "invited", json!({"n": n, "expires_at_ms": expires_at_ms})).await?;
                Ok((invited + 1..).zip(secrets).collect())
            })
        })
        .await
    }

    /// A new link to a place, whoever sits there; the old one works no longer.
    ///
    /// # Errors
    /// [`StoreError::Missing`]; [`StoreError::StudyState`].
    pub async fn invite_again(
        &self,
        study: StudyId,
        number: u32,
        expires_at_ms: i64,
    ) -> Result<Secret, StoreError> {
        let secret = Secret::random()?;
        self.write(move |t| {
            Box::pin(async move {
                check_inviting(t, study).await?;
                let changed = sqlx::query(
                    "update study_seat set invite_hash = ?, expires_at_ms = ?, invite_used = 0 where study_id = ? and number = ?",
                )
                .bind(secret.hash())
                .bind(expires_at_ms)
                .bind(study.0)
                .bind(number)
                .execute(&mut *t.connection)
                .await?;
                if changed.rows_affected() == 0 {
                    return Err(StoreError::missing("labeler", &number));
                }
                note(t, study, "invited again", json!({"seat": number})).await?;
                Ok(secret)
            })
        })
        .await
    }

    /// Where a link leads; uses nothing up, for links are opened by more than people.
    ///
    /// # Errors
    /// [`StoreError::Link`].
    pub async fn entrance(&self, secret: &Secret, now_ms: i64) -> Result<Entrance, StoreError> {
        let row = sqlx::query(INVITED)
            .bind(secret.hash())
            .fetch_optional(self.readers())
            .await?;
        entrance(row.as_ref(), now_ms)
    }

    /// Uses a link up: somebody has agreed to the consent text and sits down. The first time
    /// their questions are laid out; a return code is given each time, and earlier ones end.
    ///
    /// # Errors
    /// [`StoreError::Link`].
    pub async fn enter(
        &self,
        secret: &Secret,
        plan: StudyPlan,
        now_ms: i64,
    ) -> Result<Entered, StoreError> {
        let hash = secret.hash();
        let (browser, return_code) = (Secret::random()?, Secret::for_people()?);
        self.write(move |t| {
            Box::pin(async move {
                let row = sqlx::query(INVITED).bind(hash);
                let row = row.fetch_optional(&mut *t.connection).await?;
                let entrance = entrance(row.as_ref(), now_ms)?;
                let row = row.ok_or(StoreError::Link(LinkTrouble::Unknown))?;
                let seat: i64 = row.try_get("id")?;
                let name = name_of_seat(entrance.number, entrance.study);
                let seated = row.try_get::<Option<i64>, _>("labeler_id")?;
                let id = if let Some(seated) = seated {
                    LabelerId(seated)
                } else {
                    lay_out(t, entrance, seat, &plan).await?;
                    labeler::find_or_add_kept(t, &name).await?
                };
                sqlx::query(
                    "update study_seat set invite_used = 1, labeler_id = ?, return_hash = ?,
                        entered_at_ms = coalesce(entered_at_ms, ?) where id = ?",
                )
                .bind(id.0)
                .bind(return_code.hash())
                .bind(now_ms)
                .bind(seat)
                .execute(&mut *t.connection)
                .await?;
                labeler::admit(t, id, &browser).await?;
                let action = if entrance.is_return {
                    "came back"
                } else {
                    "agreed and sat down"
                };
                note(t, entrance.study, action, json!({"seat": entrance.number})).await?;
                let labeler = Labeler { id, name };
                Ok(Entered {
                    labeler,
                    browser,
                    return_code,
                })
            })
        })
        .await
    }

    /// A browser for the labeler whose return code this is. The code goes on working.
    ///
    /// # Errors
    /// [`StoreError::Link`].
    pub async fn come_back(&self, code: &Secret) -> Result<Secret, StoreError> {
        let (hash, browser) = (code.hash(), Secret::random()?);
        self.write(move |t| {
            Box::pin(async move {
                let row = sqlx::query(
                    "select study_seat.*, study.state from study_seat join study on study.id = study_seat.study_id
                     where return_hash = ?",
                )
                .bind(hash)
                .fetch_optional(&mut *t.connection)
                .await?;
                let row = row.ok_or(StoreError::Link(LinkTrouble::Unknown))?;
                if row.try_get::<String, _>("state")? == "closed" {
                    return Err(StoreError::Link(LinkTrouble::Closed));
                }
                let id = LabelerId(row.try_get("labeler_id")?);
                labeler::admit(t, id, &browser).await?;
                let study = StudyId(row.try_get("study_id")?);
                let number: u32 = row.try_get("number")?;
                note(t, study, "came back", json!({"seat": number})).await?;
                Ok(browser)
            })
        })
        .await
    }

    /// Every place of a study, by number.
    ///
    /// # Errors
    /// When the database cannot be read.
    pub async fn seats(&self, study: StudyId) -> Result<Vec<Seat>, StoreError> {
        let rows = sqlx::query(
            "select number, invited_at_ms, expires_at_ms, invite_used, entered_at_ms,
                coalesce((select sum(run.n_labels) from study_part join run on run.id = study_part.run_id
                 where study_part.seat_id = study_seat.id), 0) as answered,
                coalesce((select sum(run.budget) from study_part join run on run.id = study_part.run_id
                 where study_part.seat_id = study_seat.id), 0) as budget,
                (select max(answer.stored_at_ms) from study_part join answer on answer.run_id = study_part.run_id
                 where study_part.seat_id = study_seat.id) as answered_at_ms
             from study_seat where study_id = ? order by number",
        )
        .bind(study.0)
        .fetch_all(self.readers())
        .await?;
        rows.iter()
            .map(|row| {
                Ok(Seat {
                    number: row.try_get("number")?,
                    invited_at_ms: row.try_get("invited_at_ms")?,
                    expires_at_ms: row.try_get("expires_at_ms")?,
                    is_used: row.try_get("invite_used")?,
                    entered_at_ms: row.try_get("entered_at_ms")?,
                    answered: row.try_get("answered")?,
                    budget: row.try_get("budget")?,
                    answered_at_ms: row.try_get("answered_at_ms")?,
                })
            })
            .collect()
    }
}

const INVITED: &str = "select study_seat.*, study.state from study_seat
    join study on study.id = study_seat.study_id where invite_hash = ?";

async fn check_inviting(t: &mut Transaction<'_>, study: StudyId) -> Result<(), StoreError> {
    let state = state_of(t, study).await?;
    let told = match state.as_str() {
        "ready" | "open" => return Ok(()),
        "closed" => "nobody can be invited any more",
        _ => "people can be invited once all clips are there",
    };
    Err(StoreError::StudyState { state, told })
}

fn entrance(row: Option<&SqliteRow>, now_ms: i64) -> Result<Entrance, StoreError> {
    let row = row.ok_or(StoreError::Link(LinkTrouble::Unknown))?;
    let state: String = row.try_get("state")?;
    let trouble = match state.as_str() {
        "closed" => Some(LinkTrouble::Closed),
        _ if row.try_get("invite_used")? => Some(LinkTrouble::Used),
        _ if row.try_get::<i64, _>("expires_at_ms")? <= now_ms => Some(LinkTrouble::Expired),
        "open" => None,
        _ => Some(LinkTrouble::NotYet),
    };
    if let Some(trouble) = trouble {
        return Err(StoreError::Link(trouble));
    }
    Ok(Entrance {
        study: StudyId(row.try_get("study_id")?),
        number: row.try_get("number")?,
        is_return: row.try_get::<Option<i64>, _>("labeler_id")?.is_some(),
    })
}

/// A pair as laying out needs it.
struct Placed {
    item: i64,
    query: QueryId,
    task: usize,
    method: usize,
    role: String,
}

/// A question to be laid out.
struct Question<'p> {
    placed: &'p Placed,
    role: &'static str,
    left_is: Which,
    session: u32,
}

/// One run for each task with all questions to one labeler: practice first, then the rest.
async fn lay_out(
    t: &mut Transaction<'_>,
    entrance: Entrance,
    seat: i64,
    plan: &StudyPlan,
) -> Result<(), StoreError> {
    let row = sqlx::query("select question from study where id = ?").bind(entrance.study.0);
    let kind: String = row.fetch_one(&mut *t.connection).await?.try_get(0)?;
    let placed = read_items(t, entrance.study).await?;
    let (practice, rest): (Vec<_>, Vec<_>) = placed.iter().partition(|p| p.role == "practice");
    let items: Vec<study::Item> = rest
        .iter()
        .map(|p| study::Item {
            task: p.task,
            method: p.method,
            is_check: p.role == "check",
        })
        .collect();
    let mut rng = Rng::new(plan.seed, Stream::Study, u64::from(entrance.number));
    let turns = study::turns(&items, plan.repeats_per_task, &mut rng);
    for (task, name) in (0_u32..).zip(&plan.tasks) {
        let own = |turn: &&Turn| items[turn.item].task == task as usize;
        let of_task: Vec<&Turn> = turns.iter().filter(own).collect();
        let mut questions: Vec<Question> = Vec::new();
        for placed in practice.iter().filter(|p| p.task == task as usize) {
            questions.push(Question {
                placed,
                role: "practice",
                left_is: if rng.chance(0.5) {
                    Which::First
                } else {
                    Which::Second
                },
                session: 0,
            });
        }
        questions.extend(of_task.iter().map(|turn| Question {
            placed: rest[turn.item],
            role: role(turn.role),
            left_is: turn.left_is,
            session: 1,
        }));
        let run = run::insert(
            t,
            &collection(name, of_task.len() as u32),
            Some(entrance.study),
        )
        .await?;
        sqlx::query("insert into study_part (run_id, seat_id, task) values (?, ?, ?)")
            .bind(run.0)
            .bind(seat)
            .bind(task)
            .execute(&mut *t.connection)
            .await?;
        for placed in (0..).zip(&questions) {
            put(t, run, &kind, placed).await?;
        }
    }
    Ok(())
}

async fn read_items(t: &mut Transaction<'_>, study: StudyId) -> Result<Vec<Placed>, StoreError> {
    let rows = sqlx::query(
        "select id, query_id, task, method_number, role from study_item where study_id = ? order by id",
    )
    .bind(study.0)
    .fetch_all(&mut *t.connection)
    .await?;
    let index = |row: &SqliteRow, column| -> Result<usize, StoreError> {
        Ok(row.try_get::<u32, _>(column)? as usize)
    };
    rows.iter()
        .map(|row| {
            Ok(Placed {
                item: row.try_get("id")?,
                query: QueryId(row.try_get("query_id")?),
                task: index(row, "task")?,
                method: index(row, "method_number")?,
                role: row.try_get("role")?,
            })
        })
        .collect()
}

fn role(role: Role) -> &'static str {
    match role {
        Role::Counted => "counted",
        Role::Check => "check",
        Role::Repeat => "repeat",
    }
}

async fn put(
    t: &mut Transaction<'_>,
    run: run::RunId,
    kind: &str,
    (position, question): (u32, &Question<'_>),
) -> Result<(), StoreError> {
    let row = sqlx::query(
        "insert into query (run_id, session, position, asks_same_stage, clip_state, first_clip, second_clip, created_at_ms)
         select ?, ?, ?, 0, 'ready', first_clip, second_clip, ? from query where id = ? returning id",
    )
    .bind(run.0)
    .bind(question.session)
    .bind(position)
    .bind(now_ms())
    .bind(question.placed.query.0)
    .fetch_one(&mut *t.connection)
    .await?;
    let query = QueryId(row.try_get(0)?);
    sqlx::query(COPY_SEGMENTS)
        .bind(query.0)
        .bind(question.placed.query.0)
        .execute(&mut *t.connection)
        .await?;
    sqlx::query("insert into study_turn (query_id, item_id, role, left_is) values (?, ?, ?, ?)")
        .bind(query.0)
        .bind(question.placed.item)
        .bind(question.role)
        .bind(word(question.left_is))
        .execute(&mut *t.connection)
        .await?;
    ask(t, run, query, kind).await
}
