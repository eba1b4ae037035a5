//! The bytes of a packed query set.
//!
//! ```text
//! stair query set 1⏎             magic and format
//! {"task": …}⏎                   where it comes from and its sizes, as one line of JSON
//! deflate                        what the segments show
//! 8 bytes                        checksum of everything before, little-endian
//! ```
//!
//! Inflated, there are numbers of 32 bits in columns: session, place, episode and first step of
//! both segments, `[n]` each; then of each segment each number of its poses, `[H]`. A number is
//! kept as the difference of its bits from the one above it in its column, the sign in its lowest
//! bit; then come all highest bytes, all second ones, and so on. So what moves smoothly becomes
//! runs of small bytes, and no bit of a pose is lost. At the end each segment has a byte that says
//! whether its stages are known, and if so a byte for each.
//!
//! 50 queries of 50 steps of a MetaWorld task take some 60 kB, a third of what they are.

use std::path::Path;

use domain::episode::{EpisodeId, Segment};
use domain::query::QueryKey;
use learn::checksum::Checksum;
use miniz_oxide::deflate::compress_to_vec;
use miniz_oxide::inflate::decompress_to_vec_with_limit;
use serde::{Deserialize, Serialize};

use super::{PackedQueries, PackedQuery, PackedSegment, QuerySetError};

const MAGIC: &[u8] = b"stair query set ";
const FORMAT: u32 = 1;
const CHECKSUM_LEN: usize = 8;
/// Slowest and smallest: a set is packed once.
const LEVEL: u8 = 10;
/// Columns before those of the poses.
const N_KEY_COLUMNS: usize = 6;

/// Everything of a set but its queries, and how many numbers these are.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    task: String,
    method: String,
    seed: u64,
    preset: Option<String>,
    command: String,
    revision: String,
    segment_len: u32,
    pose_size: usize,
    n_queries: usize,
}

impl PackedQueries {
    /// The bytes of the file, the same each time.
    ///
    /// # Panics
    /// When segments or poses differ in their length: a bug of the caller.
    pub fn pack(&self) -> Vec<u8> {
        let head = Head {
            task: self.task.clone(),
            method: self.method.clone(),
            seed: self.seed,
            preset: self.preset.clone(),
            command: self.command.clone(),
            revision: self.revision.clone(),
            segment_len: self.segment_len,
            pose_size: self.pose_size(),
            n_queries: self.queries.len(),
        };
        let mut bytes = [MAGIC, FORMAT.to_string().as_bytes(), b"\n"].concat();
        bytes.extend(serde_json::to_vec(&head).expect("a head is plain JSON"));
        bytes.push(b'\n');
        bytes.extend(compress_to_vec(&self.body(), LEVEL));
        bytes.extend(Checksum::of(&bytes).to_le_bytes());
        bytes
    }

    /// What [`PackedQueries::pack`] made; `path` is where it lies, for whoever reads the error.
    ///
    /// # Errors
    /// Bytes of another kind or version, damaged, or of another version of the task.
    pub fn unpack(path: &Path, bytes: &[u8]) -> Result<Self, QuerySetError> {
        let owned = || path.to_owned();
        let damaged = |reason: &str| QuerySetError::Damaged {
            path: owned(),
            reason: reason.to_owned(),
        };
        let found = format_of(bytes).ok_or_else(|| QuerySetError::Foreign { path: owned() })?;
        if found > FORMAT {
            return Err(QuerySetError::TooNew {
                path: owned(),
                found,
                known: FORMAT,
            });
        }
        let content = whole(bytes).ok_or_else(|| {
            damaged("its checksum does not match its content, or it is cut short")
        })?;
        let mut lines = content.splitn(3, |&byte| byte == b'\n').skip(1);
        let (Some(head), Some(body)) = (lines.next(), lines.next()) else {
            return Err(damaged("its head is missing"));
        };
        let head: Head =
            serde_json::from_slice(head).map_err(|error| damaged(&error.to_string()))?;
        let task = sim::tasks::task(&head.task).map_err(|source| QuerySetError::UnknownTask {
            path: owned(),
            source,
        })?;
        let expected = (task.spec)().pose_size;
        if head.pose_size != expected {
            return Err(QuerySetError::OtherPoses {
                path: owned(),
                task: head.task,
                found: head.pose_size,
                expected,
            });
        }
        let queries = head.queries(body).map_err(|reason| damaged(&reason))?;
        Ok(Self {
            task: head.task,
            method: head.method,
            seed: head.seed,
            preset: head.preset,
            command: head.command,
            revision: head.revision,
            segment_len: head.segment_len,
            queries,
        })
    }

