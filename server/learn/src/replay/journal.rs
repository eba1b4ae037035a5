//! The replay on disk: one append-only journal of what happened, and the reward column whole.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use domain::environment::TaskReward;
use serde::{Deserialize, Serialize};

use super::{NO_STAGE, NewStep, Replay, ReplayShape, StepMark, row};
use crate::checkpoint::numbers;
use crate::checksum::Checksum;
use crate::durable;
use crate::error::LearnError;

const JOURNAL: &str = "journal";
const BEGIN: u8 = 0;
const PUSH: u8 = 1;
/// What a file with a reward column is called, and then its number.
const COLUMN: &str = "rewards-";

/// What a checkpoint must remember to find its state of the replay again.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReplayMark {
    journal_len: u64,
    journal_checksum: u64,
    /// Number of the file with the reward column.
    column: u64,
    n_steps: u64,
}

/// What of the replay is on disk, and what is still to be written.
#[derive(Debug)]
pub(super) struct Journal {
    /// Lanes of the events since the last sync, in order.
    pending: Vec<Pending>,
    /// States, steps and (by the events) episodes of each lane that are on disk.
    written: Vec<Written>,
    len: u64,
    checksum: Checksum,
    n_columns: u64,
}

#[derive(Debug, Clone, Copy)]
struct Pending {
    lane: u16,
    is_begin: bool,
}

#[derive(Debug, Clone, Copy, Default)]
struct Written {
    n_states: usize,
    n_steps: usize,
}

impl Journal {
    pub(super) fn new(n_lanes: usize) -> Self {
        Self {
            pending: Vec::new(),
            written: vec![Written::default(); n_lanes],
            len: 0,
            checksum: Checksum::new(),
            n_columns: 0,
        }
    }

    pub(super) fn note_begin(&mut self, lane: usize) {
        self.note(lane, true);
    }

    pub(super) fn note_push(&mut self, lane: usize) {
        self.note(lane, false);
    }

    fn note(&mut self, lane: usize, is_begin: bool) {
        let lane = u16::try_from(lane).expect("fewer than 65,536 lanes");
        self.pending.push(Pending { lane, is_begin });
    }
}

impl Replay {
    /// Makes everything so far durable in `folder` and says where it ends.
    ///
    /// What happened is appended to the journal; the reward column, which relabelling
    /// rewrites, goes whole into a file of its own (4 bytes a step), with the column of
    /// disagreement where it is kept (as much again). Earlier columns stay until
    /// [`forget_others`] is told what is still needed.
    ///
    /// # Errors
    /// When the folder cannot be written; the replay then tries the same again.
    pub fn sync(&mut self, folder: &Path) -> Result<ReplayMark, LearnError> {
        let path = folder.join(JOURNAL);
        std::fs::create_dir_all(folder).map_err(|e| LearnError::file("make", folder, e))?;
        let (bytes, written) = self.pending_bytes();
        append_durably(&path, self.journal.len, &bytes)
            .map_err(|e| LearnError::file("write", &path, e))?;
        self.journal.checksum.update(&bytes);
        self.journal.len += bytes.len() as u64;
        self.journal.pending.clear();
        self.journal.written = written;

        let number = self.journal.n_columns + 1;
        let path = column_path(folder, number);
        durable::replace(&path, &self.column_bytes())
            .map_err(|e| LearnError::file("write", &path, e))?;
        self.journal.n_columns = number;
        Ok(ReplayMark {
            journal_len: self.journal.len,
            journal_checksum: self.journal.checksum.value(),
            column: number,
            n_steps: self.len() as u64,
        })
    }

