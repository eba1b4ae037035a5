//! Who worked on a run and answered it, and for how long: `history.json` in its folder, across stops
//! and kills.

use std::fs;
use std::io;
use std::path::Path;
use std::sync::mpsc::Receiver;
use std::time::Instant;

use domain::teacher::Teacher;
use serde::{Deserialize, Serialize};

use crate::folder::{io_error, write_durably};
use crate::message::{Command, Event};
use crate::run::{Outcome, Run, RunError};

const FILE: &str = "history.json";
/// What cannot be read, kept for whoever wants to mend it.
const SET_ASIDE: &str = "history.damaged.json";

/// Where a run is computed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// Of the program.
    pub revision: String,
    /// Processor and cores of the machine.
    pub machine: String,
}

/// What ran when.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RunHistory {
    /// Of the program, in order, none twice in a row.
    pub revisions: Vec<String>,
    /// Machines, in order, none twice in a row.
    pub machines: Vec<String>,
    /// Wall time so far, seconds, waiting for answers included; of a part that was killed, up to
    /// its last checkpoint.
    pub wall_s: f64,
    /// The scripted teacher that answers it, by name; none where people or programs do, and in runs
    /// of before it was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub teacher: Option<String>,
}

/// A teacher that a run cannot go on with.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TeacherMisfit {
    /// Another one than has answered so far.
    #[error(
        "{there} has answered this run so far, and {wanted} would go on otherwise; leave --teacher out, or begin a new run"
    )]
    Another {
        /// Who has.
        there: String,
        /// Who is to.
        wanted: String,
    },
    /// Nobody knows who has answered so far.
    #[error(
        "it was not kept who answers this run (it began with an earlier revision, on a server's page, or its history was lost); say it with --teacher"
    )]
    Unknown,
}

impl RunHistory {
    /// What the run's folder knows; nothing of a run that was never started.
    ///
    /// # Errors
    /// When its history cannot be read.
    pub fn of(folder: &Path) -> Result<Self, RunError> {
        let path = folder.join(FILE);
        match fs::read(&path) {
            Ok(text) => serde_json::from_slice(&text)
                .map_err(io::Error::from)
                .map_err(io_error("read the run's history", &path)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Self::default()),
            Err(error) => Err(io_error("read the run's history", &path)(error)),
        }
    }

    /// Of a run that nobody has worked on yet.
    ///
    /// # Errors
    /// When the disk refuses.
    pub(crate) fn begin(folder: &Path, teacher: Option<&str>) -> Result<(), RunError> {
        let history = Self {
            teacher: teacher.map(str::to_owned),
            ..Self::default()
        };
        history.keep(folder)
    }

    fn keep(&self, folder: &Path) -> Result<(), RunError> {
        let text = serde_json::to_vec(self).expect("a history is plain values");
        write_durably(&folder.join(FILE), &text)
    }

    /// Notes who goes on with the run now.
    pub fn goes_on(&mut self, provenance: &Provenance) {
        let add = |list: &mut Vec<String>, item: &str| {
            if list.last().is_none_or(|last| last != item) {
                list.push(item.to_owned());
            }
        };
        add(&mut self.revisions, &provenance.revision);
        add(&mut self.machines, &provenance.machine);
    }
}

/// The history of a run that goes on in this process.
#[derive(Debug)]
pub struct Sitting<'a> {
    folder: &'a Path,
    before: RunHistory,
    began: Instant,
}

impl<'a> Sitting<'a> {
    /// Goes on with a run, and keeps who does. A history that is damaged does not hold a run
    /// up: it is set aside, and what was wrong with it returned for the person who reads the log.
    ///
    /// * `began` – when its process did
    ///
    /// # Errors
    /// When the disk refuses.
    ///
    /// # Panics
    /// Never.
    pub fn begin(
        folder: &'a Path,
        provenance: &Provenance,
        began: Instant,
    ) -> Result<(Self, Option<String>), RunError> {
        let (mut before, complaint) = match RunHistory::of(folder) {
            Ok(before) => (before, None),
            Err(damage) => {
                let aside = folder.join(SET_ASIDE);
                let set_aside = fs::rename(folder.join(FILE), &aside);
                set_aside.map_err(io_error("set the run's history aside", &aside))?;
                let complaint = format!(
                    "{damage}. It is {SET_ASIDE} now; time and revisions are counted anew from here"
                );
                (RunHistory::default(), Some(complaint))
            }
        };
        before.goes_on(provenance);
        let sitting = Self {
            folder,
            before,
            began,
        };
        sitting.keep()?;
        Ok((sitting, complaint))
    }

