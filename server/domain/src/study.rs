//! In which order, and with which sides, one labeler meets the pairs of a study.

use crate::answer::Which;
use crate::random::Rng;

/// Other pairs between a pair and its repeat, where the task has that many: nobody remembers
/// one of the last few.
const LEAST_GAP: usize = 5;

/// A pair of a study, as far as its place and sides depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Item {
    /// Number of its task; labelers meet the tasks by their numbers.
    pub task: usize,
    /// Number of the algorithm that chose it.
    pub method: usize,
    /// Whether its right answer is known, so that it counts for no algorithm.
    pub is_check: bool,
}

/// Why a labeler is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// For the study's result.
    Counted,
    /// To see whether the labeler looks.
    Check,
    /// A counted pair once more, its sides swapped: to see whether the labeler agrees with
    /// themselves.
    Repeat,
}

/// One question to a labeler.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turn {
    /// Index of the item.
    pub item: usize,
    /// Why it is asked.
    pub role: Role,
    /// Which segment is on the left.
    pub left_is: Which,
}

/// All that one labeler is asked.
///
/// Tasks follow each other; within a task everything is shuffled, so that an order says nothing
/// about algorithms. The sides of each algorithm's counted pairs alternate before the shuffling:
/// left and right differ by at most 1. They still do when repeats are counted in, where a task
/// has pairs of the algorithm with either side in the first half of its order.
///
/// * `repeats_per_task` – a task without enough pairs in the first half of its order gets fewer
pub fn turns(items: &[Item], repeats_per_task: u32, rng: &mut Rng) -> Vec<Turn> {
    let n_tasks = items.iter().map(|item| item.task + 1).max().unwrap_or(0);
    let mut sides = Sides::new(items, rng);
    let mut tasks: Vec<Vec<Turn>> = Vec::with_capacity(n_tasks);
    for task in 0..n_tasks {
        let mut order: Vec<usize> = (0..items.len()).collect();
        order.retain(|i| items[*i].task == task);
        let turns: Vec<Turn> = shuffled(&order, rng)
            .into_iter()
            .map(|item| sides.turn(item, items[item]))
            .collect();
        tasks.push(shuffled(&turns, rng));
    }
    for turns in &mut tasks {
        for repeat in choose_repeats(items, turns, repeats_per_task, &mut sides) {
            insert(turns, repeat, rng);
        }
    }
    tasks.concat()
}

/// How often each algorithm's first segment was on the left, less how often its second was.
struct Sides {
    /// One for each algorithm, and one for the checks.
    surplus: Vec<i32>,
    /// What is on the left next.
    next: Vec<Which>,
}

impl Sides {
    fn new(items: &[Item], rng: &mut Rng) -> Self {
        let n_methods = items.iter().map(|item| item.method + 1).max().unwrap_or(0);
        let mut coin = || {
            if rng.chance(0.5) {
                Which::First
            } else {
                Which::Second
            }
        };
        Self {
            surplus: vec![0; n_methods + 1],
            next: (0..=n_methods).map(|_| coin()).collect(),
        }
    }

    fn group(&self, item: Item) -> usize {
        if item.is_check {
            self.surplus.len() - 1
        } else {
            item.method
        }
    }

    fn turn(&mut self, index: usize, item: Item) -> Turn {
        let group = self.group(item);
        let left_is = self.next[group];
        self.next[group] = left_is.other();
        self.surplus[group] += sign(left_is);
        let role = if item.is_check {
            Role::Check
        } else {
            Role::Counted
        };
        Turn {
            item: index,
            role,
            left_is,
        }
    }
}

fn sign(left_is: Which) -> i32 {
    if left_is == Which::First { 1 } else { -1 }
}

/// Swapped counted pairs of the first half: of the algorithm that has the fewest so far, and of
/// its pairs the one that leaves its sides most even.
fn choose_repeats(items: &[Item], turns: &[Turn], n: u32, sides: &mut Sides) -> Vec<Turn> {
    let half = &turns[..turns.len().div_ceil(2)];
    let mut left: Vec<Turn> = half.to_vec();
    left.retain(|turn| turn.role == Role::Counted);
    let mut n_of = vec![0_u32; sides.surplus.len()];
    let mut repeats = Vec::new();
    while repeats.len() < n as usize {
        let cost = |turn: &Turn| {
            let method = items[turn.item].method;
            let after = sides.surplus[method] - sign(turn.left_is);
            (after.abs() > 1, n_of[method], after.abs())
        };
        let Some(best) = (0..left.len()).min_by_key(|i| cost(&left[*i])) else {
            break;
        };
        let original = left.remove(best);
        let method = items[original.item].method;
        n_of[method] += 1;
        sides.surplus[method] -= sign(original.left_is);
        repeats.push(Turn {
            role: Role::Repeat,
            left_is: original.left_is.other(),
            ..original
        });
    }
    repeats
}

