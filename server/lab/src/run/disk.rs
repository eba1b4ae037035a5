//! A run's beginning, its checkpoints, and the way back from them.

use std::collections::BTreeMap;
use std::path::Path;

use learn::checkpoint::Archive;
use learn::device::Device;
use learn::replay::{Replay, ReplayMark, forget_others};

use super::{Progress, Run, RunError};
use crate::config::{RunConfig, find_task};
use crate::folder::RunFolder;
use crate::history::RunHistory;
use crate::lanes::{Lanes, LanesState};
use crate::learner::Learner;
use crate::memory::{self, MemoryNeed, shape};
use crate::message::{Checkpointed, Event};
use crate::meter::Meter;
use crate::method;
use crate::preferences::Preferences;

impl Run {
    /// Makes a run's folder and its first checkpoint.
    ///
    /// # Errors
    /// [`RunError`]; nothing is started.
    pub fn start(config: RunConfig, folder: &Path) -> Result<Self, RunError> {
        Self::start_with(config, folder, None)
    }

    /// The same for a run that a scripted teacher answers, which its folder tells from the first
    /// moment on ([`RunHistory::teacher`]).
    ///
    /// # Errors
    /// [`RunError`]; nothing is started.
    pub fn start_with(
        config: RunConfig,
        folder: &Path,
        teacher: Option<&str>,
    ) -> Result<Self, RunError> {
        let task = find_task(&config.task)?;
        let spec = (task.spec)();
        let method = method::build(&config)?;
        let device = Device::open(&config.device)?;
        if let Some(bytes) = memory::available() {
            MemoryNeed::of(&config, &spec, &method).check(&spec, bytes)?;
        }
        let learner = Learner::new(&config, &spec, &method, device);
        let mut replay = Replay::new(shape(&spec), config.environment.n_envs);
        if method.bonus.is_some() {
            replay.keep_disagreement();
        }
        let lanes = Lanes::start(task, &config, &mut replay);
        let root = folder;
        let folder = RunFolder::create(root)?;
        let mut run = Self {
            task,
            spec,
            method,
            folder,
            lanes,
            replay,
            learner,
            marks: BTreeMap::new(),
            preferences: Preferences::default(),
            early: Vec::new(),
            session: None,
            progress: Progress::default(),
            meter: Meter::default(),
            is_paused: false,
            last_activity: None,
            config,
        };
        run.checkpoint()?;
        RunHistory::begin(root, teacher)?;
        run.folder.seal(&run.config.to_toml())?;
        Ok(run)
    }

    /// Whether a run was started in this folder, so that [`Run::resume`] can take it up.
    pub fn exists(folder: &Path) -> bool {
        RunFolder::holds_run(folder)
    }

    /// Takes a run up again from its newest checkpoint that can be read. Newer ones are set aside;
    /// returns what was wrong with them, for the person who reads the log.
    ///
    /// # Errors
    /// [`RunError`]; nothing is changed.
    pub fn resume(folder: &Path) -> Result<(Self, Vec<String>), RunError> {
        Self::resume_on(folder, None)
    }

    /// The same on another device than the settings name; a checkpoint fits any.
    ///
    /// # Errors
    /// [`RunError`]; nothing is changed.
    pub fn resume_on(folder: &Path, device: Option<&str>) -> Result<(Self, Vec<String>), RunError> {
        let (run_folder, text) = RunFolder::open(folder)?;
        let settings = folder.join("config.toml");
        let mut config = RunConfig::parse(&settings.display().to_string(), &text)?;
        if let Some(device) = device {
            device.clone_into(&mut config.device);
        }
        Device::open(&config.device)?; // before a checkpoint could be blamed for it
        let (mut complaints, mut damaged) = (Vec::new(), Vec::new());
        let steps = run_folder.checkpoints()?;
        let mut run_folder = Some(run_folder);
        for step in steps.into_iter().rev() {
            let opened = match run_folder.take() {
                Some(folder) => folder,
                None => RunFolder::open(folder)?.0,
            };
            match Self::restore(config.clone(), opened, step) {
                Ok(run) => {
                    for step in damaged {
                        run.folder.set_aside(step)?;
                    }
                    return Ok((run, complaints));
                }
                Err(error @ RunError::OtherSettings { .. }) => return Err(error),
                Err(error) => complaints.push(format!("checkpoint of step {step}: {error}")),
            }
            damaged.push(step);
        }
        let reasons = if complaints.is_empty() {
            "there is none".into()
        } else {
            complaints.join("; ")
        };
        Err(RunError::NoCheckpoint {
            folder: folder.to_owned(),
            reasons,
        })
    }

