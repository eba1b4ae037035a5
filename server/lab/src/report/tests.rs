use super::*;
use crate::grid::{Ended, FileText, RunRow};
use crate::message::{Evaluation, SessionOffered};

fn plans(budget: u32, methods: &str) -> Vec<crate::grid::PlannedRun> {
    let text = format!(
        "title = ''\nsummary = ''\n[[grid]]\ntasks = ['go-fetch-return']\nmethods = [{methods}]\n\
         seeds = 3\nset = ['feedback.budget={budget}']\n"
    );
    let file = FileText {
        name: "x",
        text: &text,
    };
    file.plan(false).unwrap()
}

/// A run whose success rises to `success` in a straight line over five evaluations.
fn result(plan: &crate::grid::PlannedRun, revision: &str, success: f64) -> RunResult {
    let ended = Ended::Finished {
        weights: "w".into(),
        wall_s: 1.0,
    };
    let evaluations = (0..5).map(|k| Evaluation {
        step: 1_000 * k,
        labels: 10 * k as u32,
        episodes: 50,
        success_rate: success * k as f64 / 4.0,
        return_mean: 10.0 * k as f64,
        return_std: 0.0,
        reward_correlation: None,
    });
    let session = |session: u32, chosen: f64| SessionOffered {
        session,
        step: 1_000 * u64::from(session),
        n_queries: 10,
        disagreement_chosen: None,
        disagreement_pool: None,
        stage_gap_chosen: Some(chosen),
        stage_gap_pool: Some(4.0),
        same_stage_chosen: None,
    };
    RunResult {
        row: RunRow::new(plan, revision, "two cores", ended),
        evaluations: evaluations.collect(),
        sessions: vec![session(0, 4.0), session(1, 1.0), session(2, 3.0)],
    }
}

fn results(success: impl Fn(&str, u64) -> f64) -> Vec<RunResult> {
    let plans = plans(40, "'stair', 'pebble'");
    let plans = plans.iter();
    plans
        .map(|p| result(p, "r1", success(&p.config.method, p.config.seed)))
        .collect()
}

#[test]
fn a_score_is_what_hand_and_paper_say() {
    let plan = &plans(40, "'stair'")[0];
    let score = Score::of(&result(plan, "r1", 1.0));
    assert!((score.success - 0.5).abs() < 1e-12, "mean of 0, ¼, ½, ¾, 1");
    assert!((score.area - 0.5).abs() < 1e-12, "a triangle");
    assert!((score.task_return - 20.0).abs() < 1e-12);
    let steps = score.reached.map(|r| r.map(|r| (r.step, r.labels)));
    assert_eq!(
        steps,
        [Some((2_000, 20)), Some((4_000, 40)), Some((4_000, 40))]
    );
    assert!((score.stage_gap_ratio.unwrap() - 0.5).abs() < 1e-12);
    assert_eq!(score.same_stage, None);
}

#[test]
fn methods_are_compared_seed_by_seed() {
    let results = results(|method, seed| {
        let seed = 0.1 * seed as f64;
        if method == "stair" {
            0.6 + seed
        } else {
            0.2 + seed
        }
    });
    let report = Report::new(results, ReportSettings::default()).unwrap();
    let comparisons = report.comparisons();
    assert_eq!(comparisons.len(), 1);
    let [stair, pebble] = &comparisons[0].methods[..] else {
        panic!("two methods");
    };
    assert_eq!((stair.method, pebble.method), ("stair", "pebble"));
    // scores are half of what was reached at the end: 0.35, 0.40, 0.45 against 0.15, 0.20, 0.25
    assert!((stair.success.unwrap().value - 0.4).abs() < 1e-12);
    let behind = pebble.behind_first.unwrap();
    assert!((behind.value - 0.2).abs() < 1e-12);
    assert!(
        behind.interval.hi - behind.interval.lo < 1e-12,
        "every seed differs by the same"
    );
    assert!(stair.behind_first.is_none());
    let files = report.files("A test").unwrap();
    let names: Vec<&str> = files.iter().map(|f| f.name).collect();
    assert!(names.contains(&"success.svg") && names.contains(&"stage-gap-ratio.csv"));
    assert!(
        !names.contains(&"same-stage.svg"),
        "no run knows its stages"
    );
    let markdown = &files.iter().find(|f| f.name == "report.md").unwrap().text;
    assert!(markdown.contains("| 0.40 ["), "{markdown}");
    assert!(markdown.contains("0.35 0.40 0.45"), "{markdown}");
    assert_eq!(report.files("A test").unwrap(), files, "the same bytes");
}

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let told = |results: Vec<RunResult>| {
        Report::new(results, ReportSettings::default())
            .err()
            .expect("a misfit")
            .to_string()
    };
    assert!(told(vec![]).contains("no results"));

    let mut mixed = results(|_, _| 1.0);
    mixed[1].row.revision = "r2".into();
    let said = told(mixed.clone());
    assert!(
        said.contains("r1") && said.contains("--mix-revisions"),
        "{said}"
    );
    let settings = ReportSettings {
        may_mix_revisions: true,
        ..ReportSettings::default()
    };
    assert!(Report::new(mixed, settings).is_ok());

    let mut budgets = results(|_, _| 1.0);
    let other = plans(80, "'pebble'").remove(0);
    budgets.push(result(&other, "r1", 1.0));
    budgets.retain(|r| r.row.method == "stair" || r.row.setting_at("feedback.budget") == 80);
    let said = told(budgets);
    assert!(
        said.contains("feedback.budget") && said.contains("80"),
        "{said}"
    );

    let mut partial = results(|_, _| 1.0);
    for result in &mut partial[3..] {
        result.row.setting = "N = 40".into();
    }
    partial.retain(|r| r.row.setting.is_empty() || r.row.method == "stair");
    let said = told(partial);
    assert!(
        said.contains("pebble") && said.contains("--partial"),
        "{said}"
    );
}

#[test]
fn a_failed_run_is_told_and_stops_nothing() {
    let mut results = results(|_, _| 1.0);
    results[0].row.ended = Ended::Failed {
        reason: "the disk is full".into(),
    };
    let report = Report::new(results, ReportSettings::default()).unwrap();
    let files = report.files("A test").unwrap();
    let markdown = &files.iter().find(|f| f.name == "report.md").unwrap().text;
    assert!(
        markdown.contains("go-fetch-return-stair-1: the disk is full"),
        "{markdown}"
    );
}
