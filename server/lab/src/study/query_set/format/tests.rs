use super::*;
use crate::study::query_set::QuerySetError as Error;

/// Nine numbers a pose, as go-fetch-return has.
const POSE_SIZE: usize = 9;

fn segment(number: u32, knows_stages: bool) -> PackedSegment {
    let n_steps = 4;
    let pose = |step: u32| {
        let value = |k: u8| (step as f32 * 0.01).mul_add(f32::from(k), number as f32 - 2.0);
        (0..POSE_SIZE as u8).map(value).collect()
    };
    PackedSegment {
        segment: Segment {
            episode: EpisodeId(number),
            start: 3 * number,
            len: n_steps,
        },
        poses: (0..n_steps).map(pose).collect(),
        stages: if knows_stages {
            vec![0, 0, 1, 2]
        } else {
            Vec::new()
        },
    }
}

fn example() -> PackedQueries {
    let query = |place: u32| PackedQuery {
        key: QueryKey {
            session: 1 + place / 2,
            index: place % 2,
        },
        first: segment(2 * place, true),
        second: segment(7 - place, place != 1),
    };
    PackedQueries {
        task: "go-fetch-return".into(),
        method: "stair".into(),
        seed: u64::MAX,
        preset: Some("quick".into()),
        command: "stair train go-fetch-return --preset quick".into(),
        revision: "0123456789".into(),
        segment_len: 4,
        queries: (0..3).map(query).collect(),
    }
}

fn unpack(bytes: &[u8]) -> Result<PackedQueries, QuerySetError> {
    PackedQueries::unpack(Path::new("sets/mine.queries"), bytes)
}

/// A whole file with another head and body, its checksum right.
fn forged(head: &str, body: &[u8]) -> Vec<u8> {
    let mut bytes = [b"stair query set 1\n", head.as_bytes(), b"\n", body].concat();
    bytes.extend(Checksum::of(&bytes).to_le_bytes());
    bytes
}

fn head_and_body(bytes: &[u8]) -> (String, Vec<u8>) {
    let mut lines = whole(bytes).unwrap().splitn(3, |&byte| byte == b'\n');
    let head = lines.nth(1).unwrap().to_vec();
    let body = lines.next().unwrap().to_vec();
    (String::from_utf8(head).unwrap(), body)
}

#[test]
fn what_is_unpacked_is_what_was_packed() {
    let packed = example();
    let bytes = packed.pack();
    assert_eq!(unpack(&bytes).unwrap(), packed);
    assert_eq!(packed.pack(), bytes, "the same bytes each time");
}

#[test]
fn no_bit_of_a_pose_is_lost() {
    let mut packed = example();
    let odd = [-0.0, f32::MIN_POSITIVE / 2.0, f32::MAX, -1e-30];
    for (step, value) in odd.into_iter().enumerate() {
        packed.queries[1].second.poses[step][3] = value;
    }
    let bits = |set: &PackedQueries| -> Vec<u32> {
        let poses = set.segments().flat_map(|s| s.poses.iter().flatten());
        poses.map(|number| number.to_bits()).collect()
    };
    assert_eq!(bits(&unpack(&packed.pack()).unwrap()), bits(&packed));
}

#[test]
fn damage_of_any_byte_is_refused_by_name() {
    let bytes = example().pack();
    for place in 0..bytes.len() {
        for flip in [1, 0x80] {
            let mut damaged = bytes.clone();
            damaged[place] ^= flip;
            let told = unpack(&damaged)
                .expect_err("damage goes unnoticed")
                .to_string();
            assert!(told.starts_with("sets/mine.queries "), "{told}");
        }
    }
    for len in 0..bytes.len() {
        let told = unpack(&bytes[..len]).expect_err("a part is taken for the whole");
        assert!(told.to_string().starts_with("sets/mine.queries "), "{told}");
    }
}

#[test]
fn files_of_another_kind_and_of_a_newer_program_are_told_apart() {
    for foreign in [
        &b""[..],
        b"\x89PNG\r\n\x1a\n",
        b"STAIRckp",
        b"stair query set \n",
    ] {
        assert!(matches!(unpack(foreign), Err(Error::Foreign { .. })));
    }
    let newer = [b"stair query set 7\n", &example().pack()[18..]].concat();
    let told = unpack(&newer).unwrap_err();
    assert!(
        matches!(
            told,
            Error::TooNew {
                found: 7,
                known: 1,
                ..
            }
        ),
        "{told}"
    );
}

#[test]
fn a_body_that_its_head_does_not_describe_is_damage() {
    let (head, body) = head_and_body(&example().pack());
    assert!(unpack(&forged(&head, &body)).is_ok());
    for (there, instead) in [
        ("\"n_queries\":3", "\"n_queries\":2"),
        ("\"n_queries\":3", "\"n_queries\":4"),
        ("\"n_queries\":3", "\"n_queries\":0"),
        ("\"n_queries\":3", "\"n_queries\":18446744073709551615"),
        ("\"n_queries\":3", "\"n_queries\":9223372036854775807"),
        ("\"segment_len\":4", "\"segment_len\":5"),
        ("\"segment_len\":4", "\"segment_len\":4294967295"),
        ("\"segment_len\":4", "\"segment_len\":-1"),
        ("\"seed\"", "\"sed\""),
    ] {
        assert!(head.contains(there), "{head}");
        let told = unpack(&forged(&head.replace(there, instead), &body)).unwrap_err();
        assert!(matches!(told, Error::Damaged { .. }), "{instead}: {told}");
    }
    for body in [&body[..body.len() / 2], b"", b"\xff\xff"] {
        let told = unpack(&forged(&head, body)).unwrap_err();
        assert!(matches!(told, Error::Damaged { .. }), "{told}");
    }
}

#[test]
fn a_pose_that_cannot_be_drawn_is_damage() {
    for value in [f32::NAN, f32::NEG_INFINITY] {
        let mut packed = example();
        packed.queries[1].second.poses[2][8] = value;
        let told = unpack(&packed.pack()).unwrap_err();
        assert!(matches!(told, Error::Damaged { .. }), "{told}");
    }
}

#[test]
fn a_task_that_is_not_there_or_has_changed_is_named() {
    let (head, body) = head_and_body(&example().pack());
    let other = head.replace("go-fetch-return\",\"method", "go-fetch-retrun\",\"method");
    let told = unpack(&forged(&other, &body)).unwrap_err().to_string();
    assert!(told.contains("did you mean \"go-fetch-return\""), "{told}");
    let other = head.replace("\"pose_size\":9", "\"pose_size\":8");
    let told = unpack(&forged(&other, &body)).unwrap_err().to_string();
    assert!(
        told.contains("poses of 8 numbers") && told.contains("from 9 now"),
        "{told}"
    );
}

#[test]
fn the_top_queries_are_those_ranked_highest_in_their_sessions() {
    let packed = example();
    let keys: Vec<(u32, u32)> = packed
        .top(2)
        .iter()
        .map(|query| (query.key.session, query.key.index))
        .collect();
    assert_eq!(keys, [(1, 0), (2, 0)]);
    assert_eq!(packed.top(9).len(), 3);
}
