//! The thread that owns the graphics device: recorded poses in, clips in the store out.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use lab::message::Demonstration;
use render::clip::{Clip, encode, frames_per_second};
use render::{CLIP_SIZE, Renderer};
use store::{ClipJob, NewClip, NewDemonstration, RunId, Store};
use tokio::runtime::Handle;

use super::{lock, panic_text};

mod desk;

use desk::Desk;

/// Pictures in a demonstration's clip at most: longer episodes are shown in fast motion.
const DEMONSTRATION_FRAMES: usize = 125;
const DEMONSTRATION_FPS: u32 = 25;

/// Where work for the clip thread is put. Cheap to clone.
#[derive(Clone)]
pub struct ClipQueue {
    sender: Sender<Message>,
    trouble: Arc<Mutex<Option<Trouble>>>,
}

/// Why no clips come.
struct Trouble {
    /// What is wrong, with what to do about it.
    told: String,
    /// Whether it is tried again and again; else none will come before the server starts anew.
    is_passing: bool,
}

enum Message {
    /// The store holds queries without clips.
    Wake,
    /// "How it does now."
    Demonstration {
        run: RunId,
        task: String,
        demonstration: Demonstration,
    },
    /// The server is closing.
    Close,
}

impl ClipQueue {
    /// Says that there are queries to draw.
    pub fn wake(&self) {
        self.send(Message::Wake);
    }

    /// Asks for a clip of an episode.
    pub fn demonstrate(&self, run: RunId, task: String, demonstration: Demonstration) {
        self.send(Message::Demonstration {
            run,
            task,
            demonstration,
        });
    }

    /// Lets the thread end after the clip in hand.
    pub fn close(&self) {
        self.send(Message::Close);
    }

    /// Why no clips come at the moment, with what to do about it.
    pub fn trouble(&self) -> Option<String> {
        let trouble = lock(&self.trouble);
        trouble.as_ref().map(|trouble| trouble.told.clone())
    }

    /// The same, where waiting does not help.
    pub fn lasting_trouble(&self) -> Option<String> {
        let trouble = lock(&self.trouble);
        let lasting = trouble.as_ref().filter(|trouble| !trouble.is_passing);
        lasting.map(|trouble| trouble.told.clone())
    }

    fn send(&self, message: Message) {
        // The thread has ended only when the server is closing: nobody waits for a clip then.
        let _ = self.sender.send(message);
    }
}

/// Starts the thread.
///
/// # Errors
/// When the system gives no thread.
pub fn start(store: Store, runtime: Handle) -> std::io::Result<(ClipQueue, JoinHandle<()>)> {
    let (sender, messages) = channel();
    let queue = ClipQueue {
        sender,
        trouble: Arc::default(),
    };
    let trouble = Arc::clone(&queue.trouble);
    let work = move || match Renderer::new() {
        Ok(renderer) => {
            tracing::info!(
                device = renderer.device_name(),
                "clips are drawn by {}",
                renderer.device_name()
            );
            let worker = Worker {
                desk: Desk::new(store, runtime, messages, trouble),
                renderer,
            };
            worker.work();
        }
        Err(error) => {
            tracing::error!("{error}");
            *lock(&trouble) = Some(Trouble {
                told: error.to_string(),
                is_passing: false,
            });
        }
    };
    let thread = std::thread::Builder::new()
        .name("clips".into())
        .spawn(work)?;
    Ok((queue, thread))
}

struct Worker {
    desk: Desk,
    renderer: Renderer,
}

impl Worker {
    /// Queries first, in the order in which they are asked; demonstrations when nobody waits.
    fn work(mut self) {
        while self.desk.take_all() {
            let goes_on = if let Some(job) = self.desk.next_job() {
                let drawn = self.draw_query(&job);
                if let Err(reason) = &drawn {
                    tracing::error!(run.id = %job.run, "a query's clips cannot be drawn: {reason}");
                }
                self.desk.keep(&job, &drawn)
            } else if let Some((run, task, demonstration)) = self.desk.next_demonstration() {
                self.draw_demonstration(run, &task, &demonstration);
                true
            } else {
                self.desk.wait()
            };
            if !goes_on {
                return;
            }
        }
    }

    /// Both clips of a query, or why they cannot be drawn.
    fn draw_query(&mut self, job: &ClipJob) -> Result<[NewClip; 2], String> {
        let first = self.draw(&job.task, &job.first, frames_per_second(job.first.len()))?;
        let second = self.draw(&job.task, &job.second, frames_per_second(job.second.len()))?;
        Ok([first, second].map(new_clip))
    }

    fn draw_demonstration(&mut self, run: RunId, task: &str, demonstration: &Demonstration) {
        let stride = demonstration
            .poses
            .len()
            .div_ceil(DEMONSTRATION_FRAMES)
            .max(1);
        let poses: Vec<Vec<f32>> = demonstration
            .poses
            .iter()
            .step_by(stride)
            .cloned()
            .collect();
        let Demonstration {
            session,
            step,
            success,
            task_return,
            ..
        } = *demonstration;
        let shows = NewDemonstration {
            session,
            step,
            success,
            task_return,
        };
        let drawn = self.draw(task, &poses, DEMONSTRATION_FPS);
        let stored = drawn.and_then(|clip| {
            let stored = self.desk.keep_demonstration(run, shows, &new_clip(clip));
            stored.map_err(|error| error.to_string())
        });
        if let Err(reason) = stored {
            tracing::error!(run.id = %run, "a demonstration could not be drawn or stored: {reason}");
        }
    }

    /// Draws and encodes. A device that fails is opened anew once: drivers do stop.
    fn draw(&mut self, task: &str, poses: &[Vec<f32>], fps: u32) -> Result<Clip, String> {
        let task = sim::tasks::task(task).map_err(|error| error.to_string())?;
        if let Ok(clip) = draw(&self.renderer, task, poses, fps) {
            return Ok(clip);
        }
        self.renderer = Renderer::new().map_err(|error| error.to_string())?;
        draw(&self.renderer, task, poses, fps)
    }
}

fn draw(
    renderer: &Renderer,
    task: &sim::tasks::Task,
    poses: &[Vec<f32>],
    fps: u32,
) -> Result<Clip, String> {
    let pose_size = (task.spec)().pose_size;
    if poses
        .iter()
        .any(|pose| pose.len() != pose_size || pose.iter().any(|x| !x.is_finite()))
    {
        return Err(format!("a recorded pose is not {pose_size} finite numbers"));
    }
    let drawn = catch_unwind(AssertUnwindSafe(|| {
        let scene = (task.scene)();
        let frames: Vec<_> = poses.iter().map(|pose| (task.place)(pose)).collect();
        let camera = scene
            .cameras
            .first()
            .ok_or_else(|| format!("{} has no camera", task.name))?;
        let pictures = renderer
            .draw(&scene, &frames, CLIP_SIZE, camera)
            .map_err(|error| error.to_string())?;
        encode(&pictures, fps).map_err(|error| error.to_string())
    }));
    drawn.unwrap_or_else(|panic| Err(panic_text(panic.as_ref())))
}

fn new_clip(clip: Clip) -> NewClip {
    let Clip {
        bytes,
        sha256,
        n_frames,
        fps,
        width,
        height,
    } = clip;
    NewClip {
        bytes,
        sha256,
        n_frames,
        fps,
        width,
        height,
    }
}
