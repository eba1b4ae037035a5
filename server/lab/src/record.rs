//! What a run left in its folder, to be looked at rather than gone on with.

use std::path::Path;

use domain::query::{Query, QueryKey};
use learn::checkpoint::Archive;
use learn::device::Device;
use learn::replay::{Replay, ReplayMark};
use learn::temporal::TemporalDistance;

use crate::config::{RunConfig, find_task};
use crate::folder::RunFolder;
use crate::memory::shape;
use crate::method;
use crate::preferences::Preferences;
use crate::run::{Progress, RunError};

/// A run's experience and the queries that it asked, as of its newest checkpoint.
pub struct RunRecord {
    config: RunConfig,
    step: u64,
    replay: Replay,
    asked: Vec<(QueryKey, Query)>,
    archive: Archive,
}

impl RunRecord {
    /// Reads the newest checkpoint of a run's folder that can be read, and changes nothing.
    ///
    /// # Errors
    /// When the folder holds no run, or none of its checkpoints can be read.
    pub fn open(folder: &Path) -> Result<Self, RunError> {
        let (run_folder, _) = RunFolder::open(folder)?;
        let replay = run_folder.replay();
        run_folder.newest(None, |path| Self::read(path, &replay))
    }

    fn read(checkpoint: &Path, replay: &Path) -> Result<Self, RunError> {
        let archive = Archive::read(checkpoint)?;
        let config = archive.json::<String>("config")?;
        let config = RunConfig::parse("the checkpoint's settings", &config)?;
        let spec = (find_task(&config.task)?.spec)();
        let mark: ReplayMark = archive.json("replay")?;
        let n_envs = config.environment.n_envs;
        let replay = Replay::open(replay, shape(&spec), n_envs, &mark)?;
        let preferences: Preferences = archive.json("preferences")?;
        Ok(Self {
            step: archive.json::<Progress>("progress")?.step,
            asked: preferences.keyed(),
            config,
            replay,
            archive,
        })
    }

    /// The resolved settings.
    pub fn config(&self) -> &RunConfig {
        &self.config
    }

    /// Environment steps taken.
    pub fn step(&self) -> u64 {
        self.step
    }

    /// Whether all its environment steps are taken.
    pub fn is_finished(&self) -> bool {
        self.step >= self.config.training.total_steps
    }

    /// All its episodes.
    pub fn replay(&self) -> &Replay {
        &self.replay
    }

    /// The temporal distance as learned so far, `None` where the method learns none.
    ///
    /// # Errors
    /// When the checkpoint does not hold what its settings say.
    pub fn temporal_distance(&self) -> Result<Option<TemporalDistance>, RunError> {
        if !method::build(&self.config)?.learns_temporal_distance() {
            return Ok(None);
        }
        let (settings, n) = (&self.config.temporal, self.replay.shape().observation);
        let mut temporal = TemporalDistance::new(settings, n, self.config.seed, Device::CPU);
        temporal.load(&self.archive)?;
        Ok(Some(temporal))
    }

    /// Every query that was asked, in the order of their keys.
    pub fn asked(&self) -> &[(QueryKey, Query)] {
        &self.asked
    }
}
