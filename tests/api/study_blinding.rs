//! Whether anything but the pictures tells a labeler's browser which method chose a pair: a
//! classifier is fitted on everything that the browser receives, and must fail.

use std::path::Path;
use std::time::Instant;

use domain::agreement::Share;
use domain::query::Question;
use domain::random::{Rng, Stream};
use serde_json::{Value, json};
use store::{ItemRole, NewClip, NewItem, NewStudy, SealedClips, Store, StudyId};

use super::studies::Open;
use crate::support::{Client, query};

/// Pairs, half of them of either method.
const N_PAIRS: usize = 400;
/// Studies whose labelers' browsers are looked at, each with pairs of its own.
const SEEDS: [u64; 3] = [5, 6, 7];

const FILE: &str = r#"
title = "Same stage?"
tasks = ["go-fetch-return"]
question = "same_stage"
labels_per_task = 400
segment_len = 10
consent = "Yes."
[source]
kind = "expert"
"#;

#[test]
fn nothing_but_the_pictures_tells_which_method_chose_a_pair() {
    let accuracies = SEEDS.map(|seed| looked_at(seed, true));
    // One interval in twenty misses 50 % by chance, three of three one in eight thousand.
    let holds = |share: &Share| {
        let found = share.wilson(0.95).expect("answers");
        found.interval.contains(0.5)
    };
    assert!(accuracies.iter().any(holds), "{accuracies:?}");
}

#[test]
fn clips_that_keep_their_lengths_are_found_out() {
    for share in SEEDS.map(|seed| looked_at(seed, false)) {
        assert!(share.n_yes as f64 >= 0.95 * share.n as f64, "{share:?}");
    }
}

/// Held-out accuracy of a classifier on what a labeler's browser receives. Clips of one method
/// are longer by a tenth as they are drawn.
fn looked_at(seed: u64, is_sealed_by_the_server: bool) -> Share {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let runtime = tokio::runtime::Runtime::new().expect("threads");
    let methods = runtime.block_on(fill(folder.path(), seed, is_sealed_by_the_server));
    let study = Open::over(folder);
    let rows: Vec<(Vec<f64>, bool)> = received(&study.labeler())
        .into_iter()
        .map(|(clip, features)| (features, methods[&clip]))
        .collect();
    assert_eq!(rows.len(), N_PAIRS);
    held_out_accuracy(&rows)
}

/// A study whose clips are drawn. Returns whether the second method chose a pair, by what the
/// clip on either side shows.
async fn fill(
    folder: &Path,
    seed: u64,
    leaves_sealing: bool,
) -> std::collections::HashMap<u64, bool> {
    let store = Store::open(folder).await.expect("a store");
    let study = NewStudy {
        title: "Same stage?".into(),
        question: Question::SameStage,
        file: FILE.into(),
        folder: String::new(),
    };
    let id: StudyId = store.add_study(study).await.expect("a study");
    let mut rng = Rng::new(seed, Stream::Test, 0);
    let mut of_second: Vec<bool> = (0..N_PAIRS).map(|n| n % 2 == 1).collect();
    let order = rng.permutation(N_PAIRS);
    of_second = order.iter().map(|n| of_second[*n]).collect();
    let items = of_second.iter().enumerate().map(|(n, is_second)| {
        let query = query(n as u32);
        NewItem {
            task: 0,
            method: Some(if *is_second {
                (1, "pebble".into())
            } else {
                (0, "stair".into())
            }),
            role: ItemRole::Counted,
            expects: None,
            because: String::new(),
            first: query.first,
            second: query.second,
        }
    });
    let tasks = ["go-fetch-return".to_owned()];
    store
        .add_items(id, &tasks, items.collect())
        .await
        .expect("pairs");
    let (mut methods, mut sealed) = (std::collections::HashMap::new(), Vec::new());
    for is_second in of_second {
        let job = store.next_clip_job().await.expect("a read").expect("a job");
        let mut clip = || {
            let shown = rng.next_u64() >> 11;
            methods.insert(shown, is_second);
            let len = 1_000 + rng.below(50) + 100 * usize::from(is_second);
            clip(shown, len)
        };
        let (first, second) = (clip(), clip());
        store
            .attach_clips(job.query, &first, &second)
            .await
            .expect("clips");
        sealed.push(SealedClips {
            query: job.query,
            first,
            second,
        });
    }
    if !leaves_sealing {
        store.seal_study(id, sealed).await.expect("a ready study");
    }
    methods
}