    pub(super) fn restore(
        config: RunConfig,
        mut folder: RunFolder,
        step: u64,
    ) -> Result<Self, RunError> {
        let path = folder.checkpoint_path(step);
        let archive = Archive::read(&path)?;
        let written = archive.json::<String>("config")?;
        let written = RunConfig::parse("the checkpoint's settings", &written)?;
        if let Some((key, checkpoint, settings)) = written.first_misfit(&config) {
            return Err(RunError::OtherSettings {
                path,
                key,
                checkpoint,
                settings,
            });
        }
        let task = find_task(&config.task)?;
        let spec = (task.spec)();
        let method = method::build(&config)?;
        let mut learner = Learner::new(&config, &spec, &method, Device::open(&config.device)?);
        learner.load(&archive)?;
        let lanes = Lanes::restore(task, &config, archive.json::<LanesState>("lanes")?)?;
        let mark: ReplayMark = archive.json("replay")?;
        let mut replay = Replay::open(
            &folder.replay(),
            shape(&spec),
            config.environment.n_envs,
            &mark,
        )?;
        if method.bonus.is_some() {
            replay.keep_disagreement(); // an empty column says nothing about itself
        }
        let mut marks: BTreeMap<u64, ReplayMark> = archive.json_or_default("earlier_marks")?;
        marks.insert(step, mark);
        folder.cut_metrics(archive.json("metrics_len")?)?;
        Ok(Self {
            marks,
            early: archive.json_or_default("early_answers")?,
            preferences: archive.json("preferences")?,
            session: archive.json("session")?,
            progress: archive.json("progress")?,
            task,
            spec,
            method,
            folder,
            lanes,
            replay,
            learner,
            meter: Meter::default(),
            is_paused: false,
            last_activity: None,
            config,
        })
    }

    pub(super) fn checkpoint_and_say(
        &mut self,
        events: &mut dyn FnMut(Event),
    ) -> Result<(), RunError> {
        self.checkpoint()?;
        let Progress {
            step,
            consumed_sequence,
            ..
        } = self.progress;
        events(Event::Checkpointed(Checkpointed {
            step,
            consumed_sequence,
        }));
        Ok(())
    }

    pub(super) fn checkpoint(&mut self) -> Result<(), RunError> {
        let mut archive = Archive::new();
        self.learner.save(&mut archive);
        archive.put_json("config", &self.config.to_toml());
        archive.put_json("lanes", &self.lanes.state());
        let (step, mark) = (self.progress.step, self.replay.sync(&self.folder.replay())?);
        self.marks.remove(&step);
        archive.put_json("replay", &mark);
        archive.put_json("earlier_marks", &self.marks);
        archive.put_json("preferences", &self.preferences);
        archive.put_json("early_answers", &self.early);
        archive.put_json("session", &self.session);
        archive.put_json("progress", &self.progress);
        archive.put_json("metrics_len", &self.folder.sync_metrics()?);
        self.folder.save(step, &archive)?;
        let there = self.folder.checkpoints()?;
        self.marks.insert(step, mark);
        self.marks.retain(|step, _| there.contains(step));
        forget_others(&self.folder.replay(), self.marks.values());
        Ok(())
    }

    pub(super) fn leave_policy(&self) -> Result<(), RunError> {
        let mut archive = Archive::new();
        self.learner.save_policy(&mut archive);
        archive.put_json("config", &self.config.to_toml());
        Ok(archive.write(&self.folder.policy_path())?)
    }
}
