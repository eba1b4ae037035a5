//! Rows of the figure `strips`: the top queries of packed sets, drawn.

use std::path::Path;

use anyhow::Context as _;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use domain::scene::Frame;
use lab::figure::{Shot, Source, StripRow};
use lab::study::{PackedQueries, PackedQuery, PackedSegment};
use render::{Renderer, RgbaImage, evenly};

use crate::cli::BadInput;
use crate::cli::render::png;
use crate::provenance::REVISION;

/// Pictures of a segment, from its first to its last state.
const N_SHOTS: usize = 6;
/// Twice the size at which they are shown, pixels: sharp where a unit is two of them.
const SIZE: (u32, u32) = (264, 198);

/// The `top` queries of each packed set or finished run as rows, and files of such rows as they
/// are.
///
/// # Errors
/// [`BadInput`] for what holds no queries; a machine that cannot draw.
pub(super) fn sources(paths: &[impl AsRef<Path>], top: usize) -> anyhow::Result<Vec<Source>> {
    let mut renderer = None;
    let mut sources = Vec::new();
    for path in paths.iter().map(AsRef::as_ref) {
        let packed = if path.is_dir() {
            PackedQueries::of_run(path, None, REVISION)
        } else if path.extension().is_some_and(|ending| ending == "queries") {
            PackedQueries::read(path)
        } else {
            sources.push(super::read(path)?);
            continue;
        };
        let packed = packed.map_err(BadInput::from_error)?;
        let renderer = match &mut renderer {
            Some(renderer) => renderer,
            none => none.insert(Renderer::new()?),
        };
        let mut text = String::new();
        for query in packed.top(top) {
            for row in rows(renderer, &packed, query)? {
                text.push_str(&serde_json::to_string(&row)?);
                text.push('\n');
            }
        }
        sources.push(Source {
            name: path.display().to_string(),
            text,
        });
    }
    Ok(sources)
}

fn rows(
    renderer: &Renderer,
    packed: &PackedQueries,
    query: &PackedQuery,
) -> anyhow::Result<[StripRow; 2]> {
    let row = |segment: &PackedSegment, is_second| -> anyhow::Result<StripRow> {
        Ok(StripRow {
            task: packed.task.clone(),
            method: packed.method.clone(),
            session: query.key.session,
            index: query.key.index,
            is_second,
            episode: segment.segment.episode.0,
            shots: shots(renderer, &packed.task, segment)?,
        })
    };
    Ok([row(&query.first, false)?, row(&query.second, true)?])
}

fn shots(renderer: &Renderer, task: &str, segment: &PackedSegment) -> anyhow::Result<Vec<Shot>> {
    let task = lab::config::find_task(task).map_err(BadInput::from_error)?;
    let (scene, names) = ((task.scene)(), (task.spec)().stages);
    let camera = scene.cameras.first().context("the task has no camera")?;
    let chosen: Vec<usize> = evenly(segment.poses.len(), N_SHOTS).collect();
    let frames: Vec<Frame> = chosen
        .iter()
        .map(|&step| (task.place)(&segment.poses[step]))
        .collect();
    let images = renderer.draw(&scene, &frames, SIZE, camera)?;
    let shot = |(&step, image): (&usize, &RgbaImage)| {
        let stage = segment.stages.get(step).copied();
        Ok(Shot {
            step: segment.segment.start + step as u32,
            stage: stage.and_then(|stage| names.get(usize::from(stage)).cloned()),
            png: BASE64.encode(png(image)?),
        })
    };
    chosen.iter().zip(&images).map(shot).collect()
}