/// Bytes of which the first eight stand for the pictures.
fn clip(shown: u64, len: usize) -> NewClip {
    use sha2::Digest as _;
    let mut bytes = shown.to_be_bytes().to_vec();
    bytes.resize(len, 7);
    NewClip {
        sha256: format!("{:x}", sha2::Sha256::digest(&bytes)),
        bytes,
        n_frames: 10,
        fps: 20,
        width: 8,
        height: 8,
    }
}

/// For each pair: what its left clip shows, and all that the browser received but that.
fn received(labeler: &Client) -> Vec<(u64, Vec<f64>)> {
    let mut seen = Vec::new();
    loop {
        let asked_at = Instant::now();
        let leases = labeler.leases(1);
        let lease_time = asked_at.elapsed().as_secs_f64();
        let Some(lease) = leases.first() else {
            return seen;
        };
        let mut features = vec![seen.len() as f64, lease_time, number(&lease["query_id"])];
        features.extend(digits(lease["lease_id"].as_str().expect("an id")));
        features.push(lease["expires_at"].to_string().len() as f64);
        let mut shown = 0;
        for side in ["right", "left"] {
            let clip = &lease[side];
            let address = clip["clip"].as_str().expect("an address");
            features.extend([number(&clip["n_frames"]), number(&clip["fps"])]);
            features.extend(digits(address.rsplit('/').next().expect("a name")));
            let asked_at = Instant::now();
            let file = labeler.send("GET", address, None).expect(200);
            features.push(asked_at.elapsed().as_secs_f64());
            features.push(file.len() as f64); // what is inside the file is the pictures' business
            features.push(file.headers.len() as f64);
            features.push(file.headers.values().map(|value| value.len() as f64).sum());
            let length = file.headers["content-length"].to_str().expect("text");
            features.push(length.parse().expect("a number"));
            shown = file.first_bytes();
        }
        seen.push((shown, features));
        labeler
            .answers(lease, &json!({"answer": "same"}))
            .expect(201);
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_default()
}

/// The first hexadecimal digits of a name.
fn digits(name: &str) -> impl Iterator<Item = f64> {
    let digits = name.chars().take(6).filter_map(|digit| digit.to_digit(16));
    digits.map(f64::from)
}

/// Logistic regression with a small ridge, fitted on every other row and judged on the rest.
fn held_out_accuracy(rows: &[(Vec<f64>, bool)]) -> Share {
    let n_features = rows[0].0.len();
    let (mut means, mut scales) = (vec![0.0; n_features], vec![0.0; n_features]);
    for k in 0..n_features {
        let column = || rows.iter().map(|(features, _)| features[k]);
        let n = rows.len() as f64;
        means[k] = column().sum::<f64>() / n;
        scales[k] = (column().map(|x| (x - means[k]).powi(2)).sum::<f64>() / n).sqrt();
    }
    let scaled = |features: &[f64]| -> Vec<f64> {
        let one = |k: usize| {
            if scales[k] > 0.0 {
                (features[k] - means[k]) / scales[k]
            } else {
                0.0
            }
        };
        (0..n_features).map(one).chain([1.0]).collect()
    };
    let dot = |w: &[f64], x: &[f64]| w.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
    let fitted: Vec<(Vec<f64>, f64)> = rows
        .iter()
        .step_by(2)
        .map(|(features, is_second)| (scaled(features), f64::from(u8::from(*is_second))))
        .collect();
    let mut weights = vec![0.0; n_features + 1];
    for _ in 0..500 {
        let mut gradient: Vec<f64> = weights.iter().map(|w| 0.01 * w).collect();
        for (x, y) in &fitted {
            let error = 1.0 / (1.0 + (-dot(&weights, x)).exp()) - y;
            for (g, x) in gradient.iter_mut().zip(x) {
                *g += error * x / fitted.len() as f64;
            }
        }
        for (w, g) in weights.iter_mut().zip(&gradient) {
            *w -= 0.5 * g;
        }
    }
    let held_out = rows.iter().skip(1).step_by(2);
    Share::of(
        held_out
            .map(|(features, is_second)| (dot(&weights, &scaled(features)) > 0.0) == *is_second),
    )
}
