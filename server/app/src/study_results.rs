//! What came out of a study: figures and measures with intervals, from its answers alone.
//!
//! Counted answers are those about pairs that are neither practice nor check nor repeat, that no
//! later answer replaces, and that are no skip.

use std::collections::BTreeMap;

use domain::agreement::{
    Bootstrap, Continuity, Estimate, Interval, Ratings, Share, Stratum, cochran_mantel_haenszel,
    cohens_kappa, newcombe, self_consistency,
};
use lab::figure::{self, FigureError, Request, Source};
use lab::method::rank;
use serde_json::json;
use store::{Label, LabelsOf, Store, StoreError, StudyId};

/// Of every interval.
const LEVEL: f64 = 0.95;
/// Answers that are read at once.
const PAGE: u32 = 5_000;

/// Figures and measures of a study.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Results {
    /// Counted answers.
    pub n_answers: usize,
    /// What there is to draw.
    pub figures: Vec<ResultFigure>,
    /// What there is to tell.
    pub measures: Vec<Measure>,
}

/// A figure and the rows that it draws.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultFigure {
    /// Of `stair figure`.
    pub name: &'static str,
    /// What it shows.
    pub caption: &'static str,
    /// One JSON object a line.
    pub rows: String,
}

impl ResultFigure {
    /// As SVG.
    ///
    /// # Errors
    /// Rows that the figure cannot draw.
    pub fn draw(&self) -> Result<String, FigureError> {
        let sources = [Source {
            name: "the study's answers".to_owned(),
            text: self.rows.clone(),
        }];
        let request = Request {
            sources: &sources,
            ..Request::default()
        };
        figure::make(figure::find(self.name)?, &request)
    }
}

/// A number with its interval.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Measure {
    /// What it is.
    pub name: String,
    /// The number.
    pub value: f64,
    /// Where the truth may lie, 95 %; `None` for a probability.
    pub interval: Option<[f64; 2]>,
    /// From how many answers, pairs or labelers.
    pub from: String,
}

impl Measure {
    fn new(name: impl Into<String>, estimate: Estimate, from: impl Into<String>) -> Self {
        let Interval { lo, hi } = estimate.interval;
        Self {
            name: name.into(),
            value: estimate.value,
            interval: Some([lo, hi]),
            from: from.into(),
        }
    }

    /// `0.62`
    pub fn shown_value(&self) -> String {
        shown(self.value)
    }

    /// `0.51 to 0.72`
    pub fn shown_interval(&self) -> String {
        self.interval.map_or_else(String::new, |[lo, hi]| {
            format!("{} to {}", shown(lo), shown(hi))
        })
    }
}

/// Three decimals, and very small numbers as such.
fn shown(value: f64) -> String {
    if value != 0.0 && value.abs() < 0.001 {
        format!("{value:.0e}")
    } else {
        format!("{value:.3}")
    }
}

/// All answers of a study. Before it is closed none tells its method.
///
/// # Errors
/// The database cannot be read.
pub async fn labels(store: &Store, study: StudyId) -> Result<Vec<Label>, StoreError> {
    let (mut labels, mut after) = (Vec::new(), 0);
    loop {
        let page = store.labels(LabelsOf::Study(study), after, PAGE).await?;
        labels.extend(page.labels);
        let Some(next) = page.next else { break };
        after = next;
    }
    Ok(labels)
}

/// Figures and measures of answers, as they are stored or exported. Resampling takes a while.
pub fn results(labels: &[Label]) -> Results {
    let (current, counted) = counted(labels);
    let mut measures = Vec::new();
    if counted.is_empty() {
        return Results::default();
    }
    if are_preferences(&counted) {
        preferences(&counted, &mut measures);
    } else {
        same_stage(&counted, &mut measures);
    }
    agreement(&counted, &mut measures);
    labelers(&current, &mut measures);
    Results {
        n_answers: counted.len(),
        figures: figures(labels),
        measures,
    }
}

/// What there is to draw of answers; nothing by method while methods are hidden.
pub fn figures(labels: &[Label]) -> Vec<ResultFigure> {
    let (_, counted) = counted(labels);
    if counted.is_empty() {
        return Vec::new();
    }
    if are_preferences(&counted) {
        let rows = lines(&counted, |label| {
            json!({
                "task": label.task, "t_x": label.first_start, "t_y": label.second_start, "preference": label.meaning,
            })
        });
        return vec![
            ResultFigure {
                name: "preference-scatter",
                caption: "Each answer at the starts of both segments",
                rows: rows.clone(),
            },
            ResultFigure {
                name: "preference-fit",
                caption: "Preference for the segment that starts later",
                rows,
            },
        ];
    }
    if compared(&counted).is_none() {
        return Vec::new();
    }
    let mut by_method = counted;
    by_method.sort_by_key(|label| label.method.as_deref().map(rank));
    let rows = lines(
        &by_method,
        |label| json!({"task": label.task, "method": label.method, "same": label.meaning == "same"}),
    );
    vec![ResultFigure {
        name: "same-stage-bars",
        caption: "Pairs judged to show one stage, by method",
        rows,
    }]
}

