//! Programs that answer: what their token opens, and what it does not.

use serde_json::json;

use crate::support::TestApp;

#[test]
fn a_teacher_token_opens_what_teaching_takes_and_nothing_else() {
    let app = TestApp::start_guarded(2);
    let program = app.program();
    let run = format!("/api/v1/runs/{}", app.run);
    assert_eq!(
        program.send("GET", &run, None).expect(200).json()["seed"],
        1
    );
    let lease = &program.leases(1)[0];
    let truth = format!("/api/v1/queries/{}/task-rewards", lease["query_id"]);
    program.send("GET", &truth, None).expect(200);
    let clip = lease["left"]["clip"].as_str().expect("an address");
    program.send("GET", clip, None).expect(200);
    program
        .answers(lease, &json!({"answer": "left"}))
        .expect(201);

    for (method, path) in [
        ("GET", "/".to_owned()),
        ("GET", "/studies".to_owned()),
        ("GET", format!("/runs/{}", app.run)),
        ("GET", format!("/runs/{}/label", app.run)),
        ("GET", "/api/v1/runs".to_owned()),
        ("GET", "/api/v1/runs/2".to_owned()),
        ("GET", format!("{run}/labels")),
        ("POST", format!("{run}/stop")),
        ("POST", format!("{run}/teacher-tokens")),
        ("POST", "/api/v1/runs/2/leases".to_owned()),
        ("POST", "/api/v1/labelers".to_owned()),
        ("POST", "/api/v1/studies/1/invitations".to_owned()),
    ] {
        let told = program.send(method, &path, None).expect(403).json();
        let kind = "/problems/beyond-teaching";
        assert_eq!(told["type"], kind, "{method} {path}");
    }
    let guesses = app.stranger().with_token("guessed");
    guesses.send("GET", &run, None).expect(401);
}

#[test]
fn who_answers_is_told_that_a_teacher_token_is_for_the_researcher_to_make() {
    let app = TestApp::start(1);
    let path = format!("/api/v1/runs/{}/teacher-tokens", app.run);
    for who in [app.labeler("Ada"), app.program()] {
        let told = who.send("POST", &path, Some(&json!({}))).expect(403).json();
        assert_eq!(told["type"], "/problems/researchers-only", "{told}");
        let detail = told["detail"].as_str().expect("words");
        assert!(detail.contains("send the server's token"), "{detail}");
    }
}

#[test]
fn a_query_that_has_no_number_is_a_problem_that_names_it() {
    let app = TestApp::start(1);
    let path = "/api/v1/queries/abc/task-rewards";
    let reply = app.program().send("GET", path, None).expect(404);
    assert_eq!(reply.headers["content-type"], "application/problem+json");
    let told = reply.json();
    assert_eq!(told["instance"], path);
    let detail = told["detail"].as_str().expect("words");
    assert!(detail.contains("'abc'"), "{detail}");
}
