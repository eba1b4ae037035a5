//! Both clips from one clock: frame numbers read back from the page's own pixels.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::driver::{Browser, Scheme};
use super::labeler::{Desk, N_FRAMES};

/// `read` gives the number that a canvas shows.
const SET_UP: &str = "
    window.player = document.getElementById('pair');
    window.read = (side) => {
      const canvas = player.querySelector(`canvas[data-side=${side}]`);
      const { data, width } = canvas.getContext('2d').getImageData(0, canvas.height / 4 | 0, canvas.width, 1);
      let n = 0;
      for (let k = 2; k < 18; k += 1) n = n * 2 + (data[4 * ((2 * k + 1) * width / 40 | 0) + 1] > 127 ? 1 : 0);
      return n;
    };
    return Number(player.querySelector('[data-do=scrub]').max) + 1;";

/// Looks at both canvases on every frame of the screen for some seconds.
const WATCH: &str = "
    const [speed, seconds] = given;
    player.setSpeed(speed);
    player.restart();
    const seen = [];
    const end = performance.now() + 1000 * seconds;
    while (performance.now() < end) {
      await new Promise((resolve) => requestAnimationFrame(resolve));
      seen.push([read('left'), read('right')]);
    }
    return seen;";

const SEEK: &str = "
    const wrong = [];
    for (let i = 0; i < 50; i += 1) {
      const k = (i * 37 + 11) % given[0];
      player.seek(k);
      const shown = [read('left'), read('right')];
      if (shown[0] !== k || shown[1] !== k) wrong.push([k, ...shown]);
    }
    player.seek(10);
    for (const [what, k] of [['forward', 11], ['forward', 12], ['back', 11]]) {
      player.do(what);
      if (read('left') !== k || read('right') !== k) wrong.push([what, read('left'), read('right')]);
    }
    return wrong;";

#[tokio::test(flavor = "multi_thread")]
async fn both_clips_are_never_more_than_one_frame_apart() {
    let Some(browser) = Browser::open(Scheme::Light, (1280, 900)).await else {
        return;
    };
    let desk = Desk::set_up(1).await;
    desk.sit_down(&browser).await;
    assert_eq!(
        browser.run(SET_UP, vec![]).await,
        json!(N_FRAMES),
        "every frame is decoded"
    );

    for (speed, seconds) in [(0.25, 10), (1.0, 10), (4.0, 10)] {
        let seen = browser.run(WATCH, vec![json!(speed), json!(seconds)]).await;
        let seen: Vec<(u64, u64)> = seen.as_array().expect("a list").iter().map(pair).collect();
        let apart = seen.iter().map(|(left, right)| left.abs_diff(*right)).max();
        let frames: BTreeSet<u64> = seen.iter().map(|(left, _)| *left).collect();
        println!(
            "{speed}×: {} looks in {seconds} s, {} different frames, at most {apart:?} apart",
            seen.len(),
            frames.len()
        );
        assert!(apart.is_some_and(|frames| frames <= 1), "{seen:?}");
        assert!(frames.len() > 5, "it plays: {frames:?}");
    }
    let wrong = browser.run(SEEK, vec![json!(N_FRAMES)]).await;
    assert_eq!(wrong, json!([]), "seeks and steps are exact");
}

fn pair(value: &Value) -> (u64, u64) {
    (
        value[0].as_u64().expect("a number"),
        value[1].as_u64().expect("a number"),
    )
}
