//! `stair render`: an episode as a clip or a contact sheet.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use domain::scene::{Camera, Frame, Scene};
use lab::config::find_task;
use lab::words::counted;
use learn::device::with_denormals;
use render::{CLIP_SIZE, Renderer, RgbaImage, SHEET_FRAMES, clip, contact_sheet, evenly};

use super::{BadInput, number, out};
use crate::policy::Policy;

/// Draw an episode as a clip (.mp4) or a contact sheet (.png)
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stair render window-open --policy expert --out window-open.mp4
  stair render go-fetch-return --policy random --steps 20 --out sheet.png
  stair render window-open --policy data/train/window-open-stair-1 --camera corner --out now.mp4")]
pub struct Args {
    /// The task; `stair tasks` lists them
    task: String,
    /// `expert`, `random`, a checkpoint or a run's folder
    #[arg(long)]
    policy: String,
    /// The file to write: a name ending in .mp4 or .png
    #[arg(long)]
    out: PathBuf,
    /// Which starting position, and which chances of a random policy
    #[arg(long, default_value_t = 1, value_parser = number::whole::<u64>)]
    #[arg(allow_negative_numbers = true)]
    seed: u64,
    /// Steps to draw [default: the whole episode]
    #[arg(long, allow_negative_numbers = true)]
    steps: Option<u32>,
    /// Where to look from [default: the task's first camera]
    #[arg(long)]
    camera: Option<String>,
    /// A contact sheet, whatever the file is called
    #[arg(long)]
    sheet: bool,
}

/// What is written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Clip,
    Sheet,
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for an unknown task, policy, camera or kind of file; whatever keeps the picture
/// from being drawn or written.
#[expect(
    clippy::needless_pass_by_value,
    reason = "every command has this signature"
)]
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let task = find_task(&args.task).map_err(BadInput::from_error)?;
    let form = form(&args.out, args.sheet)?;
    let scene = (task.scene)();
    let camera = camera(&scene, args.camera.as_deref())?;
    let policy = Policy::open(task, &args.policy, 0.0, args.seed)?;
    out::file(&args.out)?;
    let renderer = Renderer::new()?;
    let frames = episode(task, &policy, args.seed, args.steps)?;
    let images = match form {
        Form::Clip => renderer.draw(&scene, &frames, CLIP_SIZE, camera)?,
        Form::Sheet => renderer.draw(&scene, &spread(&frames), CLIP_SIZE, camera)?,
    };
    let bytes = match form {
        Form::Clip => clip::encode(&images, clip::frames_per_second(images.len()))?.bytes,
        Form::Sheet => png(&contact_sheet(&images)?)?,
    };
    out::write(&args.out, &bytes)?;
    println!(
        "{}: {} of {}, {} kB",
        args.out.display(),
        counted(images.len() as u64, "frame", "frames"),
        task.name,
        bytes.len().div_ceil(1000)
    );
    Ok(ExitCode::SUCCESS)
}

fn form(out: &Path, is_sheet: bool) -> anyhow::Result<Form> {
    match out.extension().and_then(|e| e.to_str()) {
        Some("png") => Ok(Form::Sheet),
        _ if is_sheet => Ok(Form::Sheet),
        Some("mp4") => Ok(Form::Clip),
        _ => Err(BadInput(format!(
            "'{}' ends neither in .mp4 (a clip) nor in .png (a contact sheet)",
            out.display()
        ))
        .into()),
    }
}

fn camera<'a>(scene: &'a Scene, name: Option<&str>) -> anyhow::Result<&'a Camera> {
    let Some(name) = name else {
        return scene.cameras.first().context("the task has no camera");
    };
    scene
        .cameras
        .iter()
        .find(|c| c.name == name)
        .ok_or_else(|| {
            let known: Vec<&str> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
            BadInput(format!(
                "there is no camera '{name}' here; the cameras are: {}",
                known.join(", ")
            ))
            .into()
        })
}

/// The frames after each step of one episode.
fn episode(
    task: &sim::tasks::Task,
    policy: &Policy,
    seed: u64,
    n_steps: Option<u32>,
) -> anyhow::Result<Vec<Frame>> {
    let n_steps = n_steps.unwrap_or((task.spec)().episode_len).max(1);
    let mut environment = (task.make)();
    let mut observation = with_denormals(|| environment.reset(seed));
    let mut frames = Vec::new();
    for t in 0..n_steps {
        let action = policy.act(&observation, t);
        let step = with_denormals(|| environment.step(&action))?;
        frames.push((task.place)(&environment.pose()));
        observation = step.observation;
        if step.end.is_some() {
            break;
        }
    }
    Ok(frames)
}

/// As many frames as a sheet shows, from the first to the last: no others need be drawn.
fn spread(frames: &[Frame]) -> Vec<Frame> {
    evenly(frames.len(), SHEET_FRAMES)
        .map(|k| frames[k].clone())
        .collect()
}

pub(super) fn png(image: &RgbaImage) -> anyhow::Result<Vec<u8>> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn a_file_of_another_kind_is_refused_before_anything_is_drawn() {
        let error = form(Path::new("clip.gif"), false)
            .err()
            .map(|e| e.to_string());
        assert!(error.is_some_and(|e| e.contains(".mp4") && e.contains(".png")));
    }

    #[test]
    fn an_unknown_camera_is_answered_with_the_known_ones() {
        let scene = (sim::tasks::tasks()[0].scene)();
        let error = camera(&scene, Some("nowhere")).err().map(|e| e.to_string());
        assert!(error.is_some_and(|e| e.contains(&scene.cameras[0].name)));
    }

    /// Each camera of each task: more than a background, and another picture once the body moved.
    #[test]
    fn every_task_draws_something_that_changes_with_its_pose() {
        let renderer = Renderer::new().expect("a driver");
        for task in sim::tasks::tasks() {
            let scene = (task.scene)();
            let policy = Policy::open(task, "random", 0.0, 1).expect("chance plays every task");
            let frames = episode(task, &policy, 1, Some(25)).expect("a sound episode");
            let ends = [frames[0].clone(), frames[24].clone()];
            for camera in &scene.cameras {
                let images = renderer
                    .draw(&scene, &ends, (160, 120), camera)
                    .expect("pictures");
                let colors = |image: &RgbaImage| -> BTreeSet<[u8; 4]> {
                    image.pixels().map(|pixel| pixel.0).collect()
                };
                let n_colors = colors(&images[0]).len();
                assert!(
                    n_colors > 100,
                    "{}, {}: {n_colors} colours",
                    task.name,
                    camera.name
                );
                let pixels = images[0].pixels().zip(images[1].pixels());
                let n_changed = pixels.filter(|(before, after)| before != after).count();
                assert!(
                    n_changed > 50,
                    "{}, {}: {n_changed} pixels",
                    task.name,
                    camera.name
                );
            }
        }
    }
}
