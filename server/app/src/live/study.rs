//! Getting a study ready on a thread of its own: segments, clips, and one length for all clips.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use lab::study::{PairRole, PlannedPair, StudyFile, plan};
use render::clip::padded;
use store::{ItemRole, NewClip, NewItem, SealedClips, StudyId, StudyRow};

use super::{Inner, lock};

/// How often the number of drawn clips is looked at.
const LOOK: Duration = Duration::from_millis(200);

/// Starts the thread. It goes on from what is stored: a study that was half prepared when the
/// server ended is finished.
///
/// # Errors
/// When the system gives no thread.
pub(super) fn start(inner: &Arc<Inner>, study: StudyId) -> std::io::Result<()> {
    let own = Arc::clone(inner);
    let work = move || {
        if let Err(error) = prepare(&own, study) {
            let reason = format!("{error:#}");
            tracing::error!("study {study} cannot be prepared: {reason}");
            if let Err(error) = own.runtime.block_on(own.store.fail_study(study, &reason)) {
                tracing::error!("and that cannot be written down: {error}");
            }
        }
    };
    let thread = std::thread::Builder::new()
        .name(format!("study {study}"))
        .spawn(work)?;
    lock(&inner.study_threads).push(thread);
    Ok(())
}

fn prepare(inner: &Inner, id: StudyId) -> anyhow::Result<()> {
    let store = &inner.store;
    let row = inner.runtime.block_on(store.study(id))?;
    if row.n_items == 0 {
        let study = parse(&row)?;
        let pairs = plan(&study, Path::new(&row.folder))?;
        let items = pairs.into_iter().map(|pair| item(&study, pair)).collect();
        inner
            .runtime
            .block_on(store.add_items(id, &study.tasks, items))?;
    }
    inner.clips.wake(); // pairs wait to be drawn: new ones, or those of a preparation taken up again
    if !wait_for_clips(inner, id)? {
        return Ok(()); // the server is closing; the next one goes on
    }
    let sealed = seal(inner, id)?;
    inner.runtime.block_on(store.seal_study(id, sealed))?;
    tracing::info!("study {id} is ready");
    Ok(())
}

/// The study that a row's file says.
///
/// # Errors
/// Mistakes of the file: it came from another version of the program.
pub fn parse(row: &StudyRow) -> anyhow::Result<StudyFile> {
    let name = format!("the file of study {}", row.id);
    Ok(StudyFile::parse(&name, &row.file, Path::new(&row.folder))?)
}

fn item(study: &StudyFile, pair: PlannedPair) -> NewItem {
    let methods = study.source.methods();
    let (role, method, expects, because) = match pair.role {
        PairRole::Counted { method } => (ItemRole::Counted, method, None, String::new()),
        PairRole::Practice { expects, because } => {
            (ItemRole::Practice, None, Some(expects), because)
        }
        PairRole::Check { expects } => (ItemRole::Check, None, Some(expects), String::new()),
    };
    NewItem {
        task: pair.task as u32,
        method: method.map(|number| (number as u32, methods[number].to_owned())),
        role,
        expects: expects.map(lab::study::Expected::word),
        because,
        first: pair.first,
        second: pair.second,
    }
}

/// Whether all clips are there; false where the server closes first.
fn wait_for_clips(inner: &Inner, id: StudyId) -> anyhow::Result<bool> {
    loop {
        let row = inner.runtime.block_on(inner.store.study(id))?;
        if row.n_drawn == row.n_items {
            return Ok(true);
        }
        if let Some(trouble) = inner.clips.lasting_trouble() {
            bail!("clips cannot be drawn: {trouble}");
        }
        if row.n_drawn + row.n_bad == row.n_items {
            let items = inner.runtime.block_on(inner.store.items(id))?;
            let trouble = items.iter().find_map(|item| item.trouble.clone());
            let (n, trouble) = (row.n_bad, trouble.unwrap_or_default());
            bail!("the clips of {n} pairs cannot be drawn: {trouble}");
        }
        if inner.is_closing.load(std::sync::atomic::Ordering::SeqCst) {
            return Ok(false);
        }
        std::thread::sleep(LOOK);
    }
}

/// Every clip of a study, padded to one length: a size tells nothing then.
fn seal(inner: &Inner, id: StudyId) -> anyhow::Result<Vec<SealedClips>> {
    let items = inner.runtime.block_on(inner.store.items(id))?;
    let mut drawn = Vec::new();
    for item in items {
        let [first, second] = item.clips.context("a pair without clips")?;
        drawn.push((item.query, read(inner, &first)?, read(inner, &second)?));
    }
    let clips = drawn.iter().flat_map(|(_, first, second)| [first, second]);
    let longest = clips.map(|clip| clip.bytes.len()).max();
    let len = longest.context("a study without pairs")? + render::clip::LEAST_PADDING;
    let pad = |clip: NewClip| -> NewClip {
        let (bytes, sha256) = padded(&clip.bytes, len);
        NewClip {
            bytes,
            sha256,
            ..clip
        }
    };
    let sealed = drawn.into_iter().map(|(query, first, second)| SealedClips {
        query,
        first: pad(first),
        second: pad(second),
    });
    Ok(sealed.collect())
}

fn read(inner: &Inner, sha256: &str) -> anyhow::Result<NewClip> {
    let (info, path) = inner.runtime.block_on(inner.store.clip(sha256))?;
    let bytes =
        std::fs::read(&path).with_context(|| format!("cannot read the clip {}", path.display()))?;
    ensure!(
        bytes.len() as u64 == info.n_bytes,
        "the clip {} is cut off",
        path.display()
    );
    Ok(NewClip {
        bytes,
        sha256: info.sha256,
        n_frames: info.n_frames,
        fps: info.fps,
        width: info.width,
        height: info.height,
    })
}
