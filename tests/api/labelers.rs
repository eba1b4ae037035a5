//! Who answers: names, and the cookies by which browsers are known.

use std::collections::BTreeMap;

use serde_json::json;

use crate::support::{Reply, TestApp};

/// A form in a body, from a browser that shows pages.
const FORM: [(&str, &str); 2] = [
    ("content-type", "application/x-www-form-urlencoded"),
    ("accept", "text/html"),
];

#[test]
fn two_servers_on_one_machine_know_their_labelers_in_one_browser() {
    let servers = [TestApp::start(2), TestApp::start(2)];
    // One jar for the machine: a browser gives a host's cookies to every port of it.
    let mut jar: BTreeMap<String, String> = BTreeMap::new();
    for app in &servers {
        let body = json!({"name": "Ada"});
        let reply = app
            .stranger()
            .send("POST", "/api/v1/labelers", Some(&body))
            .expect(201);
        let cookie = reply.headers["set-cookie"].to_str().expect("text");
        let (pair, _) = cookie.split_once(';').expect("what the cookie is for");
        let (name, value) = pair.split_once('=').expect("a name and a value");
        jar.insert(name.to_owned(), value.to_owned());
    }
    let cookies: Vec<String> = jar.iter().map(|(name, v)| format!("{name}={v}")).collect();
    let cookies = cookies.join("; ");
    for app in &servers {
        let browser = app.stranger();
        let body = Some(json!({"count": 1}).to_string());
        let headers = [("cookie", cookies.as_str())];
        let leases = browser
            .send_with("POST", &browser.leases_path(), body, &headers)
            .expect(200)
            .json();
        assert_eq!(leases["leases"].as_array().map(Vec::len), Some(1));
    }
}

#[test]
fn a_name_that_the_server_keeps_for_itself_is_refused_with_a_way_back_to_the_form() {
    let app = TestApp::start(2);
    let all = app.stranger();
    let sign_in = |name: &str| all.send("POST", "/api/v1/labelers", Some(&json!({"name": name})));
    let program = format!("program of run {}", app.run);
    let refused = |reply: Reply| {
        let told = reply.expect(422).json();
        assert_eq!(told["type"], "/problems/name-kept", "{told}");
    };
    for name in ["(server)", "labeler 1 of study 1", "Labeler 2 of study 9"] {
        refused(sign_in(name));
    }
    refused(sign_in(&program)); // before there is such a program
    let leases = app.program().leases(1);
    assert_eq!(leases.len(), 1);
    refused(sign_in(&program));
    sign_in("labeler 1").expect(201);

    let page = format!("/runs/{}/label", app.run);
    let typed = Some("name=labeler+1+of+study+1".to_owned());
    let told = all.send_with("POST", &page, typed, &FORM).expect(422).text;
    assert!(told.contains("choose another name"), "{told}");
    assert!(told.contains(&format!("href=\"{page}\"")), "{told}");
}

#[test]
fn a_browser_that_keeps_no_cookies_is_told_so_and_not_asked_for_the_name_without_end() {
    let app = TestApp::start(1);
    let page = format!("/runs/{}/label", app.run);
    let typed = Some("name=Ada".to_owned());
    // Where the name leads to, asked for without the cookie.
    let reply = app.stranger().send_with("POST", &page, typed, &FORM);
    let forgetful = reply.expect(200).text;
    assert!(forgetful.contains("keeps no cookies"), "{forgetful}");
    let first = app.stranger().send("GET", &page, None).expect(200).text;
    assert!(!first.contains("keeps no cookies"), "{first}");
}

#[test]
fn the_door_of_a_server_with_a_token_says_what_it_lacks() {
    let app = TestApp::start_guarded(1);
    let enter = |address: &str| app.stranger().send("GET", address, None);
    let told = enter("/enter").expect(400).json();
    assert_eq!(told["type"], "/problems/bad-request", "{told}");
    assert_eq!(told["detail"], "The address lacks `token`.");
    enter("/enter?token=guessed").expect(401);
}
