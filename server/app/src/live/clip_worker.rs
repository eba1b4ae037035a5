//! The thread that owns the graphics device: recorded poses in, clips in the store out.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;

use lab::message::Demonstration;
use render::clip::{Clip, encode, frames_per_second};
use render::{CLIP_SIZE, Renderer};
use serde_json::json;
use store::{ClipJob, NewClip, NewDemonstration, RunId, Store, StoreError};
use tokio::runtime::Handle;

use super::panic_text;

/// Pictures in a demonstration's clip at most: longer episodes are shown in fast motion.
const DEMONSTRATION_FRAMES: usize = 125;
const DEMONSTRATION_FPS: u32 = 25;

/// Where work for the clip thread is put. Cheap to clone.
#[derive(Clone)]
pub struct ClipQueue {
    sender: Sender<Message>,
    trouble: Arc<OnceLock<String>>,
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

    /// Why clips cannot be drawn on this machine, with what to do about it.
    pub fn trouble(&self) -> Option<&str> {
        self.trouble.get().map(String::as_str)
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
                store,
                runtime,
                renderer,
                messages,
                demonstrations: VecDeque::new(),
            };
            worker.work();
        }
        Err(error) => {
            tracing::error!("{error}");
            let _ = trouble.set(error.to_string()); // set once, here
        }
    };
    let thread = std::thread::Builder::new()
        .name("clips".into())
        .spawn(work)?;
    Ok((queue, thread))
}

struct Worker {
    store: Store,
    runtime: Handle,
    renderer: Renderer,
    messages: Receiver<Message>,
    demonstrations: VecDeque<(RunId, String, Demonstration)>,
}

impl Worker {
    /// Queries first, in the order in which they are asked; demonstrations when nobody waits.
    fn work(mut self) {
        loop {
            while let Ok(message) = self.messages.try_recv() {
                if !self.take(message) {
                    return;
                }
            }
            let job = self
                .runtime
                .block_on(self.store.next_clip_job())
                .unwrap_or_else(|error| {
                    tracing::error!("cannot read which clips to draw: {error}");
                    None
                });
            if let Some(job) = job {
                self.draw_query(&job);
            } else if let Some((run, task, demonstration)) = self.demonstrations.pop_front() {
                self.draw_demonstration(run, &task, &demonstration);
            } else {
                let Ok(message) = self.messages.recv() else {
                    return;
                };
                if !self.take(message) {
                    return;
                }
            }
        }
    }

    /// Whether to go on.
    fn take(&mut self, message: Message) -> bool {
        match message {
            Message::Wake => {}
            Message::Demonstration {
                run,
                task,
                demonstration,
            } => {
                self.demonstrations.push_back((run, task, demonstration));
            }
            Message::Close => return false,
        }
        true
    }

    fn draw_query(&mut self, job: &ClipJob) {
        let drawn = self
            .draw(&job.task, &job.first, frames_per_second(job.first.len()))
            .and_then(|first| {
                let second =
                    self.draw(&job.task, &job.second, frames_per_second(job.second.len()))?;
                Ok([first, second])
            });
        let stored = match drawn {
            Ok([first, second]) => self.runtime.block_on(self.store.attach_clips(
                job.query,
                &new_clip(first),
                &new_clip(second),
            )),
            Err(reason) => {
                tracing::error!(run.id = %job.run, "a query's clips cannot be drawn: {reason}");
                self.runtime
                    .block_on(self.store.clip_failed(job.query, &reason))
            }
        };
        if let Err(error) = stored {
            tracing::error!(run.id = %job.run, "a query's clips could not be stored: {error}");
        }
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
            let stored = self.runtime.block_on(self.keep(run, shows, new_clip(clip)));
            stored.map_err(|error| error.to_string())
        });
        if let Err(reason) = stored {
            tracing::error!(run.id = %run, "a demonstration could not be drawn or stored: {reason}");
        }
    }

    /// The clip first, then the event that shows it; an episode that a killed run shows again
    /// makes no second event.
    async fn keep(
        &self,
        run: RunId,
        shows: NewDemonstration,
        clip: NewClip,
    ) -> Result<(), StoreError> {
        self.store.add_demonstration(run, shows, &clip).await?;
        let NewDemonstration {
            session,
            step,
            success,
            task_return,
        } = shows;
        let event = json!({
            "kind": "clips", "what": "demonstration", "session": session, "step": step, "success": success,
            "task_return": task_return, "clip": format!("/api/v1/clips/{}.mp4", clip.sha256),
        });
        let name = session.map_or_else(
            || "demonstration/end".to_owned(),
            |s| format!("demonstration/{s}"),
        );
        self.store.append_event(run, &name, &event).await?;
        Ok(())
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