    fn segments(&self) -> impl Iterator<Item = &PackedSegment> {
        self.queries.iter().flat_map(|q| [&q.first, &q.second])
    }

    fn pose_size(&self) -> usize {
        let first = self.segments().next().and_then(|s| s.poses.first());
        first.map_or(0, Vec::len)
    }

    /// Everything that is deflated.
    fn body(&self) -> Vec<u8> {
        let numbers = self.columns();
        let planes = [24, 16, 8, 0].into_iter();
        let mut body: Vec<u8> = planes
            .flat_map(|shift| numbers.iter().map(move |number| (number >> shift) as u8))
            .collect();
        for segment in self.segments() {
            body.push(u8::from(!segment.stages.is_empty()));
            body.extend(&segment.stages);
        }
        body
    }

    /// All columns, one after another, as differences.
    fn columns(&self) -> Vec<u32> {
        let mut numbers = Vec::new();
        let keys: [fn(&PackedQuery) -> u32; N_KEY_COLUMNS] = [
            |q| q.key.session,
            |q| q.key.index,
            |q| q.first.segment.episode.0,
            |q| q.first.segment.start,
            |q| q.second.segment.episode.0,
            |q| q.second.segment.start,
        ];
        for key in keys {
            numbers.extend(differences(self.queries.iter().map(key)));
        }
        let (n_steps, pose_size) = (self.segment_len as usize, self.pose_size());
        for segment in self.segments() {
            assert_eq!(segment.poses.len(), n_steps, "poses of a segment");
            for number in 0..pose_size {
                let bits = segment.poses.iter().map(|pose| {
                    assert_eq!(pose.len(), pose_size, "numbers of a pose");
                    pose[number].to_bits()
                });
                numbers.extend(differences(bits));
            }
        }
        numbers
    }
}

impl Head {
    /// The queries in a deflated body, or what is wrong with it.
    fn queries(&self, body: &[u8]) -> Result<Vec<PackedQuery>, String> {
        let (n, n_steps) = (self.n_queries, self.segment_len as usize);
        if n == 0 || n_steps == 0 {
            return Err("it holds no query".into());
        }
        let too_many = || "it claims more numbers than there can be".to_owned();
        let per_segment = n_steps.checked_mul(self.pose_size);
        let n_numbers = per_segment
            .and_then(|numbers| numbers.checked_mul(2)?.checked_add(N_KEY_COLUMNS))
            .and_then(|numbers| numbers.checked_mul(n));
        let n_numbers = n_numbers.ok_or_else(too_many)?;
        let most = n_steps
            .checked_add(1)
            .and_then(|stages| stages.checked_mul(2 * n.min(usize::MAX / 2)))
            .and_then(|stages| n_numbers.checked_mul(4)?.checked_add(stages));
        let body = decompress_to_vec_with_limit(body, most.ok_or_else(too_many)?)
            .map_err(|error| format!("it cannot be inflated ({error})"))?;
        let planes = body.split_at_checked(4 * n_numbers);
        let (planes, mut stages) = planes.ok_or("it is shorter than its head says")?;
        let bits = |index| {
            let plane = |k: usize| u32::from(planes[k * n_numbers + index]);
            plane(0) << 24 | plane(1) << 16 | plane(2) << 8 | plane(3)
        };
        let mut columns = Columns { bits, next: 0 };
        let keys: [Vec<u32>; N_KEY_COLUMNS] = std::array::from_fn(|_| columns.take(n));
        let mut segment = |episode: u32, start: u32| -> Result<PackedSegment, String> {
            Ok(PackedSegment {
                segment: Segment {
                    episode: EpisodeId(episode),
                    start,
                    len: self.segment_len,
                },
                poses: columns.poses(n_steps, self.pose_size)?,
                stages: take_stages(&mut stages, n_steps)?,
            })
        };
        let queries = (0..n).map(|i| {
            Ok(PackedQuery {
                key: QueryKey {
                    session: keys[0][i],
                    index: keys[1][i],
                },
                first: segment(keys[2][i], keys[3][i])?,
                second: segment(keys[4][i], keys[5][i])?,
            })
        });
        let queries: Vec<PackedQuery> = queries.collect::<Result<_, String>>()?;
        if stages.is_empty() {
            Ok(queries)
        } else {
            Err("it is longer than its head says".into())
        }
    }
}

