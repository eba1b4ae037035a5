//! How well one number tells two kinds of things apart.

/// P(a > b) + ½ P(a = b) for `a` drawn from the first and `b` from the second: 1 where every first
/// value lies above every second one, ½ where the values say nothing of which is which. `None` where
/// one of them is empty.
///
/// Source: Mann and Whitney's U by the number of pairs, which is the area under the ROC curve.
pub fn probability_of_superiority(first: &[f32], second: &[f32]) -> Option<f64> {
    let n_pairs = first.len() as f64 * second.len() as f64;
    if n_pairs == 0.0 {
        return None;
    }
    let mut second = second.to_vec();
    second.sort_by(f32::total_cmp);
    let halves = first.iter().map(|a| {
        let n_below = second.partition_point(|b| b < a);
        let n_not_above = second.partition_point(|b| b <= a);
        n_below + n_not_above // those below twice, those equal once
    });
    Some(halves.sum::<usize>() as f64 / (2.0 * n_pairs))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_counts_pairs_in_order_and_equal_ones_half() {
        let of = probability_of_superiority;
        assert_eq!(of(&[3.0, 4.0, 5.0], &[1.0, 2.0]), Some(1.0));
        assert_eq!(of(&[1.0], &[3.0, 4.0]), Some(0.0));
        assert_eq!(of(&[1.0, 1.0], &[1.0]), Some(0.5));
        // 3 > 2; 9 > 2, 9 > 5, 9 = 9: three and a half of six
        assert_eq!(of(&[3.0, 9.0], &[9.0, 2.0, 5.0]), Some(3.5 / 6.0));
    }

    #[test]
    fn without_one_of_the_kinds_there_is_nothing_to_tell() {
        assert_eq!(probability_of_superiority(&[], &[1.0]), None);
        assert_eq!(probability_of_superiority(&[1.0], &[]), None);
    }
}
