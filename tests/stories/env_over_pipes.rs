//! `stair env` as another program uses it: a child process with two pipes.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::Stdio;

use serde_json::Value;

use super::server_process::stair;

#[test]
fn a_program_asks_acts_errs_and_goes_on_until_it_closes_the_pipe() {
    let mut child = stair()
        .args(["env", "push-green"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("stair");
    let mut to = child.stdin.take().expect("a pipe");
    let mut from = BufReader::new(child.stdout.take().expect("a pipe")).lines();
    // Each answer is read before the next line is written: nothing may wait in a buffer.
    let mut ask = |line: &str| -> Value {
        writeln!(to, "{line}").expect("the pipe is open");
        let answer = from.next().expect("an answer").expect("text");
        serde_json::from_str(&answer).expect("JSON")
    };
    assert_eq!(ask(r#"{"spec":{}}"#)["task"], "push-green");
    let start = ask(r#"{"reset":{"seed":7}}"#);
    assert_eq!(start["observation"].as_array().map(Vec::len), Some(68));
    assert!(ask(r#"{"step":{"action":[0]}}"#)["error"].is_string());
    assert!(ask("nonsense")["error"].is_string());
    let step = ask(r#"{"step":{"action":[0,0,-1,0,-1]},"pose":true}"#);
    assert_eq!(step["end"], Value::Null);
    assert_eq!(step["pose"].as_array().map(Vec::len), Some(38));
    drop(to);
    assert!(child.wait().expect("it ends").success());
}