    /// The replay as it was at `mark`; whatever was written after it is cut off.
    ///
    /// # Errors
    /// When the files cannot be read, or are not what was written.
    pub fn open(
        folder: &Path,
        shape: ReplayShape,
        n_lanes: usize,
        mark: &ReplayMark,
    ) -> Result<Self, LearnError> {
        let path = folder.join(JOURNAL);
        let bytes = read_start(&path, mark.journal_len)?;
        let mut checksum = Checksum::new();
        checksum.update(&bytes);
        if checksum.value() != mark.journal_checksum {
            return Err(LearnError::damaged(
                &path,
                "its checksum does not match its content",
            ));
        }
        let mut replay = Self::new(shape, n_lanes);
        let mut reader = Reader(&bytes);
        while !reader.0.is_empty() {
            let event = replay.replay_event(&mut reader);
            event.ok_or_else(|| {
                LearnError::damaged(&path, "it is of another task or number of environments")
            })?;
        }
        replay.read_column(folder, mark)?;
        replay.journal.pending.clear();
        for (written, lane) in replay.journal.written.iter_mut().zip(&replay.lanes) {
            *written = Written {
                n_states: lane.stages.len(),
                n_steps: lane.marks.len(),
            };
        }
        replay.journal.len = mark.journal_len;
        replay.journal.checksum = checksum;
        replay.journal.n_columns = mark.column;
        Ok(replay)
    }

    /// The events since the last sync as bytes, and what will be on disk with them.
    fn pending_bytes(&self) -> (Vec<u8>, Vec<Written>) {
        let mut written = self.journal.written.clone();
        let mut bytes = Vec::new();
        for &Pending { lane, is_begin } in &self.journal.pending {
            let (rows, done) = (&self.lanes[lane as usize], &mut written[lane as usize]);
            bytes.push(if is_begin { BEGIN } else { PUSH });
            bytes.extend(lane.to_le_bytes());
            if is_begin {
                bytes.extend(self.seed_of_state(lane, done.n_states).to_le_bytes());
            } else {
                bytes.push(rows.marks[done.n_steps].0);
                bytes.extend(rows.task_rewards[done.n_steps].to_le_bytes());
                put(
                    &mut bytes,
                    row(&rows.actions, done.n_steps, self.shape.action),
                );
                done.n_steps += 1;
            }
            bytes.push(rows.stages[done.n_states]);
            put(
                &mut bytes,
                row(&rows.observations, done.n_states, self.shape.observation),
            );
            put(&mut bytes, row(&rows.poses, done.n_states, self.shape.pose));
            done.n_states += 1;
        }
        (bytes, written)
    }

    fn seed_of_state(&self, lane: u16, first_state: usize) -> u64 {
        let begins_here =
            |e: &&super::Episode| e.lane == u32::from(lane) && e.first_state == first_state;
        let episode = self.episodes.iter().rev().find(begins_here);
        episode.expect("an episode begins where one was begun").seed
    }

    /// Does again what one record says; `None` where the record does not fit.
    fn replay_event(&mut self, reader: &mut Reader<'_>) -> Option<()> {
        let tag = reader.u8()?;
        let lane = usize::from(u16::from_le_bytes(reader.take()?));
        if lane >= self.lanes.len() {
            return None;
        }
        let ReplayShape {
            observation,
            action,
            pose,
        } = self.shape;
        if tag == BEGIN {
            let seed = u64::from_le_bytes(reader.take()?);
            let stage = stage(reader.u8()?);
            let (observation, pose) = (reader.f32s(observation)?, reader.f32s(pose)?);
            self.begin_episode(lane, seed, &observation, &pose, stage);
            return Some(());
        }
        let mark = StepMark(reader.u8()?);
        let task_reward = TaskReward(f64::from_le_bytes(reader.take()?));
        let action = reader.f32s(action)?;
        let stage = stage(reader.u8()?);
        let (next_observation, next_pose) = (reader.f32s(observation)?, reader.f32s(pose)?);
        if tag != PUSH || self.lanes[lane].running.is_none() {
            return None;
        }
        let step = NewStep {
            action: &action,
            learned_reward: 0.0,
            task_reward,
            success: mark.success(),
            stage,
            end: mark.end(),
            next_observation: &next_observation,
            next_pose: &next_pose,
        };
        self.push(lane, step);
        Some(())
    }

