//! One control step of many environments, on several threads.

use domain::environment::{EnvError, Environment, Step};
use learn::device::with_denormals;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

/// An environment and what to do in it, `[A]`.
pub type Turn<'a> = (&'a mut dyn Environment, &'a [f32]);

/// Steps every environment once, on all threads of the present rayon pool; steps come in the order of
/// the turns. Environments share nothing, so the number of threads changes nothing but the time it
/// takes.
///
/// # Errors
/// Of the first turn that an environment refuses. The others have been taken.
pub fn step_all(turns: Vec<Turn<'_>>) -> Result<Vec<Step>, EnvError> {
    let steps: Vec<Result<Step, EnvError>> = turns
        .into_par_iter()
        .map(|(env, action)| with_denormals(|| env.step(action)))
        .collect();
    steps.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use rayon::ThreadPoolBuilder;

    use super::*;

    fn environments(n: usize) -> Vec<Box<dyn Environment>> {
        let task = sim::tasks::task("go-fetch-return").expect("a task");
        let mut envs: Vec<_> = (0..n).map(|_| (task.make)()).collect();
        for (seed, env) in envs.iter_mut().enumerate() {
            env.reset(seed as u64);
        }
        envs
    }

    fn turns<'a>(envs: &'a mut [Box<dyn Environment>], actions: &'a [Vec<f32>]) -> Vec<Turn<'a>> {
        let actions = actions.iter().map(Vec::as_slice);
        envs.iter_mut()
            .map(|env| &mut **env as &mut dyn Environment)
            .zip(actions)
            .collect()
    }

    #[test]
    fn the_number_of_threads_changes_no_bit_and_no_order() {
        let n = 7;
        let size = environments(1)[0].spec().action_size;
        let actions: Vec<Vec<f32>> = (0..n).map(|k| vec![k as f32 / 7.0 - 0.4; size]).collect();
        let observations = |n_threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(n_threads).build();
            pool.expect("threads").install(|| {
                let mut envs = environments(n);
                let rounds = (0..20).map(|_| step_all(turns(&mut envs, &actions)).expect("steps"));
                let steps = rounds.flatten().map(|step| step.observation);
                steps.collect::<Vec<_>>()
            })
        };
        let alone = observations(1);
        assert_eq!(alone.len(), 20 * n);
        assert_ne!(alone[0], alone[1], "environments that differ");
        for n_threads in [2, 3, 7, 50] {
            assert_eq!(observations(n_threads), alone, "{n_threads} threads");
        }
        assert!(step_all(Vec::new()).expect("nothing to refuse").is_empty());
    }

    #[test]
    fn a_refused_action_is_told_and_the_others_are_taken() {
        let mut envs = environments(4);
        let size = envs[0].spec().action_size;
        let mut actions = vec![vec![1.0; size]; 4];
        actions[1] = Vec::new();
        let before: Vec<_> = envs.iter().map(|env| env.pose()).collect();
        assert!(step_all(turns(&mut envs, &actions)).is_err());
        let has_moved: Vec<bool> = envs
            .iter()
            .zip(&before)
            .map(|(env, pose)| env.pose() != *pose)
            .collect();
        assert_eq!(has_moved, [true, false, true, true]);
    }
}
