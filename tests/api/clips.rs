//! Clips: parts of them, for ever.

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
    ada.send_with("GET", &clip, None, &[("range", "bytes=9999-")])
        .expect(416);
    ada.send("GET", "/api/v1/clips/../../stair.sqlite", None)
        .expect(404);
    ada.send(
        "GET",
        &format!("/api/v1/clips/{}.mp4", "f".repeat(64)),
        None,
    )
    .expect(404);
}
