use super::*;
use crate::expert::rollout;

#[test]
fn the_expert_nearly_always_succeeds_and_a_random_policy_nearly_never() {
    let mut environment = GoFetchReturn::new();
    let mut rate = |policy: &mut dyn FnMut(&[f32]) -> Vec<f32>| {
        let successes = (0..300)
            .filter(|&seed| {
                rollout(&mut environment, seed, policy)
                    .expect("a valid action")
                    .success
            })
            .count();
        successes as f64 / 300.0
    };
    let expert_rate = rate(&mut expert);
    assert!(expert_rate >= 0.98, "expert: {expert_rate}");
    let mut rng = Rng::new(1, Stream::Rollout, 0);
    let random_rate = rate(&mut |_| (0..3).map(|_| rng.uniform_in(-1.0, 1.0) as f32).collect());
    assert!(random_rate <= 0.02, "random: {random_rate}");
}
