//! Stories about the API, one file per resource.

mod blinding;
mod clips;
pub(crate) mod compare;
mod labelers;
mod labels_page;
mod leases;
mod runs;
mod store_on_disk;
pub(crate) mod studies;
mod study_blinding;
mod teachers;
mod throughput;
