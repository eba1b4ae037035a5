//! How fast answers are stored; printed, never judged: a loaded machine must not fail a test.

use std::time::{Duration, Instant};

use serde_json::json;

use crate::support::TestApp;

#[test]
fn many_programs_answer_at_once_and_every_answer_is_kept() {
    const N_CLIENTS: usize = 16;
    const N_EACH: usize = 20;
    let app = TestApp::start((N_CLIENTS * N_EACH) as u32);
    let began = Instant::now();
    let mut times: Vec<Duration> = std::thread::scope(|scope| {
        let clients = (0..N_CLIENTS).map(|n| {
            let labeler = app.labeler(&format!("labeler {n}"));
            scope.spawn(move || {
                let mut times = Vec::new();
                while times.len() < N_EACH {
                    let leases = labeler.leases(5);
                    if leases.is_empty() {
                        break;
                    }
                    for lease in &leases {
                        let word = if lease["question"] == "preference" {
                            "left"
                        } else {
                            "same"
                        };
                        let sent = Instant::now();
                        labeler.answers(lease, &json!({"answer": word})).expect(201);
                        times.push(sent.elapsed());
                    }
                }
                times
            })
        });
        let clients: Vec<_> = clients.collect();
        clients
            .into_iter()
            .flat_map(|client| client.join().expect("answers"))
            .collect()
    });
    let took = began.elapsed();
    assert_eq!(app.stranger().labels().len(), times.len());
    times.sort_unstable();
    let p99 = times[times.len() * 99 / 100];
    println!(
        "{} answers by {N_CLIENTS} clients in {:.2} s: {:.0} a second, p99 {:.0} ms",
        times.len(),
        took.as_secs_f64(),
        times.len() as f64 / took.as_secs_f64(),
        p99.as_secs_f64() * 1e3
    );
}
