//! People who answer.

use sqlx::Row as _;

use crate::error::StoreError;
use crate::run::RunId;
use crate::secret::Secret;
use crate::store::Store;
use crate::study::StudyId;
use crate::time::now_ms;
use crate::writer::Transaction;

/// Number of a labeler.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(transparent)]
pub struct LabelerId(pub i64);

/// The server itself, which skips queries that cannot be drawn.
pub(crate) const SERVER: LabelerId = LabelerId(1);

/// Who answers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Labeler {
    /// Number.
    pub id: LabelerId,
    /// As they typed it.
    pub name: String,
}

impl Store {
    /// The labeler of that name, new or old, and a secret for the browser that asked. Whoever
    /// knows the name of a person comes in as that person; those who have other ways to come in
    /// cannot be had so.
    ///
    /// # Errors
    /// [`StoreError::Rule`] with `labeler_name_not_empty` for a name of no or more than 80
    /// letters; [`StoreError::NameKept`] for that of the server, of a program, or of a place in a
    /// study, also before there is one.
    pub async fn sign_in(&self, name: &str) -> Result<(Labeler, Secret), StoreError> {
        let name = name.trim().to_owned();
        let secret = Secret::random()?;
        let browser = secret.clone();
        let labeler = self
            .write(move |t| {
                Box::pin(async move {
                    let id = find_or_add(t, &name).await?;
                    if is_kept(&name) || comes_in_otherwise(t, id).await? {
                        return Err(StoreError::NameKept(name));
                    }
                    admit(t, id, &browser).await?;
                    Ok(Labeler { id, name })
                })
            })
            .await?;
        Ok((labeler, secret))
    }
}

/// The name of whoever sits at a place of a study.
pub(crate) fn name_of_seat(number: u32, study: StudyId) -> String {
    format!("labeler {number} of study {study}")
}

/// The name of the programs that answer a run.
pub(crate) fn name_of_program(run: RunId) -> String {
    format!("program of run {run}")
}

/// Whether a name is like one that the server gives, whatever its capitals and gaps: nobody
/// should be able to pass for another in a table of answers either.
fn is_kept(name: &str) -> bool {
    let is_number = |word: &str| word.bytes().all(|letter| letter.is_ascii_digit());
    let name = name.to_ascii_lowercase();
    let words: Vec<&str> = name.split_whitespace().collect();
    match words.as_slice() {
        ["(server)"] => true,
        ["labeler", number, "of", "study", study] => is_number(number) && is_number(study),
        ["program", "of", "run", run] => is_number(run),
        _ => false,
    }
}

/// Whether this is the server, or somebody with a link or a token to come in by.
async fn comes_in_otherwise(
    t: &mut Transaction<'_>,
    labeler: LabelerId,
) -> Result<bool, StoreError> {
    let row = sqlx::query(
        "select exists (select 1 from study_seat where labeler_id = ?1)
             or exists (select 1 from token where labeler_id = ?1 and kind = 'teacher')",
    )
    .bind(labeler.0)
    .fetch_one(&mut *t.connection)
    .await?;
    Ok(labeler == SERVER || row.try_get(0)?)
}

/// The labeler of a name that the server gives, new or old. Browsers that came in by having
/// typed it, as earlier versions let them, are out.
pub(crate) async fn find_or_add_kept(
    t: &mut Transaction<'_>,
    name: &str,
) -> Result<LabelerId, StoreError> {
    let id = find_or_add(t, name).await?;
    sqlx::query("delete from token where labeler_id = ? and kind = 'labeler'")
        .bind(id.0)
        .execute(&mut *t.connection)
        .await?;
    Ok(id)
}

/// Makes a secret that of one browser of a labeler.
pub(crate) async fn admit(
    t: &mut Transaction<'_>,
    labeler: LabelerId,
    browser: &Secret,
) -> Result<(), StoreError> {
    sqlx::query(
        "insert into token (hash, kind, labeler_id, created_at_ms) values (?, 'labeler', ?, ?)",
    )
    .bind(browser.hash())
    .bind(labeler.0)
    .bind(now_ms())
    .execute(&mut *t.connection)
    .await?;
    Ok(())
}

async fn find_or_add(t: &mut Transaction<'_>, name: &str) -> Result<LabelerId, StoreError> {
    sqlx::query(
        "insert into labeler (name, created_at_ms) values (?, ?) on conflict (name) do nothing",
    )
    .bind(name)
    .bind(now_ms())
    .execute(&mut *t.connection)
    .await?;
    let row = sqlx::query("select id from labeler where name = ?")
        .bind(name)
        .fetch_one(&mut *t.connection)
        .await?;
    Ok(LabelerId(row.get(0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_the_server_gives_is_known_whatever_its_capitals_and_gaps() {
        let given = [name_of_seat(4, StudyId(2)), name_of_program(RunId(9))];
        let typed = [
            "(Server)",
            "Labeler 1 of study 7",
            "labeler  1 OF study 07",
            "Program of Run 3",
        ];
        for name in given.iter().map(String::as_str).chain(typed) {
            assert!(is_kept(name), "{name}");
        }
        for name in [
            "Ada",
            "server",
            "labeler 3",
            "labeler one of study 2",
            "program of run",
            "program of run x",
        ] {
            assert!(!is_kept(name), "{name}");
        }
    }
}
