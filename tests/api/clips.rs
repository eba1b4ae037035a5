//! Clips: parts of them, for ever, and what is told of one that is lost.

use crate::support::TestApp;

#[test]
fn a_clip_is_served_in_parts_and_never_changes() {
    let app = TestApp::start(1);
    let ada = app.labeler("Ada");
    let clip = ada.leases(1)[0]["left"]["clip"]
        .as_str()
        .expect("an address")
        .to_owned();
    let whole = ada.send("GET", &clip, None).expect(200);
    assert!(
        whole.headers["cache-control"]
            .to_str()
            .is_ok_and(|c| c.contains("immutable"))
    );
    assert_eq!(whole.headers["content-type"], "video/mp4");
    assert!(whole.text.starts_with("clip number"));
    let part = ada
        .send_with("GET", &clip, None, &[("range", "bytes=5-10")])
        .expect(206);
    assert_eq!(part.text, "number");
    let beyond = ada
        .send_with("GET", &clip, None, &[("range", "bytes=9999-")])
        .expect(416);
    assert_eq!(beyond.json()["type"], "/problems/no-such-range");
    assert_eq!(
        beyond.headers["content-range"],
        format!("bytes */{}", whole.len())
    );
    let dated = [("if-unmodified-since", "Thu, 01 Jan 1970 00:00:00 GMT")];
    ada.send_with("GET", &clip, None, &dated).expect(200);
    ada.send("GET", "/api/v1/clips/../../stair.sqlite", None)
        .expect(404);
    ada.send(
        "GET",
        &format!("/api/v1/clips/{}.mp4", "f".repeat(64)),
        None,
    )
    .expect(404);
}

#[test]
fn a_clip_whose_bytes_are_gone_is_told_apart_from_a_server_that_fails() {
    let app = TestApp::start(1);
    let ada = app.labeler("Ada");
    let leases = ada.leases(1);
    let clip = leases[0]["left"]["clip"].as_str().expect("an address");
    let file = clip.strip_prefix("/api/v1/clips/").expect("a name");
    let path = app.data().join("clips").join(&file[..2]).join(file);
    std::fs::remove_file(path).expect("a file");

    let reply = ada.send("GET", clip, None).expect(410);
    assert_eq!(reply.headers["content-type"], "application/problem+json");
    assert_eq!(reply.headers["cache-control"], "no-store");
    let told = reply.json();
    assert_eq!(told["type"], "/problems/clip-gone", "{told}");
    assert!(
        told["detail"]
            .as_str()
            .is_some_and(|detail| detail.contains("data folder") && detail.contains("broken clip")),
        "{told}"
    );
    let other = leases[0]["right"]["clip"].as_str().expect("an address");
    ada.send("GET", other, None).expect(200);

    let document = ada.send("GET", "/api/v1/openapi.json", None).expect(200);
    let responses = &document.json()["paths"]["/api/v1/clips/{name}"]["get"]["responses"];
    assert!(responses["410"].is_object(), "{responses}");
}
