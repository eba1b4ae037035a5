//! Stories told in a real Chromium: what a person sees and presses.

mod accessibility;
mod answers;
mod driver;
mod following;
mod in_step;
mod labeler;
mod session;
mod studies;
mod trouble;
mod weight;