/// Answers that no later one replaces and that are no skips, and those of them that count.
fn counted(labels: &[Label]) -> (Vec<&Label>, Vec<&Label>) {
    let current = labels.iter();
    let current = current.filter(|label| label.is_current && label.meaning != "skip");
    let current: Vec<&Label> = current.collect();
    let counted = with_role(&current, "counted").collect();
    (current, counted)
}

fn are_preferences(counted: &[&Label]) -> bool {
    counted.iter().all(|label| label.question == "preference")
}

/// The two methods that a study compares, in the order of the program's list, whoever answered
/// first; `None` while they are hidden, and of one method.
fn compared(counted: &[&Label]) -> Option<[String; 2]> {
    let mut methods = names(counted.iter().filter_map(|label| label.method.as_ref()));
    methods.sort_by_key(|method| rank(method));
    methods.try_into().ok()
}

fn with_role<'l>(labels: &[&'l Label], role: &'static str) -> impl Iterator<Item = &'l Label> {
    let of_role = move |label: &&Label| label.role.as_deref() == Some(role);
    labels.iter().copied().filter(of_role)
}

/// Task 1 of the paper: where in its episode the preferred segment starts.
fn preferences(counted: &[&Label], measures: &mut Vec<Measure>) {
    for task in names(counted.iter().map(|label| &label.task)) {
        let own = || counted.iter().filter(|label| label.task == task);
        let ties = Share::of(own().map(|label| label.meaning == "equal"));
        push_share(measures, format!("ties, {task}"), ties);
        let decided = own().filter(|l| l.meaning != "equal" && l.first_start != l.second_start);
        let later =
            Share::of(decided.map(|l| (l.meaning == "second") == (l.second_start > l.first_start)));
        push_share(measures, format!("later segment preferred, {task}"), later);
    }
    let sided = || {
        counted
            .iter()
            .filter(|l| matches!(l.pressed.as_str(), "left" | "right"))
    };
    let left = Share::of(sided().map(|label| label.pressed == "left"));
    if let Some(estimate) = left.clopper_pearson(LEVEL) {
        let from = format!("{} answers", left.n);
        measures.push(Measure::new("left preferred", estimate, from));
    }
    if let Some(p) = left.binomial_test(0.5) {
        measures.push(Measure {
            name: "left bias, exact binomial p".into(),
            value: p,
            interval: None,
            from: format!("{} answers", left.n),
        });
    }
}

/// Task 2 of the paper: how many of each method's queries show one stage.
fn same_stage(counted: &[&Label], measures: &mut Vec<Measure>) {
    let is_same = |label: &&Label| label.meaning == "same";
    let tasks = names(counted.iter().map(|label| &label.task));
    let share = |task: &str, method: Option<&str>| {
        let own = counted.iter().filter(|label| {
            label.task == task
                && method.is_none_or(|method| label.method.as_deref() == Some(method))
        });
        Share::of(own.map(is_same))
    };
    for task in &tasks {
        push_share(measures, format!("same stage, {task}"), share(task, None));
    }
    let Some([first, second]) = compared(counted) else {
        return;
    };
    let mut strata = Vec::new();
    for task in &tasks {
        let (a, b) = (share(task, Some(&first)), share(task, Some(&second)));
        push_share(measures, format!("same stage, {first}, {task}"), a);
        push_share(measures, format!("same stage, {second}, {task}"), b);
        if let Some(estimate) = newcombe(a, b, LEVEL) {
            let name = format!("{first} − {second}, {task}");
            let from = format!("{} answers", a.n + b.n);
            measures.push(Measure::new(name, estimate, from));
        }
        strata.push(Stratum {
            first: a,
            second: b,
        });
    }
    let of_tasks = if tasks.len() == 1 {
        "1 task".to_owned()
    } else {
        format!("{} tasks", tasks.len())
    };
    let from = || format!("{} answers, {of_tasks}", counted.len());
    if let Some(test) = cochran_mantel_haenszel(&strata, Continuity::Corrected, LEVEL) {
        if let Some(estimate) = test.odds_ratio {
            let name = format!("odds of same stage, {first} over {second}");
            measures.push(Measure::new(name, estimate, from()));
        }
        measures.push(Measure {
            name: "Cochran–Mantel–Haenszel p".into(),
            value: test.p,
            interval: None,
            from: from(),
        });
    }
    by_labeler(counted, (&first, &second), measures);
}