/// Reads columns of differences back, one after another.
struct Columns<F> {
    bits: F,
    next: usize,
}

impl<F: Fn(usize) -> u32> Columns<F> {
    fn take(&mut self, len: usize) -> Vec<u32> {
        let start = self.next;
        self.next += len;
        let mut value = 0_u32;
        let differences = (start..self.next).map(&self.bits);
        differences
            .map(|coded| {
                let sign = (coded & 1).wrapping_neg();
                value = value.wrapping_add((coded >> 1) ^ sign);
                value
            })
            .collect()
    }

    /// `[n_steps][pose_size]`, finite: nothing else can be drawn.
    fn poses(&mut self, n_steps: usize, pose_size: usize) -> Result<Vec<Vec<f32>>, String> {
        let columns: Vec<Vec<u32>> = (0..pose_size).map(|_| self.take(n_steps)).collect();
        let is_finite = |bits: &u32| f32::from_bits(*bits).is_finite();
        if !columns.iter().flatten().all(is_finite) {
            return Err("a pose is not of finite numbers".into());
        }
        let pose = |step| columns.iter().map(|c| f32::from_bits(c[step])).collect();
        Ok((0..n_steps).map(pose).collect())
    }
}

/// A column as differences, with the sign in the lowest bit.
fn differences(column: impl Iterator<Item = u32>) -> impl Iterator<Item = u32> {
    let mut above = 0_u32;
    column.map(move |value| {
        let difference = value.wrapping_sub(above);
        above = value;
        let sign = (difference >> 31).wrapping_neg();
        (difference << 1) ^ sign
    })
}

fn take_stages(bytes: &mut &[u8], n_steps: usize) -> Result<Vec<u8>, String> {
    let cut_short = || "its stages are cut short".to_owned();
    let (&is_known, rest) = bytes.split_first().ok_or_else(cut_short)?;
    let n = match is_known {
        0 => 0,
        1 => n_steps,
        _ => return Err("its stages are neither known nor unknown".into()),
    };
    let (stages, rest) = rest.split_at_checked(n).ok_or_else(cut_short)?;
    *bytes = rest;
    Ok(stages.to_vec())
}

/// The format that the first line names; `None` where it is not the first line of a set.
fn format_of(bytes: &[u8]) -> Option<u32> {
    let rest = bytes.strip_prefix(MAGIC)?;
    let end = rest.iter().position(|&byte| byte == b'\n')?;
    let format = std::str::from_utf8(&rest[..end]).ok()?.parse().ok()?;
    (format > 0).then_some(format)
}

/// Everything before the checksum, where that is right.
fn whole(bytes: &[u8]) -> Option<&[u8]> {
    let (content, sum) = bytes.split_last_chunk::<CHECKSUM_LEN>()?;
    (Checksum::of(content).to_le_bytes() == *sum).then_some(content)
}

#[cfg(test)]
mod tests;
