//! Maps of real runs: of an episode that was asked about, with its true stages; and why there is
//! none.

use domain::teacher::{Oracle, Scripted};
use lab::figure::{self, Request, Source};
use lab::record::RunRecord;
use lab::run::Run;
use lab::temporal_map::{MapError, TemporalMap};

use super::{Folder, drive, finished, short, short_of};

#[test]
fn the_map_of_a_run_shows_an_episode_that_was_asked_about() {
    let folder = Folder::new("map");
    let mut run = Run::start(short(), &folder.0).unwrap();
    let told = TemporalMap::of(&RunRecord::open(&folder.0).unwrap(), None).unwrap_err();
    assert!(
        matches!(
            told,
            MapError::NotYet {
                first: 600,
                step: 0
            }
        ),
        "{told}"
    );
    finished(drive(&mut run, &mut Scripted::new(Box::new(Oracle), 0)).0);
    drop(run);

    let record = RunRecord::open(&folder.0).unwrap();
    let map = TemporalMap::of(&record, None).unwrap();
    let n = map.steps.len();
    assert_eq!(
        (map.distance.len(), map.stages.len(), map.starts[0]),
        (n, n, 0)
    );
    for (i, row) in map.distance.iter().enumerate() {
        assert!(row[i].abs() < 1e-3, "a state is at no distance from itself");
        assert!(row.iter().all(|d| *d >= 0.0));
    }
    assert!(!map.asked.is_empty());
    assert!(map.asked.iter().all(|s| s.start + s.len <= map.len));
    let n_asked_elsewhere = |id| TemporalMap::of(&record, Some(id)).unwrap().asked.len();
    let others = record.replay().complete_episodes().iter();
    let most = others.map(|id| n_asked_elsewhere(id.0)).max().unwrap();
    assert_eq!(
        map.asked.len(),
        most,
        "of all episodes the one most asked about"
    );

    let sources = [Source {
        name: "run".into(),
        text: serde_json::to_string(&map).unwrap(),
    }];
    let request = Request {
        sources: &sources,
        ..Request::default()
    };
    let svg = figure::make(figure::find("temporal-map").unwrap(), &request).unwrap();
    assert!(svg.contains(">True stages<") && svg.contains(&format!("episode {}", map.episode)));

    let told = TemporalMap::of(&record, Some(9_999)).unwrap_err();
    assert!(matches!(told, MapError::NoEpisode(9_999)), "{told}");
}

#[test]
fn a_method_without_a_temporal_distance_is_told_which_have_one() {
    let folder = Folder::new("no-map");
    drop(Run::start(short_of("pebble", &[]), &folder.0).unwrap());
    let record = RunRecord::open(&folder.0).unwrap();
    let told = TemporalMap::of(&record, None).unwrap_err().to_string();
    assert!(
        told.contains("pebble learns no temporal distance"),
        "{told}"
    );
    assert!(told.contains("runs of stair"), "{told}");
}