/// The difference of two methods with labelers as what is independent.
fn by_labeler(counted: &[&Label], (first, second): (&str, &str), measures: &mut Vec<Measure>) {
    let labelers = names(counted.iter().map(|label| &label.labeler));
    if labelers.len() < 2 {
        return;
    }
    let share = |labeler: &str, method: &str| {
        let own = counted
            .iter()
            .filter(|l| l.labeler == labeler && l.method.as_deref() == Some(method));
        let share = Share::of(own.map(|label| label.meaning == "same"));
        (share.n > 0).then(|| share.n_yes as f64 / share.n as f64)
    };
    let pairs: Vec<(f64, f64)> = labelers
        .iter()
        .filter_map(|labeler| share(labeler, first).zip(share(labeler, second)))
        .collect();
    if let Some(estimate) = Bootstrap::default().paired_difference(&pairs) {
        let name = format!("{first} − {second}, by labeler");
        measures.push(Measure::new(
            name,
            estimate,
            format!("{} labelers", pairs.len()),
        ));
    }
}

/// How far labelers agree about the same pairs.
fn agreement(counted: &[&Label], measures: &mut Vec<Measure>) {
    let categories = names(counted.iter().map(|label| &label.meaning));
    let category = |label: &Label| categories.iter().position(|known| *known == label.meaning);
    let mut items: BTreeMap<i64, Vec<(&str, usize)>> = BTreeMap::new();
    for label in counted {
        let (Some(item), Some(category)) = (label.item_id, category(label)) else {
            continue;
        };
        items
            .entry(item)
            .or_default()
            .push((&label.labeler, category));
    }
    let labelers = names(counted.iter().map(|label| &label.labeler));
    if labelers.len() < 2 {
        return;
    }
    let answers: Vec<Vec<usize>> = items
        .values()
        .map(|answers| answers.iter().map(|(_, category)| *category).collect())
        .collect();
    let ratings = Ratings::new(&answers);
    let settings = Bootstrap::default();
    let from = || format!("{} pairs, {} labelers", items.len(), labelers.len());
    let of = [
        (
            "agreement of two labelers",
            ratings.percent_agreement(settings),
        ),
        ("Fleiss' κ", ratings.fleiss_kappa(settings)),
        ("Krippendorff's α", ratings.krippendorff_alpha(settings)),
    ];
    for (name, estimate) in of {
        measures.extend(estimate.map(|estimate| Measure::new(name, estimate, from())));
    }
    if let [one, other] = labelers.as_slice() {
        let mut table = vec![vec![0; categories.len()]; categories.len()];
        for answers in items.values() {
            let by = |who: &str| answers.iter().find(|(l, _)| *l == who).map(|(_, c)| *c);
            if let (Some(a), Some(b)) = (by(one), by(other)) {
                table[a][b] += 1;
            }
        }
        let kappa = cohens_kappa(&table, LEVEL);
        measures.extend(kappa.map(|kappa| Measure::new("Cohen's κ", kappa, from())));
    }
}

/// Whether labelers look, and agree with themselves.
fn labelers(current: &[&Label], measures: &mut Vec<Measure>) {
    let first_answers: BTreeMap<(&str, Option<i64>), &str> = with_role(current, "counted")
        .map(|label| {
            (
                (label.labeler.as_str(), label.item_id),
                label.meaning.as_str(),
            )
        })
        .collect();
    let repeats: Vec<(&str, &str)> = with_role(current, "repeat")
        .filter_map(|label| {
            let before = first_answers.get(&(label.labeler.as_str(), label.item_id))?;
            Some((*before, label.meaning.as_str()))
        })
        .collect();
    if let Some(estimate) = self_consistency(&repeats, LEVEL) {
        let from = format!("{} repeats", repeats.len());
        measures.push(Measure::new("same answer to a repeat", estimate, from));
    }
    let checks = with_role(current, "check");
    let right = Share::of(checks.map(|label| label.expects.as_ref() == Some(&label.meaning)));
    push_share(measures, "checks answered right".to_owned(), right);
}

/// One JSON object a line.
fn lines(labels: &[&Label], row: impl Fn(&Label) -> serde_json::Value) -> String {
    let rows = labels.iter().map(|label| row(label).to_string());
    rows.fold(String::new(), |text, row| text + &row + "\n")
}

fn push_share(measures: &mut Vec<Measure>, name: String, share: Share) {
    if let Some(estimate) = share.wilson(LEVEL) {
        measures.push(Measure::new(name, estimate, format!("{} answers", share.n)));
    }
}

/// Each name once, in the order of its first appearance.
fn names<'l>(all: impl Iterator<Item = &'l String>) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for name in all {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    names
}

#[cfg(test)]
mod tests;
