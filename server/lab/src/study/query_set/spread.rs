//! Which queries stand for all of a run.

use domain::query::QueryKey;

/// How far a pick's place in its session moves on from that of the pick before, as a share of the
/// session: 1/φ, which no number of steps brings near a place that was taken.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Indices of `n` of the keys, ascending: as many from each session as its share of all, at places
/// spread over the ranks of the session, so that neither early and late sessions nor a session's
/// first and last choices are over-represented. All of them where there are no more than `n`.
///
/// Nothing is drawn: the same keys give the same picks.
///
/// * `keys` – in their own order, one session after another
///
/// # Panics
/// When the keys are in another order: a bug of the caller.
pub fn spread(keys: &[QueryKey], n: usize) -> Vec<usize> {
    let n = n.min(keys.len());
    let mut is_taken = vec![false; keys.len()];
    for pick in 0..n {
        let centre = (2 * pick + 1) * keys.len() / (2 * n);
        let session = keys[centre].session;
        let start = keys.partition_point(|key| key.session < session);
        let end = keys.partition_point(|key| key.session <= session);
        let place = ((pick as f64 + 0.5) * GOLDEN).fract();
        let offset = (place * (end - start) as f64) as usize;
        let from_there = (start + offset..end).chain(start..start + offset);
        let free = from_there.into_iter().find(|&index| !is_taken[index]);
        is_taken[free.expect("keys in their order: a session has no fewer than its picks")] = true;
    }
    (0..keys.len()).filter(|&index| is_taken[index]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(sizes: &[u32]) -> Vec<QueryKey> {
        let sessions = sizes.iter().zip(1..);
        sessions
            .flat_map(|(&size, session)| (0..size).map(move |index| QueryKey { session, index }))
            .collect()
    }

    #[test]
    fn every_session_gives_its_share() {
        let keys = keys(&[40, 20, 40]);
        let picks = spread(&keys, 10);
        let of = |session| {
            picks
                .iter()
                .filter(|&&i| keys[i].session == session)
                .count()
        };
        assert_eq!((of(1), of(2), of(3)), (4, 2, 4));
    }

    #[test]
    fn ranks_are_spread_as_evenly_as_sessions() {
        let keys = keys(&[40; 24]);
        let picks = spread(&keys, 48);
        let mut quarters = [0; 4];
        for &pick in &picks {
            quarters[keys[pick].index as usize / 10] += 1;
        }
        assert!(
            quarters.iter().all(|n| (11..=13).contains(n)),
            "{quarters:?}"
        );
    }

    #[test]
    fn as_many_as_there_are_is_all_and_none_of_none_is_none() {
        let keys = keys(&[3, 1, 5]);
        assert_eq!(spread(&keys, 9), (0..9).collect::<Vec<_>>());
        assert_eq!(spread(&keys, 100).len(), 9);
        assert!(spread(&keys, 0).is_empty() && spread(&[], 5).is_empty());
    }

    #[test]
    fn any_number_of_any_sessions_can_be_had() {
        let keys = keys(&[1, 7, 2, 30, 1, 1, 16]);
        for n in 0..=keys.len() {
            let picks = spread(&keys, n);
            assert!(picks.len() == n && picks.is_sorted(), "{n}: {picks:?}");
        }
    }
}