/// Somewhere behind its original, as far as there is room.
fn insert(turns: &mut Vec<Turn>, repeat: Turn, rng: &mut Rng) {
    let original = turns.iter().position(|turn| turn.item == repeat.item);
    let earliest = original.map_or(0, |place| place + 1 + LEAST_GAP);
    let earliest = earliest.min(turns.len());
    let place = earliest + rng.below(turns.len() + 1 - earliest);
    turns.insert(place, repeat);
}

fn shuffled<T: Copy>(values: &[T], rng: &mut Rng) -> Vec<T> {
    let order = rng.permutation(values.len());
    order.into_iter().map(|i| values[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// 4 tasks × 50 pairs, half of them of either algorithm, and a check in each task.
    fn items(n_tasks: usize, n_pairs: usize) -> Vec<Item> {
        let item = |task, k| Item {
            task,
            method: k % 2,
            is_check: k == n_pairs,
        };
        (0..n_tasks)
            .flat_map(|task| (0..=n_pairs).map(move |k| item(task, k)))
            .collect()
    }

    fn drawn(items: &[Item], n_repeats: u32, seed: u64) -> Vec<Turn> {
        turns(items, n_repeats, &mut Rng::new(seed, Stream::Test, 0))
    }

    #[test]
    fn left_and_right_differ_by_at_most_one_for_each_algorithm_with_repeats_and_without() {
        for (n_pairs, n_repeats) in [(50, 0), (50, 3), (21, 2), (20, 5)] {
            let items = items(4, n_pairs);
            for seed in 0..200 {
                let turns = drawn(&items, n_repeats, seed);
                for method in 0..2 {
                    let surplus = |roles: &[Role]| -> i32 {
                        let is_of = |turn: &&Turn| {
                            items[turn.item].method == method && roles.contains(&turn.role)
                        };
                        turns.iter().filter(is_of).map(|t| sign(t.left_is)).sum()
                    };
                    let all = surplus(&[Role::Counted, Role::Repeat]);
                    assert!(all.abs() <= 1, "{n_pairs} pairs, seed {seed}: {all}");
                    let counted = surplus(&[Role::Counted]);
                    assert!(
                        n_repeats > 0 || counted.abs() <= 1,
                        "seed {seed}: {counted}"
                    );
                }
            }
        }
    }

    #[test]
    fn every_pair_is_asked_once_and_tasks_follow_each_other() {
        let items = items(3, 10);
        let turns = drawn(&items, 2, 1);
        let mut once: Vec<usize> = turns
            .iter()
            .filter(|turn| turn.role != Role::Repeat)
            .map(|turn| turn.item)
            .collect();
        once.sort_unstable();
        assert_eq!(once, (0..items.len()).collect::<Vec<_>>());
        assert!(turns.is_sorted_by_key(|turn| items[turn.item].task));
        assert_eq!(turns.len(), items.len() + 3 * 2);
    }

    #[test]
    fn a_repeat_has_its_sides_swapped_and_comes_at_least_five_pairs_later() {
        let items = items(2, 20);
        for seed in 0..200 {
            let turns = drawn(&items, 3, seed);
            let is_repeat = |turn: &&Turn| turn.role == Role::Repeat;
            assert_eq!(turns.iter().filter(is_repeat).count(), 6);
            for (place, repeat) in turns.iter().enumerate() {
                if repeat.role == Role::Repeat {
                    let is_original = |turn: &Turn| turn.item == repeat.item;
                    let original = turns.iter().position(is_original).unwrap();
                    assert_eq!(turns[original].left_is, repeat.left_is.other());
                    assert!(place - original > LEAST_GAP, "seed {seed}");
                }
            }
        }
    }

    #[test]
    fn places_say_nothing_about_algorithms() {
        let items = items(1, 50);
        let n_seeds = 2_000;
        let n_first: usize = (0..n_seeds)
            .filter(|seed| {
                let turns = drawn(&items, 3, *seed);
                items[turns[0].item].method == 0
            })
            .count();
        let share = n_first as f64 / n_seeds as f64;
        // 26 of 51 items are of the first algorithm; five standard errors
        assert!((share - 26.0 / 51.0).abs() < 0.056, "{share}");
    }

    #[test]
    fn without_pairs_nothing_is_asked_and_one_pair_has_its_repeat_right_after() {
        assert_eq!(drawn(&[], 2, 1), []);
        let one = [Item {
            task: 0,
            method: 0,
            is_check: false,
        }];
        let turns = drawn(&one, 2, 1);
        assert_eq!(turns.len(), 2, "one pair has one repeat");
        assert_eq!(turns[1].left_is, turns[0].left_is.other());
    }
}
