//! The figures of runs that are compared: those of `stair figure curves`, with a line for each run.

use std::collections::BTreeSet;

use lab::config::RunConfig;
use lab::figure::{self, FigureError, Request, Source};
use lab::words::thousands;

use super::{Compared, answerer, size};
use crate::api::runs::RunView;
use crate::pages::home::method_name;

/// A figure of several runs.
pub(super) struct Plot {
    /// In its address, before `.svg`.
    pub(super) name: &'static str,
    pub(super) title: &'static str,
    /// Columns along its axes.
    x: &'static str,
    y: &'static str,
    /// Whether it says something only of runs of one task.
    pub(super) is_of_one_task: bool,
}

/// In the order of the page.
pub(super) const PLOTS: &[Plot] = &[
    Plot {
        name: "success-by-steps",
        title: "Success over environment steps",
        x: "step",
        y: "success_rate",
        is_of_one_task: false,
    },
    Plot {
        name: "success-by-answers",
        title: "Success over answers",
        x: "labels",
        y: "success_rate",
        is_of_one_task: false,
    },
    Plot {
        name: "return-by-steps",
        title: "Task return over environment steps",
        x: "step",
        y: "return_mean",
        is_of_one_task: true,
    },
];

/// The figure as SVG.
///
/// # Errors
/// Trials that cannot be read, or none at all.
pub(super) fn draw(runs: &[Compared], plot: &Plot) -> Result<String, FigureError> {
    let sources = runs.iter().zip(names(runs));
    let sources = sources.map(|(one, name)| source(one, name));
    let sources = sources.collect::<Result<Vec<_>, FigureError>>()?;
    let request = Request {
        sources: &sources,
        x: Some(plot.x),
        y: Some(plot.y),
        ..Request::default()
    };
    figure::make(figure::find("curves")?, &request)
}

/// The trials of a run as rows. In a figure the runs of a method share a line; here each run has
/// one of its own, so that none is averaged with one of other settings.
///
/// * `name` – of the line
fn source(compared: &Compared, name: String) -> Result<Source, FigureError> {
    let run = &compared.run;
    let config = RunConfig {
        task: run.task.clone(),
        method: name,
        seed: run.seed,
        ..RunConfig::default()
    };
    let name = format!("run {}", run.id);
    Ok(Source {
        text: figure::rows_of_run(&config, &name, &compared.trials)?,
        name,
    })
}

/// `run 1: STAIR, seed 1`, and behind it what else tells these runs apart.
fn names(runs: &[Compared]) -> Vec<String> {
    let parts: [fn(&RunView) -> String; 3] = [size, answered_by, budget];
    let mut telling = Vec::new();
    for part in parts {
        let told: BTreeSet<String> = runs.iter().map(|one| part(&one.run)).collect();
        if told.len() > 1 {
            telling.push(part);
        }
    }
    let name = |one: &Compared| {
        let run = &one.run;
        let mut words = vec![
            format!("run {}: {}", run.id, method_name(&run.method)),
            format!("seed {}", run.seed),
        ];
        words.extend(telling.iter().map(|part| part(run)));
        words.join(", ")
    };
    runs.iter().map(name).collect()
}

fn answered_by(run: &RunView) -> String {
    format!("answered by {}", answerer(run))
}

fn budget(run: &RunView) -> String {
    format!("budget {}", thousands(run.budget.into()))
}

#[cfg(test)]
pub(super) mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::api::runs::StateView;

    /// A run that has its number as its seed and was tried so often.
    pub(in crate::pages::compare) fn run(id: i64, n_trials: u32) -> Compared {
        let mut trials = String::new();
        for n in 0..n_trials {
            let (step, labels) = (1_000 * n, 10 * n);
            writeln!(
                trials,
                "{{\"kind\":\"evaluation\",\"step\":{step},\"labels\":{labels},\"episodes\":5,\
                 \"success_rate\":0.5,\"return_mean\":1.5,\"return_std\":0.0,\"reward_correlation\":null}}"
            )
            .unwrap();
        }
        Compared {
            trials,
            success: (n_trials > 0).then_some(0.5),
            run: RunView {
                id,
                task: "go-fetch-return".into(),
                method: "stair".into(),
                preset: "quick".into(),
                seed: id.unsigned_abs(),
                teacher: "oracle".into(),
                teacher_settings: None,
                state: StateView {
                    kind: "finished".into(),
                    message: "Finished".into(),
                    since: String::new(),
                    next: String::new(),
                },
                step: 1_000,
                total_steps: 1_000,
                labels: 40,
                budget: 40,
                session: None,
                session_answered: 0,
                session_size: 0,
                created_at: String::new(),
            },
        }
    }

    #[test]
    fn a_line_is_called_by_what_tells_its_run_apart() {
        let runs = [run(1, 1), run(2, 1)];
        assert_eq!(
            names(&runs),
            ["run 1: STAIR, seed 1", "run 2: STAIR, seed 2"]
        );
        let mut other = run(3, 1);
        other.run.preset = String::new();
        other.run.budget = 1_000;
        other.run.teacher = "human".into();
        assert_eq!(
            names(&[run(1, 1), other]),
            [
                "run 1: STAIR, seed 1, quick, answered by the script oracle, budget 40",
                "run 3: STAIR, seed 3, full size, answered by people, budget 1,000"
            ]
        );
    }

    #[test]
    fn each_run_is_a_line_of_its_own_even_where_settings_and_seeds_are_the_same() {
        let mut twin = run(2, 3);
        twin.run.seed = 1;
        let runs = [run(1, 3), twin, run(3, 0)];
        for plot in PLOTS {
            let svg = draw(&runs, plot).unwrap();
            let n_lines = svg.matches("stroke-width=\"0.8\"").count();
            assert_eq!(n_lines, 2, "{}", plot.name);
            for name in ["run 1: STAIR, seed 1", "run 2: STAIR, seed 1"] {
                assert!(svg.contains(name), "{name} is not in: {svg}");
            }
        }
        assert!(draw(&[run(1, 0), run(2, 0)], &PLOTS[0]).is_err());
    }
}
