//! A trained policy, to be looked at rather than trained on.

use std::path::{Path, PathBuf};

use learn::checkpoint::Archive;
use learn::device::Device;
use learn::sac::{Act, Sac};

use crate::config::RunConfig;
use crate::folder::RunFolder;
use crate::run::RunError;

/// A policy that takes its mean action.
pub struct TrainedPolicy {
    agent: Sac,
    config: RunConfig,
    path: PathBuf,
}

impl TrainedPolicy {
    /// Opens a checkpoint or policy file, or of a run's folder the newest checkpoint that can be
    /// read, else the policy that the finished run left.
    ///
    /// # Errors
    /// When there is none, or it is damaged.
    pub fn open(path: &Path) -> Result<Self, RunError> {
        if !path.is_dir() {
            return Self::read(path);
        }
        let (folder, _) = RunFolder::open(path)?;
        let left = Some(folder.policy_path()).filter(|path| path.exists());
        folder.newest(left, Self::read)
    }

    fn read(path: &Path) -> Result<Self, RunError> {
        let archive = Archive::read(path)?;
        let config = RunConfig::parse(
            "the checkpoint's settings",
            &archive.json::<String>("config")?,
        )?;
        let spec = (crate::config::find_task(&config.task)?.spec)();
        let device = Device::open("cpu")?;
        let (s, a) = (spec.observation_size, spec.action_size);
        let mut agent = Sac::new(&config.agent, s, a, config.seed, device);
        agent.load_policy(&archive)?;
        Ok(Self {
            agent,
            config,
            path: path.to_owned(),
        })
    }

    /// The settings of the run that trained it.
    pub fn config(&self) -> &RunConfig {
        &self.config
    }

    /// The checkpoint file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Mean actions, `[n × A]`, for states `[n × S]`.
    pub fn act(&self, observations: &[f32]) -> Vec<f32> {
        self.agent.act(observations, Act::Mean)
    }
}