    /// Keeps which scripted teacher answers: the one that is wanted, else the one who has.
    ///
    /// # Errors
    /// [`TeacherMisfit`], where another one has or it is not known who.
    pub fn answered_by(&mut self, wanted: Option<&str>) -> Result<&str, TeacherMisfit> {
        let there = &mut self.before.teacher;
        if let (Some(there), Some(wanted)) = (there.as_deref(), wanted)
            && there != wanted
        {
            return Err(TeacherMisfit::Another {
                there: there.to_owned(),
                wanted: wanted.to_owned(),
            });
        }
        if there.is_none() {
            *there = wanted.map(str::to_owned);
        }
        there.as_deref().ok_or(TeacherMisfit::Unknown)
    }

    /// The whole so far.
    pub fn history(&self) -> RunHistory {
        RunHistory {
            wall_s: self.before.wall_s + self.began.elapsed().as_secs_f64(),
            ..self.before.clone()
        }
    }

    /// Drives the run as [`Run::drive`] does, and keeps the whole with every checkpoint and at
    /// the end.
    ///
    /// # Errors
    /// What the run says; the disk where it refuses the history, after the run's own end.
    ///
    /// # Panics
    /// Never.
    pub fn drive(
        &self,
        run: &mut Run,
        teacher: &mut dyn Teacher,
        commands: &Receiver<Command>,
        events: &mut dyn FnMut(Event),
    ) -> Result<Outcome, RunError> {
        let mut kept = Ok(());
        let outcome = run.drive(teacher, commands, &mut |event| {
            if matches!(event, Event::Checkpointed(_)) {
                kept = self.keep();
            }
            events(event);
        })?;
        kept?;
        self.keep()?;
        Ok(outcome)
    }

    /// Keeps the whole so far.
    ///
    /// # Errors
    /// When the disk refuses.
    ///
    /// # Panics
    /// Never: a history is plain values.
    pub fn keep(&self) -> Result<(), RunError> {
        self.history().keep(self.folder)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_run_that_was_stopped_tells_of_its_whole() {
        let folder = tempfile::tempdir().unwrap();
        let of = |revision: &str| Provenance {
            revision: revision.into(),
            machine: "two cores".into(),
        };
        let earlier = Instant::now().checked_sub(Duration::from_secs(100));
        let earlier = earlier.unwrap();
        for (revision, least) in [("a", 100.0), ("a", 200.0), ("b", 300.0)] {
            let (sitting, complaint) =
                Sitting::begin(folder.path(), &of(revision), earlier).unwrap();
            assert_eq!(complaint, None);
            sitting.keep().unwrap();
            let kept = RunHistory::of(folder.path()).unwrap();
            assert!(kept.wall_s >= least, "{kept:?}");
            assert!(kept.wall_s <= sitting.history().wall_s);
        }
        let kept = RunHistory::of(folder.path()).unwrap();
        assert_eq!(kept.revisions, ["a", "b"]);
        assert_eq!(kept.machines, ["two cores"]);
    }

    #[test]
    fn whoever_answered_a_run_goes_on_answering_it() {
        let folder = tempfile::tempdir().unwrap();
        let provenance = Provenance {
            revision: "a".into(),
            machine: "two cores".into(),
        };
        let begin = || {
            let (sitting, _) = Sitting::begin(folder.path(), &provenance, Instant::now()).unwrap();
            sitting
        };
        let mut sitting = begin();
        assert_eq!(sitting.answered_by(None), Err(TeacherMisfit::Unknown));
        assert_eq!(sitting.answered_by(Some("mistaken")), Ok("mistaken"));
        sitting.keep().unwrap();

        let mut sitting = begin();
        let told = sitting.answered_by(Some("oracle")).unwrap_err().to_string();
        assert!(
            told.contains("mistaken") && told.contains("oracle"),
            "{told}"
        );
        assert_eq!(sitting.answered_by(None), Ok("mistaken"));
        assert_eq!(sitting.answered_by(Some("mistaken")), Ok("mistaken"));
    }

    #[test]
    fn a_run_that_was_never_started_has_none() {
        let folder = tempfile::tempdir().unwrap();
        let none = RunHistory::of(folder.path()).unwrap();
        assert_eq!(none, RunHistory::default());
    }

    #[test]
    fn a_damaged_history_is_named_and_set_aside() {
        let folder = tempfile::tempdir().unwrap();
        let damaged = r#"{"revisions": ["a"], "machines": ["two co"#;
        fs::write(folder.path().join(FILE), damaged).unwrap();
        let error = RunHistory::of(folder.path()).unwrap_err().to_string();
        assert!(error.contains(FILE) && error.contains("line 1"), "{error}");

        let provenance = Provenance {
            revision: "b".into(),
            machine: "two cores".into(),
        };
        let (sitting, complaint) =
            Sitting::begin(folder.path(), &provenance, Instant::now()).unwrap();
        let complaint = complaint.unwrap();
        assert!(complaint.contains(SET_ASIDE), "{complaint}");
        let aside = fs::read_to_string(folder.path().join(SET_ASIDE)).unwrap();
        assert_eq!(aside, damaged);
        assert_eq!(sitting.history().revisions, ["b"]);
        assert_eq!(RunHistory::of(folder.path()).unwrap().revisions, ["b"]);
    }
}