    fn column_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(4 * self.len() + 8);
        for lane in &self.lanes {
            put(&mut bytes, &lane.learned_rewards);
        }
        for lane in &self.lanes {
            put(&mut bytes, &lane.disagreements);
        }
        let sum = Checksum::of(&bytes);
        bytes.extend(sum.to_le_bytes());
        bytes
    }

    fn read_column(&mut self, folder: &Path, mark: &ReplayMark) -> Result<(), LearnError> {
        let path = column_path(folder, mark.column);
        let bytes = std::fs::read(&path).map_err(|e| LearnError::file("read", &path, e))?;
        let one_column = 4 * self.len();
        let n_bytes = bytes.len().saturating_sub(8);
        let n_columns_fit = n_bytes == one_column || n_bytes == 2 * one_column;
        if self.len() as u64 != mark.n_steps || bytes.len() < 8 || !n_columns_fit {
            return Err(LearnError::damaged(&path, "it has the wrong length"));
        }
        let (values, sum) = bytes.split_at(n_bytes);
        if Checksum::of(values).to_le_bytes() != sum {
            return Err(LearnError::damaged(
                &path,
                "its checksum does not match its content",
            ));
        }
        let mut values = numbers(values, f32::from_le_bytes).into_iter();
        for lane in &mut self.lanes {
            lane.learned_rewards
                .iter_mut()
                .zip(&mut values)
                .for_each(|(to, from)| *to = from);
        }
        if n_bytes > one_column {
            self.keep_disagreement();
            let columns = self.lanes.iter_mut().map(|lane| &mut lane.disagreements);
            columns
                .flatten()
                .zip(&mut values)
                .for_each(|(to, from)| *to = from);
        }
        Ok(())
    }
}

/// Removes the reward columns of all but these marks from a replay's folder: only whoever keeps the
/// checkpoints knows which of them are left. What cannot be removed stays and does no harm.
pub fn forget_others<'a>(folder: &Path, marks: impl IntoIterator<Item = &'a ReplayMark>) {
    let needed: Vec<PathBuf> = marks
        .into_iter()
        .map(|mark| column_path(folder, mark.column))
        .collect();
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        let name = path.file_name().and_then(|name| name.to_str());
        let is_column = name.is_some_and(|name| name.starts_with(COLUMN));
        if is_column && !needed.contains(&path) {
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Takes a record apart; `None` past the end.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (own, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*own)
    }

    fn u8(&mut self) -> Option<u8> {
        self.take::<1>().map(|[byte]| byte)
    }

    fn f32s(&mut self, n: usize) -> Option<Vec<f32>> {
        let (own, rest) = self.0.split_at_checked(4 * n)?;
        self.0 = rest;
        Some(numbers(own, f32::from_le_bytes))
    }
}

/// A state's stage from its byte.
fn stage(byte: u8) -> Option<u8> {
    (byte != NO_STAGE).then_some(byte)
}

fn put(bytes: &mut Vec<u8>, values: &[f32]) {
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
}

fn column_path(folder: &Path, number: u64) -> PathBuf {
    folder.join(format!("{COLUMN}{number}"))
}

/// Cuts the file to `len` bytes, appends, and makes it durable.
fn append_durably(path: &Path, len: u64, bytes: &[u8]) -> std::io::Result<()> {
    let file = OpenOptions::new()
        .create(true)
        .truncate(false)
        .write(true)
        .open(path)?;
    file.set_len(len)?;
    let mut writer = BufWriter::new(file);
    writer.seek(SeekFrom::Start(len))?;
    writer.write_all(bytes)?;
    writer
        .into_inner()
        .map_err(std::io::IntoInnerError::into_error)?
        .sync_all()
}

fn read_start(path: &Path, len: u64) -> Result<Vec<u8>, LearnError> {
    let file = File::open(path).map_err(|e| LearnError::file("read", path, e))?;
    let mut bytes = Vec::with_capacity(len as usize);
    file.take(len)
        .read_to_end(&mut bytes)
        .map_err(|e| LearnError::file("read", path, e))?;
    if bytes.len() as u64 != len {
        return Err(LearnError::damaged(
            path,
            "it is shorter than the checkpoint says",
        ));
    }
    Ok(bytes)
}
